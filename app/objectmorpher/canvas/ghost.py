"""The outline that an object had before the stroke in progress, to compare with."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32

from .memo import Memo

if TYPE_CHECKING:
    from ..editor.state import EditorState

CELLS = 160.0  # along the longer side of the grid on which the outline is followed
GAP = 2.0  # cells between points that are of one silhouette

_outlines = Memo(1)


def ghost(editor: EditorState) -> tuple[F32, ...]:
    """Outlines, (N, 2) image px each, of the current object where it was; none if it is there."""
    before, now, k = editor.committed, editor.preview, editor.current
    if before is None or now is None or k >= len(before.objects):
        return ()
    was, item = before.objects[k], now.objects[k]
    if was.lifted is None or was.placement == item.placement:
        return ()
    splats = editor.derived.posed(before, k)
    is_solid = splats.rest.lifted.texture.solidity > 0.5
    camera = before.photo.camera

    def build() -> tuple[F32, ...]:
        means = splats.means[is_solid if is_solid.any() else slice(None)]
        places = camera.project(means[means[:, 2] > 0])
        is_seen = ((places >= 0) & (places <= before.photo.size)).all(1)
        return _silhouette(places[is_seen])

    return _outlines(build, splats)


def _silhouette(places: np.ndarray) -> tuple[F32, ...]:
    """The outlines of points (N, 2) image px that lie close."""
    if len(places) == 0:
        return ()
    low = places.min(0)
    cell = max(float(np.ptp(places, axis=0).max()) / CELLS, 1e-6)
    margin = int(2 * GAP) + 1
    at = np.round((places - low) / cell).astype(int) + margin
    grid = np.zeros((at[:, 1].max() + margin + 1, at[:, 0].max() + margin + 1), np.uint8)
    grid[at[:, 1], at[:, 0]] = 255
    side = int(2 * GAP) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    filled = cv2.morphologyEx(grid, cv2.MORPH_CLOSE, kernel)
    found = cv2.findContours(filled, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    lines = [((line[:, 0] - margin) * cell + low).astype(np.float32) for line in found]
    return tuple(line for line in lines if len(line) > side * 3)
