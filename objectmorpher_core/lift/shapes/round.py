"""Surfaces of revolution and ellipsoids that look like the photo.

A circle about an axis is seen as an ellipse, as much narrower than wide as the axis leans towards
the camera. The outline of a surface of revolution is the hull of all its circles' ellipses, each of
which fits into it: so the radius at a place on the axis is that of the largest ellipse about it,
and the leaning is all that is to be found.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F64, Mask
from .drawing import Mesh
from .evidence import Evidence, Misfit
from .refining import refined
from .solids import AROUND, FINE, ellipsoid, revolved

LEANS = np.radians([4.0, 15.0, 28.0, 42.0, 58.0, 74.0])  # of the axis from the picture's plane
PLACES = 16  # on the axis
ACROSS = 64  # rows in which outlines are compared
TRIED = 48  # of them, at which its ends are looked for
TRIM = 0.004  # x the outline's area, that trimmed ends may lose
KEPT = 2  # leanings that are refined
LEAST_SHARE = 0.6  # of the mask, that is alike on both sides
CAPS = (0.0, 0.35, 1.0)  # height of the end that is seen, x its radius


def fit_ellipsoid(evidence: Evidence) -> tuple[Mesh, Misfit]:
    """Its outline is the ellipse of the mask; how deep it is the network says."""
    middle, axes, half, away = _moments(evidence)
    forward = middle / np.linalg.norm(middle)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    frame = np.column_stack([right, np.cross(forward, right), forward])
    spread = frame[:, :2] @ (axes * half)
    start = np.array([0.0, 0.0, 0.0, 0.0, 0.0, np.log(np.sqrt(half[0] * half[1])), 0.0, 0.0])
    steps = np.array([0.02, 0.02, 0.06, 0.06, 0.06, 0.3, 0.15 * half[0], 0.15 * half[1]])

    def build(numbers: F64, around: int = AROUND) -> Mesh:
        x, y, grow_a, grow_b, skew, deep, lean_a, lean_b = numbers
        flat = spread @ np.array([[np.exp(grow_a), skew], [skew, np.exp(grow_b)]])
        columns = np.column_stack(
            [flat + np.outer(forward, [lean_a, lean_b]), np.exp(deep) * forward]
        )
        return ellipsoid(middle + away * (frame[:, 0] * x + frame[:, 1] * y), columns, around)

    best, misfit = refined(build, start, steps, evidence)
    return build(best, FINE), misfit


def _moments(evidence: Evidence) -> tuple[F64, F64, F64, float]:
    """Middle (3,), axes (2, 2) columns, half lengths (2,) and distance of the mask's ellipse."""
    at = evidence.grid.tangents[evidence.mask]
    mean = at.mean(0)
    values, axes = np.linalg.eigh(np.cov((at - mean).T))
    depth = float(np.median(evidence.depth[evidence.sure])) + 0.0
    half = 2 * np.sqrt(np.maximum(values, 1e-12)) * depth
    middle = np.append(mean, 1.0) * (depth + 0.5 * half.min())
    return middle, axes, half, float(np.linalg.norm(middle))


