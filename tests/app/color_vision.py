"""How colours look to those who see few of them: Machado, Oliveira and Fernandes 2009."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]

# Linear sRGB to linear sRGB at severity 1.0, the paper's table.
MATRICES: dict[str, F64] = {
    "protan": np.array([
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ]),
    "deutan": np.array([
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ]),
    "tritan": np.array([
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ]),
}  # fmt: skip
XYZ = np.array([
    [0.4124564, 0.3575761, 0.1804375],
    [0.2126729, 0.7151522, 0.0721750],
    [0.0193339, 0.1191920, 0.9503041],
])  # fmt: skip  # of linear sRGB, D65
SIGHTS = ("all colours", *MATRICES)


def lab(color: tuple[float, float, float], sight: str) -> F64:
    """CIELAB (3,) of sRGB in [0, 1], as it is seen with that sight."""
    srgb = np.array(color, np.float64)
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    if sight in MATRICES:
        linear = (MATRICES[sight] @ linear).clip(0, 1)
    ratio = XYZ @ linear / XYZ.sum(1)
    root = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * root[1] - 16, *(500, 200) * -np.diff(root)])


def difference(one: tuple[float, float, float], other: tuple[float, float, float], sight: str):
    """Delta E 1976 between two colours with that sight."""
    return float(np.linalg.norm(lab(one, sight) - lab(other, sight)))
