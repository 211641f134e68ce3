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

import numpy as np

from ...base.arrays import F32
from ...document.gaussians import Gaussians
from ..limits import LEAST_SCALE, SplatFileError, empty_columns, mended
from .axes import half_turned
from .ply import SH0
from .spz_container import RUB, SpzParts, pack_gzip, unpack

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
