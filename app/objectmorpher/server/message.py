"""Values as bytes: one safetensors file, its arrays raw, and a tree of JSON that places them.

A tree is made of numbers, texts, tuples, lists and the dataclasses of a fixed table. Large
arrays are messages of their own, named by their SHA-256, so that a photo is sent once. Nothing is
unpickled, nothing unpacked: what a message claims is compared with the bytes that are there before
anything is made of it.

Layout (https://github.com/huggingface/safetensors#format): u64 little-endian length of the header,
the header in JSON, then the arrays, which must fill the rest without gaps or overlaps.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, NoReturn

import numpy as np

from objectmorpher_core.base.limits import MESSAGE_ARRAYS as MOST_ARRAYS
from objectmorpher_core.base.limits import MESSAGE_AXES as MOST_AXES
from objectmorpher_core.base.limits import MESSAGE_DEPTH as MOST_DEPTH
from objectmorpher_core.base.limits import MESSAGE_HEADER as MOST_HEADER

from .fitting import fits, hints

LARGE = 1 << 20  # bytes, from which on an array is a message of its own
DTYPES = {
    "BOOL": "?", "U8": "u1", "I8": "i1", "U16": "<u2", "I16": "<i2", "U32": "<u4", "I32": "<i4",
    "U64": "<u8", "I64": "<i8", "F16": "<f2", "F32": "<f4", "F64": "<f8",
}  # fmt: skip
NAMES = {np.dtype(code): name for name, code in DTYPES.items()}
TREE = "tree"  # key of the metadata
ARRAY, BLOB, TUPLE, LIST, DATA, FIELDS = "array", "blob", "tuple", "list", "data", "fields"


class MessageError(ValueError):
    """Bytes that are no message, or one that says what it must not; one sentence."""


class MissingError(MessageError):
    """A message names large arrays that were not sent."""

    def __init__(self, digests: tuple[str, ...]) -> None:
        super().__init__(f"{len(digests)} large arrays are missing")
        self.digests = digests


@dataclass(frozen=True)
class WireMessage:
    """A value on the wire."""

    body: bytes
    blobs: Mapping[str, bytes]  # SHA-256 in hexadecimal -> a message that is one array


Types = Mapping[str, type]  # the dataclasses that a message may name


def digest(body: bytes) -> str:
    """The name of a large array's message."""
    return hashlib.sha256(body).hexdigest()


def encode(value: Any, types: Types, is_split: bool = False) -> WireMessage:
    """`value` as bytes; `is_split`: large arrays beside it. TypeError where it has no form."""
    arrays: list[np.ndarray] = []
    blobs: dict[str, bytes] = {}

    def plain(part: Any) -> Any:
        if part is None or isinstance(part, bool | int | float | str):
            return part
        if isinstance(part, np.generic):
            return part.item()
        if isinstance(part, np.ndarray):
            if is_split and part.nbytes >= LARGE:
                body = encode(part, types).body
                name = digest(body)
                blobs[name] = body
                return {BLOB: name}
            arrays.append(part)
            return {ARRAY: len(arrays) - 1}
        if isinstance(part, tuple):
            return {TUPLE: [plain(each) for each in part]}
        if isinstance(part, list):
            return {LIST: [plain(each) for each in part]}
        name = type(part).__name__
        if is_dataclass(part) and types.get(name) is type(part):
            return {
                DATA: name,
                FIELDS: {f.name: plain(getattr(part, f.name)) for f in fields(part)},
            }
        raise TypeError(f"a {name} cannot be sent")

    tree = json.dumps(plain(value), allow_nan=False)
    return WireMessage(_packed(tree, arrays), blobs)


def _packed(tree: str, arrays: list[np.ndarray]) -> bytes:
    header: dict[str, Any] = {"__metadata__": {TREE: tree}}
    parts, end = [], 0
    # Wide numbers first: so each array lies at a multiple of its numbers' width.
    for k in sorted(range(len(arrays)), key=lambda k: -arrays[k].dtype.itemsize):
        name = NAMES.get(arrays[k].dtype.newbyteorder("<"))
        if name is None:
            raise TypeError(f"an array of {arrays[k].dtype} cannot be sent")
        data = np.ascontiguousarray(arrays[k], dtype=DTYPES[name]).tobytes()
        shape = list(arrays[k].shape)
        header[str(k)] = {"dtype": name, "shape": shape, "data_offsets": [end, end + len(data)]}
        parts.append(data)
        end += len(data)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    return b"".join([len(text).to_bytes(8, "little"), text, *parts])


def decode(body: bytes, types: Types, blobs: Mapping[str, bytes] | None = None) -> Any:
    """The value of a message; its arrays are read-only views of `body`.

    Raises MessageError, and MissingError where `blobs` lacks some that it names.
    """
    tree, arrays = _unpacked(body)
    known = blobs or {}
    missing = sorted(name for name in _named(tree, 0) if name not in known)
    if missing:
        raise MissingError(tuple(missing))

    def value(part: Any) -> Any:
        if not isinstance(part, dict):
            return part
        if set(part) == {ARRAY} and _is_index(part[ARRAY]) and str(part[ARRAY]) in arrays:
            return arrays[str(part[ARRAY])]
        if set(part) == {BLOB}:
            return _single(known[part[BLOB]])
        if set(part) == {TUPLE} and isinstance(part[TUPLE], list):
            return tuple(value(each) for each in part[TUPLE])
        if set(part) == {LIST} and isinstance(part[LIST], list):
            return [value(each) for each in part[LIST]]
        if set(part) == {DATA, FIELDS} and isinstance(part[FIELDS], dict):
            return _built(part[DATA], {k: value(v) for k, v in part[FIELDS].items()}, types)
        raise MessageError("the message's tree has a branch of no known kind")

    return value(tree)


