"""A camera RAW file (DNG) of a scene that is made in code."""

from __future__ import annotations

import io

import numpy as np
import tifffile

LINEAR_SRGB_FROM_XYZ = np.linalg.inv(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
     [0.0193339, 0.1191920, 0.9503041]]
)  # fmt: skip
WHITE = 65535
D65 = 21  # of EXIF's light sources


def dng(light: np.ndarray) -> bytes:
    """The file of a sensor with the primaries of sRGB that saw `light` (H, W, 3) in [0, 1].

    Its filters are red, green / green, blue.
    """
    seen = np.empty(light.shape[:2])
    for row, column, channel in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
        seen[row::2, column::2] = light[row::2, column::2, channel]
    matrix = [(round(v * 10_000), 10_000) for v in LINEAR_SRGB_FROM_XYZ.ravel()]
    tags = [
        (33421, "H", 2, (2, 2), True), (33422, "B", 4, bytes([0, 1, 1, 2]), True),
        (50706, "B", 4, bytes([1, 4, 0, 0]), True), (50707, "B", 4, bytes([1, 1, 0, 0]), True),
        (50708, "s", 0, "Made in code", True), (50717, "H", 1, WHITE, True),
        (50721, "2i", 9, [n for pair in matrix for n in pair], True),
        (50728, "2I", 3, (1, 1) * 3, True), (50778, "H", 1, D65, True),
        (271, "s", 0, "Nobody", True), (272, "s", 0, "Made in code", True),
    ]  # fmt: skip
    out = io.BytesIO()
    sensor = np.rint(seen * WHITE).astype(np.uint16)
    tifffile.imwrite(out, sensor, photometric=32803, extratags=tags, metadata=None)
    return out.getvalue()
