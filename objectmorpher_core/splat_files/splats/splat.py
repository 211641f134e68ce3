"""The .splat format of the first web viewer: 32 bytes a Gaussian and nothing else.

Position and scale as float32, colour and opacity and the quaternion (wxyz, 128 q + 128) as bytes.
It is written with the largest and most opaque first, so that a viewer that draws while it loads
shows the object early.
"""

from __future__ import annotations

import numpy as np

from ...document.gaussians import Gaussians
from ..limits import SplatFileError, check_count, empty_columns, mended

ROW = np.dtype(
    [("means", "<f4", 3), ("scales", "<f4", 3), ("rgba", "u1", 4), ("quats", "u1", 4)]
)  # 32 bytes


def decode_splat(data: bytes) -> Gaussians:
    """The Gaussians of a .splat file's bytes. Raises SplatFileError."""
    if not data:
        raise SplatFileError("the .splat file is empty")
    if len(data) % ROW.itemsize:
        raise SplatFileError(
            f"the .splat file is damaged or ends early: its {len(data):,} bytes are no multiple "
            f"of {ROW.itemsize}"
        )
    table = np.frombuffer(data, ROW)
    check_count(len(table))
    means, quats, scales, opacities, colors = empty_columns(len(table))
    means[:], scales[:] = table["means"], table["scales"]
    if (scales < 0).any():
        raise SplatFileError("the .splat file is damaged: it holds negative scales")
    opacities[:] = table["rgba"][:, 3] / np.float32(255)
    colors[:] = table["rgba"][:, :3] / np.float32(255)
    quats[:] = (table["quats"].astype(np.float32) - 128) / 128
    return mended(means, quats, scales, opacities, colors)


def encode_splat(gaussians: Gaussians) -> bytes:
    """The .splat file of the Gaussians, axes as they are.

    Raises SplatFileError for an empty set: the file would have no byte.
    """
    if not len(gaussians):
        raise SplatFileError("there are no Gaussians to write")
    logs = np.log(np.maximum(gaussians.scales.astype(np.float64), 1e-30)).sum(1)
    seen = logs + np.log(np.maximum(gaussians.opacities, 1e-6))
    order = np.argsort(-seen, kind="stable")
    table = np.empty(len(gaussians), ROW)
    table["means"] = gaussians.means[order]
    table["scales"] = gaussians.scales[order]
    shades = np.column_stack([gaussians.colors, gaussians.opacities])[order]
    table["rgba"] = np.clip(np.round(shades * 255.0), 0, 255)
    table["quats"] = np.clip(np.round(gaussians.quats[order] * 128.0 + 128), 0, 255)
    return table.tobytes()
