"""Cuts in a surface: a near part ends there, and what lies behind it continues beneath."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from ...base.arrays import F64, I64, Mask
from ...base.poisson_disk import nearest_in
from .integration import CLOSE, ROUNDS, solved

STEEP = 1.5  # height per length across, from which a front may be cut
LEAST_JUMP = 0.02  # x extent, over which a cut falls
REACH = 3  # cells to both sides, over which a blurred jump is looked for
LIKELY = 0.35  # probability of an edge, beside which a jump is one
LEAST_CELLS = 6  # of an edge
HELD, FREE = 100.0, 1e-4  # weight of what a field says, beyond reach of a cut; near it, x that


@dataclass(frozen=True, eq=False)
class Cuts:
    """Pairs of neighbouring cells of a grid (h, w) between which the surface is not one."""

    down: Mask  # (h - 1, w) between a cell and the one below
    right: Mask  # (h, w - 1) between a cell and the one to its right

    def gradient(self, field: F64) -> tuple[F64, F64]:
        """(h, w) each, what `field` (h, w) grows by down and right; never across a cut."""
        return _grown(field, self.down), _grown(field.T, self.right.T).T

    def settled(self, grid_xy: F64) -> F64:
        """Grid coordinates (N, 2), those at the nearest cell that have a cut between their four."""
        down, right = self.down, self.right
        splits = down[:, :-1] | down[:, 1:] | right[:-1] | right[1:]  # squares between cells
        j, i = np.floor(grid_xy).astype(int).T
        is_split = splits[np.clip(i, 0, len(splits) - 1), np.clip(j, 0, splits.shape[1] - 1)]
        return np.where(is_split[:, None], np.rint(grid_xy), grid_xy)

    def sharpened(self, field: F64, inside: Mask) -> F64:
        """`field` (h, w) that was blurred across cuts: what is near them as it is farther away."""
        near = cv2.dilate(self.beside().astype(np.uint8), np.ones((2 * REACH + 1,) * 2)) > 0
        held = np.where(near, FREE, 1.0)
        down = (inside[1:] & inside[:-1] & ~self.down).astype(np.float64)
        right = (inside[:, 1:] & inside[:, :-1] & ~self.right).astype(np.float64)
        none = np.zeros(field.shape)
        weights = np.pad(down, ((0, 1), (0, 0))), np.pad(right, ((0, 0), (0, 1)))
        start = np.ascontiguousarray(field)  # the kernel is compiled for that
        change = solved(start, HELD * held, none, none, *weights, ROUNDS, CLOSE)
        return np.where(near & inside, field + change, field)

    def beside(self) -> Mask:
        """(h, w) the cells at cuts."""
        found = np.zeros((self.right.shape[0], self.down.shape[1]), bool)
        found[:-1] |= self.down
        found[1:] |= self.down
        found[:, :-1] |= self.right
        found[:, 1:] |= self.right
        return found


def find_cuts(front: F64, edge: F64, inside: Mask, cell: float, extent: float) -> Cuts | None:
    """Find where a front (h, w) px falls off beside likely edges (h, w); None for nowhere.

    Of a jump that is blurred over several cells the steepest place is the cut, as in edge
    detection (Canny 1986).
    """
    smooth = cv2.GaussianBlur(np.where(inside, front, 0.0), (0, 0), 0.7)
    weight = cv2.GaussianBlur(inside.astype(np.float64), (0, 0), 0.7)
    smooth = np.where(inside, smooth / np.maximum(weight, 1e-6), 0.0)
    likely = cv2.dilate((edge > LIKELY).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    down = _steepest(smooth, inside, likely, cell, extent)
    right = _steepest(smooth.T, inside.T, likely.T, cell, extent).T
    if int(down.sum() + right.sum()) < LEAST_CELLS:
        return None
    return Cuts(down, right)


def _steepest(front: F64, inside: Mask, likely: Mask, cell: float, extent: float) -> Mask:
    """(h - 1, w) steps down a column that are the steepest within REACH, and fall far enough."""
    step = np.where(inside[1:] & inside[:-1], front[1:] - front[:-1], 0.0)
    size = np.abs(step)
    kernel = np.ones((2 * REACH + 1, 1), np.uint8)
    is_top = size >= cv2.dilate(size, kernel) - 1e-12
    fall = np.abs(cv2.blur(step, (1, 2 * REACH + 1), borderType=cv2.BORDER_CONSTANT))
    fall *= 2 * REACH + 1
    is_edge = likely[1:] | likely[:-1]
    return is_top & is_edge & (size > STEEP * cell) & (fall > LEAST_JUMP * extent)


def _grown(field: F64, cut: Mask) -> F64:
    """(h, w) what `field` (h, w) grows by down; `cut` (h - 1, w) steps do not count."""
    step = field[1:] - field[:-1]
    total, count = np.zeros(field.shape), np.zeros(field.shape)
    for there in (slice(None, -1), slice(1, None)):
        total[there] += np.where(cut, 0.0, step)
        count[there] += ~cut
    return total / np.maximum(count, 1)


# What lies behind a part of the object and before another: backs, and fronts beneath.

GAP = 0.03  # x extent of air between two parts, from which the nearer has a back of its own
LEAST_PART_CELLS = 24  # of such a part
CLEAR = 2.0  # cells from a cut, nearer to which colours are mixed with the other side's
SMOOTH = 1.5  # cells


class Walls(NamedTuple):
    """Stretches of cuts, each between a near cell and a far one, side by side."""

    near: I64  # (n, 2) column and row
    step: I64  # (n, 2) to the far cell
    top: F64  # (n,) px, height of the near front
    foot: F64  # (n,) px, where that part ends or the far front begins


@dataclass(frozen=True, eq=False)
class Overlaps:
    """Fields (h, w) over a silhouette's cells; heights are px."""

    walls: Walls
    own_back: F64  # of the part that is seen
    beneath: F64  # of the front that goes on behind it, hidden from the photo
    beside: I64  # (h, w, 2) column and row of a cell that has the colours of that
    is_apart: Mask  # where there is air between the two
    own_beside: I64 | None = None  # (h, w, 2) likewise of the own back; None: those that hide it

    def known(self, behind: Behind) -> Overlaps:
        """Return these with what a shape says is behind it, and nothing else."""
        is_known = np.isfinite(behind.front)
        rows, columns = np.divmod(nearest_in(is_known), is_known.shape[1])
        # Beyond it the sheets go on, so that they do not bend at its end.
        return replace(
            self,
            own_back=behind.own_back[rows, columns],
            beneath=behind.front[rows, columns],
            beside=behind.beside,
            is_apart=is_known,
            own_beside=behind.own_beside,
        )


