"""Whether a value that came over the wire is of the type that a function or a field declares."""

from __future__ import annotations

import types
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from objectmorpher_core.base.arrays import Pixels


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
