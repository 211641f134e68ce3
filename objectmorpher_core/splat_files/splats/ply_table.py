"""The .ply container: a header that names elements and their columns, then the rows.

Rows are read a block at a time, so that the columns nobody wants (45 coefficients of spherical
harmonics, say) never lie in memory together. Nothing is allocated for a count that the file
cannot hold.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import IO

import numpy as np

from ...base.arrays import F64
from ...base.limits import PLY_HEADER as MAX_HEADER
from ...base.limits import PLY_LINE as MAX_LINE
from ...base.rotations import matrices_from_quats, quats_from_matrices
from ...document.gaussians import Gaussians
from ..limits import SplatFileError

# Ways in which files have their axes, and the turns that bring them to ours.
#
# Ours are a camera's: x right, y down, z away from the viewer (DESIGN section 2).

HALF_TURN = np.diag([1.0, -1.0, -1.0])  # about x: y up and z back, as in glTF and .spz
QUARTER_TURN = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # z up and y away: .stl


def half_turned(gaussians: Gaussians) -> Gaussians:
    """Turned by 180 degrees about x, exactly: its own inverse."""
    w, x, y, z = gaussians.quats.T
    means = gaussians.means * np.array([1, -1, -1], np.float32)
    return replace(gaussians, means=means, quats=np.stack([-x, w, -z, y], axis=1))


def turned(gaussians: Gaussians, matrix: F64) -> Gaussians:
    """The Gaussians after a rotation (3, 3) about the origin."""
    axes = matrix @ matrices_from_quats(gaussians.quats.astype(np.float64))
    return replace(gaussians, means=gaussians.means @ matrix.T, quats=quats_from_matrices(axes))


BLOCK = 1 << 16  # rows at a time; a multiple of a compressed file's chunk
TEXT_BLOCK = 1 << 12

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
KINDS = ("ascii", "binary_little_endian", "binary_big_endian")

Table = dict[str, np.ndarray]  # columns (rows,) by name


@dataclass(frozen=True)
class Element:
    """A table of the file."""

    name: str
    count: int
    properties: tuple[tuple[str, str], ...]  # (numpy type or "list", name)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(name for _, name in self.properties)

    @property
    def has_lists(self) -> bool:
        return any(form == "list" for form, _ in self.properties)


@dataclass(frozen=True)
class PlyHeader:
    """The declarations in the text at the beginning of the file."""

    kind: str  # one of KINDS
    elements: tuple[Element, ...]
    start: int  # bytes; where the rows begin

    def element(self, name: str) -> Element | None:
        return next((e for e in self.elements if e.name == name), None)


def read_header(stream: IO[bytes]) -> PlyHeader:
    """The header of the file that `stream` is at the beginning of. Raises SplatFileError."""
    head = stream.read(MAX_HEADER)
    if not head.startswith((b"ply\n", b"ply\r\n")):
        raise SplatFileError("the file is not a .ply file")
    end = head.find(b"end_header")
    start = head.find(b"\n", end) + 1
    if end < 0 or start == 0:
        raise SplatFileError("the .ply file's header does not end")
    kind, elements = "", []
    try:
        for line in head[:end].decode("latin-1").split("\n")[1:]:
            match line.split():
                case ["format", word, _] if word in KINDS:
                    kind = word
                case ["element", name, count] if count.isascii() and count.isdigit():
                    elements.append((name, int(count), []))
                case ["property", "list", _, _, name]:
                    elements[-1][2].append(("list", name))
                case ["property", form, name]:
                    elements[-1][2].append((TYPES[form], name))
                case [] | ["comment", *_] | ["obj_info", *_]:
                    pass
                case _:
                    raise ValueError(line)
        if not kind:
            raise ValueError("no format")
    except (ValueError, KeyError, IndexError) as error:
        raise SplatFileError("the .ply file's header is damaged") from error
    return PlyHeader(kind, tuple(Element(n, c, tuple(p)) for n, c, p in elements), start)


def blocks(stream: IO[bytes], header: PlyHeader, name: str, size: int) -> Iterator[Table]:
    """The rows of element `name`, in order, a block of them at a time.

    `size` is the file's, bytes. Raises SplatFileError where the file ends before its rows do.
    """
    stream.seek(header.start)
    for element in header.elements:
        if element.has_lists or len(set(element.names)) < len(element.names):
            raise SplatFileError("the .ply file is a mesh or is damaged, not 3D Gaussians")
        if header.kind == "ascii":
            rows = _text_rows(stream, element)
        else:
            rows = _binary_rows(stream, element, header.kind, size)
        if element.name == name:
            yield from rows
            return
        if header.kind == "ascii":
            for _ in rows:
                pass
        else:
            stream.seek(element.count * _row(element, header.kind).itemsize, 1)
    raise SplatFileError(f"the .ply file has no element {name}")


def _row(element: Element, kind: str) -> np.dtype:
    order = ">" if kind == "binary_big_endian" else "<"
    return np.dtype([(name, order + form) for form, name in element.properties])


def _binary_rows(stream: IO[bytes], element: Element, kind: str, size: int) -> Iterator[Table]:
    row = _row(element, kind)
    if element.count * row.itemsize > size - stream.tell():
        raise SplatFileError("the .ply file ends early")
    if not row.itemsize:
        return
    for first in range(0, element.count, BLOCK):
        rows = min(BLOCK, element.count - first)
        table = np.frombuffer(stream.read(rows * row.itemsize), row)
        yield {name: table[name] for name in element.names}


def _text_rows(stream: IO[bytes], element: Element) -> Iterator[Table]:
    for first in range(0, element.count, TEXT_BLOCK):
        rows = min(TEXT_BLOCK, element.count - first)
        lines = [stream.readline(MAX_LINE) for _ in range(rows)]
        if not lines[-1].strip() or max(map(len, lines)) == MAX_LINE:
            raise SplatFileError("the .ply file is damaged or ends early")
        try:
            words = b" ".join(lines).split()
            table = np.array(words, np.float64).reshape(rows, len(element.names))
        except ValueError as error:
            raise SplatFileError("the .ply file is damaged or ends early") from error
        yield {name: table[:, k] for k, name in enumerate(element.names)}
