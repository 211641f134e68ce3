"""Limits on the claims of a file, and the treatment of values that cannot be drawn."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F32
from ..base.limits import GAUSSIANS as MAX_GAUSSIANS
from ..base.quoting import counted
from ..document.gaussians import Gaussians

LEAST_SCALE = 1e-12  # trainers leave logarithms of -inf; its square is still a float32
GREATEST = 1e9  # position or scale: beyond it products of squares leave float32


class SplatFileError(ValueError):
    """The bytes are not a file of 3D Gaussians or a mesh that can be read; one sentence."""


def check_count(count: int, what: str = "Gaussians") -> None:
    """Raises SplatFileError where a file declares more than can be held."""
    if count > MAX_GAUSSIANS:
        raise SplatFileError(
            f"the file declares {counted(count)} {what}, more than the {MAX_GAUSSIANS:,} that can "
            "be read"
        )


def mended(means: F32, quats: F32, scales: F32, opacities: F32, colors: F32) -> Gaussians:
    """Gaussians of a file's values, shapes as in `Gaussians`: what cannot be drawn is left out.

    Left out are those with a value that is no number or a position or scale beyond GREATEST.
    Quaternions become unit (a zero one is no turn), scales at least LEAST_SCALE, opacities and
    colours are clipped to [0, 1]. Raises SplatFileError where none of them is left.
    """
    count = len(means)
    with np.errstate(invalid="ignore"):  # comparisons with NaN are false, as they should be
        is_drawable = (np.abs(means) <= GREATEST).all(1) & (scales <= GREATEST).all(1)
        is_drawable &= np.isfinite(quats).all(1) & ~np.isnan(opacities) & ~np.isnan(colors).any(1)
    if not is_drawable.all():
        parts = (means, quats, scales, opacities, colors)
        means, quats, scales, opacities, colors = (part[is_drawable] for part in parts)
    if count and not len(means):
        raise SplatFileError("none of the file's Gaussians has values that can be drawn")
    lengths = np.sqrt(np.einsum("ij,ij->i", quats, quats, dtype=np.float64))[:, None]
    still = np.array([1.0, 0.0, 0.0, 0.0])
    with np.errstate(invalid="ignore", divide="ignore"):
        quats = np.where(lengths > 0, quats / lengths, still).astype(np.float32)
    return Gaussians(
        means.astype(np.float32, copy=False),
        quats,
        np.maximum(scales, np.float32(LEAST_SCALE)).astype(np.float32, copy=False),
        np.clip(opacities, 0, 1).astype(np.float32, copy=False),
        np.clip(colors, 0, 1).astype(np.float32, copy=False),
    )


def empty_columns(count: int) -> tuple[F32, F32, F32, F32, F32]:
    """Means (N, 3), quats (N, 4), scales (N, 3), opacities (N,), colours (N, 3), to be filled."""
    check_count(count)
    means, quats, scales = (np.empty((count, k), np.float32) for k in (3, 4, 3))
    return means, quats, scales, np.empty(count, np.float32), np.empty((count, 3), np.float32)
