"""What a reader promises: a sound value, or one sentence of its own error class."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

LONGEST = 500  # characters of a sentence


@dataclass(frozen=True)
class Reader:
    """One way into the product."""

    name: str
    seeds: Callable[[], list[bytes]]  # whole files
    read: Callable[[bytes, Path], None]  # a file and an empty folder; AssertionError, Refused
    mend: Callable[[bytes], bytes] = lambda data: data  # puts checksums right after damage
    share: float = 1.0  # of the time that others get


class Refused(Exception):
    """The reader's own error, which was as it has to be."""


@contextmanager
def refusing(*kinds: type[Exception]) -> Iterator[None]:
    """Turns the reader's own errors into Refused, if each is one sentence."""
    try:
        yield
    except kinds as error:
        check_sentence(str(error))
        raise Refused(str(error)) from error


def check_sentence(told: str) -> None:
    """One line that says something, and not too much."""
    assert told.strip(), "nothing is said"
    assert "\n" not in told, f"more than one line: {told!r}"
    assert len(told) <= LONGEST, f"{len(told)} characters: {told[:200]!r}"
    assert "Traceback" not in told


def check_gaussians(found: Any) -> None:
    """Finite, unit quaternions, positive scales, the rest in [0, 1]."""
    count = len(found)
    shapes = {"means": (count, 3), "quats": (count, 4), "scales": (count, 3),
              "opacities": (count,), "colors": (count, 3)}  # fmt: skip
    for name, shape in shapes.items():
        array = getattr(found, name)
        assert array.shape == shape and array.dtype == np.float32, (name, array.shape, array.dtype)
        assert np.isfinite(array).all(), f"{name} is not finite"
    if not count:
        return
    np.testing.assert_allclose(np.linalg.norm(found.quats, axis=1), 1, atol=1e-3)
    assert (found.scales > 0).all()
    for name in ("opacities", "colors"):
        values = getattr(found, name)
        assert values.min() >= 0 and values.max() <= 1, name


def check_picture(picture: Any) -> None:
    """Upright RGB pixels, and alpha of the same size."""
    pixels = picture.pixels
    assert pixels.dtype in (np.uint8, np.uint16) and pixels.ndim == 3, pixels.dtype
    assert pixels.shape[2] == 3 and pixels.size > 0, pixels.shape
    assert not pixels.flags.writeable
    if picture.alpha is not None:
        assert picture.alpha.shape == pixels.shape[:2] and picture.alpha.dtype == pixels.dtype
    if picture.focal_35mm is not None:
        assert picture.focal_35mm > 0 and math.isfinite(picture.focal_35mm)


def check_finite(value: Any, where: str = "it") -> None:
    """No NaN or infinity anywhere in a tree of dataclasses, tuples and arrays."""
    if isinstance(value, np.ndarray):
        assert value.dtype.kind != "f" or np.isfinite(value).all(), f"{where} is not finite"
        assert value.dtype.kind != "O", f"{where} holds objects"
    elif dataclasses.is_dataclass(value):
        for f in dataclasses.fields(value):
            check_finite(getattr(value, f.name), f"{where}.{f.name}")
    elif isinstance(value, tuple | list):
        for k, part in enumerate(value):
            check_finite(part, f"{where}[{k}]")
    elif isinstance(value, float):
        assert math.isfinite(value), f"{where} is {value}"


def check_same(got: Any, expected: Any, where: str = "it") -> None:
    """Same types and values, arrays bit for bit."""
    assert type(got) is type(expected), where
    if isinstance(expected, np.ndarray):
        assert got.dtype == expected.dtype and got.shape == expected.shape, where
        assert got.tobytes() == expected.tobytes(), where
    elif dataclasses.is_dataclass(expected):
        for f in dataclasses.fields(expected):
            check_same(getattr(got, f.name), getattr(expected, f.name), f"{where}.{f.name}")
    elif isinstance(expected, tuple | list):
        assert len(got) == len(expected), where
        for k, (a, b) in enumerate(zip(got, expected, strict=True)):
            check_same(a, b, f"{where}[{k}]")
    else:
        assert got == expected, where