@dataclass(frozen=True, eq=False)
class Lathe:
    """An axis in the picture, and the outline about it; lengths are tangents at the middle."""

    middle: F64  # (2,) tangents
    along: F64  # (2,) unit, in the picture
    outline: F64  # (n, 2) across and along
    low: float  # ends of the mask along the axis
    high: float

    def radii(self, lean: float) -> tuple[F64, F64]:
        """Places (PLACES,) of circles along the axis in the picture, and their radii."""
        places = np.linspace(self.low, self.high, TRIED + 2)[1:-1]
        # The camera looks at each circle along another ray.
        own = lean + places / float(np.hypot(1.0, np.linalg.norm(self.middle)))
        flat = np.maximum(np.abs(np.sin(own)), 0.02)
        away = np.hypot(self.outline[:, :1], (self.outline[:, 1:] - places) / flat)
        return self._trimmed(places, away.min(0), flat)

    def _trimmed(self, places: F64, radii: F64, flat: F64) -> tuple[F64, F64]:
        """Without the ends that are seen edge-on: what is left still has the same outline."""
        grid = np.linspace(self.low, self.high, ACROSS)
        half = radii[:, None] * np.sqrt(
            np.clip(1 - ((grid - places[:, None]) / ((flat * radii)[:, None] + 1e-9)) ** 2, 0, 1)
        )
        # The outline that is left when so many are trimmed from an end, after each other
        least = (1 - TRIM) * half.max(0).sum()
        left = np.maximum.accumulate(half[::-1])[::-1].sum(1)
        first = min(int(np.flatnonzero(left >= least)[-1]), len(places) - 6)
        left = np.maximum.accumulate(half[first:]).sum(1)
        last = max(first + int(np.flatnonzero(left >= (1 - TRIM) * left[-1])[0]), first + 5)
        ends = (first, last + 1)
        own = slice(*ends)
        even = np.linspace(float(places[ends[0]]), float(places[ends[1] - 1]), PLACES)
        radii = np.interp(even, places[own], radii[own])
        inner = np.convolve(radii, [0.25, 0.5, 0.25], "same")  # the ends stay: there are its rims
        return even, np.concatenate([radii[:1], inner[1:-1], radii[-1:]])


def fit_revolution(evidence: Evidence) -> tuple[Mesh, Misfit] | None:
    """The best of several axes and leanings; None where nothing is alike on both sides."""
    trials = []
    for lathe in _lathes(evidence):
        for lean in np.concatenate([LEANS, -LEANS]):
            mesh = _built(lathe, lean, np.zeros(6), 0.0, evidence)
            trials.append((evidence.misfit(mesh).total, lathe, lean))
    trials.sort(key=lambda trial: trial[0])
    fits = [_refined(lathe, lean, evidence) for _, lathe, lean in trials[:KEPT]]
    return min(fits, key=lambda fit: fit[1].total, default=None)


def _refined(lathe: Lathe, lean: float, evidence: Evidence) -> tuple[Mesh, Misfit]:
    size = lathe.high - lathe.low
    steps = np.array([0.15, 0.06, 0.02 * size, 0.02 * size, 0.05, 0.05])
    best, _ = refined(lambda n: _built(lathe, lean, n, 0.0, evidence), np.zeros(6), steps, evidence)
    fits = [(cap, evidence.misfit(_built(lathe, lean, best, cap, evidence))) for cap in CAPS]
    cap, misfit = min(fits, key=lambda fit: fit[1].total)
    return _built(lathe, lean, best, cap, evidence, FINE), misfit


def _built(
    lathe: Lathe, lean: float, change: F64, cap: float, evidence: Evidence, around: int = AROUND
) -> Mesh:
    """`change` (6,): of leaning, turn in the picture, place, and logarithms of width and length."""
    lean = float(np.clip(lean + change[0], -1.5, 1.5))
    places, radii = lathe.radii(lean)
    middle = np.append(lathe.middle + change[2:4], 1.0)
    forward = middle / np.linalg.norm(middle)
    cosine, sine = np.cos(change[1]), np.sin(change[1])
    along = np.append(np.array([[cosine, -sine], [sine, cosine]]) @ lathe.along, 0.0)
    inside = along - forward * (along @ forward)
    inside /= np.linalg.norm(inside)
    axis = np.cos(lean) * inside + np.sin(lean) * forward
    depth = float(np.median(evidence.depth[evidence.sure]))
    centre = depth * (middle + along * 0.5 * (places[0] + places[-1]))
    # Where the axis meets the rays of the circles' middles, and how far away that is
    rays = middle + places[:, None] * along
    across = np.cross(axis, rays)
    steps = -(np.cross(centre, rays) * across).sum(1) / np.maximum((across**2).sum(1), 1e-9)
    most = 2 * depth * (lathe.high - lathe.low) / max(np.cos(lean), 0.1)
    steps = np.clip(steps, -most, most)
    away = np.maximum(centre[2] + steps * axis[2], 0.2 * depth)
    radii = np.exp(change[4]) * radii * away
    steps = np.exp(change[5]) * steps
    if cap > 0:
        steps, radii = _capped(steps, radii, cap, lean > 0)
    # Seen from near, a circle's rim is wider than it is far away.
    far = np.linalg.norm(centre + steps[:, None] * axis, axis=1)
    radii = radii * np.sqrt(np.clip(1 - (radii / far) ** 2, 0.5, 1))
    return revolved(centre + steps[:, None] * axis, radii, axis, around)


