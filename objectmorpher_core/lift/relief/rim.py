"""The rim of a body as one smooth line in space, with honest breaks.

What a network, or a silhouette's discs, say of the depth beside an outline differs from pixel to
pixel by more than an eye forgives: where the object turns, its outline is just that line. Depth
along a rim is therefore a smooth function of its length, but for corners and for places in which
one part ends behind another. Both are found by the fit itself: a bend costs the less the sharper
it is (Geman and McClure 1985), so few sharp ones are cheaper than many slight ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.sparse import csc_array, dia_array
from scipy.sparse.linalg import spsolve
from scipy.spatial import KDTree

from ...base.arrays import F64, I64, Mask
from .bilinear import bilinear
from .silhouette import Silhouette
from .thickness import FULLNESS, Thickness

if TYPE_CHECKING:
    from .body import Body

WAVE = 0.25  # x extent: shorter waves of a rim's depth are noise
SHARP = 0.08  # change of slope per cell, from which a bend is a corner
ROUNDS = 4  # of the fit: what is sharp then stays so
SHORTEST = 4  # cells of a rim that is looked at
STAIRS = 1.5  # cells, over which the staircase of an outline is evened
DEEP = (0.8, 4.0)  # cells inwards from an outline, where the depth beside it is read
BESIDE = 2.0  # cells from an outline, up to which its own direction tells how deep a cell is
OF_RADIUS = 0.6  # x the radius of the part, that this is at most
CLOSES = 0.15  # x the square of the thickness there, below which a body closes at its outline
REACH = 0.06  # x extent, over which what the rim gained is spread inwards
SOFT = 1.5  # cells


@dataclass(frozen=True, eq=False)
class RimLine:
    """A closed outline of a silhouette: of the object, or of a hole in it."""

    xy: F64  # (n, 2) grid coordinates on the outline itself, evened
    inward: F64  # (n, 2) unit

    @property
    def length(self) -> F64:
        """(n + 1,) cells from its first place."""
        steps = np.linalg.norm(np.roll(self.xy, -1, axis=0) - self.xy, axis=1)
        return np.r_[0.0, np.cumsum(steps)]


def rim_lines(inside: Mask) -> list[RimLine]:
    """All outlines of cells (h, w) that are long enough to have a shape."""
    found, _ = cv2.findContours(inside.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    lines = []
    for ring in found:
        cells = ring[:, 0]
        if len(cells) < SHORTEST:
            continue
        xy = gaussian_filter1d(cells.astype(np.float64), STAIRS, axis=0, mode="wrap")
        way = np.roll(xy, -1, axis=0) - np.roll(xy, 1, axis=0)
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        # The object lies to one side of all lines, at the centres of its outermost cells.
        away = np.column_stack([-way[:, 1], way[:, 0]])
        side = np.rint(xy + 1.5 * away).astype(int)
        h, w = inside.shape
        beyond = inside[np.clip(side[:, 1], 0, h - 1), np.clip(side[:, 0], 0, w - 1)]
        if beyond.mean() > 0.5:
            away = -away
        lines.append(RimLine(xy + 0.5 * away, -away))
    return lines


@dataclass(frozen=True, eq=False)
class Rims:
    """All outlines of a silhouette, and the cells beside them."""

    outline: Silhouette
    lines: list[RimLine]
    xy: F64  # (n, 2) grid coordinates of the places of all lines
    inward: F64  # (n, 2) unit
    deep: F64  # (n,) cells inwards of each place of the lines, where a field is read
    nearest: I64  # (h, w) the place that is nearest to a cell
    depth: F64  # (h, w) cells inwards of the outline, negative outside it

    @staticmethod
    def of(outline: Silhouette, lines: list[RimLine]) -> Rims:
        xy = np.concatenate([line.xy for line in lines])
        inward = np.concatenate([line.inward for line in lines])
        radius = bilinear(outline.radius / outline.cell, xy + 1.5 * inward)
        cells = outline.cells
        away, nearest = KDTree(xy).query(cells.reshape(-1, 2))
        nearest = np.asarray(nearest, np.int64).reshape(outline.shape)
        away = np.asarray(away, np.float64).reshape(outline.shape)
        depth = ((cells - xy[nearest]) * inward[nearest]).sum(-1)
        # Farther away a line is a point, of which no side is the inner one.
        depth = np.where(away < BESIDE, depth, np.where(outline.inside, away, -BESIDE))
        deep = np.clip(OF_RADIUS * radius, *DEEP)
        return Rims(outline, lines, xy, inward, deep, nearest, depth)

    def read(self, field: F64, share: float) -> F64:
        """(n,) of `field` (h, w) at that share of the way inwards, smooth along each line."""
        values = bilinear(field, self.places(share)) / self.outline.cell
        wave, first = WAVE * self.outline.extent / self.outline.cell, 0
        for line in self.lines:
            own = slice(first, first + len(line.xy))
            values[own] = smoothed(values[own], line.length, wave)
            first = own.stop
        return self.outline.cell * values

    def places(self, share: float) -> F64:
        """(n, 2) grid coordinates at that share of the way inwards."""
        return self.xy + share * self.deep[:, None] * self.inward

    def changed(self, field: F64, share: float, wanted: F64) -> F64:
        """`field` (h, w) that is `wanted` (n,) at that share of the way inwards.

        What changes there fades out farther inwards.
        """
        change = (wanted - bilinear(field, self.places(share)))[self.nearest]
        change = cv2.GaussianBlur(change, (0, 0), SOFT)
        fade = np.clip(1 - self.outline.depth / (REACH * self.outline.extent), 0, 1)
        return field + fade * fade * (3 - 2 * fade) * change

    def straight(self, field: F64, edge: F64, inner: F64) -> F64:
        """`field` (h, w) that runs straight from `edge` (n,) at the outline to `inner` (n,)."""
        far = self.changed(field, 1.0, inner)
        deep = self.deep[self.nearest]
        line = edge[self.nearest] + (inner - edge)[self.nearest] * self.depth / deep
        return line + np.clip(2 * self.depth / deep - 1, 0, 1) * (far - line)


def evened(body: Body) -> Body:
    """The body with smooth rims: its middle sheet, and the thickness on both sides of it."""
    outline = body.silhouette
    lines = rim_lines(outline.inside)
    if not lines:
        return body
    rims = Rims.of(outline, lines)
    middle = rims.changed(body.middle, 0.5, rims.read(body.middle, 0.5))
    sides = [_evened_side(side, rims) for side in (body.front, body.back)]
    return replace(body, middle=middle, front=sides[0], back=sides[1])


def _evened_side(side: Thickness, rims: Rims) -> Thickness:
    """A side whose square runs straight to the outline: that of a round limb does."""
    half = side.half(rims.outline.cells.reshape(-1, 2)).reshape(rims.outline.shape)
    crease = bilinear(side.crease, rims.places(0.5))  # smooth as it is
    near, inner = (
        (rims.read(half, share) / FULLNESS + crease) ** 2 - crease**2 for share in (0.5, 1.0)
    )
    # What is left at the outline itself: nothing, where it is about to close.
    rest = np.maximum(2 * near - inner - CLOSES * inner, 0.0) / (1 - CLOSES)
    return replace(side, square=rims.straight(side.square, np.minimum(rest, inner), inner))


def smoothed(values: F64, length: F64, wave: float) -> F64:
    """`values` (n,) along a closed line, `length` (n + 1,), without waves shorter than `wave`.

    Where one of them bends sharply, it may.
    """
    count = max(SHORTEST, round(length[-1]))
    even = np.linspace(0, length[-1], count, endpoint=False)
    own = _fitted(np.interp(even, length, np.r_[values, values[0]]), (wave / (2 * np.pi)) ** 4)
    return np.interp(length[:-1], np.r_[even, length[-1]], np.r_[own, own[0]])


def _fitted(values: F64, stiffness: float) -> F64:
    """(n,) near `values` (n,) along a closed line, with few and sharp bends."""
    n = len(values)
    rows = np.arange(n)
    bend = csc_array(
        (
            np.tile([1.0, -2.0, 1.0], n),
            (np.repeat(rows, 3), np.column_stack([rows - 1, rows, rows + 1]).ravel() % n),
        ),
        shape=(n, n),
    )
    one, weight, found = _diagonal(np.ones(n)), np.ones(n), values
    for _ in range(ROUNDS):
        system = one + bend.T @ (_diagonal(stiffness * weight) @ bend)
        found = np.asarray(spsolve(csc_array(system), values), np.float64)
        weight = 1 / (1 + (np.asarray(bend @ found) / SHARP) ** 2) ** 2
    return found


def _diagonal(values: F64) -> dia_array:
    return dia_array((values[None], [0]), shape=(len(values), len(values)))
