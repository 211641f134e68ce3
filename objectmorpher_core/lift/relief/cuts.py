"""Where a surface is cut: a near part ends there, and what lies behind it goes on beneath."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F64, Mask
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
    """Where a front (h, w) px falls off beside likely edges (h, w); None where it does nowhere.

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
