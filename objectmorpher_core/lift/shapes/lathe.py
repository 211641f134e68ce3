"""The profile of a surface of revolution, from its outline and a guess of its axis.

A circle about an axis is seen as an ellipse, as much narrower than wide as the axis leans towards
the camera. The outline of a surface of revolution is that of all its circles' ellipses together,
each of which fits into it: so the radius at a place on the axis is that of the largest circle
whose picture fits. The axis is all that is left to be found, and the right one has the simplest
profile: about a wrong one even a plain cylinder seems to taper towards its ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from ...base.arrays import F64, Mask
from ...base.kernel_files import numba
from .evidence import STRIDE, Evidence
from .solids import AROUND, Mesh, cross, revolved

TRIED = 40  # places on the axis, at which the profile's ends are looked for
PLACES = 24  # of the profile itself, while its axis is looked for
FINER = 48, 96  # of one that is shown, and of one with steps, as of a lamp's shade
STRAIGHT = 0.05  # radians from one place to the next, that are noise of the outline
TRIM = 0.002  # x the outline's area, that the outline may lose at each end
CORNERS = 24  # of a circle, that are looked up in the outline
SLACK = 0.5  # px that a circle may reach out of an outline, whose pixels are stairs
HALVINGS = 12  # of an interval that holds a radius
NEAREST = 0.8  # x its depth, that it may reach towards the camera
ALIKE = 0.998  # cosine between two axes that are tried as one
SHIFT = 4  # bits of a pixel's fraction, as OpenCV draws


class Profile(NamedTuple):
    """Circles about an axis, in camera axes."""

    places: F64  # (n, 3)
    radii: F64  # (n,)
    axis: F64  # (3,) unit
    bend: float  # radians, total absolute curvature of the profile between its ends

    def mesh(self, around: int = AROUND) -> Mesh:
        return revolved(self.places, self.radii, self.axis, around)

    def capped(self, cap: float) -> Profile:
        """With an end that faces the camera `cap` x its radius high; below 0 it is hollow."""
        if cap == 0.0:
            return self
        end = 0 if self.axis @ self.places[0] > 0 else -1
        away = self.places[end] - self.places[-1 - end]
        away /= np.linalg.norm(away)
        if cap > 0:
            angle = np.linspace(0, 0.5 * np.pi, 7)[1:]
            steps, widths = cap * np.sin(angle), np.maximum(np.cos(angle), 1e-3)
        else:
            steps, widths = cap * np.array([0.0, 1.0, 1.0]), np.array([0.93, 0.85, 1e-3])
        more = self.places[end] + self.radii[end] * steps[:, None] * away
        radii = self.radii[end] * widths
        if end == 0:
            more, radii = more[::-1], radii[::-1]
        first, last = (more, self.places) if end == 0 else (self.places, more)
        own = (radii, self.radii) if end == 0 else (self.radii, radii)
        return self._replace(places=np.vstack([first, last]), radii=np.concatenate(own))


@dataclass(frozen=True, eq=False)
class Lathe:
    """An axis in the picture, and how deep in the outline each pixel is."""

    middle: F64  # (2,) tangents
    along: F64  # (2,) unit, in the picture
    low: float  # ends of the mask along the axis, tangents from the middle
    high: float
    inside: F64  # (s, s) px to the outline, negative outside
    start: F64  # (2,) tangents of the first pixel
    step: float  # tangents from pixel to pixel
    depth: float  # at which the middle is

    @staticmethod
    def of(evidence: Evidence, middle: F64, along: F64) -> Lathe:
        own = (evidence.grid.tangents[evidence.mask] - middle) @ along
        half = 0.5 * evidence.grid.step
        step = evidence.grid.step / STRIDE
        depth = float(np.median(evidence.depth[evidence.sure]))
        start = np.array(evidence.grid.start) - (STRIDE // 2) * step
        inside = _signed(evidence.fine)
        ends = float(own.min()) - half, float(own.max()) + half
        return Lathe(middle, along, *ends, inside, start, step, depth)

    def profile(self, lean: float, change: F64, places: int = PLACES) -> Profile | None:
        """About an axis that leans so much away from the picture's plane, radians.

        `change` (2,): of its angle in the picture, radians, and of its place across, tangents.
        It has so many `places`. None where no circle fits.
        """
        cosine, sine = np.cos(change[0]), np.sin(change[0])
        along = np.array([[cosine, -sine], [sine, cosine]]) @ self.along
        middle = self.middle + change[1] * np.array([-along[1], along[0]])
        ray, flat = np.append(middle, 1.0), np.append(along, 0.0)
        rays = ray + np.linspace(self.low, self.high, TRIED)[:, None] * flat
        forward = ray / np.linalg.norm(ray)
        flat -= forward * (flat @ forward)
        flat /= np.linalg.norm(flat)
        axis = np.cos(lean) * flat + np.sin(lean) * forward
        centre = self.depth * ray
        # Where the axis meets the rays of the circles' middles
        across = cross(axis, rays)
        steps = -(cross(centre, rays) * across).sum(1) / np.maximum((across**2).sum(1), 1e-9)
        most = 2 * self.depth * (self.high - self.low) / max(np.cos(lean), 0.1)
        most = min(most, NEAREST * self.depth / max(abs(axis[2]), 1e-3))
        steps = np.clip(steps, -most, most)
        return self._fitted(centre, steps, axis, places)

    def _fitted(self, centre: F64, steps: F64, axis: F64, places: int) -> Profile | None:
        u = cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        u /= np.linalg.norm(u)
        v = cross(axis, u)
        turn = 2 * np.pi * np.arange(CORNERS) / CORNERS
        ways = np.asarray(np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v, np.float64)
        most = self.depth * (self.high - self.low)

        def radii(steps: F64) -> F64:
            places = centre + steps[:, None] * axis
            return _radii(places, ways, self.inside, self.start, self.step, most)

        found = radii(steps)
        held = np.flatnonzero(found > 0.01 * most)
        if len(held) < 6:
            return None
        steps, found = steps[held[0] : held[-1] + 1], found[held[0] : held[-1] + 1]
        first, last = self._ends(centre + steps[:, None] * axis, found, ways)
        ends = np.interp([first, last], range(len(steps)), steps)

        def evened(places: int) -> tuple[F64, F64]:
            at = np.linspace(ends[0], ends[1], places)
            own = np.maximum(radii(at), 0.5 * np.interp(at, steps, found))
            for _ in range(2):
                own[1:-1] = np.convolve(own, [0.25, 0.5, 0.25], "valid")
            return at, own

        even, own = evened(PLACES)
        slope = np.arctan2(np.diff(own), np.diff(even))  # of more places it would be noise
        bend = float(np.maximum(np.abs(np.diff(slope)) - STRAIGHT, 0.0).sum())
        if places != PLACES:
            even, own = evened(places)
        return Profile(centre + even[:, None] * axis, own, axis, bend)

    def _ends(self, places: F64, radii: F64, ways: F64) -> tuple[float, float]:
        """The first and last of circles that the outline cannot do without, with fractions."""
        corners = places[:, None] + radii[:, None, None] * ways
        pixels = (corners[..., :2] / corners[..., 2:] - self.start) / self.step
        polygons = np.rint(np.clip(pixels, -1e4, 1e4) * (1 << SHIFT)).astype(np.int32)
        is_inside = self.inside > 0

        def left(polygons: np.ndarray) -> F64:
            """(n,) px of the area without the first so many, or none."""
            latest = np.zeros(is_inside.shape, np.uint8)  # the last that covers each px
            for k, polygon in enumerate(polygons, 1):
                cv2.fillConvexPoly(latest, polygon, k, shift=SHIFT)
            counts = np.bincount(latest[is_inside], minlength=len(polygons) + 1)
            return np.cumsum(counts[:0:-1])[::-1].astype(np.float64)

        whole = left(polygons)
        first = _crossing(whole, (1 - TRIM) * whole[0])
        back = left(polygons[int(first) :][::-1])
        last = len(radii) - 1 - _crossing(back, (1 - TRIM) * back[0])
        if last - first < 3:
            middle = 0.5 * (first + last)
            first, last = max(middle - 1.5, 0.0), min(middle + 1.5, len(radii) - 1.0)
        return first, last


def _crossing(falling: F64, level: float) -> float:
    """Where `falling` (n,), which never rises, passes a level; with fractions."""
    after = int(np.argmax(falling < level))
    if after == 0:
        return 0.0 if falling[0] < level else float(len(falling) - 1)
    high, low = falling[after - 1], falling[after]
    return after - 1 + float((high - level) / (high - low))


def _signed(mask: Mask) -> F64:
    inside, outside = (
        cv2.distanceTransform(np.pad(side, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
        for side in (mask, ~mask)
    )
    away = np.where(mask, inside - 0.5, 0.5 - outside)
    return np.asarray(cv2.GaussianBlur(away.astype(np.float64), (0, 0), 0.7), np.float64)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _radii(places, ways, inside, start, step, most):
    """(n,) of the largest circles about `places` (n, 3) that are seen where `inside` is above 0."""
    height, width = inside.shape
    found = np.zeros(len(places))
    for k in range(len(places)):
        low, high = 0.0, most
        for halving in range(HALVINGS + 1):
            r = 0.5 * (low + high) if halving > 0 else 0.0
            fits = True
            for c in range(len(ways)):
                z = places[k, 2] + r * ways[c, 2]
                if z <= 1e-6:
                    fits = False
                    break
                x = ((places[k, 0] + r * ways[c, 0]) / z - start[0]) / step
                y = ((places[k, 1] + r * ways[c, 1]) / z - start[1]) / step
                if x < 0 or y < 0 or x >= width - 1 or y >= height - 1:
                    fits = False
                    break
                j, i = int(x), int(y)
                a, b = x - j, y - i
                value = (1 - b) * ((1 - a) * inside[i, j] + a * inside[i, j + 1]) + b * (
                    (1 - a) * inside[i + 1, j] + a * inside[i + 1, j + 1]
                )
                if value < -SLACK:
                    fits = False
                    break
            if halving == 0:
                if not fits:
                    break
            elif fits:
                low = r
            else:
                high = r
        found[k] = low
    return found


def ways_of(evidence: Evidence) -> list[F64]:
    """(2,) unit each: along which, in the picture, an axis may lie."""
    at = evidence.grid.tangents[evidence.mask]
    _, axes = np.linalg.eigh(np.cov((at - at.mean(0)).T))
    corners = cv2.boxPoints(cv2.minAreaRect(evidence.outline.astype(np.float32)))
    sides = [corners[k + 1] - corners[k] for k in (0, 1)]
    sides = [side / max(float(np.linalg.norm(side)), 1e-9) for side in sides]
    found: list[F64] = []
    for way in (axes[:, 0], axes[:, 1], np.array([0.0, 1.0]), *sides):
        way = way * np.sign(way[1] + 1e-9)
        if all(abs(way @ other) <= ALIKE for other in found):
            found.append(way)
    return found
