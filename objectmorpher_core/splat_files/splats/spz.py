"""The .spz format of Niantic: 16 to 20 bytes a Gaussian, then compressed.

Column after column: positions as fixed-point numbers of 24 bits, opacities as bytes, colours as
bytes of a range a little wider than [0, 1], log-scales in steps of 1/16, quaternions. Versions
differ in two things:

    version  positions    quaternions                          packed with
    1        float16      x, y, z in a byte each               gzip
    2        fixed 24     x, y, z in a byte each               gzip
    3        fixed 24     three smaller components, 10 bits    gzip
    4        fixed 24     three smaller components, 10 bits    zstandard, column by column

All are read. Version 3 is written: its quaternions are seven times as exact as version 2's, and
everything that reads version 4 reads it, too, while not everything reads 4. The file's axes are
x right, y up, z back (`RUB`, the format's own), ours those of a camera: half a turn about x.
"""

from __future__ import annotations

import gzip
import struct
import zlib
from dataclasses import dataclass

import numpy as np

from ...base.arrays import F32, U8
from ...base.limits import SPLATS_UNPACKED as MAX_UNPACKED
from ...document.gaussians import Gaussians
from ..limits import LEAST_SCALE, SplatFileError, check_count, empty_columns, mended
from .ply import SH0, half_turned

# The container of an .spz file's columns: header, gzip (versions 1 to 3) or zstandard streams (4).
#
# No more is unpacked than the header's count of Gaussians needs, and that count is believed only
# as far as a file of this size can hold it.

MAGIC = b"NGSP"
GZIP_MAGIC = b"\x1f\x8b"
HEADER = struct.Struct("<4sIIBBBB")  # magic, version, count, degree, bits, flags, 0 or streams
HEADER_4 = 32  # bytes of version 4's, which goes on with the table's offset
TABLE_ROW = struct.Struct("<QQ")  # packed and unpacked bytes of a stream
SH_BYTES = (0, 9, 24, 45, 72)  # a Gaussian, by degree
MOST_EXPONENT_BITS = 24
HAS_EXTENSIONS = 2  # flag
AXES_EXTENSION = 0xADBE0003  # says that the file's axes are others
RUB, RDF = 4, 6  # its values: the format's own axes (y up), and those of a .ply (y down)
MAX_EXTENSIONS = 1 << 16  # bytes
MAX_RATIO = 1032  # deflate packs no better; of zstandard nothing honest does
LEVEL = 6


@dataclass(frozen=True, eq=False)
class SpzParts:
    """The columns as they are stored."""

    version: int
    fractional_bits: int
    positions: U8  # (N, 9), or (N, 6) of version 1
    alphas: U8  # (N,)
    colors: U8  # (N, 3)
    scales: U8  # (N, 3)
    rotations: U8  # (N, 3), or (N, 4) from version 3 on
    axes: int = RUB

    @property
    def count(self) -> int:
        return len(self.alphas)


def pack_gzip(parts: SpzParts) -> bytes:
    """The file of the columns, version 3 or before. The same columns give the same bytes."""
    header = HEADER.pack(MAGIC, parts.version, parts.count, 0, parts.fractional_bits, 0, 0)
    columns = (parts.positions, parts.alphas, parts.colors, parts.scales, parts.rotations)
    return gzip.compress(header + b"".join(c.tobytes() for c in columns), LEVEL, mtime=0)


def unpack(data: bytes) -> SpzParts:
    """The columns of an .spz file's bytes. Raises SplatFileError."""
    if data.startswith(GZIP_MAGIC):
        return _unpack_gzip(data)
    if data.startswith(MAGIC):
        return _unpack_zstandard(data)
    raise SplatFileError("the file is not an .spz file")


@dataclass(frozen=True)
class _Head:
    version: int
    count: int
    degree: int
    bits: int
    flags: int
    streams: int

    def sizes(self) -> list[int]:
        """Bytes a Gaussian of each column; the last is the higher harmonics'."""
        position, rotation = 6 if self.version == 1 else 9, 3 if self.version < 3 else 4
        return [position, 1, 3, 3, rotation, SH_BYTES[self.degree]]


def _head(data: bytes, versions: tuple[int, ...], packed: int) -> _Head:
    """The header at the beginning of `data`, which is of a file of `packed` bytes."""
    if len(data) < HEADER.size:
        raise SplatFileError("the .spz file ends early")
    magic, *fields = HEADER.unpack_from(data)
    head = _Head(*fields)
    if magic != MAGIC:
        raise SplatFileError("the file is not an .spz file")
    if head.version not in versions:
        raise SplatFileError(f"the .spz file is of version {head.version}, which is not known")
    if head.degree >= len(SH_BYTES) or head.bits > MOST_EXPONENT_BITS:
        raise SplatFileError("the .spz file's header is damaged")
    check_count(head.count)
    needed = head.count * sum(head.sizes())
    if needed > MAX_UNPACKED:
        raise SplatFileError(f"the .spz file would unpack to more than {MAX_UNPACKED >> 30} GiB")
    if needed > MAX_RATIO * packed:
        raise SplatFileError("the .spz file ends early")
    return head


