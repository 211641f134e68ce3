"""A photo's evidence for a shape: outline, and the network's depth and normals, on a coarse grid.

A shape is drawn on the same rays and compared: how far its outline strays, and how far its front
and its normals are from what the network sees, over what they are expected to be off.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np
from scipy.optimize import minimize

from ...base.arrays import F64, Mask
from ...base.kernel_files import numba
from ...base.masks import box_of, disc
from ..crop import rays
from ..relief.shape_look import SeenShape
from .solids import Mesh, RayGrid, drawn, face_normals

# The numbers of a shape that fit the evidence best, from a first guess.

TRIALS = 18  # of the simplex, for each number
HOPELESS = 60.0  # misfit, from which nothing comes of refining
# Misfit, from which what was refined once is not begun again, nor what is so many times worse than
# the best: 134 photographed and drawn things are recognised as before, in four fifths of the time.
SPENT, WORSE = 14.0, 1.2
CLOSE = 0.004  # difference of misfits that no longer matters

Build = Callable[[F64], Mesh]
Cost = Callable[[F64], float]


def least(cost: Cost, start: F64, steps: F64) -> F64:
    """Numbers (n,) near `start` that cost least, by the simplex method (Nelder and Mead 1965).

    `steps` (n,): how far off `start` may well be.
    """
    return start + steps * _again(cost, start, steps, _once(cost, start, steps)[0])[0]


def all_least(costs: Sequence[Cost], starts: Sequence[F64], steps: F64) -> list[F64]:
    """Numbers (n,) near each of `starts` that cost least, likewise.

    Each is refined once, and those that may be the best of them once more.
    """
    found = [
        (np.zeros(len(start)), first)
        if (first := cost(start)) > HOPELESS else _once(cost, start, steps)
        for cost, start in zip(costs, starts, strict=True)
    ]  # fmt: skip
    most = min(SPENT, WORSE * min(value for _, value in found))
    return [
        start + steps * (change if value > most else _again(cost, start, steps, change)[0])
        for (change, value), cost, start in zip(found, costs, starts, strict=True)
    ]


def _once(cost: Cost, start: F64, steps: F64) -> tuple[F64, float]:
    """A change (n,), in steps, and what it costs."""
    return _simplex(cost, start, steps, np.zeros(len(start)), 1.0)


def _again(cost: Cost, start: F64, steps: F64, change: F64) -> tuple[F64, float]:
    """Likewise, begun anew where a simplex ended, as it may have collapsed (Kelley 1999)."""
    return _simplex(cost, start, steps, change, -0.3)


def _simplex(cost: Cost, start: F64, steps: F64, around: F64, size: float) -> tuple[F64, float]:
    simplex = around + size * np.vstack([np.zeros(len(start)), np.eye(len(start))])
    found = minimize(
        lambda change: cost(start + steps * change), around, method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": TRIALS * len(start), "fatol": CLOSE,
                 "xatol": 0.02, "adaptive": True},
    )  # fmt: skip
    return np.asarray(found.x, np.float64), float(found.fun)


STRIDE = 4  # px of the crop per cell
INNER = 2.0  # px of the crop from the outline, nearer to which its pixels mix
OUTLINE_ERROR = 0.007  # x extent, that an outline may stray
FARTHEST = 8.0  # x that; beyond, something else sticks out
NORMAL_ERROR = 0.35  # length of the difference of two unit vectors
LEAST_ERROR = 0.012  # crop units, of the network's front
TAIL = 2.5  # errors, from which a pixel counts less
BLUR = 1  # cells to either side, over which the network's normals are blurred
LENGTH = 3.0  # x extent, of a usual outline
CORNERED = 0.03  # x its length, that an outline may stray from four lines
FILLED = 0.06  # x its area, likewise
LEAST_CELLS = 12  # that are compared


class Misfit(NamedTuple):
    """The distances of a shape from the evidence; each is 1 where it is as large as expected."""

    outline: float
    depth: float
    normal: float
    thick: float  # which the network knows least of all

    @property
    def total(self) -> float:
        """Return the sum that the fits minimise."""
        return 2.0 * self.outline + self.depth + self.normal + 0.3 * self.thick


BESIDE = 4  # cells from what sticks out, nearer to which an outline is not the core's own
THIN = 0.45  # x the largest disc's radius, that of what is thin
LEAST_PIECE = 0.025  # x the mask's area, of what sticks out; a corner is less
LEAST_CORE = 0.55  # x the mask's area, that a core has
FAR = Misfit(1e3, 1e3, 1e3, 1e3)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Fields (h, w) over a coarse grid of the crop."""

    grid: RayGrid
    mask: Mask
    sure: Mask  # within the mask, where the network's pixels are not mixed
    outside: F64  # px of the crop to the outline, on either side
    depth: F64  # along the axis, crop units
    error: F64  # expected, over the depth
    normal: F64  # (h, w, 3) unit, camera axes
    facing: F64  # (h, w, 3) unit rays
    thick: F64  # along the axis through the whole object, crop units
    thick_error: F64
    extent: float  # px of the crop, longer side of the mask's box
    fine: Mask  # (s, s) the mask on the crop's own pixels

    @staticmethod
    def of(seen: SeenShape) -> Evidence:
        """Gather the evidence of an object of which the network sees something."""
        mask, crop = seen.mask, seen.crop
        side = len(mask)
        own = slice(STRIDE // 2, None, STRIDE)
        inside = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
        outside = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
        ways = rays(crop.tangents, side)
        distance = crop.away - seen.front.astype(np.float64)
        error = np.maximum(seen.front_error.astype(np.float64), LEAST_ERROR) / distance
        width = float(crop.tangents[2])
        low = [float(crop.tangents[k]) + ((own.start + 0.5) / side - 0.5) * width for k in (0, 1)]
        x0, y0, x1, y1 = box_of(mask)
        extent = float(max(x1 - x0, y1 - y0))
        shape = mask[own, own].shape
        grid = RayGrid((low[0], low[1]), STRIDE * width / side, (shape[0], shape[1]))

        def own_of(part: np.ndarray) -> np.ndarray:
            """Contiguous, as `within` makes masks: else `_compared` is compiled twice, 4 s each."""
            return np.ascontiguousarray(part[own, own])

        return Evidence(
            grid, own_of(mask), own_of(inside > INNER),
            own_of(np.where(mask, inside - 0.5, outside - 0.5).astype(np.float64)),
            own_of(distance * ways[..., 2]), own_of(error),
            own_of(seen.normal.astype(np.float64)), own_of(ways),
            own_of(seen.depth * ways[..., 2]),
            own_of(np.maximum(seen.depth_error.astype(np.float64), LEAST_ERROR)),
            extent, mask,
        )  # fmt: skip

    def within(self, mask: Mask) -> Evidence:
        """Return the evidence of a part of the object alone, `mask` (h, w)."""
        inside, outside = (
            cv2.distanceTransform(side.astype(np.uint8), cv2.DIST_L2, 5) for side in (mask, ~mask)
        )
        away = np.where(mask, inside - 0.5, outside - 0.5).astype(np.float64) * STRIDE
        # Where the part ends as the object does, that outline is known more finely; where it goes
        # on in the rest, or behind it, there is none.
        away = np.where(self.mask == mask, np.minimum(away, self.outside), away)
        rest = (self.mask & ~mask).astype(np.uint8)
        away = np.where(cv2.dilate(rest, np.ones((2 * BESIDE + 1,) * 2, np.uint8)) > 0, 0.0, away)
        near = cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8))
        whole = cv2.resize(near, self.fine.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
        fine = self.fine & whole
        return replace(self, mask=mask, sure=self.sure & mask, outside=away, fine=fine)

    def core(self) -> Evidence:
        """Return the evidence without thin parts that stick out far: handles, stalks, limbs."""
        radius = int(round(THIN * float(self.outside[self.mask].max()) / STRIDE))
        if radius < 1:
            return self
        opened = cv2.morphologyEx(self.mask.astype(np.uint8), cv2.MORPH_OPEN, disc(radius))
        rest = (self.mask & (opened == 0)).astype(np.uint8)
        _, pieces, stats, _ = cv2.connectedComponentsWithStats(rest, connectivity=4)
        is_far = np.asarray(stats)[:, cv2.CC_STAT_AREA] > LEAST_PIECE * self.mask.sum()
        is_far[0] = False
        core = self.mask & ~is_far[np.asarray(pieces)]
        is_main = is_far.any() and core.sum() >= LEAST_CORE * self.mask.sum()
        return self.within(core) if is_main else self

    @property
    def outline(self) -> F64:
        """(n, 2) tangents along the outside of the mask's largest piece."""
        found, _ = cv2.findContours(
            self.fine.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
        )
        ring = max(found, key=len)[:, 0].astype(np.float64)
        steps = ring - ring.mean(0)
        ring += 0.5 * steps / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-9)
        step = self.grid.step / STRIDE
        return np.array(self.grid.start) + step * (ring - STRIDE // 2)

    @property
    def is_four_cornered(self) -> bool:
        """Whether the outline is a quadrilateral: what a flat rectangle looks like."""
        hull = cv2.convexHull(self.outline.astype(np.float32))
        quad = cv2.approxPolyDP(hull, CORNERED * cv2.arcLength(hull, True), True)
        if len(quad) != 4:
            return False
        area = float(self.fine.sum()) * (self.grid.step / STRIDE) ** 2
        return abs(cv2.contourArea(quad) / area - 1) < FILLED

    @property
    def points(self) -> F64:
        """(n, 3) what is surely seen."""
        x, y = (self.grid.tangents[self.sure] * self.depth[self.sure][:, None]).T
        return np.column_stack([x, y, self.depth[self.sure]])

    def misfit(self, mesh: Mesh) -> Misfit:
        """Return the misfit of a mesh in camera axes, crop units; its scale does not count."""
        if mesh.vertices[:, 2].min() <= 1e-3:
            return FAR
        seen = drawn(mesh, self.grid)
        error = OUTLINE_ERROR * self.extent
        stray, depth, normal, thick = _compared(
            seen, face_normals(mesh), self.mask, self.sure, self.outside, FARTHEST * error,
            self.depth, self.error, self.normal, self.facing, self.thick, self.thick_error,
        )  # fmt: skip
        # px^3: the outline's length times half the square of its offset
        square = 2 * stray * STRIDE**2 / (LENGTH * self.extent)
        return Misfit(square / error**2, depth, normal, thick)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _blurred(normals, face):
    """(h, w, 3) the normals of what is met, each the mean of those around it, unit."""
    height, width = face.shape
    rows = np.zeros((height, width, 3))
    for i in range(height):
        for j in range(width):
            for b in range(max(j - BLUR, 0), min(j + BLUR + 1, width)):
                if face[i, b] >= 0:
                    rows[i, j] += normals[face[i, b]]
    found = np.zeros((height, width, 3))
    for i in range(height):
        for j in range(width):
            if face[i, j] < 0:
                continue
            for a in range(max(i - BLUR, 0), min(i + BLUR + 1, height)):
                found[i, j] += rows[a, j]
            found[i, j] /= max(np.sqrt((found[i, j] ** 2).sum()), 1e-9)
    return found


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _compared(
    seen, normals, mask, sure, outside, farthest, depth, error, normal, facing, thick, thick_error
):
    """What is off: the outline (sum), and robust means of front, normals, thickness.

    The mean square in which no value counts more than a tail is Geman and McClure's (1987).
    """
    near, far, face = seen
    height, width = mask.shape
    smooth = _blurred(normals, face)  # as the network's are
    offsets, errors = np.zeros(height * width), np.zeros(height * width)
    count, stray, apart, through = 0, 0.0, 0.0, 0.0
    for i in range(height):
        for j in range(width):
            is_met = near[i, j] > 0.0
            if is_met != mask[i, j]:
                stray += min(outside[i, j], farthest)
            if not (is_met and sure[i, j]):
                continue
            offsets[count] = -np.log(near[i, j] * depth[i, j])
            errors[count] = error[i, j]
            count += 1
            n = smooth[i, j]
            away = (n * facing[i, j]).sum()
            sign = -1.0 if away > 0 else 1.0
            square = ((sign * n - normal[i, j]) ** 2).sum() / NORMAL_ERROR**2
            apart += square / (1.0 + square / TAIL**2)
            own = (near[i, j] / far[i, j] - 1.0) * depth[i, j]
            square = ((own - thick[i, j]) / thick_error[i, j]) ** 2
            through += square / (1.0 + square / TAIL**2)
    if count < LEAST_CELLS:
        return 1e3, 1e3, 1e3, 1e3
    middle = np.median(offsets[:count])
    total = 0.0
    for k in range(count):
        square = ((offsets[k] - middle) / errors[k]) ** 2
        total += square / (1.0 + square / TAIL**2)
    return stray, total / count, apart / count, through / count
