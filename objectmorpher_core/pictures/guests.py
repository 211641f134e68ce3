"""HEIC, JPEG XL and camera RAW files, by packages that are installed only on request.

pi-heif brings libheif and libde265 (LGPL), rawpy brings LibRaw (LGPL or CDDL) without its GPL
parts, and pylibjxl brings libjxl (BSD). All come with the extra `formats`.
"""

from __future__ import annotations

import json
import logging
import struct
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from . import decode_apart, tiff

log = logging.getLogger(__name__)

HEIC_BRANDS = (b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1")
JXL_MARKS = (b"\xff\x0a", b"\0\0\0\x0cJXL \r\n\x87\n")
RAW_MARKS = (b"FUJIFILMCCD-RAW", b"IIRO", b"IIRS", b"MMOR", b"IIU\0")  # RAF, ORF, RW2
CR2_MARK = b"CR\x02\0"  # behind the header of a TIFF
DNG_VERSION, PHOTOMETRIC, SUB_IFDS = 50706, 262, 330
OF_A_SENSOR = (32803, 34892)  # photometric: a colour filter array, linear RAW
MOST_ENTRIES = 4096  # of all directories of a file that are looked at
PACKAGES = {"HEIC": "pi_heif", "JPEG XL": "pylibjxl", "camera RAW": "rawpy"}
SECONDS = 180  # that a decoder has; a RAW file of 100 megapixels takes 30
MOST_LOGGED = 2000  # characters
EFFORT = 4  # of JPEG XL's encoder, of 9; 7 takes three times as long for 3 % less
BEST = 100  # quality that keeps every pixel


class GuestError(ValueError):
    """The file is damaged, or the package that reads such files is not installed."""


@dataclass(frozen=True, eq=False)
class Guest:
    """The upright samples of a file and what it says of them."""

    samples: np.ndarray  # (H, W, 1..4) u8 or u16
    icc: bytes | None
    exif: bytes | None  # a TIFF structure


def kind_of(data: bytes) -> str | None:
    """Return "HEIC", "JPEG XL" or "camera RAW" by the file's content, None for all others."""
    if data[4:8] == b"ftyp":
        if data[8:12] == b"crx ":
            return "camera RAW"
        brands = {data[8:12], *(data[k : k + 4] for k in range(16, min(_box(data), 128), 4))}
        return "HEIC" if brands & set(HEIC_BRANDS) and b"avif" not in brands else None
    if data.startswith(JXL_MARKS):
        return "JPEG XL"
    is_raw = data.startswith(RAW_MARKS) or (data[:4] in tiff.MARKS[:2] and _is_raw_tiff(data))
    return "camera RAW" if is_raw else None


def read(kind: str, data: bytes, most: int) -> Guest:
    """Read a file of that kind, of at most `most` px. Raises GuestError."""
    package = PACKAGES[kind]
    if find_spec(package) is None:
        raise GuestError(_needs(package, kind))
    command = [sys.executable, "-P", decode_apart.__file__, kind, str(most)]
    try:
        done = subprocess.run(command, input=data, capture_output=True, timeout=SECONDS)
    except subprocess.TimeoutExpired:
        raise GuestError(f"the {kind} image takes too long to read: it is damaged") from None
    if done.stderr:
        log.info("%s: %s", kind, done.stderr[-MOST_LOGGED:].decode(errors="replace"))
    line, _, rest = done.stdout.partition(b"\n")
    if done.returncode != 0 or not line:
        raise GuestError(f"the {kind} image is damaged: its decoder ended")
    about = json.loads(line)
    if "error" in about:
        raise GuestError(about["error"])
    dtype = np.dtype(about["dtype"])
    count = int(np.prod(about["shape"]))
    samples = np.frombuffer(rest, dtype, count).reshape(about["shape"])
    behind = rest[count * dtype.itemsize :]
    icc, block = behind[: about["icc"]], behind[about["icc"] :]
    if kind == "camera RAW":
        icc, block = _srgb(), tiff.described_raw(data) or b""
    return Guest(samples, icc or None, block or None)


def _srgb() -> bytes:
    """The colour profile of sRGB."""
    from PIL import ImageCms

    return ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


def encode_jxl(samples: np.ndarray, icc: bytes | None, exif: bytes | None, quality: int) -> bytes:
    """Return the JPEG XL file of samples (H, W, 1, 3 or 4) u8; quality 100 keeps every pixel."""
    if (reason := missing_jxl()) is not None:
        raise GuestError(reason)
    import pylibjxl

    if quality >= BEST:
        return pylibjxl.encode(
            np.ascontiguousarray(samples), EFFORT, lossless=True, icc=icc, exif=exif
        )
    distance = _distance(quality)
    return pylibjxl.encode(np.ascontiguousarray(samples), EFFORT, distance, icc=icc, exif=exif)


def missing_jxl() -> str | None:
    """Return the sentence why JPEG XL cannot be written, None where it can."""
    return None if find_spec("pylibjxl") is not None else _needs("pylibjxl", "JPEG XL")


def _distance(quality: int) -> float:
    """libjxl's own scale: 1 is what a viewer can just not see; as its `cjxl` maps it."""
    return 0.1 + (100 - quality) * 0.09 if quality >= 30 else 15.0


def _needs(package: str, kind: str) -> str:
    name = package.replace("_", "-")
    return f"{kind} files need the package {name}: pip install 'objectmorpher[formats]'"


def _box(data: bytes) -> int:
    """The length of the first box of an ISO media file."""
    return struct.unpack(">I", data[:4])[0]


def _is_raw_tiff(data: bytes) -> bool:
    """Whether a TIFF file holds what a sensor saw."""
    if data[8:12] == CR2_MARK:
        return True
    order = "<" if data[:2] == b"II" else ">"
    try:
        return _holds_raw(data, order, struct.unpack_from(order + "I", data, 4)[0])
    except struct.error:
        return False


def _holds_raw(data: bytes, order: str, first: int) -> bool:
    waiting, seen = [first], 0
    while waiting:
        at = waiting.pop()
        count = struct.unpack_from(order + "H", data, at)[0]
        seen += count
        if seen > MOST_ENTRIES:
            return False
        for k in range(count):
            entry = at + 2 + 12 * k
            tag, kind, number = struct.unpack_from(order + "HHI", data, entry)
            if tag == DNG_VERSION:
                return True
            if tag == PHOTOMETRIC:
                if struct.unpack_from(order + "H", data, entry + 8)[0] in OF_A_SENSOR:
                    return True
            elif tag == SUB_IFDS and kind in (4, 13) and number <= 16:
                place = struct.unpack_from(order + "I", data, entry + 8)[0]
                start = entry + 8 if number == 1 else place
                waiting += struct.unpack_from(f"{order}{number}I", data, start)
    return False
