"""What lies behind a part of the object and before another: backs, and fronts beneath."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from ...base.arrays import F64, I64, Mask
from ...base.distances import nearest_in
from .cuts import LEAST_JUMP, Cuts

GAP = 0.03  # x extent of air between two parts, from which the nearer has a back of its own
LEAST_CELLS = 24  # of such a part
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
    kept = np.asarray(stats)[:, cv2.CC_STAT_AREA] >= LEAST_CELLS
    kept[0] = False
    return kept[np.asarray(found, np.int64)]
