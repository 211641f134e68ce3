"""The 3DGS .ply format, and the only place that knows how it stores values.

A file holds logarithms of scales, logits of opacities, and colours as coefficients of spherical
harmonics; `Gaussians` holds the values themselves. Degree 0 is written; of any degree the first
coefficient is read, which is the colour averaged over all directions: what the photo shows of an
object wears the photo's own pixels, and the rest is seen from sides that the photo did not see,
so a colour evaluated for the photo's side would be wrong exactly where it is used.

Surfels (2DGS) have two scales: the third becomes FLATNESS of the smaller. A .ply that holds
points and nothing of a Gaussian (COLMAP's points3D.ply, a scanner's output) becomes small splats,
each as large as the gap to its neighbours: round, or flat on its normal where the file has normals.

The file's rows are read a block at a time, so that the columns nobody wants (45 coefficients of
spherical harmonics, say) never lie in memory together. Nothing is allocated for a count that the
file cannot hold.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import IO

import numpy as np

from ...base.arrays import F32, F64
from ...base.limits import PLY_HEADER as MAX_HEADER
from ...base.limits import PLY_LINE as MAX_LINE
from ...base.rotations import matrices_from_quats, quats_along, quats_from_matrices
from ...document.gaussians import Gaussians
from ..limits import GREATEST, LEAST_SCALE, SplatFileError, check_count, empty_columns, mended

# Ways in which files have their axes, and the turns that bring them to ours.
#
# Ours are a camera's: x right, y down, z away from the viewer.

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


SH0 = 0.28209479177387814  # the constant spherical harmonic, 1 / (2 sqrt(pi))
LEAST_ALPHA = 1e-6  # a logit is infinite at 0 and 1
FLATNESS = 0.01  # x the smaller of a surfel's two scales

MEANS = ("x", "y", "z")
NORMALS = ("nx", "ny", "nz")  # written as 0: some readers expect them
COLORS = ("f_dc_0", "f_dc_1", "f_dc_2")
SCALES = ("scale_0", "scale_1", "scale_2")
QUATS = ("rot_0", "rot_1", "rot_2", "rot_3")  # wxyz
WRITTEN = (*MEANS, *NORMALS, *COLORS, "opacity", *SCALES, *QUATS)
SURFEL = (*MEANS, *COLORS, "opacity", *SCALES[:2], *QUATS)
READ = (*SURFEL, SCALES[2])


def encode_ply(gaussians: Gaussians) -> bytes:
    """Binary little-endian .ply file of the Gaussians, degree 0, axes as they are."""
    properties = "".join(f"property float {name}\n" for name in WRITTEN)
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(gaussians)}\n{properties}end_header\n"
    )
    alpha = np.clip(gaussians.opacities.astype(np.float64), LEAST_ALPHA, 1 - LEAST_ALPHA)
    columns = (
        gaussians.means,
        np.zeros_like(gaussians.means),
        (gaussians.colors.astype(np.float64) - 0.5) / SH0,
        np.log(alpha / (1 - alpha))[:, None],
        np.log(np.maximum(gaussians.scales.astype(np.float64), LEAST_SCALE)),
        gaussians.quats,
    )
    table = np.concatenate([column.astype("<f4") for column in columns], axis=1)
    return header.encode("ascii") + table.tobytes()


def decode_ply(data: bytes) -> Gaussians:
    """The Gaussians of a .ply file's bytes, binary or text, its properties in any order.

    Properties and elements that are not a Gaussian's are ignored. Raises SplatFileError.
    """
    stream = io.BytesIO(data)
    return read_ply(stream, read_header(stream), len(data))


def read_ply(stream: IO[bytes], header: PlyHeader, size: int) -> Gaussians:
    """The Gaussians of an open .ply file of `size` bytes. Raises SplatFileError."""
    vertex = header.element("vertex")
    if vertex is None:
        raise SplatFileError("the .ply file has no vertices")
    if is_mere_points(vertex):
        raise SplatFileError("the .ply file holds points or a mesh, not 3D Gaussians")
    missing = [name for name in SURFEL if name not in vertex.names]
    if missing:
        raise SplatFileError(f"the .ply file holds no 3D Gaussians: {missing[0]} is missing")
    check_count(vertex.count)
    rows, first = blocks(stream, header, "vertex", size), 0
    table = next(rows, None)  # before anything is allocated: the file is as long as it says
    columns = empty_columns(vertex.count)
    while table is not None:
        last = first + len(table["x"])
        _decode(table, tuple(column[first:last] for column in columns))
        first, table = last, next(rows, None)
    return mended(*columns)


def is_mere_points(vertex: Element) -> bool:
    """True where not one of a vertex's properties is a Gaussian's own."""
    return not set(vertex.names) & (set(READ) - set(MEANS))


def stack(table: Table, names: tuple[str, ...]) -> np.ndarray:
    """Columns (N, len(names)) f64."""
    return np.stack([table[name].astype(np.float64) for name in names], axis=1)


def _decode(table: Table, columns: tuple[F32, ...]) -> None:
    """Fills the rows of `columns` (see `empty_columns`) from the stored values."""
    means, quats, scales, opacities, colors = columns
    with np.errstate(over="ignore", invalid="ignore"):  # `mended` leaves out what overflows
        means[:] = stack(table, MEANS)
        quats[:] = stack(table, QUATS)
        if SCALES[2] in table:
            scales[:] = np.exp(stack(table, SCALES))
        else:
            scales[:, :2] = np.exp(stack(table, SCALES[:2]))
            scales[:, 2] = FLATNESS * scales[:, :2].min(1)
        opacities[:] = 1 / (1 + np.exp(-table["opacity"].astype(np.float64)))
        colors[:] = 0.5 + SH0 * stack(table, COLORS)


NEIGHBOURS = 3  # as 3DGS starts its training (Kerbl et al. 2023)
SIZE = 0.6  # x mean distance to them: neighbours overlap without gaps
POINT_FLATNESS = 0.2  # x the size, across a surface
WIDEST = 10.0  # x median size: a stray point is no balloon
GREY = 0.5
POINT_COLORS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"))


def read_points(stream: IO[bytes], header: PlyHeader, size: int) -> Gaussians:
    """Read one splat per point of an open .ply file of `size` bytes. Raises SplatFileError."""
    vertex = header.element("vertex")
    if vertex is None or not {"x", "y", "z"} <= set(vertex.names):
        raise SplatFileError("the .ply file holds no points: x, y or z is missing")
    check_count(vertex.count, "points")
    if not vertex.count:
        raise SplatFileError("the .ply file holds no points")
    names = next((names for names in POINT_COLORS if set(names) <= set(vertex.names)), None)
    scale = _color_scale(dict((name, form) for form, name in vertex.properties), names)
    points, colors, normals = [], [], []
    for table in blocks(stream, header, "vertex", size):
        at = np.stack([table[name].astype(np.float64) for name in "xyz"], axis=1)
        points.append(at)
        if names:
            block = np.stack([table[name].astype(np.float32) for name in names], axis=1)
            colors.append(np.clip(np.nan_to_num(block * scale), 0, 1).astype(np.float32))
        if set(NORMALS) <= set(vertex.names):
            normals.append(np.stack([table[n].astype(np.float64) for n in NORMALS], axis=1))
    cloud = np.concatenate(points)
    kept = (np.abs(cloud) <= GREATEST).all(1)  # NaN compares false
    if not kept.any():
        raise SplatFileError("none of the file's points has a finite position")
    shades = np.concatenate(colors) if colors else np.full((len(cloud), 3), GREY, np.float32)
    across = np.concatenate(normals)[kept] if normals else None
    return _splats(cloud[kept], shades[kept], across)


def _color_scale(forms: dict[str, str], names: tuple[str, ...] | None) -> np.float32:
    """What brings a stored colour to [0, 1]."""
    form = forms[names[0]] if names else "f4"
    if form.startswith("f"):
        return np.float32(1)
    return np.float32(1 / (65535 if form == "u2" else 255))


def _splats(points: F64, colors: np.ndarray, normals: F64 | None) -> Gaussians:
    from scipy.spatial import KDTree

    gaps = KDTree(points).query(points, k=min(NEIGHBOURS + 1, len(points)), workers=1)[0]
    gaps = gaps.reshape(len(points), -1)[:, 1:]
    sizes = SIZE * gaps.mean(1) if gaps.shape[1] else np.full(1, SIZE)
    positive = sizes[sizes > 0]
    usual = float(np.median(positive)) if len(positive) else 1.0
    sizes = np.clip(sizes, 0.05 * usual, WIDEST * usual)
    scales = np.repeat(sizes[:, None], 3, axis=1)
    quats = np.tile([1.0, 0.0, 0.0, 0.0], (len(points), 1))
    if normals is not None:
        lengths = np.linalg.norm(normals, axis=1)
        known = np.isfinite(lengths) & (lengths > 1e-12)
        quats[known] = quats_along(normals[known] / lengths[known, None])
        scales[known, 2] *= POINT_FLATNESS
    parts = (points, quats, scales, np.ones(len(points)), colors)
    return Gaussians(*(part.astype(np.float32) for part in parts))
