"""A round brush with a soft edge: what a stroke of it covers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import F32

Box = tuple[int, int, int, int]  # x0, y0, x1, y1 px
EDGE = 0.5  # px: the edge of the hardest brush is a pixel wide


@dataclass(frozen=True)
class Brush:
    """Its size and edge."""

    radius: float = 20.0  # px of the photo, > 0
    hardness: float = 0.8  # share of the radius that covers fully, in [0, 1]

    def coverage(self, distance: np.ndarray) -> F32:
        """Return the coverage in [0, 1] at these distances, px, from the middle: smooth."""
        inner = min(self.hardness * self.radius, self.radius - EDGE)
        outer = self.radius + EDGE
        share = np.clip((outer - distance) / (outer - inner), 0, 1)
        return (share * share * (3 - 2 * share)).astype(np.float32)


class Stroke:
    """The coverage of a brush on a picture since it was put down."""

    def __init__(self, size: tuple[int, int], brush: Brush) -> None:
        """`size`: (width, height) px of the picture."""
        self.coverage: F32 = np.zeros((size[1], size[0]), np.float32)
        self.box: Box | None = None  # around all of it that is covered
        self._brush = brush
        self._last: tuple[float, float] | None = None

    def move_to(self, x: float, y: float) -> Box:
        """Covers the way from the last place to (x, y) px; returns the box that changed."""
        x0, y0 = self._last or (x, y)
        self._last = (x, y)
        height, width = self.coverage.shape
        reach = self._brush.radius + EDGE + 1
        left, right = np.clip((min(x0, x) - reach, max(x0, x) + reach), 0, width).astype(int)
        top, bottom = np.clip((min(y0, y) - reach, max(y0, y) + reach), 0, height).astype(int)
        part = self.coverage[top:bottom, left:right]
        if part.size:
            gap = _gap_to_segment((x0, y0), (x, y), (left, top, right, bottom))
            np.maximum(part, self._brush.coverage(gap), out=part)
        box = (int(left), int(top), int(right), int(bottom))
        self.box = box if self.box is None else _around(self.box, box)
        return box


def _gap_to_segment(a: tuple[float, float], b: tuple[float, float], box: Box) -> F32:
    """(h, w) px from the middles of a box's pixels to the segment from a to b."""
    x0, y0, x1, y1 = box
    x = np.arange(x0, x1, dtype=np.float32)[None] + np.float32(0.5 - a[0])
    y = np.arange(y0, y1, dtype=np.float32)[:, None] + np.float32(0.5 - a[1])
    dx, dy = np.float32(b[0] - a[0]), np.float32(b[1] - a[1])
    along = np.clip((x * dx + y * dy) / max(dx * dx + dy * dy, np.float32(1e-12)), 0, 1)
    return np.hypot(x - along * dx, y - along * dy)


def _around(a: Box, b: Box) -> Box:
    return min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3])
