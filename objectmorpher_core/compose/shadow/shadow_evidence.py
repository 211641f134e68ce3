"""Evidence that a fitted shadow is the object's, and not something else that is dark.

A shadow begins where the object touches the ground, ends at an edge all around, takes light of
all colours alike, is darker than what else is beside the object, and the photo is explained by it
better than by none. Each of these is a number; their weighted sum must exceed a margin. The
weights are those of a logistic regression on half of the scenes of tests/shadow_scenes.py, and on
those of docs/compositing, which says how often the other half is right.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask
from ...document.settings import Shadow
from .shadow_shear import Flat, ShadowSheet

# Linear regression that outliers do not spoil (Huber's loss, iteratively reweighted).
#
# Holland and Welsch 1977, "Robust Regression Using Iteratively Reweighted Least-Squares".

ROUNDS = 5
HUBER = 1.3  # x the scale of what is usual
LEAST_SCALE = 0.02


def regressed(
    basis: F64, values: F64, weight: F64, scale: float | None = None
) -> tuple[F64, float, float]:
    """Coefficients, mean loss and scale of the robust fit of `values` (n,) by a basis (n, k)."""
    weights, found, used = weight, np.zeros(basis.shape[1]), 0.0
    rest = values
    for _ in range(ROUNDS):
        weighted = basis * weights[:, None]
        ridge = 1e-6 * len(values) * np.eye(basis.shape[1])
        found = np.linalg.solve(weighted.T @ basis + ridge, weighted.T @ values)
        rest = values - basis @ found
        used = 1.4826 * float(np.median(np.abs(rest))) + LEAST_SCALE
        weights = weight / np.maximum(np.abs(rest) / (HUBER * used), 1)
    off = np.abs(rest) / (used if scale is None else scale)
    loss = np.where(off < HUBER, off * off / 2, HUBER * off - HUBER**2 / 2)
    return np.asarray(found, np.float64), float((weight * loss).sum() / weight.sum()), used


FULL = 0.75  # of the light, that a full shadow is taken to leave out
CORE = 0.3  # of the darkest that was fitted: what is darker is the shadow's core
LIT = 0.1  # of it: what is lighter is lit ground
OVER = 2.0  # cells, over which the ground's own texture is evened
SIDE = 4.0  # cells, over which the two sides of an edge are compared
WIDE = 5.0  # cells from an edge that belong to its sides
FOOT = 0.2  # x the object's height, around the line on which it stands
TOUCHING = 4.0  # cells from the object
NEAR = 25.0  # cells from it, where other dark things count
AS_DARK = 0.4  # x the shadow: what is darker beside it is as dark
LEAST_OTHERS = 0.02  # of what is beside it
WEIGHTS = {
    "gain": 2.62, "others": -1.47, "joined": 1.79, "whole": 1.97, "tint": -1.08, "behind": 2.77,
}  # fmt: skip
BIAS = -4.81
MOST_TINT = 0.6  # x its darkness: what changes colours by more is another material
SURE = 2.1  # margin: 11 of 295 scenes without a shadow that were held out have a higher score
LIKELY = 0.7  # margin where somebody has asked for the shadow, sees it outlined, and can refuse


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The object's surroundings on a small grid."""

    brightness: F32  # (h, w) natural logarithm of linear light
    colour: F32  # (h, w, 2) logarithms of ratios
    cover: F32  # (h, w) of the object
    free: Mask  # (h, w) ground, or whatever else is not the object
    standing: ShadowSheet | Flat
    left: float
    top: float
    pitch: float


@dataclass(frozen=True, eq=False)
class ShadowGround:
    """The ground around an object, and its variation without a shadow."""

    index: np.ndarray  # (n,) of the cells
    weight: F64  # (n,)
    basis: F64  # (n, 6)
    everywhere: F64  # (h, w, 6) the same of all cells
    brightness: F64  # (n,)
    contact: F64  # (n,) natural logarithm of the light that a contact takes
    alone: F64  # (6,) its brightness where there is no shadow
    loss: float
    scale: float  # of what is not explained


@dataclass(frozen=True, eq=False)
class TriedShadow:
    """A shadow that was tried."""

    shadow: Shadow
    gain: float  # of the loss
    thrown: F32  # (h, w) natural logarithm of the light that it takes at strength 1
    ground: F64  # (6,)
    dark: float  # how much of it there is
    contact: float
    scale: float  # of what is not explained


def taken(shadow: F32) -> F32:
    """Natural logarithm of the light that a shadow of opacity (h, w) takes."""
    return np.asarray(-np.log(1 - FULL * np.clip(shadow, 0, 1)), np.float32)


