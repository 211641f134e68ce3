"""The participants' pictures, under names that reveal nothing, all of a subject at one size."""

from __future__ import annotations

import secrets
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from objectmorpher_core.base.arrays import RGB
from objectmorpher_core.pictures.image import (
    Picture,
    at_most,
    encode_picture,
    read_picture,
    resized,
    to_u8,
)

from ..evaluation.error import EvaluationError
from ..evaluation.pairs import read_pixels
from ..evaluation.subjects.subject import EvaluatedEdit

LONGEST = 1600  # px of a picture's longer side
KEPT = 24  # pictures in memory
MOST_NAMES = 200_000
SAME_SHAPE = 0.02  # by which width / height of a result may differ


@dataclass(frozen=True)
class _Shown:
    path: Path
    size: tuple[int, int]  # px


class StudyPictures:
    """Names for pictures, and their bytes. Safe to use from several threads."""

    def __init__(self, subjects: Sequence[EvaluatedEdit]) -> None:
        """Looks at every picture once. Raises EvaluationError for one that cannot be shown."""
        self._subjects = {subject.name: subject for subject in subjects}
        checked = {subject.name: _checked(subject) for subject in subjects}
        self._widths = {name: width for name, (width, _) in checked.items()}
        self._sizes = {name: size for name, (_, size) in checked.items()}
        self._guides = {
            subject.name: _fitted(subject.guidance.picture)
            for subject in subjects
            if subject.guidance.picture is not None
        }
        self._names: dict[str, _Shown] = {}
        self._encoded = lru_cache(KEPT)(_encoded)
        self._lock = threading.Lock()

    def size(self, subject: str) -> tuple[int, int]:
        """Width and height, px, at which all of the subject's pictures are shown."""
        return self._sizes[subject]

    def photo_width(self, subject: str) -> int:
        """Return the width of the photo itself, px, which guidance refers to."""
        return self._widths[subject]

    def name_original(self, subject: str) -> str:
        """A new name of the photo."""
        return self._name(_Shown(self._subjects[subject].image, self._sizes[subject]))

    def name_result(self, subject: str, method: str) -> str:
        """A new name of a result, in the photo's size whatever its own is."""
        picture = self._subjects[subject].results[method].picture
        return self._name(_Shown(picture, self._sizes[subject]))

    def name_guidance(self, subject: str) -> tuple[str, tuple[int, int]] | None:
        """A new name of the picture that shows what is asked, and its size."""
        path = self._subjects[subject].guidance.picture
        if path is None:
            return None
        size = self._guides[subject]
        return self._name(_Shown(path, size)), size

    def read(self, name: str) -> bytes | None:
        """PNG without any metadata but the colours' profile; None for an unknown name."""
        with self._lock:
            shown = self._names.get(name)
        return None if shown is None else self._encoded(shown)

    def _name(self, shown: _Shown) -> str:
        with self._lock:
            while len(self._names) >= MOST_NAMES:  # the oldest pages are reloaded first
                self._names.pop(next(iter(self._names)))
            name = secrets.token_urlsafe(12)
            self._names[name] = shown
            return name


def _checked(subject: EvaluatedEdit) -> tuple[int, tuple[int, int]]:
    """The photo's own width, and the size in which it is shown."""
    photo = read_pixels(subject.image)
    for method, result in subject.results.items():
        pixels = read_pixels(result.picture)
        if abs(_shape(pixels) / _shape(photo) - 1) > SAME_SHAPE:
            raise EvaluationError(
                f"{method}: {subject.name} is {pixels.shape[1]} x {pixels.shape[0]} px, of another"
                f" shape than its photo of {photo.shape[1]} x {photo.shape[0]} px"
            )
    return photo.shape[1], _size(photo)


def _fitted(path: Path) -> tuple[int, int]:
    return _size(read_pixels(path))


def _size(pixels: RGB) -> tuple[int, int]:
    """Width and height, px, at which a picture is shown."""
    height, width = at_most(pixels, LONGEST).shape[:2]
    return width, height


def _shape(pixels: RGB) -> float:
    return pixels.shape[1] / pixels.shape[0]


def _encoded(shown: _Shown) -> bytes:
    picture = read_picture(shown.path.read_bytes())
    pixels = to_u8(picture.pixels)
    if (pixels.shape[1], pixels.shape[0]) != shown.size:
        pixels = resized(pixels, *shown.size)
    return encode_picture(Picture(pixels, icc=None if picture.is_grey else picture.icc), ".png")
