"""PNG of 8 and 16 bits a channel, with profile and EXIF. OpenCV codes the pixels, we the chunks."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

import cv2
import numpy as np

SIGNATURE = b"\x89PNG\r\n\x1a\n"
GREY_ALPHA = 4  # IHDR colour type


def bit_depth(data: bytes) -> int:
    """Bits a channel that IHDR declares."""
    return data[24] if len(data) > 24 else 0


def check_whole(data: bytes) -> None:
    """ValueError where the file ends early or a chunk's checksum is wrong."""
    if not any(kind == b"IEND" for kind, _ in _chunks(data)):
        raise ValueError("the PNG file ends early")


def read_16_bit(data: bytes) -> np.ndarray:
    """A 16-bit PNG's samples (H, W, 1..4) u16: grey, grey + alpha, RGB or RGBA; as stored.

    Raises ValueError where the file is broken.
    """
    check_whole(data)  # OpenCV would write its complaints to stderr
    stored = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if stored is None:
        raise ValueError("the PNG data is damaged")
    if stored.ndim == 2:
        return stored[..., None]
    if stored.shape[2] == 4:
        rgba = cv2.cvtColor(stored, cv2.COLOR_BGRA2RGBA)
        has_one_colour = data[25] in (0, GREY_ALPHA)
        return rgba[..., [0, 3]] if has_one_colour else rgba
    return cv2.cvtColor(stored, cv2.COLOR_BGR2RGB)


def encode(samples: np.ndarray, icc: bytes | None, exif: bytes | None) -> bytes:
    """PNG file of samples (H, W, 1..4) u8 or u16: grey, grey + alpha, RGB or RGBA."""
    if samples.shape[2] == 2:
        plain = _encode_grey_alpha(samples)
    else:
        to_bgr = {1: None, 3: cv2.COLOR_RGB2BGR, 4: cv2.COLOR_RGBA2BGRA}[samples.shape[2]]
        plain = cv2.imencode(".png", samples if to_bgr is None else cv2.cvtColor(samples, to_bgr))[
            1
        ].tobytes()
    head = len(SIGNATURE) + 25  # IHDR is always 25 bytes; profile and EXIF belong before IDAT
    extra = b""
    if icc:
        extra += _chunk(b"iCCP", b"ICC profile\0\0" + zlib.compress(icc))
    if exif:
        extra += _chunk(b"eXIf", exif)
    return plain[:head] + extra + plain[head:]


def _encode_grey_alpha(samples: np.ndarray) -> bytes:
    """OpenCV has no two-channel PNG: rows with the Sub filter, deflated here."""
    height, width = samples.shape[:2]
    depth = 8 * samples.itemsize
    rows = samples.astype(samples.dtype.newbyteorder(">")).view(np.uint8).reshape(height, -1)
    pixel = 2 * samples.itemsize  # bytes
    filtered = np.empty((height, rows.shape[1] + 1), np.uint8)
    filtered[:, 0] = 1
    filtered[:, 1 : 1 + pixel] = rows[:, :pixel]
    filtered[:, 1 + pixel :] = rows[:, pixel:] - rows[:, :-pixel]
    header = struct.pack(">IIBBBBB", width, height, depth, GREY_ALPHA, 0, 0, 0)
    image = _chunk(b"IHDR", header) + _chunk(b"IDAT", zlib.compress(filtered.tobytes(), 3))
    return SIGNATURE + image + _chunk(b"IEND", b"")


def _chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """(kind, body) of every chunk whose checksum holds; ValueError at the first that breaks."""
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
        at += 12 + length