def _unpack_gzip(data: bytes) -> SpzParts:
    stream = zlib.decompressobj(16 + zlib.MAX_WBITS)
    try:
        first = stream.decompress(data, HEADER.size)
        head = _head(first, (1, 2, 3), len(data))
        needed = head.count * sum(head.sizes())
        body = stream.decompress(stream.unconsumed_tail, needed) if needed else b""
        if len(body) < needed:
            raise SplatFileError("the .spz file ends early")
        records = b""
        if head.flags & HAS_EXTENSIONS:
            records = stream.decompress(stream.unconsumed_tail, MAX_EXTENSIONS)
    except zlib.error as error:
        raise SplatFileError("the .spz file is damaged: it cannot be unpacked") from error
    columns, start = [], 0
    for size in head.sizes()[:-1]:
        columns.append(np.frombuffer(body, np.uint8, head.count * size, start))
        start += head.count * size
    return _parts(head, columns, _axes(records))


def _unpack_zstandard(data: bytes) -> SpzParts:
    import zstandard

    if len(data) < HEADER_4:
        raise SplatFileError("the .spz file ends early")
    head = _head(data, (4,), len(data))
    sizes = [head.count * size for size in head.sizes() if head.count * size]
    (table,) = struct.unpack_from("<I", data, HEADER.size)
    start = table + head.streams * TABLE_ROW.size
    if head.streams != len(sizes) or not HEADER_4 <= table <= start <= len(data):
        raise SplatFileError("the .spz file is damaged: its table of streams does not fit")
    records = data[HEADER_4:table] if head.flags & HAS_EXTENSIONS else b""
    columns = []
    for k, size in enumerate(sizes):
        packed, unpacked = TABLE_ROW.unpack_from(data, table + k * TABLE_ROW.size)
        if unpacked != size or packed > len(data) - start:
            raise SplatFileError("the .spz file is damaged: its table of streams does not fit")
        limited = zstandard.ZstdDecompressor(max_window_size=1 << 27)
        try:
            with limited.stream_reader(data[start : start + packed]) as reader:
                column = reader.read(size)
        except zstandard.ZstdError as error:
            raise SplatFileError("the .spz file is damaged: it cannot be unpacked") from error
        if len(column) < size:
            raise SplatFileError("the .spz file ends early")
        columns.append(np.frombuffer(column, np.uint8))
        start += packed
    return _parts(head, columns[:5] or [np.empty(0, np.uint8)] * 5, _axes(records))


def _parts(head: _Head, columns: list[U8], axes: int) -> SpzParts:
    shaped = [c.reshape(head.count, s) for c, s in zip(columns, head.sizes()[:-1], strict=True)]
    positions, alphas, colors, scales, rotations = shaped
    return SpzParts(
        head.version, head.bits, positions, alphas[:, 0], colors, scales, rotations, axes
    )  # fmt: skip


def _axes(records: bytes) -> int:
    """The file's axes: the format's own, unless one of its extensions says otherwise."""
    at = 0
    while at + 12 <= len(records):
        kind, length, axes = struct.unpack_from("<III", records, at)
        if kind == AXES_EXTENSION and length == 4 and axes:
            if axes not in (RUB, RDF):
                raise SplatFileError(
                    f"the .spz file is stored in axes (system {axes}) that are not supported"
                )
            return axes
        at += 8 + length
    return RUB


VERSION = 3  # written
FIXED_MOST = (1 << 23) - 1  # of a 24-bit number
FEWEST_BITS, MOST_BITS = 1, 24  # after the point: what readers take
COLOR_SCALE = 0.15  # x 255: a byte's step is SH0 / COLOR_SCALE / 255 = 0.0074 of a colour
SCALE_STEPS, SCALE_LOW = 16.0, -10.0  # bytes a unit of log-scale, and that of byte 0
OTHERS = np.array([[j for j in range(4) if j != k] for k in range(4)])  # components but k
ROOT_HALF = np.sqrt(0.5)
TENTH = (1 << 9) - 1  # magnitude of a component: ten bits, one of them the sign


