"""The .compressed.ply format of PlayCanvas and SuperSplat: 16 bytes a Gaussian.

Gaussians stand in chunks of 256. A chunk stores the bounds of its positions, log-scales and
colours as float32, and each Gaussian four words within them: position and log-scale with 11, 10
and 11 bits, the quaternion's three smaller components with 10 each and 2 for which is left out,
colour and opacity with 8. Files of the first version have no colour bounds: then they are [0, 1].
An element `sh` of higher harmonics is ignored (see `ply.py`) and not written.
"""

from __future__ import annotations

import io
from typing import IO

import numpy as np

from ...base.arrays import F32, F64
from ...document.gaussians import Gaussians
from ..limits import LEAST_SCALE, SplatFileError, check_count, empty_columns, mended
from .ply import PlyHeader, Table, blocks, read_header

CHUNK = 256  # Gaussians that share bounds
BITS_111011 = ((21, 11), (11, 10), (0, 11))  # (shift, bits) of x, y, z
BITS_8888 = ((24, 8), (16, 8), (8, 8), (0, 8))
BITS_ROTATION = ((20, 10), (10, 10), (0, 10))
OTHERS = np.array([[j for j in range(4) if j != k] for k in range(4)])  # components but k
ROOT2 = np.sqrt(2.0)
LOG_SCALES = (-20.0, 20.0)  # as other writers bound them
MORTON_BITS = 21  # an axis: three of them fit a 64-bit key

AXES = ("x", "y", "z")
BOUNDS = tuple(
    tuple(f"{end}_{kind}{axis}" for axis in axes)
    for kind, axes in (("", AXES), ("scale_", AXES), ("", ("r", "g", "b")))
    for end in ("min", "max")
)  # position low, position high, scale low, ... colour high
PACKED = ("packed_position", "packed_rotation", "packed_scale", "packed_color")


def is_compressed(header: PlyHeader) -> bool:
    """True for a .ply file of packed chunks, whatever its name."""
    vertex = header.element("vertex")
    return vertex is not None and bool(set(PACKED) & set(vertex.names))


def decode_compressed(data: bytes) -> Gaussians:
    """The Gaussians of a .compressed.ply file's bytes. Raises SplatFileError."""
    stream = io.BytesIO(data)
    return read_compressed(stream, read_header(stream), len(data))


