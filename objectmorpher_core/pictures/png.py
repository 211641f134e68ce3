"""PNG of 8 and 16 bits a channel, with profile and EXIF. OpenCV reads the pixels, we write them."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np

from ..base.arrays import PixelSource
from ..base.threads import core_count

SIGNATURE = b"\x89PNG\r\n\x1a\n"
GREY, GREY_ALPHA = 0, 4  # IHDR colour types
COLOUR_TYPES = (GREY, GREY_ALPHA, 2, 6)  # of one to four channels
SUB, UP, AVERAGE = 1, 2, 3  # filters
STRIP_BYTES = 1 << 19  # of pixels: what is computed from them stays in the processor's cache
ADLER_MODULUS = 65521


def bit_depth(data: bytes) -> int:
    """Bits a channel that IHDR declares."""
    return data[24] if len(data) > 24 else 0


def read_16_bit(data: bytes) -> tuple[np.ndarray, bytes | None]:
    """A 16-bit PNG's samples (H, W, 1..4) u16: grey, grey + alpha, RGB or RGBA; as stored.

    And its EXIF block, which may stand behind the pixels. Raises ValueError where the file is
    broken, or ends early: OpenCV would write its complaints to stderr.
    """
    found = dict(_chunks(data))
    if b"IEND" not in found:
        raise ValueError("the PNG file ends early")
    stored = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if stored is None:
        raise ValueError("the PNG data is damaged")
    return _samples(stored, data[25], found.get(b"tRNS")), found.get(b"eXIf")


def _samples(stored: np.ndarray, colour_type: int, transparent: bytes | None) -> np.ndarray:
    """(H, W, 1..4) of what OpenCV returns, which of grey with one clear value leaves out that."""
    if stored.ndim == 2:
        grey = stored[..., None]
        if transparent is None or len(transparent) != 2:
            return grey
        is_opaque = grey != struct.unpack(">H", transparent)[0]
        return np.concatenate([grey, is_opaque * np.uint16(65535)], axis=2)
    if stored.shape[2] == 4:
        rgba = cv2.cvtColor(stored, cv2.COLOR_BGRA2RGBA)
        return rgba[..., [0, 3]] if colour_type in (GREY, GREY_ALPHA) else rgba
    return cv2.cvtColor(stored, cv2.COLOR_BGR2RGB)


def encode(samples: PixelSource, icc: bytes | None, exif: bytes | None) -> bytes:
    """PNG file of samples (H, W, 1..4) u8 or u16: grey, grey + alpha, RGB or RGBA.

    The rows are filtered and deflated in strips, on all cores. For photos run lengths deflate
    as well as a search for repetitions, and far faster.
    """
    height, width, channels = samples.shape
    depth = 8 * samples.dtype.itemsize
    rows = max(STRIP_BYTES // (width * channels * samples.dtype.itemsize), 1)

    def strip(top: int) -> tuple[bytes, int, int]:
        """Deflated rows from `top` on; checksum and length of what was deflated."""
        stored = _filtered(samples[max(top - 1, 0) : top + rows], top > 0).data
        packer = zlib.compressobj(1, zlib.DEFLATED, -zlib.MAX_WBITS, 9, zlib.Z_RLE)
        is_last = top + rows >= height
        packed = packer.compress(stored) + packer.flush(
            zlib.Z_FINISH if is_last else zlib.Z_SYNC_FLUSH
        )
        return packed, zlib.adler32(stored), stored.nbytes

    with ThreadPoolExecutor(core_count()) as pool:  # zlib and numpy let go of the interpreter lock
        strips = list(pool.map(strip, range(0, height, rows)))
    checksum = struct.pack(">I", _joined_adler32([(adler, size) for _, adler, size in strips]))
    header = struct.pack(">IIBBBBB", width, height, depth, COLOUR_TYPES[channels - 1], 0, 0, 0)
    parts = [SIGNATURE, *_chunk(b"IHDR", header)]
    if icc:
        parts += _chunk(b"iCCP", b"ICC profile\0\0" + zlib.compress(icc))
    if exif:
        parts += _chunk(b"eXIf", exif)
    parts += _chunk(b"IDAT", b"\x78\x01")  # a zlib stream, fast
    for packed, _, _ in strips:
        parts += _chunk(b"IDAT", packed)
    return b"".join([*parts, *_chunk(b"IDAT", checksum), *_chunk(b"IEND", b"")])


def _filtered(samples: np.ndarray, has_row_above: bool) -> np.ndarray:
    """Rows (h, w, c) as bytes (h, 1 + n): of each the filter, and what it leaves.

    Of the differences to the left, upper, and the mean of both neighbours each row gets those
    with the least sum. With `has_row_above` the first row is only a neighbour.
    """
    height, width, channels = samples.shape
    pixel = channels * samples.dtype.itemsize  # bytes
    stored = np.ascontiguousarray(samples, samples.dtype.newbyteorder(">"))
    rows = stored.view(np.uint8).reshape(height, width * pixel)
    if not has_row_above:
        rows = np.concatenate([np.zeros_like(rows[:1]), rows])
    above, rows = rows[:-1], rows[1:]
    left = np.zeros_like(rows)
    left[:, pixel:] = rows[:, :-pixel]
    mean = (left & above) + ((left ^ above) >> 1)  # of bytes, rounded down
    best = np.empty((len(rows), 1 + width * pixel), np.uint8)
    least = np.full(len(rows), np.iinfo(np.int64).max)
    for kind, guess in ((SUB, left), (UP, above), (AVERAGE, mean)):
        rest = rows - guess
        size = np.minimum(rest, -rest).sum(1, dtype=np.int64)  # of a difference, whatever its sign
        better = size < least
        best[better, 0], least[better] = kind, size[better]
        best[better, 1:] = rest[better]
    return best


def _joined_adler32(parts: list[tuple[int, int]]) -> int:
    """zlib's checksum of bytes that come in parts, from the checksum and length of each."""
    low, high = 1, 0
    for adler, size in parts:
        high = (high + (adler >> 16) + size * (low - 1)) % ADLER_MODULUS
        low = (low + (adler & 0xFFFF) - 1) % ADLER_MODULUS
    return high << 16 | low


def _chunk(kind: bytes, body: bytes) -> tuple[bytes, bytes, bytes]:
    checksum = zlib.crc32(body, zlib.crc32(kind))
    return struct.pack(">I", len(body)) + kind, body, struct.pack(">I", checksum)


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """(kind, body) of every chunk to the last; ValueError at the first whose checksum is wrong."""
    at = len(SIGNATURE)
    while at + 12 <= len(data):
        length = struct.unpack_from(">I", data, at)[0]
        body = data[at + 8 : at + 8 + length]
        end = data[at + 8 + length : at + 12 + length]
        if len(end) < 4 or struct.unpack(">I", end)[0] != zlib.crc32(
            body, zlib.crc32(data[at + 4 : at + 8])
        ):
            raise ValueError("the PNG file is damaged or ends early")
        yield data[at + 4 : at + 8], body
        if data[at + 4 : at + 8] == b"IEND":
            return
        at += 12 + length
