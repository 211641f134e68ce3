"""A check that a value from the wire has the type that a function or a field declares."""

from __future__ import annotations

import types
from dataclasses import fields, is_dataclass
from functools import cache, singledispatch
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from objectmorpher_core.base.arrays import Pixels
from objectmorpher_core.compose.plate.repair import PlatePatch
from objectmorpher_core.document.model import LiftedObject, Matte, Plate
from objectmorpher_core.document.settings import Refined
from objectmorpher_core.document.sides import Sides
from objectmorpher_core.segment import Found

from ..worker.job_functions import Variant


@cache
def hints(kind: type) -> dict[str, Any]:
    """Field -> declared type of a dataclass."""
    told = get_type_hints(kind)
    return {field.name: told[field.name] for field in fields(kind)}


def fits(value: Any, wanted: Any) -> bool:
    """Whether `value` is a `wanted`: a class, a union, a tuple or an array of a dtype."""
    origin = get_origin(wanted)
    if origin in (Union, types.UnionType):
        return any(fits(value, each) for each in get_args(wanted))
    if origin is tuple:
        return isinstance(value, tuple) and _fit_each(value, get_args(wanted))
    if origin is np.ndarray:
        return isinstance(value, np.ndarray) and _is_of(value, get_args(wanted)[1])
    if wanted is None or wanted is type(None):
        return value is None
    if wanted is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if wanted in (int, str, bool):
        return type(value) is wanted
    return is_dataclass(wanted) and type(value) is wanted


def _fit_each(value: tuple[Any, ...], wanted: tuple[Any, ...]) -> bool:
    if len(wanted) == 2 and wanted[1] is Ellipsis:
        return all(fits(each, wanted[0]) for each in value)
    return len(value) == len(wanted) and all(map(fits, value, wanted))


def _is_of(array: np.ndarray, wanted: Any) -> bool:
    """`wanted` is np.dtype[scalar], where Any stands for each of them."""
    scalar = get_args(wanted)[0]
    return scalar is Any or array.dtype == np.dtype(scalar)


def is_photo(array: np.ndarray) -> bool:
    """(H, W, 3) u8 or u16, not empty."""
    return array.ndim == 3 and array.shape[2] == 3 and array.size > 0 and fits(array, Pixels)


# Whether an answer's arrays fit each other, and the photo that was asked about.


def is_sound(answer: Any, arguments: tuple[Any, ...]) -> bool:
    """Whether each part of an answer is whole; `arguments` are those of the request."""
    asked = arguments[0] if arguments else None
    parts = answer if isinstance(answer, tuple) else (answer,)
    return all(_is_whole(part, asked) for part in parts)


@singledispatch
def _is_whole(part: Any, asked: Any) -> bool:
    """Numbers, texts and nothing are; `asked`: a photo, or what carries one."""
    return True


def _photo(asked: Any) -> Any:
    return getattr(asked, "pixels", asked)


@_is_whole.register
def _(part: Found, asked: Any) -> bool:
    return part.mask.shape == _photo(asked).shape[:2]


@_is_whole.register
def _(part: Matte, asked: Any) -> bool:
    shape = part.alpha.shape
    return len(shape) == 2 and part.alpha.size > 0 and part.foreground.shape == (*shape, 3)


@_is_whole.register
def _(part: LiftedObject, asked: Any) -> bool:
    count, texture, points = len(part.gaussians), part.texture, part.control_points
    return (
        count > 0
        and texture.u0.shape == (count, 2)
        and texture.visibility.shape == texture.solidity.shape == (count,)
        and (part.middle is None or part.middle.shape == (count, 3))
        and points.ndim == 2
        and points.shape[1] == 3
        and len(points) > 0
        and part.world_from_object.shape == (4, 4)
        and (part.sides is None or _fit_gaussians(part.sides, count))
    )


def _fit_gaussians(sides: Sides, count: int) -> bool:
    """Whether they are pictures, and say of each of `count` Gaussians where it looks."""
    found = sides.at.shape, sides.slopes.shape, sides.zoom.shape, sides.pixels.shape[2:]
    return found == ((count, 2), (count, 2, 3), (count,), (3,)) and sides.pixels.size > 0


@_is_whole.register
def _(part: Plate, asked: Any) -> bool:
    pixels = _photo(asked)
    if not is_photo(part.pixels) or part.hole.shape != part.pixels.shape[:2]:
        return False
    x0, y0, x1, y1 = part.box
    is_inside = 0 <= x0 <= x1 <= pixels.shape[1] and 0 <= y0 <= y1 <= pixels.shape[0]
    is_painted_whole = part.painted is None or part.painted.shape == part.hole.shape
    return is_inside and is_painted_whole and part.pixels.dtype == pixels.dtype


@_is_whole.register
def _(part: Variant, asked: Any) -> bool:
    return is_photo(part.thumb) and _is_whole(part.plate, asked)


@_is_whole.register
def _(part: PlatePatch, asked: Any) -> bool:
    pixels = _photo(asked)
    is_same = part.pixels.shape == pixels.shape and part.pixels.dtype == pixels.dtype
    return is_same and part.coverage.shape == pixels.shape[:2]


@_is_whole.register
def _(part: Refined, asked: Any) -> bool:
    """Of the crop that was sent, and seen where the edit is and nowhere else."""
    return (
        (part.left, part.top) == (asked.left, asked.top)
        and part.pixels.shape == asked.pixels.shape
        and part.pixels.dtype == asked.pixels.dtype
        and np.array_equal(part.alpha, asked.shown)
        and 0 <= part.strength <= 1
    )
