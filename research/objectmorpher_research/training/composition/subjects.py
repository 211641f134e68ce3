"""Subjects200K (Tan et al. 2024, "OminiControl"): one wide picture a pair, and what is said of it.

Either .parquet tables with the pictures in them, as published (they need pyarrow), or a folder of
pictures with `metadata.jsonl` or `metadata.json` (rows with `file_name`) or a `NAME.json` each.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import TrainingError
from .pictures import IMAGE, PictureSource, opened_table

QUALITIES = ("compositeStructure", "objectConsistency", "imageQuality")
LEAST_QUALITY = 5  # of 5, each: as its makers choose what they train on
SAID = "quality_assessment", "description"
LISTS = ("metadata.jsonl", "metadata.json")


@dataclass(frozen=True)
class WidePicture:
    """A wide picture."""

    picture: PictureSource
    item: str = ""
    problem: str = ""


def subjects_in(source: Path) -> Iterator[WidePicture]:
    """The rows of a folder or a .parquet file; none where it is not laid out so."""
    tables = [source] if source.is_file() else sorted(source.rglob("*.parquet"))
    for table in tables:
        yield from _of_table(table)
    if tables:
        return
    for name in LISTS:
        if (at := source / name).is_file():
            for told in _rows(at):
                file = told.get("file_name")
                if not isinstance(file, str) or not (source / file).is_file():
                    raise TrainingError(f"{at}: there is no picture {file!r}")
                yield _row(PictureSource(str(source / file)), told)
            return
    for at in sorted(source.glob("*.json")):
        pictures = [p for p in source.glob(f"{at.stem}.*") if p.suffix != ".json"]
        told = next(iter(_rows(at)), {})
        if len(pictures) == 1 and any(key in told for key in SAID):
            yield _row(PictureSource(str(pictures[0])), told)


def _of_table(at: Path) -> Iterator[WidePicture]:
    table = opened_table(str(at))
    names = table.schema_arrow.names
    if IMAGE not in names:
        raise TrainingError(f"{at.name} has no column called {IMAGE!r}")
    told = table.read(columns=[key for key in SAID if key in names]).to_pylist()
    rows = told or [{} for _ in range(table.metadata.num_rows)]
    for k, row in enumerate(rows):
        yield _row(PictureSource(str(at), "row", k), row)


def _rows(at: Path) -> list[dict[str, Any]]:
    try:
        text = at.read_text(encoding="utf-8")
        if at.suffix == ".jsonl":
            rows = [json.loads(line) for line in text.splitlines() if line.strip()]
        else:
            rows = json.loads(text)
    except (OSError, ValueError, RecursionError) as error:
        raise TrainingError(f"{at} cannot be read: {error}") from error
    rows = rows if isinstance(rows, list) else [rows]
    if not all(isinstance(row, dict) for row in rows):
        raise TrainingError(f"{at} holds something else than rows of named values")
    return rows


def _row(picture: PictureSource, told: dict[str, Any]) -> WidePicture:
    quality, words = (told.get(key) or {} for key in SAID)
    if not isinstance(quality, dict) or not isinstance(words, dict):
        return WidePicture(picture, problem="its metadata are not those of Subjects200K")
    item, problem = str(words.get("item") or ""), ""
    low = [name for name in QUALITIES if (quality.get(name) or 0) < LEAST_QUALITY]
    if quality and low:
        problem = f"its makers rate {low[0]} below {LEAST_QUALITY}"
    elif words.get("description_valid") is False:
        problem = "its makers call its description wrong"
    return WidePicture(picture, item, problem)
