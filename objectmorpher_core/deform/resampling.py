"""Gaussians at rest, split where a pose stretches them too far, or thinned for a quick picture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import F64, I32, frozen
from ..base.poisson_disk import thin_to_spacing
from ..base.rotations import matrices_from_quats
from ..document.gaussians import Gaussians
from ..document.model import LiftedObject, PhotoTexture

# Splits Gaussians that a pose stretches too far into several, at rest.

MOST_STRETCH = 2.0  # a Gaussian of half the resolution: the eye sees the smear from here on
MOST_PIECES = 8
APART = 2.0  # x their sd: the sum of the pieces varies by 5 % between them; at 3 by 35 %


@dataclass(frozen=True, eq=False)
class Split:
    """Gaussians in the order of those they come from."""

    gaussians: Gaussians  # (N',)
    parents: I32  # (N',) row of the one that each is, or is a piece of


def split_stretched(gaussians: Gaussians, linear: F64, most: float = MOST_STRETCH) -> Split:
    """Replaces Gaussians whose plane is stretched by more than `most` under F = `linear`.

    `linear` (N, 3, 3) is the Jacobian at each. One that is stretched by s becomes ceil(s / most)
    pieces, at most eight, in its own plane. They keep its colour, normal, thickness and opacity:
    where they overlap they cover about what it covered in its middle, 0.51 instead of 0.50 for
    two and 0.57 for three that are half transparent, and no more than all if it was opaque. The
    others stay as they are.
    """
    if not most > 0:
        raise ValueError(f"the most that a Gaussian may be stretched must be > 0, not {most:g}")
    stretch, angle = _most_stretched(gaussians, linear)
    counts = np.clip(np.ceil(stretch / most - 1e-9), 1, MOST_PIECES).astype(np.int64)
    parents = np.repeat(np.arange(len(gaussians)), counts)
    all_of_them = gaussians.select(parents)
    rows = np.flatnonzero(counts[parents] > 1)
    if len(rows) == 0:
        return Split(gaussians, parents.astype(np.int32))
    count = counts[parents[rows]]
    place = rows - (np.cumsum(counts) - counts)[parents[rows]] - (count - 1) / 2
    pieces = _pieces(all_of_them.select(rows), angle[parents[rows]], count, place)
    means, quats, scales = (
        np.array(v) for v in (all_of_them.means, all_of_them.quats, all_of_them.scales)
    )
    means[rows], quats[rows], scales[rows] = pieces
    result = Gaussians(means, quats, scales, all_of_them.opacities, all_of_them.colors)
    return Split(result, parents.astype(np.int32))


def _most_stretched(gaussians: Gaussians, linear: F64) -> tuple[F64, F64]:
    """The largest stretch (N,) in each one's plane, and its direction (N,): rad from local +x."""
    axes = linear @ matrices_from_quats(gaussians.quats.astype(np.float64))[:, :, :2]
    xx, yy = (axes**2).sum(1).T
    angle, half = _principal(xx, yy, (axes[:, :, 0] * axes[:, :, 1]).sum(1))
    return np.sqrt((xx + yy) / 2 + half), angle


def _principal(xx: F64, yy: F64, xy: F64) -> tuple[F64, F64]:
    """Direction (N,) of the larger eigenvalue of 2 x 2 matrices, half the eigenvalues' gap."""
    return 0.5 * np.arctan2(2 * xy, xx - yy), np.hypot((xx - yy) / 2, xy)


def _pieces(
    gaussians: Gaussians, angle: F64, count: np.ndarray, place: F64
) -> tuple[F64, F64, F64]:
    """Means (P, 3), quats (P, 4) and scales (P, 3) of pieces.

    The arguments belong to each piece: its parent, the direction in its plane, how many there
    are, and its place in their row, from the middle one on.
    """
    quats, scales = gaussians.quats.astype(np.float64), gaussians.scales.astype(np.float64)
    c, s = np.cos(angle), np.sin(angle)
    square = 1 / ((c / scales[:, 0]) ** 2 + (s / scales[:, 1]) ** 2)  # l^2
    own = square / (1 + APART**2 * (count**2 - 1) / 12)  # s^2
    directions = np.einsum("nab,nb->na", matrices_from_quats(quats)[:, :, :2], np.stack([c, s], 1))
    means = gaussians.means + (place * APART * np.sqrt(own))[:, None] * directions
    taken = square - own  # the variance that lies between the pieces
    xx, yy = scales[:, 0] ** 2 - taken * c * c, scales[:, 1] ** 2 - taken * s * s
    turn, half = _principal(xx, yy, -taken * c * s)
    large = (xx + yy) / 2 + half
    # determinant of the reduced matrix: no difference of nearly equal numbers for thin pieces
    small = (scales[:, 0] * scales[:, 1]) ** 2 * own / square / large
    a, b = np.cos(turn / 2), np.sin(turn / 2)  # q (a, 0, 0, b): a turn about local +z
    w, x, y, z = quats.T
    turned = np.stack([a * w - b * z, a * x + b * y, a * y - b * x, a * z + b * w], axis=1)
    return means, turned, np.stack([np.sqrt(large), np.sqrt(small), scales[:, 2]], axis=1)


# Fewer, wider Gaussians that stand for all of an object where its picture must be quick.

LEAST_GAIN = 1.2  # x spacing: with less, thinning is not worth it


def thinned(lifted: LiftedObject, count: int) -> tuple[LiftedObject, I32] | None:
    """About `count` of the solid Gaussians, so much wider, and which ones; None for a small object.

    The soft edge and hair stay as they are: each of their Gaussians is seen by itself.
    """
    is_solid = (lifted.texture.solidity > 0.5) & ~lifted.is_hair
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
        sides=None if lifted.sides is None else lifted.sides.select(chosen),
        spacing=gain * lifted.spacing,
    )  # fmt: skip
    return wide, chosen