def fitted(seen: Surroundings, found: TriedShadow) -> F32:
    """(h, w) natural logarithm of the light that the shadow takes which was found."""
    contact = taken(seen.standing.contact())
    return np.asarray(found.dark * found.thrown + found.contact * contact, np.float32)


def score(seen: Surroundings, ground: ShadowGround, found: TriedShadow) -> float:
    """Return the evidence for the shadow against other dark things (see SURE); -inf for none."""
    numbers = evidence(seen, ground, found)
    if numbers["tint"] > MOST_TINT:
        return -np.inf
    return sum(weight * numbers[name] for name, weight in WEIGHTS.items()) + BIAS


def evidence(seen: Surroundings, ground: ShadowGround, found: TriedShadow) -> dict[str, float]:
    """Return the evidence for the shadow by the names of WEIGHTS."""
    thrown = fitted(seen, found)
    lacking = (ground.everywhere @ found.ground).astype(np.float32) - seen.brightness
    unlike = seen.brightness - (ground.everywhere @ ground.alone).astype(np.float32)
    even, told, without = (_evened(v, seen.free) for v in (lacking, thrown, unlike))
    weight = np.zeros(seen.cover.size)
    weight[ground.index] = ground.weight
    weight = weight.reshape(seen.cover.shape)
    asked = weight > 0
    most = float(thrown[asked].max())
    away = cv2.distanceTransform((seen.cover < 0.5).astype(np.uint8), cv2.DIST_L2, 5)
    beside = asked & (thrown < LIT * most) & (away < NEAR)
    others = float((even[beside] > AS_DARK * most).mean()) if beside.any() else 1.0
    near = asked & (thrown > CORE * most) & (away < TOUCHING)
    rest = float((weight * np.abs(even - told)).sum())
    is_flat = isinstance(seen.standing, Flat)
    return {
        "gain": float(np.log((weight * np.abs(without)).sum() / max(rest, 1e-6))),
        "others": float(np.log(others + LEAST_OTHERS)),
        "joined": _joined(seen, even, told, near),
        "whole": _whole(lacking, thrown, asked, most),
        "tint": min(_tint(seen, ground, found), 1.5),
        "behind": 0.0 if is_flat else min(float(np.sin(np.radians(found.shadow.direction))), 0.0),
    }


def _evened(values: F32, free: Mask) -> F32:
    """(h, w) means over some cells of what is seen."""
    weight = free.astype(np.float32)
    spread = np.maximum(cv2.GaussianBlur(weight, (0, 0), OVER), 0.05)
    return np.asarray(cv2.GaussianBlur(values * weight, (0, 0), OVER) / spread, np.float32)


def _joined(seen: Surroundings, even: F32, told: F32, near: Mask) -> float:
    """The share of where the object touches the ground, in shadow, that is dark indeed."""
    standing = seen.standing
    if isinstance(standing, ShadowSheet):
        rows = np.arange(len(near))[:, None] + 0.5
        near = near & (np.abs(rows - standing.ground) < FOOT * standing.height)
    return float((even[near] > 0.5 * told[near]).mean()) if near.any() else 0.0


def _whole(lacking: F32, thrown: F32, asked: Mask, most: float) -> float:
    """The share of the shadow's edge at which the photo has a step of light, too."""
    is_shade = thrown > 0.5 * most
    inside, outside = (
        cv2.distanceTransform(part.astype(np.uint8), cv2.DIST_L2, 5)
        for part in (is_shade, ~is_shade)
    )
    is_lit = ~is_shade & (thrown < AS_DARK * most)
    sides = asked & is_shade & (inside < WIDE), asked & is_lit & (outside < WIDE)
    weights = [cv2.GaussianBlur(side.astype(np.float32), (0, 0), SIDE) for side in sides]
    edge = ~is_shade & (outside < 1.5) & (weights[0] > 0.03) & (weights[1] > 0.03)
    if not edge.any():
        return 0.0
    steps = []
    for values in (lacking, thrown):
        inner, outer = (
            cv2.GaussianBlur(values * side, (0, 0), SIDE)[edge] / weight[edge]
            for side, weight in zip(sides, weights, strict=True)
        )
        steps.append(inner - outer)
    return float((steps[0] > AS_DARK * steps[1]).mean())


def _tint(seen: Surroundings, ground: ShadowGround, found: TriedShadow) -> float:
    """How much it changes colours, x its darkness: another material begins with another colour."""
    column = found.thrown.ravel()[ground.index].astype(np.float64)
    basis = np.column_stack([ground.basis, -column])
    channels = seen.colour.reshape(-1, 2)[ground.index].T.astype(np.float64)
    changes = [abs(float(regressed(basis, c, ground.weight)[0][6])) for c in channels]
    return max(changes) / max(found.dark, 1e-6)
