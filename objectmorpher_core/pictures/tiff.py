"""TIFF of 8 and 16 bits a channel, with profile and EXIF."""

from __future__ import annotations

import struct
import zlib
from concurrent.futures import ThreadPoolExecutor
from itertools import accumulate
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ..base.arrays import PixelSource

if TYPE_CHECKING:
    from PIL import Image
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

MARKS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")  # classic and BigTIFF
SHORT, LONG, UNDEFINED = 3, 4, 7  # types of a tag's values
ASSOCIATED_ALPHA, STRAIGHT_ALPHA = 1, 2
WHITE_IS_ZERO, BLACK_IS_ZERO, RGB = 0, 1, 2
DEFLATE, HORIZONTAL_DIFFERENCES = 8, 2
DEFLATE_LEVEL = 1  # 3 takes twice as long for 5 % less
STRIP_BYTES = 1 << 20  # of pixels; a strip is what readers hold at a time

# Describing tags of the first directory that survive; the others tell how its pixels are stored.
KEPT_TAGS = (270, 271, 272, 282, 283, 296, 305, 306, 315, 33432, 0x8769, 0x8825)


def read_16_bit(data: bytes, max_pixels: int) -> tuple[np.ndarray, int, bytes | None] | None:
    """Samples (H, W, 1..4) u16 as stored, orientation 1..8 and profile; None for fewer bits.

    Raises ValueError for floating point, for more than 16 bits or `max_pixels`, and where the
    file is broken.
    """
    import io

    import tifffile

    try:
        page = tifffile.TiffFile(io.BytesIO(data)).pages.first
        if page.bitspersample <= 8:
            return None
        if page.dtype is None or page.dtype.kind != "u" or page.bitspersample != 16:
            kind = "floating-point" if page.sampleformat == 3 else f"{page.bitspersample}-bit"
            raise ValueError(f"{kind} TIFF is not supported, only 8 and 16 bits a channel are")
        if page.photometric not in (WHITE_IS_ZERO, BLACK_IS_ZERO, RGB):
            return None  # Pillow converts CMYK and Lab, at 8 bits
        if page.imagewidth * page.imagelength > max_pixels:
            raise ValueError(f"it is {page.imagewidth} x {page.imagelength} px, which is too large")
        samples = _decode(page, data)
    except ValueError:
        raise
    except Exception as error:  # tifffile raises whatever a broken file makes it stumble over
        raise ValueError("the TIFF file is damaged or ends early") from error
    colours = 3 if page.photometric == RGB else 1
    if page.photometric == WHITE_IS_ZERO:
        samples = np.concatenate([65535 - samples[..., :1], samples[..., 1:]], axis=2)
    extra = page.extrasamples[0] if page.extrasamples else None  # or something else than alpha
    samples = samples[..., : colours + (extra in (ASSOCIATED_ALPHA, STRAIGHT_ALPHA))]
    if extra == ASSOCIATED_ALPHA:
        samples = _unpremultiplied(samples)
    tag = page.tags.get(274)
    turn = int(tag.value) if tag is not None and 1 <= int(tag.value) <= 8 else 1
    icc = page.iccprofile
    return samples, turn, icc if isinstance(icc, bytes) else None


def _decode(page, data: bytes) -> np.ndarray:
    """(H, W, C) u16 of tifffile's page; OpenCV's libtiff where tifffile lacks the codec (LZW)."""
    try:
        samples = page.asarray()
    except ValueError as error:
        if "imagecodecs" not in str(error) or page.planarconfig != 1 or page.samplesperpixel == 2:
            raise
        upright = bytearray(data)  # OpenCV turns pages; tifffile does not
        tag = page.tags.get(274)
        if tag is not None:
            struct.pack_into(page.parent.byteorder + "H", upright, tag.valueoffset, 1)
        samples = cv2.imdecode(np.frombuffer(upright, np.uint8), cv2.IMREAD_UNCHANGED)
        if samples is None:
            raise
        if samples.ndim == 3:
            turn = cv2.COLOR_BGR2RGB if samples.shape[2] == 3 else cv2.COLOR_BGRA2RGBA
            samples = cv2.cvtColor(samples, turn)
    if samples.ndim == 2:
        return samples[..., None]
    return np.moveaxis(samples, 0, 2) if page.planarconfig == 2 else samples


