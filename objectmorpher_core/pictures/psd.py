"""Photoshop files (.psd) of layers, 8 and 16 bits a channel, with profile and EXIF.

By Adobe's specification of the format: header, resources, layers, and what they look like
together. Channels of layers are deflated: of 8 bits the differences of neighbours, of 16 the
samples as they are, because Krita (5.1) reads their differences wrongly.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from ..base.threads import core_count
from ..compose.layers import Layer
from ..document.bounds import MULTIPLY, NORMAL, SCREEN, SOFT_LIGHT
from .image import ImageError, Picture, profile_for

MOST_SIDE = 30_000  # px, of the format
MOST_BYTES = (1 << 31) - 1
SIGNATURE, MARK, RGB_MODE = b"8BPS", b"8BIM", 3
PLAIN, DEFLATED, DEFLATED_DIFFERENCES = 0, 2, 3  # compressions
LEVEL = 3  # of zlib; 6 takes twice as long for 3 % less
ALPHA, MASK = -1, -2  # numbers of channels beside 0, 1, 2 for red, green and blue
ICC, EXIF, VERSION = 1039, 1058, 1057  # resources
HIDDEN, PHOTOSHOP_5, IS_EMPTY = 2, 8, 16  # flags of a layer; the last one: it is no picture
OPEN_GROUP, END_OF_GROUP = 1, 3  # of a divider between layers
GROUP = "Photo, transparency"
PROGRAM = "ObjectMorpher"
MIXED = {NORMAL: b"norm", MULTIPLY: b"mul ", SCREEN: b"scrn", SOFT_LIGHT: b"sLit"}


@dataclass(frozen=True, eq=False)
class _Record:
    """A layer of the file: a picture, or one of the two ends of a group."""

    name: str
    box: tuple[int, int, int, int]  # left, top, right, bottom px
    channels: dict[int, np.ndarray | None]
    flags: int
    divider: int = 0
    mask: np.ndarray | None = None  # (H, W) over the whole picture
    mode: str = NORMAL


def encode_psd(layers: Sequence[Layer], merged: Picture) -> bytes:
    """The file of `layers` from below, which together look like `merged`.

    Where `merged` has an alpha channel, the layers are in a group with that as its mask.
    Raises ImageError where the format cannot hold it.
    """
    height, width = merged.pixels.shape[:2]
    if max(width, height) > MOST_SIDE:
        raise ImageError(f"PSD cannot hold {width} x {height} px; choose .ora")
    records = [_record(layer) for layer in layers]
    if merged.alpha is not None:
        start = _Record("</Layer group>", (0, 0, 0, 0), _nothing(), IS_EMPTY, END_OF_GROUP)
        group = _Record(GROUP, (0, 0, 0, 0), _nothing(), IS_EMPTY, OPEN_GROUP, merged.alpha)
        records = [start, *records, group]
    planes = [merged.pixels[..., k] for k in range(3)]
    planes += [] if merged.alpha is None else [merged.alpha]
    bits = 8 * merged.pixels.dtype.itemsize
    header = struct.pack(">4sH6xHIIHH", SIGNATURE, 1, len(planes), height, width, bits, RGB_MODE)
    parts = [
        header, _sized(b""), _sized(_resources(merged)),
        _sized(_layer_section(records, bits, merged.alpha is not None)),
        struct.pack(">H", PLAIN), *(_big_endian(plane).tobytes() for plane in planes),
    ]  # fmt: skip
    if sum(map(len, parts)) > MOST_BYTES:
        raise ImageError("the layers are too large for a PSD file; choose .ora")
    return b"".join(parts)


def _record(layer: Layer) -> _Record:
    height, width, count = layer.pixels.shape
    channels: dict[int, np.ndarray | None] = {k: layer.pixels[..., k] for k in range(3)}
    if count == 4:
        channels = {ALPHA: layer.pixels[..., 3], **channels}
    box = (layer.left, layer.top, layer.left + width, layer.top + height)
    flags = 0 if layer.is_shown else HIDDEN
    return _Record(layer.name, box, channels, flags, mode=layer.mode)


def _nothing() -> dict[int, np.ndarray | None]:
    return dict.fromkeys((ALPHA, 0, 1, 2))


def _resources(merged: Picture) -> bytes:
    names = "".join((_text(PROGRAM), _text(PROGRAM)))
    version = struct.pack(">IB", 1, True) + names.encode("utf-16-be") + struct.pack(">I", 1)
    found = {VERSION: version, ICC: profile_for(merged.icc, 3), EXIF: merged.exif}
    return b"".join(
        MARK + struct.pack(">HxxI", number, len(data)) + _padded(data, 2)
        for number, data in sorted(found.items()) if data
    )  # fmt: skip


def _layer_section(records: list[_Record], bits: int, is_transparent: bool) -> bytes:
    """The layers; those of 16 bits are in a block of their own behind the usual, empty place."""
    with ThreadPoolExecutor(core_count()) as pool:  # zlib lets go of the interpreter lock
        packed = [
            {number: pool.submit(_packed, plane) for number, plane in _planes(record).items()}
            for record in records
        ]
        data = [{number: job.result() for number, job in one.items()} for one in packed]
    count = -len(records) if is_transparent else len(records)
    parts = [struct.pack(">h", count)]
    parts += [_head(record, own) for record, own in zip(records, data, strict=True)]
    parts += [channel for own in data for channel in own.values()]
    info = _padded(b"".join(parts), 4)
    if bits == 8:
        return _sized(info) + _sized(b"")
    return _sized(b"") + _sized(b"") + MARK + b"Lr16" + _sized(info)


def _planes(record: _Record) -> dict[int, np.ndarray | None]:
    return record.channels if record.mask is None else {**record.channels, MASK: record.mask}


def _head(record: _Record, data: dict[int, bytes]) -> bytes:
    """What stands of a layer before the pixels of all."""
    left, top, right, bottom = record.box
    parts = [struct.pack(">4iH", top, left, bottom, right, len(data))]
    parts += [struct.pack(">hI", number, len(channel)) for number, channel in data.items()]
    parts.append(
        MARK + MIXED[record.mode] + struct.pack(">BBBx", 255, 0, record.flags | PHOTOSHOP_5)
    )
    mask = b""
    if record.mask is not None:
        mask = struct.pack(">4iBBxx", 0, 0, *record.mask.shape, 0, 0)
    short = record.name.encode("ascii", "replace")[:255]
    extra = [_sized(mask), _sized(b""), _padded(bytes([len(short)]) + short, 4)]
    name = _text(record.name).encode("utf-16-be", "surrogatepass")
    extra.append(MARK + b"luni" + _sized(_padded(name, 4)))
    if record.divider:
        extra.append(MARK + b"lsct" + _sized(struct.pack(">I", record.divider) + MARK + b"norm"))
    return b"".join([*parts, _sized(b"".join(extra))])


def _packed(plane: np.ndarray | None) -> bytes:
    """A channel: how it is packed, and its bytes."""
    if plane is None:
        return struct.pack(">H", PLAIN)
    if plane.dtype != np.uint8:
        return struct.pack(">H", DEFLATED) + zlib.compress(_big_endian(plane).tobytes(), LEVEL)
    differences = plane.copy()
    differences[:, 1:] -= plane[:, :-1]
    stored = zlib.compress(differences.tobytes(), LEVEL)
    return struct.pack(">H", DEFLATED_DIFFERENCES) + stored


def _big_endian(plane: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(plane, plane.dtype.newbyteorder(">"))


def _text(text: str) -> str:
    """As the format has it in UTF-16: its length in 32 bits, then itself."""
    length = len(text.encode("utf-16-be", "surrogatepass")) // 2
    return chr(length >> 16) + chr(length & 0xFFFF) + text


def _sized(data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + data


def _padded(data: bytes, step: int) -> bytes:
    return data + bytes(-len(data) % step)
