"""A stroke of a brush on a selection, as it is seen while it is painted.

Soft strokes lie over each other: c + b (1 - c) adds what the brush covers, c (1 - b) takes it away.
"""

from __future__ import annotations

import numpy as np

from ..arrays import U8, Selection
from ..brush import EDGE, Box, Brush, Stroke
from .mask_edit import FULL, as_coverage, is_selected


class MaskPainting:
    """One stroke. `shown` is changed in place: a large photo has no time for a copy each frame."""

    def __init__(
        self, size: tuple[int, int], selection: Selection | None, brush: Brush, is_erasing: bool
    ) -> None:
        """`size`: (width, height) px of the photo; a selection of None is empty."""
        nothing = np.zeros((size[1], size[0]), np.bool_)
        self._before = as_coverage(nothing if selection is None else selection)
        self.shown: U8 = self._before.copy()
        self.touched: list[Box] = []  # what each move changed
        # Nothing is drawn soft by an edge of a pixel: there the photo is asked.
        self._is_hard = (1 - brush.hardness) * brush.radius <= 2 * EDGE
        self._is_bool = self._is_hard and (selection is None or selection.dtype == np.bool_)
        self.is_erasing = is_erasing
        self._stroke = Stroke(size, brush)

    def move_to(self, x: float, y: float) -> None:
        """Paints the way from the last place to (x, y) px of the photo."""
        box = x0, y0, x1, y1 = self._stroke.move_to(x, y)
        if x0 >= x1 or y0 >= y1:
            return
        part = np.s_[y0:y1, x0:x1]
        brush, before = self._stroke.coverage[part], self._before[part]
        if self._is_hard:
            brush = (brush >= 0.5).astype(np.float32)
        after = before * (1 - brush) if self.is_erasing else before + (FULL - before) * brush
        self.shown[part] = (after + 0.5).astype(np.uint8)
        self.touched.append(box)

    def selection(self) -> Selection:
        """What is selected now (H, W); it must not be painted on after that."""
        return is_selected(self.shown) if self._is_bool else self.shown
