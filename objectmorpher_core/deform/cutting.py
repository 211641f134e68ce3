"""The two sides of a cut that is drawn across an object's picture."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..base.arrays import F64, I32


def sides_of_cut(pairs: np.ndarray, picture: F64, stroke: F64) -> tuple[I32, I32]:
    """The control points left and right of a cut; both empty where it crosses no link.

    `pairs` (L, 2) are the links, `picture` (M, 2) px where the control points are seen, `stroke`
    (S, 2) px the line that was drawn. The cut goes right through the object: every link whose
    picture crosses the line is cut, on its near side and on its far side.
    """
    votes = np.zeros(len(picture))
    a, b = picture[pairs[:, 0]], picture[pairs[:, 1]]
    for start, end in pairwise(stroke):
        along = end - start
        if not along.any():
            continue
        side_a, side_b = _cross(along, a - start), _cross(along, b - start)
        link = b - a
        apart = _cross(link, start - a) * _cross(link, end - a) < 0
        crossed = apart & (side_a * side_b < 0)
        np.add.at(votes, pairs[crossed, 0], np.sign(side_a[crossed]))
        np.add.at(votes, pairs[crossed, 1], np.sign(side_b[crossed]))
    return np.flatnonzero(votes < 0).astype(np.int32), np.flatnonzero(votes > 0).astype(np.int32)


def _cross(a: np.ndarray, b: np.ndarray) -> F64:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
