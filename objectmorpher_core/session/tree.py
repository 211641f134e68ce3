"""Dataclasses of the document to JSON values and back, by their type hints; arrays set apart.

An array becomes {"png": member} where it is a mask or 8- or 16-bit pixels, else {"array": path}.
"""

from __future__ import annotations

import io
import json
import math
import types
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import cache
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from ..base.arrays import all_finite, frozen
from ..base.quoting import named
from ..pictures.image import (
    MAX_PIXELS,
    ImageError,
    Picture,
    encode_mask,
    encode_picture,
    read_picture,
)

A_MASK = np.zeros((0, 0), bool)


class SessionError(ValueError):
    """The file is not a session that can be opened; one sentence."""


def encode_tree(tree: Any, **layout: Any) -> bytes:
    """The UTF-8 file of JSON values. Of a file's name that is not UTF-8 the odd bytes are escaped.

    Raises ValueError for numbers beyond the finite ones.
    """
    text = json.dumps(tree, ensure_ascii=False, allow_nan=False, **layout)
    return text.encode("utf-8", "backslashreplace")  # only halves of pairs: as JSON writes them


@dataclass
class TreeWriter:
    """Turns values into JSON values, and collects the arrays on the way."""

    skipped: tuple[type, ...] = ()  # dataclasses that the caller writes
    arrays: dict[str, np.ndarray] = field(default_factory=dict)  # by path
    pictures: dict[str, bytes] = field(default_factory=dict)  # PNG files by member name

    def tree(self, value: Any, path: str) -> Any:
        """The JSON value of `value`, whose arrays are named after `path`."""
        if isinstance(value, np.ndarray):
            return self._array(value, path)
        if isinstance(value, self.skipped):
            return None
        if is_dataclass(value):
            inner = f"{path}/" if path else ""
            return {
                f.name: self.tree(getattr(value, f.name), inner + f.name) for f in fields(value)
            }
        if isinstance(value, tuple | list):
            return [self.tree(part, f"{path}/{k}") for k, part in enumerate(value)]
        if value is None or isinstance(value, str):
            return value
        if isinstance(value, bool | np.bool_):
            return bool(value)
        if isinstance(value, int | np.integer):
            return int(value)
        if not math.isfinite(value):
            raise SessionError(f"{path} is not a finite number and cannot be saved")
        return float(value)

    def _array(self, array: np.ndarray, path: str) -> dict[str, str]:
        if array.dtype.kind == "f" and not all_finite(array):
            raise SessionError(f"{path} holds values that are not finite and cannot be saved")
        is_mask = array.dtype == np.bool_ and array.ndim == 2
        is_pixels = array.dtype in (np.uint8, np.uint16) and array.shape[2:] in ((3,), (4,))
        if array.size and (is_mask or is_pixels):
            member = f"{path}.png"
            alpha = array[..., 3] if array.shape[2:] == (4,) else None
            self.pictures[member] = (
                encode_mask(array)
                if is_mask
                else encode_picture(Picture(array[..., :3], alpha), "png")
            )
            return {"png": member}
        self.arrays[path] = array
        return {"array": path}


