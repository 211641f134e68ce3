"""Changes of a selection as a whole: its edge, its holes, its inside and outside, corrections.

A selection is a mask (H, W) bool or, where an artist made it soft, a coverage (H, W) u8, 255 for
fully selected. Every change takes either and gives the same kind, and a coverage's mask (what is
at least half covered) changes as the mask alone would: is_selected(grow(c)) = grow(is_selected(c)).
The photo's frame is no edge: what is cut by it neither shrinks nor softens there.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..base.arrays import U8, Mask, Selection
from ..base.brush import EDGE, Box, Brush, Stroke
from ..document.model import SELECTED as HALF
from ..document.model import EditObject, Prompt
from .selection import box_around

FULL = 255
FINE = 4  # bits of a px that corners are given to
EXACT = 1e-4  # px, rounding of distances
LARGEST_SMOOTHING = 127.0  # px; what OpenCV's median takes
ISLAND = 0.02  # x the largest piece: what is smaller is an island
WIDE_REACH = 40.0  # px from which on shades are found at half the size
LARGEST_REACH = 500.0  # px that an edge is moved or softened at once


def is_selected(selection: Selection) -> Mask:
    """(H, W) bool of a mask or a coverage."""
    return selection if selection.dtype == np.bool_ else selection >= HALF


def is_soft(coverage: U8) -> Mask:
    """(H, W) where a coverage says more than its mask."""
    return (coverage > 0) & (coverage < FULL)


def as_coverage(selection: Selection) -> U8:
    """(H, W) u8, a copy, of a mask or a coverage."""
    if selection.dtype == np.bool_:
        return selection.view(np.uint8) * np.uint8(FULL)
    return selection.copy().view(np.uint8)


def enclosed(outline: np.ndarray, size: tuple[int, int]) -> Mask:
    """(H, W) what is inside a closed line (N, 2) px, in a picture of `size` (width, height) px."""
    inside = np.zeros((size[1], size[0]), np.uint8)
    corners = np.rint((np.asarray(outline) - 0.5) * (1 << FINE)).astype(np.int32)
    if len(corners) > 2:
        cv2.fillPoly(inside, [corners], (1,), cv2.LINE_8, FINE)
    return inside.view(np.bool_)


def united(selection: Selection | None, mask: Mask) -> Selection:
    """`selection` and `mask` (H, W) besides."""
    if selection is None or selection.dtype == np.bool_:
        return mask if selection is None else selection | mask
    return np.where(mask, np.uint8(FULL), selection)


def without(selection: Selection | None, mask: Mask) -> Selection:
    """`selection` less `mask` (H, W)."""
    if selection is None or selection.dtype == np.bool_:
        return np.zeros_like(mask) if selection is None else selection & ~mask
    return np.where(mask, np.uint8(0), selection)


def grow(selection: Selection, px: float) -> Selection:
    """Select everything that is at most `px` from the selection: round at corners."""
    changed = selection.copy()
    window = box_around(selection, px + 1)
    if window is not None:
        changed[window] = _grown_everywhere(np.ascontiguousarray(selection[window]), px)
    return changed


def shrink(selection: Selection, px: float) -> Selection:
    """Select everything that is more than `px` from the outside."""
    changed = selection.copy()
    window = box_around(selection, 1)
    if window is not None:
        changed[window] = invert(_grown_everywhere(invert(selection[window]), px))
    return changed


def smooth(selection: Selection, px: float) -> Selection:
    """Take the majority within `px` to each side: teeth, specks and slits disappear."""
    reach = round(min(max(px, 1.0), LARGEST_SMOOTHING))
    changed = selection.copy()
    window = box_around(selection, reach + 1)
    if window is None:
        return changed
    part = np.ascontiguousarray(selection[window]).view(np.uint8)
    changed[window] = cv2.medianBlur(part, 2 * reach + 1).view(selection.dtype)
    return changed


def fill_holes(selection: Selection) -> Selection:
    """Without holes: what is not selected and does not reach the photo's frame."""
    if selection.dtype == np.bool_:
        return selection | _closed_in(~selection, ~selection)
    changed = selection.copy()
    # Together with its soft rim; a soft place without a hole in it is meant.
    for level in (FULL, HALF):
        changed[_closed_in(changed < level, changed < HALF)] = FULL
    return changed


