"""Pairs of pictures of one object: Subjects200K's layout, folders of pairs, frames of videos.

A mask beside a picture, `NAME.mask.png`, is used instead of looking for the subject.
"""

from __future__ import annotations

import hashlib
import json
import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from objectmorpher_core.pictures.image import READ_ENDINGS
from objectmorpher_core.pictures.video import VideoError, frame_rate

from . import TrainingError
from .pictures import PADDING, PictureSource
from .subjects import subjects_in

VIDEOS = {".mp4", ".webm", ".mov", ".mkv", ".avi", ".m4v"}
LAYOUTS = ("auto", "subjects", "pairs", "frames")
ONE_OF_TWO = re.compile(r"(.+?)[._-]?([ab])", re.IGNORECASE)
MASK = ".mask"
NAMED = 80  # bytes of a name that are kept: with all that comes after them a file may have 255


@dataclass(frozen=True)
class SourcePair:
    """Two pictures of one object: it is lifted out of `b` and put where `a` shows it."""

    name: str  # unique, and fit for a file's name
    b: PictureSource
    a: PictureSource
    item: str = ""  # what it is, where the source says so
    mask_b: str = ""  # files; none: the picture's subject
    mask_a: str = ""
    problem: str = ""  # why the source itself says that it is of no use

    @property
    def turned_round(self) -> SourcePair:
        """Return the same two in the other order."""
        return replace(
            self, name=f"{self.name}-back", b=self.a, a=self.b, mask_b=self.mask_a,
            mask_a=self.mask_b,
        )  # fmt: skip


@dataclass(frozen=True)
class SourceReading:
    """The reading of a source."""

    layout: str = "auto"  # of LAYOUTS
    both_ways: bool = True  # each pair also with its pictures exchanged
    seconds: float = 1.0  # between a video's two frames
    padding: float = PADDING  # around and between two halves, x the height

    def __post_init__(self) -> None:
        if self.layout not in LAYOUTS:
            raise TrainingError(f"there is no layout {self.layout!r}; known: {', '.join(LAYOUTS)}")
        if not self.seconds > 0:
            raise TrainingError(f"{self.seconds:g} s between two frames are not above 0")
        if not 0 <= self.padding < 0.4:
            raise TrainingError(f"a padding of {self.padding:g} is not between 0 and 0.4")


def find_pairs(source: Path, how: SourceReading | None = None) -> tuple[SourcePair, ...]:
    """Find all pairs of a file or a folder, in an order that depends on nothing but the names.

    Raises TrainingError where there is none.
    """
    how = how or SourceReading()
    if not source.exists():
        raise TrainingError(f"there is no {source}")
    found = list(_found(source.absolute(), how))
    if how.both_ways:
        found = [one for pair in found for one in (pair, pair.turned_round)]
    if not found:
        raise TrainingError(f"{source} holds no pairs: see docs/training.md for the layouts")
    names = [pair.name for pair in found]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise TrainingError(f"{source} has two pairs called {twice!r}")
    return tuple(found)


def fingerprint(pairs: tuple[SourcePair, ...]) -> str:
    """SHA-256 of which pairs there are and how they are read, wherever the folder lies."""
    told = hashlib.sha256()
    for pair in pairs:
        facts: list[Any] = [pair.name, pair.problem]
        for picture, mask in ((pair.b, pair.mask_b), (pair.a, pair.mask_a)):
            facts += [picture.index, picture.half, picture.padding, bool(mask)]
        told.update(json.dumps(facts).encode())
    return told.hexdigest()


def pair_from(told: dict[str, Any]) -> SourcePair:
    """A pair out of `asdict(pair)`."""
    values: dict[str, Any] = {
        **told,
        "a": PictureSource(**told["a"]),
        "b": PictureSource(**told["b"]),
    }
    return SourcePair(**values)


def _found(source: Path, how: SourceReading) -> Iterator[SourcePair]:
    if source.is_file():
        if source.suffix.lower() in VIDEOS:
            yield from _frames(source, how)
        elif source.suffix.lower() == ".parquet":
            yield from _subjects(source, how)
        else:
            raise TrainingError(f"{source} is no folder, video or .parquet file")
        return
    if how.layout in ("auto", "subjects"):
        subjects = list(_subjects(source, how))
        yield from subjects
        if subjects or how.layout == "subjects":
            return
    if how.layout in ("auto", "pairs"):
        yield from _pairs(source)
    if how.layout in ("auto", "frames"):
        for video in sorted(p for p in source.rglob("*") if p.suffix.lower() in VIDEOS):
            yield from _frames(video, how)


def _subjects(source: Path, how: SourceReading) -> Iterator[SourcePair]:
    for k, row in enumerate(subjects_in(source)):
        left, right = (replace(row.picture, half=h, padding=how.padding) for h in ("left", "right"))
        yield SourcePair(f"{k:07d}", left, right, row.item, problem=row.problem)


def _pairs(folder: Path) -> Iterator[SourcePair]:
    """NAME-a and NAME-b in one folder; in other folders each picture and the next."""
    here = _pictures(folder)
    two: dict[str, dict[str, Path]] = {}
    for path in here:
        if match := ONE_OF_TWO.fullmatch(path.stem):
            two.setdefault(match[1], {})[match[2].lower()] = path
    whole = {name: sides for name, sides in two.items() if len(sides) == 2}
    for name, sides in sorted(whole.items()):
        yield _of_files(name, sides["b"], sides["a"])
    if not whole:
        for one, other in pairwise(here):
            yield _of_files(f"{one.stem}-{other.stem}", one, other)
    for sub in sorted(p for p in folder.iterdir() if p.is_dir() and not p.name.startswith(".")):
        for pair in _pairs(sub):
            yield replace(pair, name=_safe(f"{sub.name}-{pair.name}"))


def _of_files(name: str, b: Path, a: Path) -> SourcePair:
    masks = [b.with_name(b.stem + MASK + ".png"), a.with_name(a.stem + MASK + ".png")]
    known = [str(m) if m.exists() else "" for m in masks]
    return SourcePair(_safe(name), PictureSource(str(b)), PictureSource(str(a)), "", *known)


def _pictures(folder: Path) -> list[Path]:
    return sorted(
        p
        for p in folder.iterdir()
        if p.suffix.lower() in READ_ENDINGS and not p.stem.endswith(MASK)
    )


def _frames(video: Path, how: SourceReading) -> Iterator[SourcePair]:
    try:
        rate, count = frame_rate(video)
    except VideoError as error:
        raise TrainingError(str(error)) from error
    step = max(round(how.seconds * rate), 1)
    for first in range(0, count - step, step):
        one, other = (PictureSource(str(video), "frame", k) for k in (first, first + step))
        yield SourcePair(f"{_safe(video.stem)}-{first:06d}", one, other)


def _safe(name: str) -> str:
    """Fit for a file's name everywhere; if more than spaces is lost, with a hash of the whole."""
    whole = unicodedata.normalize("NFC", name)
    kept = re.sub(r"[^\w-]+", "-", whole).encode()[:NAMED].decode(errors="ignore")
    if kept and kept == whole.replace(" ", "-"):
        return kept
    digest = hashlib.sha256(whole.encode(errors="surrogatepass")).hexdigest()
    return f"{kept}-{digest[:8]}"