@dataclass
class TreeReader:
    """Builds values of a given type from JSON values. Raises SessionError."""

    members: Mapping[str, bytes]  # the PNG files by member name
    arrays: Mapping[str, np.ndarray]  # by path
    most: int = MAX_PIXELS  # px of a mask
    most_colours: int = MAX_PIXELS  # px of a picture
    _pictures: dict[str, np.ndarray] = field(default_factory=dict)  # decoded, by member name

    def value(self, hint: Any, tree: Any, where: str) -> Any:
        """A value of the type `hint`; `where` names it in an error."""
        if isinstance(hint, type) and isinstance(tree, hint) and is_dataclass(hint):
            return tree  # made by the caller already
        origin = get_origin(hint)
        if origin in (Union, types.UnionType):
            return self._union(get_args(hint), tree, where)
        if hint is np.ndarray or origin is np.ndarray:
            return self._array((hint,), tree, where)
        if origin is tuple:
            return self._tuple(get_args(hint), tree, where)
        if is_dataclass(hint):
            return self._dataclass(hint, tree, where)
        if hint is float and type(tree) is int and abs(tree) < 1 << 63:
            return float(tree)
        if type(tree) is not hint:
            raise _damaged(where)
        return tree

    def _union(self, hints: tuple, tree: Any, where: str) -> Any:
        """`X | None`, or several kinds of array."""
        if tree is None and types.NoneType in hints:
            return None
        some = tuple(hint for hint in hints if hint is not types.NoneType)
        if all(get_origin(hint) is np.ndarray for hint in some):
            return self._array(some, tree, where)
        return self.value(some[0], tree, where)

    def _tuple(self, hints: tuple, tree: Any, where: str) -> tuple:
        if not isinstance(tree, list):
            raise _damaged(where)
        if hints[-1] is Ellipsis:
            hints = (hints[0],) * len(tree)
        if len(hints) != len(tree):
            raise _damaged(where)
        pairs = enumerate(zip(hints, tree, strict=True))
        return tuple(self.value(hint, part, f"{where}.{k}") for k, (hint, part) in pairs)

    def _dataclass(self, kind: Any, tree: Any, where: str) -> Any:
        if not isinstance(tree, dict):
            raise _damaged(where)
        hints = _hints(kind)
        given = {}
        for f in fields(kind):
            if f.name in tree:
                given[f.name] = self.value(hints[f.name], tree[f.name], f"{where}.{f.name}")
            elif f.default is MISSING and f.default_factory is MISSING:
                raise _damaged(f"{where}.{f.name}")
        return kind(**given)

    def _array(self, hints: tuple, tree: Any, where: str) -> np.ndarray:
        """An array of one of the declared kinds: a kernel would be compiled anew for others."""
        match tree:
            case {"array": str(path)} if path in self.arrays:
                array = self.arrays[path]
            case {"png": str(member)} if member in self.members:
                is_mask = all(_is_of(A_MASK, hint) for hint in hints)
                array = self._picture(member, self.most if is_mask else self.most_colours)
            case _:
                raise _damaged(where)
        if not any(_is_of(array, hint) for hint in hints):
            raise SessionError(f"the session is damaged: {where} has numbers of another kind")
        return frozen(array)

    def _picture(self, member: str, most: int) -> np.ndarray:
        """A member's pixels, or mask: the same array wherever it is named again."""
        if member not in self._pictures:
            try:
                picture = read_picture(self.members[member], most)
            except ImageError as error:
                raise SessionError(f"the session is damaged: {named(member)}: {error}") from error
            pixels = picture.pixels
            if picture.alpha is not None:
                pixels = frozen(np.dstack([pixels, picture.alpha]))
            self._pictures[member] = frozen(pixels[..., 0] > 127) if picture.is_grey else pixels
        return self._pictures[member]


@cache
def _hints(kind: type) -> dict[str, Any]:
    """The types of a dataclass's fields; looking them up costs more than reading one."""
    return get_type_hints(kind)


def _is_of(array: np.ndarray, hint: Any) -> bool:
    """Whether `hint` is an array of that dtype, or of any."""
    kinds = [get_args(part) for part in get_args(hint)[1:]]  # np.ndarray[shape, np.dtype[scalar]]
    return hint is np.ndarray or any(
        k and (k[0] is Any or np.dtype(k[0]) == array.dtype) for k in kinds
    )


def _damaged(where: str) -> SessionError:
    return SessionError(f"the session's document.json is damaged at {where}")


# Arrays as NumPy's .npy bytes: of numbers only, and no larger than the bytes that are there.

HEADER = 1 << 17  # bytes, more than any header has
KINDS = "fiub"  # floating point, whole numbers, truths; never objects


class ArrayError(ValueError):
    """The bytes are no array that can be taken; what they are, as the end of a sentence."""


def read_npy(data: bytes | bytearray) -> np.ndarray:
    """The array in a .npy file's bytes, a view of them. Raises ArrayError.

    The header is compared with the bytes before anything is allocated.
    """
    file = io.BytesIO(bytes(memoryview(data)[:HEADER]))
    try:
        version = np.lib.format.read_magic(file)
        if version == (1, 0):
            shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(file)
        else:
            shape, is_fortran, dtype = np.lib.format.read_array_header_2_0(file)
    except Exception as error:  # the header is a Python literal: whatever parsing it stumbles over
        raise ArrayError("no array") from error
    if dtype.kind not in KINDS:
        raise ArrayError("no array of numbers")
    if not all(0 <= n < 1 << 40 for n in shape) or len(shape) > 8:
        raise ArrayError("no array")
    if math.prod(shape) * dtype.itemsize != len(data) - file.tell():
        raise ArrayError("an array that is longer or shorter than its bytes")
    if math.prod(shape) == 0 and max(shape, default=0) > 1 << 24:
        raise ArrayError("no array")  # an empty one that claims memory which nothing backs
    flat = np.frombuffer(data, dtype, math.prod(shape), file.tell())
    array = flat.reshape(shape, order="F" if is_fortran else "C")
    if dtype.kind == "f" and not all_finite(array):
        raise ArrayError("an array with values that are not finite")
    return array
