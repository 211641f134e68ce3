"""The pictures to compare: two files, or two folders whose files have the same names."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from objectmorpher_core.base.arrays import F64, RGB
from objectmorpher_core.pictures.image import READ_ENDINGS, read_mask, read_picture, to_u8

from .error import EvaluationError
from .measures.regions import check_pair


@dataclass(frozen=True)
class MaskedPair:
    """Two pictures of one thing, and where the mask is."""

    name: str
    a: Path
    b: Path
    mask: Path | None = None

    def read(self) -> tuple[RGB, RGB, F64 | None]:
        """Both as 8-bit RGB (H, W, 3), and the mask (H, W) of 0 and 1. Raises EvaluationError."""
        a, b = read_pixels(self.a), read_pixels(self.b)
        try:
            check_pair(a, b)
            if self.mask is None:
                return a, b, None
            size = (a.shape[1], a.shape[0])
            return a, b, read_mask(self.mask.read_bytes(), size).astype(np.float64)
        except ValueError as error:
            raise EvaluationError(f"{self.name}: {error}") from error


def find_pairs(a: Path, b: Path, mask: Path | None = None) -> tuple[MaskedPair, ...]:
    """Pairs of two files, or of two folders by the files' stems, in the order of the names.

    `mask`: one file for all pairs, or a folder with one for each. Raises EvaluationError.
    """
    for path in (a, b, *([mask] if mask else [])):
        if not path.exists():
            raise EvaluationError(f"there is no {path}")
    if a.is_dir() != b.is_dir():
        raise EvaluationError("compare two files, or two folders, not one with the other")
    if not a.is_dir():
        return (MaskedPair(a.stem, a, b, _mask_of(a.stem, mask)),)
    left, right = _pictures(a), _pictures(b)
    lacking = sorted(left.keys() ^ right.keys())
    if lacking:
        where = b if lacking[0] in left else a
        raise EvaluationError(f"{where} has no picture called {lacking[0]!r}")
    return tuple(
        MaskedPair(name, left[name], right[name], _mask_of(name, mask)) for name in sorted(left)
    )


def _mask_of(name: str, mask: Path | None) -> Path | None:
    if mask is None or not mask.is_dir():
        return mask
    found = _pictures(mask).get(name)
    if found is None:
        raise EvaluationError(f"{mask} has no mask called {name!r}")
    return found


def _pictures(folder: Path) -> dict[str, Path]:
    """By stem. Raises EvaluationError where there is none, or two of one name."""
    found = pictures_in(folder)
    if not found:
        raise EvaluationError(f"{folder} holds no picture")
    return found


def pictures_in(folder: Path) -> dict[str, Path]:
    """The folder's own picture files by stem. Raises EvaluationError where two have one name."""
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() not in READ_ENDINGS or not path.is_file():
            continue
        if path.stem in found:
            raise EvaluationError(f"{folder} has two pictures called {path.stem!r}")
        found[path.stem] = path
    return found


def read_pixels(path: Path) -> RGB:
    """(H, W, 3) of a picture file, upright. Raises EvaluationError with the file's name."""
    try:
        return to_u8(read_picture(path.read_bytes()).pixels)
    except ValueError as error:
        raise EvaluationError(f"{path}: {error}") from error