class Behind(NamedTuple):
    """Fields (h, w) of what a shape hides from the photo of itself; NaN where it hides nothing."""

    own_back: F64  # px, of the part that is seen
    front: F64  # px, of the next part
    own_beside: I64  # (h, w, 2) column and row of a cell that has the colours of the own back
    beside: I64  # likewise of the next part
    stands: Mask  # where a part ends before the next one
    seen_beside: I64  # likewise of what is seen, from where that is its own and clear


def overlaps_of(
    front: F64, back: F64, thickness: F64, cuts: Cuts, inside: Mask, extent: float
) -> Overlaps:
    """`thickness` (h, w) px of the part that is seen, beneath its `front` (h, w)."""
    own_back = np.maximum(front - thickness, back)
    walls = _walls(front, own_back, cuts, LEAST_JUMP * extent)
    far = np.zeros(inside.shape, bool)
    far[walls.near[:, 1] + walls.step[:, 1], walls.near[:, 0] + walls.step[:, 0]] = True
    nearest = nearest_in(far & inside)
    rows, columns = np.divmod(nearest, inside.shape[1])
    smooth = cv2.GaussianBlur(front[rows, columns], (0, 0), SMOOTH)
    beneath = np.asarray(smooth, np.float64)
    clear = cv2.distanceTransform((~cuts.beside()).astype(np.uint8), cv2.DIST_L2, 3) >= CLEAR
    is_farther = front - beneath < GAP * extent  # the far side of a cut
    source = clear & inside & is_farther
    if source.any():
        nearest = nearest_in(source).ravel()[nearest]
    beside = np.stack(np.divmod(nearest, inside.shape[1])[::-1], -1)
    is_apart = inside & (own_back - np.maximum(beneath, back) > GAP * extent)
    return Overlaps(walls, own_back, beneath, beside, _large(is_apart))


def _walls(front: F64, own_back: F64, cuts: Cuts, least: float) -> Walls:
    """Where the front falls by at least so many px."""
    nears, steps = [], []
    for is_cut, step in ((cuts.down, (0, 1)), (cuts.right, (1, 0))):
        rows, columns = np.nonzero(is_cut)
        first = np.column_stack([columns, rows])
        second = first + step
        is_first = front[rows, columns] > front[second[:, 1], second[:, 0]]
        near = np.where(is_first[:, None], first, second)
        nears.append(near)
        steps.append(np.where(is_first[:, None], second, first) - near)
    near, step = np.concatenate(nears), np.concatenate(steps)
    beyond = near + step
    fall = front[near[:, 1], near[:, 0]] - front[beyond[:, 1], beyond[:, 0]]
    near, step, beyond = near[fall >= least], step[fall >= least], beyond[fall >= least]
    top = front[near[:, 1], near[:, 0]]
    foot = np.maximum(own_back[near[:, 1], near[:, 0]], front[beyond[:, 1], beyond[:, 0]])
    return Walls(near, step, top, np.minimum(foot, top))


def _large(mask: Mask) -> Mask:
    """Without specks."""
    _, found, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    kept = np.asarray(stats)[:, cv2.CC_STAT_AREA] >= LEAST_PART_CELLS
    kept[0] = False
    return kept[np.asarray(found, np.int64)]
