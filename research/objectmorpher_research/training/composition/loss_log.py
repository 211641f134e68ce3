"""The losses of every step, a line of JSON each."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from objectmorpher_core.base.files import write_all

from . import TrainingError

FILE = "losses.jsonl"


class LossLog:
    """Appends to a folder's log; what was written beyond the last checkpoint is cut off."""

    def __init__(self, folder: Path, step: int) -> None:
        self._file = folder / FILE
        kept = [row for row in read_losses(folder) if row["step"] < step]
        write_all({self._file: "".join(json.dumps(row) + "\n" for row in kept).encode()})

    def add(self, row: dict[str, Any]) -> None:
        """A step's figures, among them `step`."""
        with self._file.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")


def read_losses(folder: Path) -> list[dict[str, Any]]:
    """The rows of a folder's log; a last line that was cut off when it was killed does not count.

    Raises TrainingError.
    """
    at = folder / FILE
    if not at.exists():
        return []
    rows = []
    lines = at.read_text(encoding="utf-8").splitlines()
    for k, line in enumerate(lines):
        try:
            rows.append(json.loads(line))
        except ValueError as error:
            if k < len(lines) - 1:
                raise TrainingError(f"{at}, line {k + 1}: {error}") from error
    return rows
