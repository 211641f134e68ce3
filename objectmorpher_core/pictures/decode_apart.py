"""Decodes a HEIC, JPEG XL or camera RAW file in a process of its own.

    python -P decode_apart.py KIND MOST_PIXELS < file > samples

Their decoders are large C++ libraries, and damaged files have crashed them: here that costs one
process and one sentence. The answer is a line of JSON, then the samples, profile and EXIF block.
This file imports nothing of its package: an installed program runs it as a script.
"""

from __future__ import annotations

import io
import json
import struct
import sys
from typing import Any

import numpy as np

MEMORY = 12 << 30  # bytes of address space; a file that asks for more is damaged
CLIPPED = 1e-3  # share of the pixels that may turn white where a RAW file is brightened
SRGB_CURVE = (2.4, 12.92)  # exponent and slope; LibRaw's own are those of television
TIFF_MARKS = (b"II*\0", b"MM\0*")


class TooLarge(ValueError):
    """The picture has more pixels than are allowed."""


def read_heic(data: bytes, most: int) -> tuple[np.ndarray, bytes, bytes]:
    """Samples as the file's own boxes turn them, profile, EXIF block."""
    import pi_heif

    file = pi_heif.open_heif(io.BytesIO(data), convert_hdr_to_8bit=False)
    width, height = file.size
    check_size(width, height, most)
    samples = np.array(file)
    block = bytes(file.info.get("exif") or b"").removeprefix(b"Exif\0\0")
    return samples, bytes(file.info.get("icc_profile") or b""), block


def read_jxl(data: bytes, most: int) -> tuple[np.ndarray, bytes, bytes]:
    """The same of JPEG XL; its EXIF box begins with the place where the block does."""
    import pylibjxl

    found = pylibjxl.probe(data)
    check_size(found["width"], found["height"], most)
    samples, about = pylibjxl.decode(data, metadata=True)
    block = about.get("exif") or b""
    if block and block[:4] not in TIFF_MARKS:
        block = block[4 + struct.unpack(">I", block[:4])[0] :]
    return np.asarray(samples), about.get("icc") or b"", block


def read_raw(data: bytes, most: int) -> tuple[np.ndarray, bytes, bytes]:
    """A RAW file, developed: the camera's white balance, sRGB, 16 bits."""
    import rawpy

    with rawpy.imread(io.BytesIO(data)) as raw:
        check_size(raw.sizes.width, raw.sizes.height, most)
        samples = raw.postprocess(
            use_camera_wb=True, output_bps=16, output_color=rawpy.ColorSpace.sRGB,
            gamma=SRGB_CURVE, auto_bright_thr=CLIPPED,
        )  # fmt: skip
    return samples, b"", b""


READERS = {"HEIC": read_heic, "JPEG XL": read_jxl, "camera RAW": read_raw}


def check_size(width: int, height: int, most: int) -> None:
    """Raise TooLarge for a picture of more than `most` px."""
    if width * height > most:
        megapixels = f"{most / 1e6:.3g} megapixels"
        raise TooLarge(f"the image is {width} x {height} px, more than {megapixels}")


def answer(about: dict[str, Any], *parts: bytes | memoryview) -> None:
    """Write the line that says what follows, and that."""
    sys.stdout.buffer.write(json.dumps(about).encode() + b"\n")
    for part in parts:
        sys.stdout.buffer.write(part)


def main() -> None:
    """Read standard input, write the answer."""
    if sys.platform == "linux":
        import resource

        _, allowed = resource.getrlimit(resource.RLIMIT_AS)  # by the user's own `ulimit -v`
        limit = MEMORY if allowed == resource.RLIM_INFINITY else min(MEMORY, allowed)
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    kind, most = sys.argv[1], int(sys.argv[2])
    try:
        samples, icc, block = READERS[kind](sys.stdin.buffer.read(), most)
    except TooLarge as error:
        return answer({"error": str(error)})
    except MemoryError:
        return answer({"error": "the image cannot be read: there is not enough memory for it"})
    except Exception as error:  # bindings raise whatever a broken file makes them stumble over
        sys.stderr.write(f"{type(error).__name__}: {error}\n")
        return answer({"error": f"the {kind} image is damaged or ends early"})
    samples = np.ascontiguousarray(samples.reshape(*samples.shape[:2], -1))
    about = {"shape": samples.shape, "dtype": samples.dtype.name, "icc": len(icc)}
    answer(about, samples.data, icc, block)


if __name__ == "__main__":
    main()
