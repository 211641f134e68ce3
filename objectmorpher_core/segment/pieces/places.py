"""Where pieces lie: how far they reach, and how deep in them a place is."""

from __future__ import annotations

import cv2
import numpy as np

from ...base.arrays import F32, Mask
from ...document.model import Click
from .pieces import Pieces

OFF_CENTRE = 0.05  # least that counts for being in the middle


def centred(pieces: Pieces, mask: Mask, click: Click) -> float:
    """How near a click is to the middle of pieces (n,): its depth in them over the greatest."""
    deep = depth(pieces.paint_sparsely(mask))
    column, row = (c // 2 for c in pieces.pixel(click.x, click.y))
    near = deep[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
    here = near.max() if near.size else 0.0
    return max(float(here / max(deep.max(), 1e-6)), OFF_CENTRE)


def depth(mask: Mask) -> F32:
    """(h, w) px to the edge of a mask; the frame is one."""
    framed = cv2.copyMakeBorder(mask.view(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    return np.asarray(cv2.distanceTransform(framed, cv2.DIST_L2, 3)[1:-1, 1:-1], np.float32)


def only(pieces: Pieces, piece: int) -> Mask:
    alone = np.zeros(pieces.count, bool)
    alone[piece] = True
    return alone


def extent(pieces: Pieces, mask: Mask) -> tuple[int, int, int, int]:
    """left, top, right, bottom px of the reduced photo that pieces (n,) reach."""
    painted = pieces.paint(mask)
    rows, columns = np.flatnonzero(painted.any(1)), np.flatnonzero(painted.any(0))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