def _capped(steps: F64, radii: F64, cap: float, is_first_seen: bool) -> tuple[F64, F64]:
    """With a round end where the axis comes towards the camera."""
    angle = np.linspace(0, 0.5 * np.pi, 7)[1:]
    end = 0 if is_first_seen else -1
    sign = -1.0 if is_first_seen else 1.0
    more = steps[end] + sign * cap * radii[end] * np.sin(angle)
    less = np.maximum(radii[end] * np.cos(angle), 1e-3 * radii[end])
    if is_first_seen:
        return np.concatenate([more[::-1], steps]), np.concatenate([less[::-1], radii])
    return np.concatenate([steps, more]), np.concatenate([radii, less])


def _lathes(evidence: Evidence) -> list[Lathe]:
    """About the axes of the mask; what sticks out on one side only is left out."""
    at = evidence.grid.tangents
    mean = at[evidence.mask].mean(0)
    _, axes = np.linalg.eigh(np.cov((at[evidence.mask] - mean).T))
    corners = cv2.boxPoints(cv2.minAreaRect(evidence.outline.astype(np.float32)))
    sides = [corners[k + 1] - corners[k] for k in (0, 1)]
    sides = [side / max(float(np.linalg.norm(side)), 1e-9) for side in sides]
    ways = [axes[:, 0], axes[:, 1], np.array([0.0, 1.0]), *sides]
    found: list[Lathe] = []
    for way in ways:
        way = way * np.sign(way[1] + 1e-9)
        if any(abs(way @ other.along) > 0.999 for other in found):
            continue
        middle = _axis_of(evidence.mask, at, mean, way)
        mirrored = _both_sides(evidence, middle, way)
        mirrored = _largest(mirrored)
        if mirrored.sum() < LEAST_SHARE * evidence.mask.sum():
            continue
        outline = evidence.within(mirrored).outline - middle
        outline = np.column_stack([outline @ [-way[1], way[0]], outline @ way])[::4]
        low, high = outline[:, 1].min(), outline[:, 1].max()
        found.append(Lathe(middle, way, outline, low, high))
    return found


def _axis_of(mask: Mask, at: F64, mean: F64, way: F64) -> F64:
    """(2,) a place on the line along `way` that halves most chords across it."""
    normal = np.array([-way[1], way[0]])
    along, across = (at[mask] - mean) @ way, (at[mask] - mean) @ normal
    bins = np.clip(((along - along.min()) / max(np.ptp(along), 1e-9) * 24).astype(int), 0, 23)
    middles, weights = [], []
    for k in range(24):
        own = across[bins == k]
        if len(own) > 2:
            middles.append(0.5 * (own.min() + own.max()))
            weights.append(np.ptp(own))
    order = np.argsort(middles)
    share = np.cumsum(np.array(weights)[order])
    return mean + normal * np.array(middles)[order][np.searchsorted(share, 0.5 * share[-1])]


def _both_sides(evidence: Evidence, middle: F64, way: F64) -> Mask:
    """(h, w) of the mask, whose mirror image about the axis is in it, too."""
    at = evidence.grid.tangents
    normal = np.array([-way[1], way[0]])
    image = at - 2 * ((at - middle) @ normal)[..., None] * normal
    cells = (image - evidence.grid.start) / evidence.grid.step
    j, i = np.moveaxis(np.rint(cells).astype(int), -1, 0)
    h, w = evidence.mask.shape
    inside = (i >= 0) & (i < h) & (j >= 0) & (j < w)
    return evidence.mask & inside & evidence.mask[i.clip(0, h - 1), j.clip(0, w - 1)]


def _largest(mask: Mask) -> Mask:
    """The largest piece of `mask` (h, w)."""
    count, pieces, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if count <= 2:
        return mask
    return np.asarray(pieces) == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
