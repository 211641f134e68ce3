"""The container of an .spz file's columns: header, gzip (versions 1 to 3) or zstandard streams (4).

No more is unpacked than the header's count of Gaussians needs, and that count is believed only
as far as a file of this size can hold it.
"""

from __future__ import annotations

import gzip
import struct
import zlib
from dataclasses import dataclass

import numpy as np

from ...base.arrays import U8
from ...base.limits import SPLATS_UNPACKED as MAX_UNPACKED
from ..limits import SplatFileError, check_count

MAGIC = b"NGSP"
GZIP_MAGIC = b"\x1f\x8b"
HEADER = struct.Struct("<4sIIBBBB")  # magic, version, count, degree, bits, flags, 0 or streams
HEADER_4 = 32  # bytes of version 4's, which goes on with the table's offset
TABLE_ROW = struct.Struct("<QQ")  # packed and unpacked bytes of a stream
SH_BYTES = (0, 9, 24, 45, 72)  # a Gaussian, by degree
MOST_BITS = 24
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
    if head.degree >= len(SH_BYTES) or head.bits > MOST_BITS:
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