def name_of(array: np.ndarray, blobs: Mapping[str, bytes]) -> str:
    """The name of an array of a decoded message: its own message's, or made of its bytes."""
    owner: Any = array
    while isinstance(owner, np.ndarray):
        owner = owner.base
    named = next((name for name, body in blobs.items() if body is owner), None)
    return named or digest(array.tobytes())


def _named(part: Any, depth: int) -> set[str]:
    """The large arrays that a tree names; refuses one that is too deep or has bare lists."""
    if depth > MOST_DEPTH:
        raise MessageError("the message's tree is too deep")
    if isinstance(part, dict):
        if set(part) == {BLOB}:
            if not isinstance(part[BLOB], str):
                raise MessageError("a large array's name is no text")
            return {part[BLOB]}
        part = [child for each in part.values() for child in _children(each)]
        return set().union(*(_named(child, depth + 1) for child in part))
    if isinstance(part, list):
        raise MessageError("the message's tree has a branch of no known kind")
    return set()


def _children(part: Any) -> list[Any]:
    if isinstance(part, list):
        return part
    return list(part.values()) if isinstance(part, dict) else []


def _is_index(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _single(body: bytes) -> np.ndarray:
    tree, arrays = _unpacked(body)
    if tree != {ARRAY: 0} or len(arrays) != 1:
        raise MessageError("a large array's message is something else")
    return arrays["0"]


def _built(name: Any, values: dict[str, Any], types: Types) -> Any:
    """A dataclass of the table, if all its fields are of the types that it declares."""
    kind = types.get(name) if isinstance(name, str) else None
    if kind is None:
        raise MessageError("the message names a type that is not served")
    wanted = hints(kind)
    if set(values) != set(wanted):
        raise MessageError(f"a {name} has other fields")
    for field, value in values.items():
        if not fits(value, wanted[field]):
            raise MessageError(f"the {field} of a {name} is of another type")
    try:
        return kind(**values)
    except (ValueError, TypeError, IndexError, AttributeError) as error:
        raise MessageError(f"a {name} is refused: {error}") from error


def _unpacked(body: bytes) -> tuple[Any, dict[str, np.ndarray]]:
    """The tree, and the arrays by their names."""
    size = int.from_bytes(body[:8], "little")
    if len(body) < 8 or size > min(MOST_HEADER, len(body) - 8):
        raise MessageError("this is no message: its header is not there")
    try:
        header = _parsed(body[8 : 8 + size].decode("utf-8"))
        tree = _parsed(header.pop("__metadata__")[TREE])
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise MessageError("this is no message: its header cannot be read") from error
    if len(header) > MOST_ARRAYS:
        raise MessageError(f"the message has more than {MOST_ARRAYS} arrays")
    spans = {name: _Span.of(entry) for name, entry in header.items()}
    end = 0
    for span in sorted(spans.values(), key=lambda s: (s.start, s.end)):
        if span.start != end:
            raise MessageError("the message's arrays have gaps or overlap")
        end = span.end
    if end != len(body) - 8 - size:
        raise MessageError("the message is longer or shorter than its arrays")
    return tree, {name: span.array(body, 8 + size) for name, span in spans.items()}


def _parsed(text: str) -> Any:
    return json.loads(text, parse_constant=_refuse_constant)


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")


@dataclass(frozen=True)
class _Span:
    """Where an array says that it lies, compared with its shape."""

    dtype: np.dtype
    shape: tuple[int, ...]
    start: int  # bytes after the header
    end: int

    @staticmethod
    def of(entry: Any) -> _Span:
        if not isinstance(entry, dict) or set(entry) != {"dtype", "shape", "data_offsets"}:
            raise MessageError("an array's entry has other fields")
        name, shape, offsets = entry["dtype"], entry["shape"], entry["data_offsets"]
        if not isinstance(name, str) or name not in DTYPES:
            raise MessageError("an array is of a type that is not served")
        are_lists = isinstance(shape, list) and isinstance(offsets, list)
        if not are_lists or not all(_is_index(n) and n >= 0 for n in (*shape, *offsets)):
            raise MessageError("an array's shape or place is no list of whole numbers")
        if len(shape) > MOST_AXES or len(offsets) != 2:
            raise MessageError("an array has too many axes, or no place")
        dtype = np.dtype(DTYPES[name])
        if offsets[1] - offsets[0] != math.prod(shape) * dtype.itemsize:
            raise MessageError("an array's shape and its bytes disagree")
        return _Span(dtype, tuple(shape), offsets[0], offsets[1])

    def array(self, body: bytes, base: int) -> np.ndarray:
        count = math.prod(self.shape)
        if count == 0:
            # An empty array's other axes claim memory that nothing backs.
            if max(self.shape) > MOST_HEADER:
                raise MessageError("an empty array has an axis that is too long")
            return np.zeros(self.shape, self.dtype)
        if self.dtype == np.bool_:
            data = np.frombuffer(body, np.uint8, count, base + self.start)
            if data.max() > 1:
                raise MessageError("an array of truths has other values")
            return data.view(np.bool_).reshape(self.shape)
        return np.frombuffer(body, self.dtype, count, base + self.start).reshape(self.shape)
