"""A set of 3D Gaussians (paper 3.1), values as used and not as a .ply stores them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import F32, frozen
from ..base.rotations import matrices_from_quats, quats_from_matrices


@dataclass(frozen=True, eq=False)
class Gaussians:
    """Paper's G_i = (mu, o, s, q, c), in the object frame.

    A Gaussian that lies on a surface has its local +z along the surface's outward normal, and
    that is its thinnest axis.
    """

    means: F32  # (N, 3) object frame
    quats: F32  # (N, 4) wxyz, unit
    scales: F32  # (N, 3) standard deviations, > 0, object units
    opacities: F32  # (N,) in [0, 1]
    colors: F32  # (N, 3) sRGB in [0, 1]

    def __post_init__(self) -> None:
        count = len(self.means)
        shapes = {"means": 3, "quats": 4, "scales": 3, "opacities": 0, "colors": 3}
        for name, columns in shapes.items():
            array = getattr(self, name)
            expected = (count, columns) if columns else (count,)
            if array.shape != expected:
                raise ValueError(f"{name} is {array.shape}, expected {expected}")
            if not np.isfinite(array).all():
                raise ValueError(f"{name} holds values that are not finite")
            object.__setattr__(self, name, frozen(array, np.float32))

    def __len__(self) -> int:
        return len(self.means)

    @property
    def normals(self) -> np.ndarray:
        """Local +z axes (N, 3), unit, object frame."""
        return matrices_from_quats(self.quats)[:, :, 2]

    def covariances(self) -> np.ndarray:
        """Covariance matrices (N, 3, 3), object frame."""
        axes = matrices_from_quats(self.quats.astype(np.float64)) * self.scales[:, None, :]
        return axes @ axes.transpose(0, 2, 1)

    def moved(self, means: np.ndarray, linear: np.ndarray) -> Gaussians:
        """The Gaussians at `means` (N, 3), each deformed by `linear` (N, 3, 3): F Sigma F^T.

        The axes come out in the order of their lengths, the thinnest last: local +z stays the
        normal of a flat Gaussian.
        """
        covariances = linear @ self.covariances() @ linear.transpose(0, 2, 1)
        variances, axes = np.linalg.eigh(covariances)
        axes = axes[:, :, ::-1].copy()
        axes[np.linalg.det(axes) < 0, :, 0] *= -1
        normals = np.linalg.inv(linear).transpose(0, 2, 1) @ self.normals[:, :, None]
        inward = (axes[:, :, 2] * normals[:, :, 0]).sum(1) < 0
        axes[inward, :, 1:] *= -1  # two axes: a rotation stays a rotation
        scales = np.sqrt(np.maximum(variances[:, ::-1], 1e-20))
        return Gaussians(means, quats_from_matrices(axes), scales, self.opacities, self.colors)

    def select(self, index: np.ndarray) -> Gaussians:
        """The Gaussians at `index` (integers or booleans)."""
        return Gaussians(
            self.means[index], self.quats[index], self.scales[index],
            self.opacities[index], self.colors[index],
        )  # fmt: skip