def remove_islands(selection: Selection, share: float = ISLAND) -> Selection:
    """Without the pieces that are smaller than `share` of the largest; 1 leaves that one alone.

    Pieces that touch at a corner are one. The soft rim of a piece goes with it.
    """
    changed = selection.copy()
    window = box_around(selection, 1)
    if window is None:
        return changed
    part = np.ascontiguousarray(selection[window])
    found = cv2.connectedComponentsWithStats(is_selected(part).view(np.uint8), connectivity=8)
    labels, sizes = np.asarray(found[1], np.int32), found[2][:, cv2.CC_STAT_AREA].astype(np.float64)
    sizes[0] = np.inf  # what is not selected
    is_island = sizes < share * sizes[1:].max(initial=0)
    if is_island.any():
        away = is_island[labels]
        if part.dtype != np.bool_:
            away |= _rims(part, labels, is_island)
        changed[window] = np.where(away, part.dtype.type(0), part)
    return changed


def invert(selection: Selection) -> Selection:
    """Invert the selection."""
    return ~selection  # of u8 it is 255 - c


def feather(selection: Selection, px: float) -> U8:
    """Coverage that falls from full to nothing within `px` of the edge, on either side.

    What is selected stays the same: the half line stays on the edge.
    """
    from .matting.soft_edge import (
        signed_distance,  # its module needs numba; the window starts without
    )

    mask = is_selected(selection)
    coverage = np.zeros(mask.shape, np.uint8)
    window = box_around(mask, px + 1)
    if window is None:
        return coverage
    part = np.ascontiguousarray(mask[window])
    share = np.clip(0.5 + 0.5 * signed_distance(part) / px, 0, 1)
    soft = (share * share * (3 - 2 * share) * FULL + 0.5).astype(np.uint8)
    coverage[window] = np.where(part, np.maximum(soft, HALF), np.minimum(soft, HALF - 1))
    return coverage