def decode_spz(data: bytes) -> Gaussians:
    """The Gaussians of an .spz file's bytes, in our axes (y down). Raises SplatFileError."""
    parts = unpack(data)
    means, quats, scales, opacities, colors = empty_columns(parts.count)
    _decode_positions(parts, means)
    opacities[:] = parts.alphas / np.float32(255)
    colors[:] = 0.5 + (parts.colors / np.float32(255) - 0.5) * np.float32(SH0 / COLOR_SCALE)
    scales[:] = np.exp(parts.scales / np.float32(SCALE_STEPS) + np.float32(SCALE_LOW))
    if parts.version < 3:
        _decode_first_three(parts.rotations, quats)
    else:
        _decode_smallest_three(parts.rotations.view("<u4")[:, 0], quats)
    gaussians = mended(means, quats, scales, opacities, colors)
    return half_turned(gaussians) if parts.axes == RUB else gaussians


def encode_spz(gaussians: Gaussians) -> bytes:
    """The .spz file of Gaussians in our axes.

    Raises SplatFileError where they reach too far for fixed-point numbers of 24 bits, or are none.
    """
    if not len(gaussians):
        raise SplatFileError("there are no Gaussians to write")
    gaussians = half_turned(gaussians)
    means = gaussians.means.astype(np.float64)
    reach = float(np.abs(means).max())
    bits = MOST_BITS
    while bits > FEWEST_BITS and reach * (1 << bits) > FIXED_MOST:
        bits -= 1
    if reach * (1 << bits) > FIXED_MOST:
        raise SplatFileError(f"a position of {reach:,.0f} is more than an .spz file can hold")
    fixed = np.round(means * (1 << bits)).astype("<i4")
    logs = np.log(np.maximum(gaussians.scales.astype(np.float64), LEAST_SCALE))
    shades = (gaussians.colors.astype(np.float64) - 0.5) / SH0 * COLOR_SCALE + 0.5
    return pack_gzip(
        SpzParts(
            version=VERSION,
            fractional_bits=bits,
            positions=fixed.view(np.uint8).reshape(-1, 3, 4)[:, :, :3].reshape(-1, 9),
            alphas=_byte(gaussians.opacities * 255.0),
            colors=_byte(shades * 255.0),
            scales=_byte((logs - SCALE_LOW) * SCALE_STEPS),
            rotations=_smallest_three(gaussians.quats),
        )
    )


def _byte(values: np.ndarray) -> np.ndarray:
    return np.clip(np.round(values), 0, 255).astype(np.uint8)


def _decode_positions(parts: SpzParts, means: F32) -> None:
    if parts.version == 1:
        means[:] = parts.positions.view("<f2")
        return
    wide = np.zeros((parts.count, 3, 4), np.uint8)
    wide[:, :, 1:] = parts.positions.reshape(-1, 3, 3)
    # read as the upper three bytes of a 32-bit number, shifted down with its sign
    means[:] = (wide.view("<i4")[:, :, 0] >> 8) * 2.0**-parts.fractional_bits


def _decode_first_three(rotations: np.ndarray, quats: F32) -> None:
    """Of bytes (N, 3): x, y, z of a quaternion whose w is not negative."""
    quats[:, 1:] = rotations / np.float32(127.5) - 1
    quats[:, 0] = np.sqrt(np.maximum(0, 1 - (quats[:, 1:] ** 2).sum(1)))


def _decode_smallest_three(words: np.ndarray, quats: F32) -> None:
    """Of words (N,) u4. The components' order is x, y, z, w; the first stands highest."""
    words = words.astype(np.uint32)
    which = words >> 30
    fields = [(words >> shift) & 1023 for shift in (20, 10, 0)]
    smaller = np.stack(
        [np.where(f >> 9, -1.0, 1.0) * (f & TENTH) * (ROOT_HALF / TENTH) for f in fields], axis=1
    )
    largest = np.sqrt(np.maximum(0, 1 - (smaller**2).sum(1)))
    which = which.astype(np.int64)
    xyzw = np.empty((len(words), 4))
    np.put_along_axis(xyzw, which[:, None], largest[:, None], axis=1)
    np.put_along_axis(xyzw, OTHERS[which], smaller, axis=1)
    quats[:] = xyzw[:, [3, 0, 1, 2]]


def _smallest_three(quats: F32) -> np.ndarray:
    """Bytes (N, 4) of unit quaternions (N, 4) wxyz."""
    xyzw = quats[:, [1, 2, 3, 0]].astype(np.float64)
    which = np.abs(xyzw).argmax(1)
    rows = np.arange(len(xyzw))
    xyzw *= np.where(xyzw[rows, which] < 0, -1.0, 1.0)[:, None]  # -q is the same rotation
    smaller = xyzw[rows[:, None], OTHERS[which]]
    sizes = np.clip(np.round(np.abs(smaller) / ROOT_HALF * TENTH), 0, TENTH).astype(np.uint32)
    fields = sizes | ((smaller < 0).astype(np.uint32) << 9)
    words = which.astype(np.uint32) << 30
    for k, shift in enumerate((20, 10, 0)):
        words |= fields[:, k] << np.uint32(shift)
    return words.astype("<u4").view(np.uint8).reshape(-1, 4)