def _unpremultiplied(samples: np.ndarray) -> np.ndarray:
    """Straight colours of samples whose last channel is an associated alpha; u16."""
    alpha = np.maximum(samples[..., -1:].astype(np.uint32), 1)
    colours = np.minimum((samples[..., :-1] * np.uint32(65535) + alpha // 2) // alpha, 65535)
    return np.concatenate([colours.astype(np.uint16), samples[..., -1:]], axis=2)


def encode(samples: PixelSource, icc: bytes | None, exif: bytes | None) -> bytes:
    """Little-endian, deflated TIFF file of samples (H, W, 1..4) u8 or u16."""
    height, width, channels = samples.shape
    rows = max(1, STRIP_BYTES // (width * channels * samples.dtype.itemsize))
    with ThreadPoolExecutor() as pool:  # zlib lets go of the interpreter lock
        tops = range(0, height, rows)
        strips = list(pool.map(lambda top: _deflated(samples[top : top + rows]), tops))
    lengths = [len(strip) for strip in strips]
    starts = tuple(accumulate(lengths[:-1], initial=0))  # Pillow adds the directory's own length
    fields = _described_by(exif)
    values: dict[int, tuple[int, object]] = {
        256: (LONG, width),
        257: (LONG, height),
        258: (SHORT, (8 * samples.dtype.itemsize,) * channels),
        259: (SHORT, DEFLATE),
        262: (SHORT, RGB if channels > 2 else BLACK_IS_ZERO),
        273: (LONG, starts),
        274: (SHORT, 1),
        277: (SHORT, channels),
        278: (LONG, rows),
        279: (LONG, tuple(lengths)),
        284: (SHORT, 1),
        317: (SHORT, HORIZONTAL_DIFFERENCES),
    }
    if channels in (2, 4):
        values[338] = (SHORT, 2)  # straight alpha
    if icc:
        values[34675] = (UNDEFINED, icc)
    for tag, (kind, value) in values.items():
        fields.tagtype[tag] = kind
        fields[tag] = value
    directory = fields.tobytes(8)
    if 8 + len(directory) + sum(lengths) >= 1 << 32:
        raise ValueError("the picture is too large for a TIFF file")
    return b"II*\0" + struct.pack("<I", 8) + directory + b"".join(strips)


def _deflated(strip: np.ndarray) -> bytes:
    differences = strip.copy()
    differences[:, 1:] -= strip[:, :-1]
    return zlib.compress(differences.astype(strip.dtype.newbyteorder("<")).tobytes(), DEFLATE_LEVEL)


def described(image: Image.Image) -> bytes | None:
    """EXIF block of what an opened TIFF file says of its picture; None where it says nothing."""
    try:
        fields = _directory()
        _copy_described(image.getexif(), fields)
        block = fields.tobytes(8)
    except Exception:  # Pillow raises whatever a broken directory makes it stumble over
        return None
    return b"II*\0" + struct.pack("<I", 8) + block if len(fields) else None


def described_raw(data: bytes) -> bytes | None:
    """EXIF block of what a file that is built like a TIFF says, whoever decodes it.

    None where it says nothing, and for all other files.
    """
    if data[:4] not in MARKS[:2]:
        return None
    fields = _described_by(data)
    return b"II*\0" + struct.pack("<I", 8) + fields.tobytes(8) if len(fields) else None


def _described_by(exif: bytes | None) -> ImageFileDirectory_v2:
    """A directory with what an EXIF block says, which is nothing where it cannot be read."""
    from PIL import Image

    if exif:
        try:
            source, fields = Image.Exif(), _directory()
            source.load(exif)
            _copy_described(source, fields)
            fields.tobytes(8)
            return fields
        except Exception:  # as above: a photo is not lost for a broken description
            pass
    return _directory()


def _directory() -> ImageFileDirectory_v2:
    """An empty one of a small-endian file."""
    from PIL.TiffImagePlugin import ImageFileDirectory_v2  # 10 ms that only TIFF files need

    return ImageFileDirectory_v2(b"II*\0\0\0\0\0")


def _copy_described(source: Image.Exif, fields: ImageFileDirectory_v2) -> None:
    """Copies what EXIF says of the picture into a TIFF directory."""
    for tag in KEPT_TAGS:
        if tag in (0x8769, 0x8825):
            if part := source.get_ifd(tag):
                fields[tag] = dict(part)
        elif tag in source:
            fields[tag] = source[tag]
