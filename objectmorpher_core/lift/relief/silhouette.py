"""The silhouette of an object on a grid of its own, in which shapes are found.

The grid covers the mask's box with a ring of cells around it, GRID cells on its longer side. An
object that leaves the photo goes on a little beyond the frame, where its cut is no outline.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ...base.arrays import F32, F64, U8, Mask, crop
from ...base.kernel_files import numba
from ...base.masks import box_of, dilated, disc, reduced, reduced_mask
from ...base.poisson_disk import distance_inside
from ...document.model import Matte
from ...segment.matting.matte import band_width, extended_mask, frame_extension, is_large
from .canvas import bilinear

GRID = 256  # cells on the longer side of the box
FINENESS = 4.0  # px to a cell, at least, at which the outline is looked at
SMOOTHING = 0.4  # cells: the outline is smoothed by so much
STEEP = 0.9  # growth of the depth per cell, from which a farther disc covers this one
TOUCHING = 0.03  # x extent: how far above its lower hull an outline still touches the ground


@dataclass(frozen=True, eq=False)
class ReliefSilhouette:
    """The object's coarse place, and the distance of its outline."""

    inside: Mask  # (h, w) the outermost ring is outside
    cell: float  # px of the photo per cell
    left: float  # px, photo coordinates of the grid's corner
    top: float
    extent: float  # px, longer side of the silhouette's box
    is_open: tuple[bool, bool, bool, bool]  # top, bottom, left, right: it leaves the photo there

    @staticmethod
    def of(mask: Mask) -> ReliefSilhouette:
        """Build it from `mask` (H, W), which has at least one pixel."""
        extension = frame_extension(mask)
        whole = extended_mask(mask, extension)
        left, top, right, bottom = box_of(whole)
        crop = whole[top:bottom, left:right]
        extent = float(max(crop.shape))
        cell = max(1.0, extent / GRID)
        # What closes beyond the frame has an outline there.
        up, down, before, after = extension
        is_open = (
            up > 0 and top == 0, down > 0 and bottom == whole.shape[0],
            before > 0 and left == 0, after > 0 and right == whole.shape[1],
        )  # fmt: skip
        inside = np.pad(_reduced(crop, cell, is_open[1], is_open[3]), 1)
        corner = (left - before - cell, top - up - cell)
        return ReliefSilhouette(inside, cell, *corner, extent, is_open)

    @property
    def shape(self) -> tuple[int, int]:
        """(h, w) cells."""
        return self.inside.shape[0], self.inside.shape[1]

    @property
    def cells(self) -> F64:
        """Grid coordinates (h, w, 2) of all cells."""
        h, w = self.shape
        return np.stack(np.meshgrid(np.arange(w), np.arange(h)), -1).astype(np.float64)

    def grid_xy(self, xy: F64) -> F64:
        """Grid coordinates (..., 2), cell centres at integers, of photo px (..., 2)."""
        return (xy - [self.left, self.top]) / self.cell - 0.5

    def photo_xy(self, grid_xy: F64) -> F64:
        """Photo px (..., 2) of grid coordinates (..., 2)."""
        return (grid_xy + 0.5) * self.cell + [self.left, self.top]

    @cached_property
    def depth(self) -> F64:
        """(h, w) px from the outline, 0 outside.

        An open side is no outline: the silhouette is thought to go on there as it is.
        """
        reach = max(self.shape)
        h, w = self.shape
        box = self.continued(self.inside, reach).astype(np.uint8)
        far = distance_inside(box)
        far = far[reach : reach + h, reach : reach + w]
        return np.where(self.inside, np.maximum(far - 0.5, 0.25), 0.0) * self.cell

    def continued(self, field: np.ndarray, count: int) -> np.ndarray:
        """`field` (h, w) with `count` cells more on each side.

        Outside the object they are 0. Where it leaves the photo it goes on as it is there.
        """
        top, bottom, left, right = (
            (count + 1, 0) if is_open else (0, count + 1) for is_open in self.is_open
        )
        core = field[1:-1, 1:-1]
        core = np.pad(core, [(top[0], bottom[0]), (left[0], right[0])], mode="edge")
        return np.pad(core, [(top[1], bottom[1]), (left[1], right[1])])

    @cached_property
    def radius(self) -> F64:
        """(h, w) px, of the largest disc in the silhouette that covers a cell; 0 outside."""
        return largest_disc(self.depth / self.cell) * self.cell

    @cached_property
    def contour(self) -> tuple[F64, F64]:
        """Stretches of the outline: their middles (n, 2) and their ends' offsets (n, 2), photo px.

        Also where the object leaves the photo: there it is sawn off, not hollow.
        """
        solid = self.inside.astype(np.uint8)
        found, _ = cv2.findContours(solid, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        middles, offsets = [], []
        for ring in found:
            points = ring[:, 0].astype(np.float64)
            steps = np.roll(points, -1, axis=0) - points
            middles.append(points + 0.5 * steps)
            offsets.append(steps)
        return self.photo_xy(np.concatenate(middles)), np.concatenate(offsets) * self.cell

    @cached_property
    def lower_outline(self) -> tuple[F64, F64]:
        """Columns (n,) px and the lowest row (n,) px of the silhouette in each, ascending."""
        inside = self.inside
        j = np.flatnonzero(inside.any(0))
        i = inside.shape[0] - np.argmax(inside[::-1][:, j], axis=0)  # the cell below the lowest
        x, y = (j + 0.5) * self.cell + self.left, i * self.cell + self.top
        return x.astype(np.float64), y.astype(np.float64)

    def outward(self, xy: F64) -> F64:
        """Unit directions (N, 2) away from the silhouette at photo px (N, 2) outside it."""
        at, (h, w) = self.grid_xy(xy), self.shape
        beyond = np.maximum(-at, at - [w - 1, h - 1]).max(initial=0)
        pad = int(np.ceil(beyond)) + 2
        distance = distance_inside(~np.pad(self.inside, pad))
        dy, dx = np.gradient(cv2.GaussianBlur(distance, (0, 0), 1.0))
        direction = bilinear(np.stack([dx, dy], -1), at + pad)
        length = np.linalg.norm(direction, axis=1, keepdims=True)
        return np.where(length > 1e-6, direction / np.maximum(length, 1e-6), [0.0, -1.0])


def lower_hull(x: F64, y: F64) -> list[int]:
    """Indices of the corners of the hull of (x, y) on the side of large y; x ascending."""
    hull: list[int] = []
    for k in range(len(x)):
        while len(hull) >= 2:
            a, b = hull[-2], hull[-1]
            cross = (x[b] - x[a]) * (y[k] - y[a]) - (y[b] - y[a]) * (x[k] - x[a])
            if cross < 0:
                break
            hull.pop()
        hull.append(k)
    return hull


def _reduced(crop: Mask, cell: float, goes_down: bool, goes_right: bool) -> Mask:
    """The crop (H, W) on cells (h, w) of `cell` px; never empty.

    The frame may cut the last cells, which are no less inside for that where the object goes on.
    """
    grid = tuple(int(np.ceil(n / cell)) for n in crop.shape)
    step = max(1, int(cell / FINENESS))
    size = [(round(n * cell) + 1 + step - 1) // step for n in grid]
    padded = np.zeros((size[0] * step, size[1] * step), np.uint8)
    np.multiply(crop, 255, out=padded[: crop.shape[0], : crop.shape[1]], dtype=np.uint8)
    if goes_down:
        padded[crop.shape[0] :] = padded[crop.shape[0] - 1]
    if goes_right:
        padded[:, crop.shape[1] :] = padded[:, crop.shape[1] - 1 : crop.shape[1]]
    blocks = cv2.resize(padded, (size[1], size[0]), interpolation=cv2.INTER_AREA)
    whole = np.asarray(blocks, np.float32) * np.float32(1 / 255)
    if cell > 1.0:
        # A block has averaged a little already.
        spread = np.sqrt((SMOOTHING * cell) ** 2 - (step**2 - 1) / 12) / step
        whole = cv2.GaussianBlur(whole, (0, 0), float(spread))
    cell /= step
    warp = np.array([[1, 0, 0.5], [0, 1, 0.5]]) / cell - [0, 0, 0.5]
    inside = cv2.warpAffine(whole, warp, (grid[1], grid[0]), flags=cv2.INTER_LINEAR) > 0.5
    return inside if inside.any() else np.ones(grid, bool)


@numba.njit(cache=True)
def is_covered(depth, i, j):
    """Whether the disc about a cell, as large as fits, lies in a neighbour's but for a sliver."""
    height, width = depth.shape
    for a in range(max(i - 1, 0), min(i + 2, height)):
        for b in range(max(j - 1, 0), min(j + 2, width)):
            away = np.sqrt((a - i) ** 2 + (b - j) ** 2)
            if away > 0 and depth[a, b] - depth[i, j] >= STEEP * away:
                return True
    return False


@numba.njit(cache=True)
def largest_disc(depth):
    """(h, w) the largest radius of a disc in the silhouette that covers a cell; `depth` cells."""
    height, width = depth.shape
    largest = depth.copy()
    for i in range(height):
        for j in range(width):
            r = depth[i, j]
            if r <= 0 or is_covered(depth, i, j):
                continue
            reach = int(r)
            for a in range(max(i - reach, 0), min(i + reach + 1, height)):
                rest = r * r - (a - i) ** 2
                half = math.ceil(math.sqrt(max(rest, 0.0)))
                while half >= 0 and half * half >= rest:  # as far as cells are nearer than r
                    half -= 1
                for b in range(max(j - half, 0), min(j + half + 1, width)):
                    largest[a, b] = max(largest[a, b], r)
    return largest


# The fringe of a cut-out, in which hairs, blur and light from behind mix with its own colours.
#
# What turns into view there is as what is farther in. A bright tip of a hair, drawn out over a
# whole side, looks like nothing.

LONGEST = 400  # px, longer side of the picture in which its width is found
MIXED = 0.03, 0.97  # alpha of what is soft
CRISP = (
    1.0  # px of that, across an edge as crisp as any: of drawn solids 0.7 to 1, of photos 4 to 8
)
DEEP = 2.5  # x what is soft beyond that
LIT, LIGHTER = 8.0, 1.05  # x that, as light from behind reaches farther in; x what lies inside it
AROUND = 0.03  # x the root of the area, along the outline: what is as wide
MOST = 0.08  # x the root of the area
OF_RADIUS, THIN = 0.35, 2.0  # x the radius of a limb, at most; px, of what is as thin as a hair


def inwardness(alpha: F32, colors: F32) -> F32:
    """(h, w) how far a pixel of a matte `alpha` (h, w) is inside its fringe: 0 at the outline.

    From 1 on it shows the object's own `colors` (h, w, 3). A fringe that is lighter than what lies
    inside it is lit from behind, and deeper; a dark one is the object's own.
    """
    scale = min(1.0, LONGEST / max(alpha.shape))
    size = max(1, round(alpha.shape[1] * scale)), max(1, round(alpha.shape[0] * scale))
    small = np.asarray(cv2.resize(alpha, size, interpolation=cv2.INTER_AREA), np.float32)
    solid = np.pad((small > 0.5).astype(np.uint8), 1)
    root = float(np.sqrt(solid.sum()))
    if root == 0:
        return np.ones(alpha.shape, np.float32)
    away = cv2.distanceTransform(solid, cv2.DIST_L2, 5)[1:-1, 1:-1].astype(np.float64)
    soft = ((small > MIXED[0]) & (small < MIXED[1])).astype(np.float32)
    edge = cv2.morphologyEx(solid[1:-1, 1:-1], cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    area, length = (
        cv2.GaussianBlur(part, (0, 0), AROUND * root)
        for part in (soft, 0.5 * edge.astype(np.float32))  # both sides of an edge are in it
    )
    softness = area / np.maximum(length, 1e-3) - CRISP
    most = np.minimum(np.maximum(OF_RADIUS * largest_disc(away), THIN), MOST * root)
    lit = np.clip(LIT * softness, 1e-3, most)
    light = cv2.resize(colors.mean(-1), size, interpolation=cv2.INTER_AREA)
    fringe, inner = (away > DEEP / LIT * lit) & (away < lit), (away > lit) & (away < 2 * lit)
    is_lit = fringe.any() and inner.any() and light[fringe].mean() > LIGHTER * light[inner].mean()
    deep = lit if is_lit else np.clip(DEEP * softness, 1e-3, most)
    inward = (away / deep).clip(0, 1).astype(np.float32)
    return np.asarray(cv2.resize(inward, alpha.shape[::-1]), np.float32)


# Of hair an outline that was drawn around it holds more than what is solid.

SOLID = 0.9  # share of what is near, within the outline, that the matte covers where it is solid
HOLLOW = 0.2  # of what is not, at least, is less than half covered: what is drawn never is
LEAST = 12.0  # x the band squared: area of that
OFF = 3.0  # x the band, that it is deep somewhere: elsewhere an edge is never so far off
BESIDE = 2.0  # x the band, around what is not: strands there are none of the body
PIECE = 0.05  # of the largest piece, at least, else it is a lock of hair
FINE = 6.0  # px of a band, at least, in a smaller picture of what is large


def solid_part(mask: Mask, matte: Matte) -> Mask:
    """`mask` (H, W) without what is hair and the gaps in it: the brim carries it, see `spread`.

    An edge no farther off than masks are, and a limb however thin, stay as they are; the same array
    where there is nothing else.
    """
    band = band_width(mask.shape[1], mask.shape[0])
    if not is_large(mask, band):
        return mask
    box = box_of(mask, int(3 * band) + 2)
    window = np.s_[box[1] : box[3], box[0] : box[2]]
    part, alpha = mask[window], crop(matte.alpha, matte.box, box)
    times = max(int(band / FINE), 1)
    hair = _hair(reduced_mask(part, times), reduced(alpha, times), band / times)
    if hair is None:
        return mask
    height, width = (times * side for side in hair.shape)
    hair = cv2.resize(hair.astype(np.float32), (width, height))[: len(part), : part.shape[1]] > 0.5
    solid = np.zeros_like(mask)
    solid[window] = part & ~hair
    return solid if solid.any() else mask


def _hair(part: Mask, alpha: F32, band: float) -> Mask | None:
    """Where `part` (h, w) of a matte `alpha` (h, w) is hair and gaps in it; None: nowhere."""
    spot = disc(int(np.ceil(band)))
    share, whole = (
        cv2.GaussianBlur(field.astype(np.float32), (0, 0), band) for field in (part * alpha, part)
    )
    gaps = _opened(part & (share < SOLID * whole), spot)
    pieces, area = _pieces(gaps)
    away = cv2.distanceTransform(part.astype(np.uint8), cv2.DIST_L2, 5)
    deep = _pieces_in(pieces, away > OFF * band) > 0
    is_gap = deep & (_pieces_in(pieces, alpha < 0.5) > HOLLOW * area) & (area > LEAST * band**2)
    gaps = is_gap[pieces]
    if not gaps.any():
        return None
    near = dilated(gaps, int(np.ceil(BESIDE * band)))
    rest = part & ~gaps
    rest &= ~near | _opened(rest, spot)
    pieces, area = _pieces(rest)
    kept = (area >= PIECE * area.max()) | (_pieces_in(pieces, near) == 0)
    kept[0] = False
    return part & ~kept[pieces]


def _opened(mask: Mask, spot: U8) -> Mask:
    return cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_OPEN, spot).view(np.bool_)


def _pieces(mask: Mask) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (h, w) of the pieces of `mask` (h, w), 0 outside, and the px of each, of 0 none."""
    count, pieces = cv2.connectedComponents(mask.view(np.uint8))
    area = np.bincount(pieces.ravel(), minlength=count)
    area[0] = 0
    return np.asarray(pieces), area


def _pieces_in(pieces: np.ndarray, where: Mask) -> np.ndarray:
    """How many px of each of the `pieces` (h, w) are `where` (h, w); of 0 none."""
    found = np.bincount(pieces[where], minlength=int(pieces.max()) + 1)
    found[0] = 0
    return found