def read_compressed(stream: IO[bytes], header: PlyHeader, size: int) -> Gaussians:
    """The Gaussians of an open .compressed.ply file of `size` bytes. Raises SplatFileError."""
    vertex, chunk = header.element("vertex"), header.element("chunk")
    if vertex is None or chunk is None:
        raise SplatFileError("the compressed .ply file has no chunks")
    forms = {name: form for form, name in vertex.properties}
    for name in PACKED:
        if forms.get(name) != "u4":
            raise SplatFileError(f"the compressed .ply file is damaged: {name} is missing")
    for name in (name for group in BOUNDS[:4] for name in group):
        if name not in chunk.names:
            raise SplatFileError(f"the compressed .ply file is damaged: {name} is missing")
    check_count(vertex.count)
    if chunk.count != -(-vertex.count // CHUNK):
        raise SplatFileError(
            f"the compressed .ply file is damaged: {vertex.count:,} Gaussians in "
            f"{chunk.count:,} chunks of {CHUNK}"
        )
    bounds = _read_bounds(stream, header, size)
    rows, first = blocks(stream, header, "vertex", size), 0
    table = next(rows, None)
    columns = empty_columns(vertex.count)
    while table is not None:
        last = first + len(table[PACKED[0]])
        _decode(table, bounds[first // CHUNK :], tuple(column[first:last] for column in columns))
        first, table = last, next(rows, None)
    return mended(*columns)


def _read_bounds(stream: IO[bytes], header: PlyHeader, size: int) -> F32:
    """(chunks, 6, 3): the bounds in the order of BOUNDS."""
    parts = []
    for table in blocks(stream, header, "chunk", size):
        rows = len(next(iter(table.values())))
        bounds = np.empty((rows, len(BOUNDS), 3), np.float32)
        bounds[:, 4], bounds[:, 5] = 0, 1
        for k, names in enumerate(BOUNDS):
            if set(names) <= set(table):
                bounds[:, k] = np.stack([table[name] for name in names], axis=1)
        parts.append(bounds)
    return np.concatenate(parts) if parts else np.empty((0, len(BOUNDS), 3), np.float32)


def _decode(table: Table, bounds: F32, columns: tuple[F32, ...]) -> None:
    """Fills the rows of `columns` (see `empty_columns`); the first row begins a chunk."""
    means, quats, scales, opacities, colors = columns
    position, rotation, scale, color = (table[name].astype(np.uint32) for name in PACKED)
    ends = np.repeat(bounds[: -(-len(position) // CHUNK)], CHUNK, axis=0)[: len(position)]

    def within(k: int, share: F64) -> F64:
        low = ends[:, k].astype(np.float64)
        return low + (ends[:, k + 1] - low) * share

    with np.errstate(over="ignore", invalid="ignore"):  # `mended` leaves out what overflows
        means[:] = within(0, _unpacked(position, BITS_111011))
        scales[:] = np.exp(within(2, _unpacked(scale, BITS_111011)))
        shades = _unpacked(color, BITS_8888)
        colors[:] = within(4, shades[:, :3])
    opacities[:] = shades[:, 3]
    quats[:] = _unpacked_quats(rotation)


def _unpacked(words: np.ndarray, layout: tuple[tuple[int, int], ...]) -> F64:
    """(N, fields) in [0, 1]."""
    fields = [((words >> shift) & ((1 << bits) - 1)) / ((1 << bits) - 1) for shift, bits in layout]
    return np.stack(fields, axis=1)


def _unpacked_quats(words: np.ndarray) -> F64:
    """Unit quaternions (N, 4) wxyz."""
    smaller = (_unpacked(words, BITS_ROTATION) - 0.5) * ROOT2
    largest = np.sqrt(np.maximum(0, 1 - (smaller**2).sum(1)))
    which = (words >> 30).astype(np.int64)
    quats = np.empty((len(words), 4))
    np.put_along_axis(quats, which[:, None], largest[:, None], axis=1)
    np.put_along_axis(quats, OTHERS[which], smaller, axis=1)
    return quats


def encode_compressed(gaussians: Gaussians) -> bytes:
    """The .compressed.ply file of the Gaussians, axes as they are, neighbours in one chunk.

    Raises SplatFileError for an empty set: readers of the format take no empty file.
    """
    count = len(gaussians)
    if not count:
        raise SplatFileError("there are no Gaussians to write")
    chunks = -(-count // CHUNK)
    order = _morton_order(gaussians.means)
    padded = np.concatenate([order, np.repeat(order[-1:], chunks * CHUNK - count)])
    logs = np.log(np.maximum(gaussians.scales.astype(np.float64), LEAST_SCALE))
    values = (gaussians.means, np.clip(logs, *LOG_SCALES), gaussians.colors)
    bounds = np.empty((chunks, len(BOUNDS), 3), np.float32)
    shares = []
    for k, value in enumerate(values):
        grouped = value[padded].astype(np.float32).reshape(chunks, CHUNK, 3)
        low, high = grouped.min(1), grouped.max(1)
        bounds[:, 2 * k], bounds[:, 2 * k + 1] = low, high
        extent = (high.astype(np.float64) - low)[:, None]
        share = (grouped - low[:, None].astype(np.float64)) / np.where(extent > 0, extent, 1)
        shares.append(share.reshape(-1, 3)[:count])
    alphas = gaussians.opacities[order][:, None]
    table = np.empty((count, 4), "<u4")
    table[:, 0] = _packed(shares[0], BITS_111011)
    table[:, 1] = _packed_quats(gaussians.quats[order])
    table[:, 2] = _packed(shares[1], BITS_111011)
    table[:, 3] = _packed(np.concatenate([shares[2], alphas], axis=1), BITS_8888)
    return _header(chunks, count) + bounds.astype("<f4").tobytes() + table.tobytes()


def _header(chunks: int, count: int) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", f"element chunk {chunks}"]
    lines += [f"property float {name}" for group in BOUNDS for name in group]
    lines += [f"element vertex {count}", *(f"property uint {name}" for name in PACKED)]
    return ("\n".join(lines) + "\nend_header\n").encode("ascii")


def _packed(shares: np.ndarray, layout: tuple[tuple[int, int], ...]) -> np.ndarray:
    """Words (N,) u4 of numbers (N, fields) in [0, 1], to the nearest step."""
    words = np.zeros(len(shares), np.uint32)
    for k, (shift, bits) in enumerate(layout):
        steps = (1 << bits) - 1
        field = np.clip(np.floor(shares[:, k] * steps + 0.5), 0, steps)
        words |= field.astype(np.uint32) << np.uint32(shift)
    return words


def _packed_quats(quats: F32) -> np.ndarray:
    """Words (N,) u4 of unit quaternions (N, 4) wxyz."""
    which = np.abs(quats).argmax(1)
    rows = np.arange(len(quats))
    # -q is the same rotation: with it the component that is left out is positive
    quats = quats * np.where(quats[rows, which] < 0, -1.0, 1.0)[:, None]
    smaller = quats[rows[:, None], OTHERS[which]]
    return _packed(smaller / ROOT2 + 0.5, BITS_ROTATION) | (which.astype(np.uint32) << 30)


def _morton_order(points: F32) -> np.ndarray:
    """Indices (N,) along a space-filling curve: 256 in a row lie close together."""
    low, extent = points.min(0).astype(np.float64), np.ptp(points, axis=0).astype(np.float64)
    cells = (points - low) / np.where(extent > 0, extent, 1) * ((1 << MORTON_BITS) - 1)
    keys = np.zeros(len(points), np.uint64)
    for axis in range(3):
        keys |= _spread(cells[:, axis].astype(np.uint64)) << np.uint64(axis)
    return np.argsort(keys, kind="stable")


def _spread(values: np.ndarray) -> np.ndarray:
    """Two zero bits between each two bits of 21-bit numbers (N,) u8."""
    for shift, mask in (
        (32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249),
    ):  # fmt: skip
        values = (values | (values << np.uint64(shift))) & np.uint64(mask)
    return values
