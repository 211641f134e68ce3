"""The location of a pair's picture: a file, half of one, a video's frame, a table's row.

A `PictureSource` is a few words, so that a list of a hundred thousand pairs goes to any machine;
the pixels are read where the pair is worked on.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from objectmorpher_core.base.arrays import RGB
from objectmorpher_core.pictures.image import ImageError, read_picture, to_u8
from objectmorpher_core.pictures.video import VideoError, read_frames

from . import TrainingError

Half = Literal["", "left", "right"]
PADDING = 8 / 528  # x the height: around and between Subjects200K's halves (OminiControl)
IMAGE = "image"  # Subjects200K's column


@dataclass(frozen=True)
class PictureSource:
    """The location of a picture."""

    path: str
    kind: Literal["file", "frame", "row"] = "file"
    index: int = 0  # of the frame, of the table's row
    half: Half = ""
    padding: float = PADDING  # x the height

    def read(self) -> RGB:
        """(H, W, 3). Raises TrainingError."""
        return halved(self._whole(), self.half, self.padding)

    def _whole(self) -> RGB:
        try:
            if self.kind == "frame":
                return read_frames(Path(self.path), (self.index,))[0]
            data = self._row() if self.kind == "row" else Path(self.path).read_bytes()
            return to_u8(read_picture(data).pixels)
        except (ImageError, VideoError) as error:
            raise TrainingError(f"{Path(self.path).name}: {error}") from error
        except OSError as error:
            raise TrainingError(f"{self.path} cannot be read: {error.strerror or error}") from error

    def _row(self) -> bytes:
        table = opened_table(self.path)
        group, first = 0, 0
        while first + table.metadata.row_group(group).num_rows <= self.index:
            first += table.metadata.row_group(group).num_rows
            group += 1
        value = _column(self.path, group)[self.index - first].as_py()
        if isinstance(value, dict):
            value = value.get("bytes")
        if not isinstance(value, bytes):
            raise TrainingError(f"{Path(self.path).name}, row {self.index}: it holds no picture")
        return value


def halved(whole: RGB, half: Half, padding: float) -> RGB:
    """The left or right picture of two that lie side by side, each `padding` from what is around.

    The square's side is the height without its padding; with none each is half of the width.
    """
    if not half:
        return whole
    height, width = whole.shape[:2]
    edge = round(padding * height)
    side = height - 2 * edge if edge else width // 2
    left = edge if half == "left" else side + 2 * edge
    if side < 1 or left + side > width:
        raise TrainingError(f"{width} x {height} px are not two pictures side by side")
    return np.ascontiguousarray(whole[edge : height - edge, left : left + side])


@lru_cache(maxsize=4)
def opened_table(path: str) -> Any:
    """A .parquet file. Raises TrainingError."""
    try:
        from pyarrow import ArrowException
        from pyarrow.parquet import ParquetFile
    except ImportError as error:
        raise TrainingError(f"{Path(path).name} needs pyarrow: `pip install pyarrow`") from error
    try:
        return ParquetFile(path)
    except (OSError, ArrowException) as error:
        raise TrainingError(f"{Path(path).name} is no .parquet file: {error}") from error


@lru_cache(maxsize=2)  # rows that follow one another are in one group
def _column(path: str, group: int) -> Any:
    return opened_table(path).read_row_group(group, columns=[IMAGE]).column(0)
