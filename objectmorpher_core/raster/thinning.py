"""Fewer, wider Gaussians that stand for all of an object where its picture must be quick."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.arrays import I32, frozen
from ..base.poisson_disk import thin_to_spacing
from ..document.model import LiftedObject, PhotoTexture

LEAST_GAIN = 1.2  # x spacing: with less, thinning is not worth it


def thinned(lifted: LiftedObject, count: int) -> tuple[LiftedObject, I32] | None:
    """About `count` of the solid Gaussians, so much wider, and which ones; None for a small object.

    The soft edge stays as it is: its Gaussians are few and each is seen by itself.
    """
    is_solid = lifted.texture.solidity > 0.5
    solid = np.flatnonzero(is_solid)
    gain = float(np.sqrt(len(solid) / count))
    if gain < LEAST_GAIN:
        return None
    points = lifted.gaussians.means[solid].astype(np.float64)
    normals = lifted.gaussians.normals[solid]
    # Those that the photo shows are offered first: they have most to tell.
    order = np.argsort(-lifted.texture.visibility[solid], kind="stable")
    kept = solid[thin_to_spacing(points, gain * lifted.spacing, order, normals)]
    chosen = frozen(np.concatenate([kept, np.flatnonzero(~is_solid)]), np.int32)
    gaussians, texture = lifted.gaussians.select(chosen), lifted.texture
    gain = float(np.sqrt(len(solid) / len(kept)))  # what the thinning really gave
    scales = gaussians.scales.copy()
    scales[: len(kept), :2] *= gain  # along the surface
    own = PhotoTexture(
        texture.u0[chosen], texture.visibility[chosen], texture.solidity[chosen]
    )  # fmt: skip
    wide = replace(
        lifted, gaussians=replace(gaussians, scales=scales), texture=own,
        spacing=gain * lifted.spacing,
    )  # fmt: skip
    return wide, chosen