def _grown_everywhere(part: Selection, px: float) -> Selection:
    """`grow` of an array that is wanted as a whole."""
    if part.dtype != np.bool_:
        return _dilated(part, px)
    if not part.any():  # distances to nothing are no distances
        return part
    away = cv2.distanceTransform((~part).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return away <= px + EXACT


def _dilated(coverage: U8, px: float) -> U8:
    """Largest value within a disc; of a wide one, found at half the size.

    What is full, what is selected and what is anything is exact even then: only the shades between
    are the smaller picture's.
    """
    if px <= WIDE_REACH:
        return _dilated_by_rows(coverage, px)
    height, width = coverage.shape
    half = cv2.resize(coverage, ((width + 1) // 2, (height + 1) // 2), interpolation=cv2.INTER_AREA)
    small = _dilated(np.asarray(half, np.uint8), px / 2)
    shades = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
    full, mask, any_ = (
        _grown_everywhere(coverage >= level, px) for level in (np.uint8(FULL), np.uint8(HALF), 1)
    )
    most = np.where(mask, np.maximum(shades, HALF), np.clip(shades, 1, HALF - 1))
    most[full], most[~any_] = FULL, 0
    return most.astype(np.uint8)


def _dilated_by_rows(coverage: U8, px: float) -> U8:
    """Largest value within a disc: of each of its rows, which OpenCV does in one go."""
    height = len(coverage)
    most = coverage.copy()
    for dy in range(min(int(px + EXACT), height - 1) + 1):
        half = int(np.sqrt(max(px * px - dy * dy, 0.0)) + EXACT)
        wide = cv2.dilate(coverage, np.ones((1, 2 * half + 1), np.uint8))
        np.maximum(most[dy:], wide[: height - dy], out=most[dy:])
        np.maximum(most[: height - dy], wide[dy:], out=most[: height - dy])
    return most


def _rims(coverage: U8, labels: np.ndarray, is_island: np.ndarray) -> Mask:
    """(H, W) what is faintly covered, hangs together with an island and is nearest to it."""
    faint = (labels == 0).view(np.uint8)
    nearest = np.asarray(
        cv2.distanceTransformWithLabels(faint, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)[1],
        np.int32,
    )
    of_island = np.zeros(int(nearest.max()) + 1, np.bool_)
    of_island[nearest[labels > 0]] = is_island[labels[labels > 0]]
    _, found = cv2.connectedComponents((coverage > 0).view(np.uint8), connectivity=8)
    pieces = np.asarray(found, np.int32)
    holds_island = np.zeros(int(pieces.max()) + 1, np.bool_)
    holds_island[pieces[is_island[labels]]] = True
    return (coverage > 0) & (labels == 0) & of_island[nearest] & holds_island[pieces]


def _closed_in(outside: Mask, meant: Mask) -> Mask:
    """The pieces (H, W) of `outside` that hold something of `meant` and do not touch the frame."""
    count, found = cv2.connectedComponents(outside.view(np.uint8), connectivity=4)
    labels = np.asarray(found, np.int32)
    is_hole = np.zeros(count, bool)
    is_hole[np.unique(labels[meant])] = True
    for side in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        is_hole[side] = False
    is_hole[0] = False
    return is_hole[labels]


# A stroke of a brush on a selection, as it is seen while it is painted.


class MaskPainting:
    """A stroke. `shown` is changed in place: a large photo has no time for a copy each frame."""

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
        """Return the current selection (H, W); it must not be painted on after that."""
        return is_selected(self.shown) if self._is_bool else self.shown


# The artist's manual corrections of a mask, kept when a later click has the object found anew.
#
# `EditObject.found` is what the prompt had given: where the mask differs from it, the artist
# decided.


def corrected(item: EditObject, found: Mask, prompt: Prompt) -> tuple[Selection, Mask]:
    """`found` (H, W) with the object's corrections, and without them.

    A piece of them that a new click of the prompt contradicts is given up. A soft edge stays
    where the outline does.
    """
    assert item.mask is not None and item.found is not None
    kept = item.mask != item.found
    for x, y in _contradictions(item, prompt):
        kept &= ~_piece(kept, x, y)
    mask = np.where(kept, item.mask, found)
    without = mask ^ kept
    if item.coverage is None:
        return mask, without
    soft = is_soft(item.coverage)
    soft &= ~grow(mask != item.mask, _softness(item.mask, soft))
    return np.where(soft, item.coverage, mask * np.uint8(FULL)), without


def _contradictions(item: EditObject, prompt: Prompt) -> list[tuple[int, int]]:
    """Pixels x, y of new clicks that say the contrary of the mask."""
    assert item.mask is not None
    places = []
    for click in prompt.clicks:
        x, y = int(click.x), int(click.y)
        if click not in item.prompt.clicks and item.mask[y, x] != click.is_foreground:
            places.append((x, y))
    return places


def _piece(mask: Mask, x: int, y: int) -> Mask:
    """The connected piece (H, W) of a mask that pixel x, y is in; nothing beside the mask."""
    if not mask[y, x]:
        return np.zeros_like(mask)
    _, labels = cv2.connectedComponents(mask.view(np.uint8), connectivity=4)
    return labels == labels[y, x]


def _softness(mask: Mask, soft: Mask) -> float:
    """How far, in px, what is soft (H, W) reaches from the mask's edge."""
    from .matting.soft_edge import signed_distance

    return 1.0 + float(np.abs(signed_distance(mask))[soft].max(initial=0.0))
