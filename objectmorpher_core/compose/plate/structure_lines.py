"""Straight edges that enter a hole on two sides, and so go on behind it.

A segment that ends at the hole and points into it is matched with one on the other side that lies
on the same line between the same two colours. What is beside such a line, inside the hole, comes
from beside the same line outside it (structure before texture, as Sun et al. 2005, "Image
Completion with Structure Propagation", but found, not drawn).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask

BAND = 4.0  # px on either side of a line that belong to it
LEAST_LENGTH = 9.0  # px of a segment
LEAST_PICTURE = 24  # px, less has no such lines
REACH = 5.0  # px between a segment's end and the hole
MOST_TURN = np.radians(7)  # between two ends of one line
MOST_SHIFT = 0.06  # x the gap: how far one end lies beside the other's line
MOST_UNLIKE = 45.0  # levels of 255 between the colours on the same side of two ends
LEAST_CONTRAST = 14.0  # levels of 255 between a line's two sides
LEAST_HIDDEN = 0.7  # share of the way between the ends that the hole covers
LEAST_SEEN = 0.35  # x the gap, of a line outside the hole on either side: gravel has short ones
MOST_LINES = 30
BESIDE = 2.5  # px from a line, where its sides' colours are read


@dataclass(frozen=True, eq=False)
class Line:
    """A line behind the hole: from `tails[0]` over `tips[0]` to `tips[1]` and `tails[1]`."""

    tips: tuple[F64, F64]  # (2,) x, y px, where it enters the hole and leaves it
    tails: tuple[F64, F64]  # (2,) how far it is seen outside


@dataclass(frozen=True, eq=False)
class _End:
    """A segment that ends at the hole."""

    tip: F64  # (2,) x, y px, the end at the hole
    tail: F64  # (2,) the other one
    into: F64  # (2,) unit, from the tail to the tip
    sides: F64  # (2, 3) colours on its left and its right, looking into the hole

    @property
    def length(self) -> float:
        return float(np.hypot(*(self.tip - self.tail)))

    @property
    def contrast(self) -> float:
        return float(np.abs(self.sides[0] - self.sides[1]).max())


def find_lines(rgb: F32, hole: Mask) -> tuple[Line, ...]:
    """The lines of a picture (h, w, 3) of levels up to 255 that go on behind its hole (h, w).

    What `rgb` is in the hole must be smooth and meet what is around it, or its rim is an edge.
    """
    pairs = _pairs(_ends(rgb, hole), hole)
    return tuple(Line((a.tip, b.tip), (a.tail, b.tail)) for a, b in pairs)


def draw_lines(lines: tuple[Line, ...], scale: tuple[float, float], hole: Mask) -> tuple[F32, F32]:
    """Return the lines that the hole (h, w) wants and those offered outside, both (h, w, 3).

    Channels 0 and 1 are a line's number and the signed px beside it; see `patch_search`. `scale`:
    px across and down per px of the lines.
    """
    wanted, offered = np.zeros((*hole.shape, 3), np.float32), np.zeros((*hole.shape, 3), np.float32)
    for number, line in enumerate(lines, start=1):
        (tip, other), (tail, far) = (
            tuple(np.asarray(point) * scale for point in ends) for ends in (line.tips, line.tails)
        )
        _draw(wanted, hole, number, (tip, other))
        _draw(offered, ~hole, number, (tail, tip))
        _draw(offered, ~hole, number, (other, far))
    return wanted, offered


def _ends(rgb: F32, hole: Mask) -> list[_End]:
    """The segments that point into the hole."""
    if min(hole.shape) < LEAST_PICTURE:
        return []
    grey = cv2.cvtColor(np.clip(rgb, 0, 255).astype(np.uint8), cv2.COLOR_RGB2GRAY)
    least = round(LEAST_LENGTH)
    detector = cv2.ximgproc.createFastLineDetector(least, 1.41421356, 30.0, 80.0, 3, False)
    segments = detector.detect(grey)
    if segments is None:
        return []
    away = np.asarray(cv2.distanceTransform((~hole).astype(np.uint8), cv2.DIST_L2, 5), np.float32)
    ends = []
    for segment in np.asarray(segments, np.float64).reshape(-1, 2, 2):
        for tip, tail in _outside(segment, away):
            end = _end(tip, tail, rgb, away)
            if end is not None:
                ends.append(end)
    return ends


def _outside(segment: F64, away: F32) -> list[tuple[F64, F64]]:
    """Tip and tail, either way, of the longest part of a segment (2, 2) outside the hole.

    A smooth guess has the edge's beginning, so that a segment may reach into the hole.
    """
    count = max(round(float(np.hypot(*(segment[1] - segment[0])))), 1) + 1
    points = segment[0] + np.linspace(0, 1, count)[:, None] * (segment[1] - segment[0])
    is_out = np.concatenate([[False], [_at(away, point) > 1 for point in points], [False]])
    changes = np.flatnonzero(np.diff(is_out.astype(int))).reshape(-1, 2)
    if not len(changes):
        return []
    first, end = changes[np.argmax(changes[:, 1] - changes[:, 0])]
    start, stop = points[first], points[end - 1]
    return [(start, stop), (stop, start)]


def _end(tip: F64, tail: F64, rgb: F32, away: F32) -> _End | None:
    """The end of a segment, if it is at the hole, outside it and points into it."""
    length = float(np.hypot(*(tip - tail)))
    if length < LEAST_LENGTH or _at(away, tip) > REACH or _at(away, tail) < LEAST_LENGTH / 2:
        return None
    into = (tip - tail) / length
    if _at(away, tip + into * (REACH + 2)) > 0:
        return None
    left = np.array([into[1], -into[0]]) * BESIDE
    middles = tip - into * np.linspace(1.5, min(length, 12.0), 8)[:, None]
    outside = [m for m in middles if _at(away, m) > 1]
    if len(outside) < 3:
        return None
    sides = [np.mean([_at(rgb, m + side) for m in outside], 0) for side in (left, -left)]
    end = _End(tip, tail, into, np.array(sides, np.float64))
    return end if end.contrast >= LEAST_CONTRAST else None


def _pairs(ends: list[_End], hole: Mask) -> list[tuple[_End, _End]]:
    """Ends that continue each other, the likeliest first; each at most once."""
    rated = []
    for one, other in combinations(range(len(ends)), 2):
        cost = _cost(ends[one], ends[other], hole)
        if cost < 1:
            rated.append((cost, one, other))
    taken: set[int] = set()
    found = []
    for _, one, other in sorted(rated):
        if not {one, other} & taken and len(found) < MOST_LINES:
            taken |= {one, other}
            found.append((ends[one], ends[other]))
    return found


def _cost(one: _End, other: _End, hole: Mask) -> float:
    """How little two ends look like one line: from 1 on they are none."""
    gap = other.tip - one.tip
    length = float(np.hypot(*gap))
    if min(one.length, other.length) < LEAST_SEEN * length:
        return np.inf
    if length < 2 * REACH or one.into @ other.into > -np.cos(2 * MOST_TURN):
        return np.inf
    turn = max(_angle(one.into, gap), _angle(other.into, -gap)) / MOST_TURN
    shift = max(abs(_cross(one.into, gap)), abs(_cross(other.into, gap)))
    shift /= MOST_SHIFT * length + 1.5
    unlike = np.abs(one.sides - other.sides[::-1]).mean(1).max() / MOST_UNLIKE
    way = one.tip + gap * np.linspace(0, 1, 32)[:, None]
    hidden = np.mean([_at(hole, point) for point in way])
    if hidden < LEAST_HIDDEN or max(min(turn, 2 * shift), shift, unlike) >= 1:
        return np.inf
    return float((shift + unlike) / 2)


def _draw(image: F32, allowed: Mask, number: int, way: tuple[F64, F64]) -> None:
    """Marks the band along a way of `image` (h, w, 3) where it is `allowed`, in place."""
    start, along = way[0], way[1] - way[0]
    length = float(np.hypot(*along))
    if length < 1e-6:
        return
    along = along / length
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    far = (x - start[0]) * along[0] + (y - start[1]) * along[1]
    beside = along[0] * (y - start[1]) - along[1] * (x - start[0])
    is_near = (np.abs(beside) <= BAND) & (far > -2) & (far < length + 2) & allowed
    is_near &= image[..., 0] == 0
    image[is_near, 0] = number
    image[is_near, 1] = beside[is_near]


def _angle(one: F64, other: F64) -> float:
    return float(np.arctan2(abs(_cross(one, other)), one @ other))


def _cross(one: F64, other: F64) -> float:
    return float(one[0] * other[1] - one[1] * other[0])


def _at(image: np.ndarray, xy: F64) -> np.ndarray:
    """The pixel nearest to (x, y); that at the border outside."""
    height, width = image.shape[:2]
    x, y = np.rint(xy).astype(int)
    return image[min(max(y, 0), height - 1), min(max(x, 0), width - 1)]
