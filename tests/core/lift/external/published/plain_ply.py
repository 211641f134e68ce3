"""Writes a 3DGS .ply of a few Gaussians."""

from __future__ import annotations

import numpy as np

FIRST = ("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity")
NAMES = (*FIRST, "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3")


def write(path: object, means: np.ndarray) -> None:
    """Small grey balls at means (N, 3)."""
    count = len(means)
    rest = [0, 0, 0, 0, 0, 0, 3, -4, -4, -4, 1, 0, 0, 0]
    table = np.hstack([means, np.tile(rest, (count, 1))]).astype("<f4")
    head = "".join(f"property float {name}\n" for name in NAMES)
    text = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{head}end_header\n"
    with open(str(path), "wb") as file:
        file.write(text.encode() + table.tobytes())
