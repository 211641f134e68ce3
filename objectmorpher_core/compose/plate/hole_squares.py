"""Holes filled by a network that sees squares of one size, and the photo around them untouched.

Each hole, or group of near ones, gets a square of the photo around it: as many of the photo's own
pixels as the network sees, or more for a large hole, which are then shrunk. What comes back has no
finer detail than the network saw; it is continued by the photo's own, from where the photo looks
like what was invented.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, Mask, Pixels, pixels_from_unit, unit_pixels
from ...base.masks import box_of
from ...base.progress import Progress, part, silent
from .. import InpaintError
from .completion import smooth, sources_like
from .patch_detail import with_detail

SURROUNDINGS = 2.0  # x a hole's longer side: the side of the square around it
APART = 4  # cells of an eighth of the square: holes that are no farther apart are one
FINER = 1.02  # x what the network saw: with less there is no detail to be continued

Fill = Callable[[F32, Mask, Progress, int], F32]
"""fill(picture (n, n, 3) in [0, 1], hole (n, n), progress, seed) -> (n, n, 3), filled.

In the hole the picture is a smooth guess, unless the network is to see what stands there.
"""


@dataclass(frozen=True)
class Filler:
    """A network."""

    side: int  # px of the square that it sees
    fill: Fill
    sees_all: bool = False  # also what stands in the hole


@dataclass(frozen=True, eq=False)
class Square:
    """An area that is filled at once."""

    box: tuple[int, int, int, int]  # x0, y0, x1, y1 px of the photo; smaller than square at frames
    own: Mask  # (h, w) of the box: the hole that is filled here


def squares(hole: Mask, side: int) -> tuple[Square, ...]:
    """Around each group of holes (H, W), for a network that sees `side` px."""
    height, width = hole.shape
    cell = max(side // 8, 1)
    rows, columns = -(-height // cell), -(-width // cell)
    padded = np.pad(hole, ((0, rows * cell - height), (0, columns * cell - width)))
    cells = np.asarray(padded.reshape(rows, cell, columns, cell).any((1, 3)), np.uint8)
    near = cv2.dilate(cells, np.ones((APART + 1, APART + 1), np.uint8))
    count, groups = cv2.connectedComponents(near, connectivity=8)
    labels = np.kron(groups, np.ones((cell, cell), groups.dtype))[:height, :width]
    found = []
    for group in range(1, count):
        own = hole & (labels == group)
        box = _box(own, side)
        found.append(Square(box, own[box[1] : box[3], box[0] : box[2]]))
    return tuple(found)


def fill_squares(
    rgb: Pixels, hole: Mask, filler: Filler, progress: Progress = silent, seed: int = 0
) -> Pixels:
    """`rgb` (H, W, 3) with its hole filled by a network that sees squares.

    Raises InpaintError where the hole is everything; the same bytes outside.
    """
    if hole.all():
        raise InpaintError("the hole covers everything: there is nothing to fill it from")
    filled, rest = rgb.copy(), hole.copy()
    if not hole.any():
        return filled
    progress(0.0, "Filling in the background")
    found = squares(hole, filler.side)
    for k, square in enumerate(found):
        step = part(progress, k / len(found), (k + 1) / len(found))
        x0, y0, x1, y1 = square.box
        window = slice(y0, y1), slice(x0, x1)
        # Of other holes in it, those that are filled count as known.
        shown = rgb[window] if filler.sees_all else None
        new = _filled(filled[window], rest[window], shown, filler, step, seed)
        np.copyto(filled[window], new, where=square.own[..., None])
        rest[window] &= ~square.own
    progress(1.0, "Filled the background")
    return filled


def _box(own: Mask, side: int) -> tuple[int, int, int, int]:
    """Of the square around a hole, as far as the photo reaches."""

    def reach(first: int, last: int, size: int) -> tuple[int, int]:
        length = min(wanted, size)
        start = int(np.clip((first + last - length) // 2, 0, size - length))
        return start, start + length

    x0, y0, x1, y1 = box_of(own)
    wanted = max(side, round(SURROUNDINGS * max(x1 - x0, y1 - y0)))
    (y0, y1), (x0, x1) = reach(y0, y1, own.shape[0]), reach(x0, x1, own.shape[1])
    return x0, y0, x1, y1


def _filled(
    crop: Pixels, hole: Mask, shown: Pixels | None, filler: Filler, progress: Progress, seed: int
) -> Pixels:
    """A crop (h, w, 3), its whole hole filled; `shown`: the same with what stands there."""
    if hole.all():  # other holes have left nothing of it
        raise InpaintError("nothing around the hole is known: there is nothing to fill it from")
    (height, width), side = hole.shape, filler.side
    longer = max(height, width)
    above, before = (longer - height) // 2, (longer - width) // 2
    rims = (above, longer - height - above), (before, longer - width - before)
    picture, known = unit_pixels(crop), (~hole).astype(np.float32)
    # What lies beyond the photo's frame is its mirror image.
    picture = np.pad(picture * known[..., None], (*rims, (0, 0)), mode="symmetric")
    known = np.pad(known, rims, mode="symmetric")
    seen, share = _resized(picture, side), _resized(known, side)
    is_known = share > 1 - 1e-4 if share.min() < share.max() else share >= share.max()
    if not is_known.any():
        is_known = share >= share.max()
    mean = np.asarray(seen / np.maximum(share, 1e-6)[..., None] * is_known[..., None], np.float32)
    guess = np.clip(smooth(mean, is_known.astype(np.float32)), 0, 1).astype(np.float32)
    if shown is not None:
        whole = np.pad(unit_pixels(shown), (*rims, (0, 0)), mode="symmetric")
        guess = np.clip(_resized(whole, side), 0, 1)
    answer = filler.fill(guess, ~is_known, part(progress, 0.0, 0.9), seed)
    progress(0.9, "Copying the details")
    if longer <= FINER * side:
        whole = _resized(answer, longer)[above : above + height, before : before + width]
        return np.where(hole[..., None], pixels_from_unit(whole, crop.dtype), crop)
    scale = side / longer
    size = max(1, round(width * scale)), max(1, round(height * scale))
    step = np.array([width, height]) * scale / size  # px of the square, nearly 1
    start = scale * np.array([before, above]) + 0.5 * step - 0.5

    def inner(square: F32) -> F32:
        """What of the square is the crop, be it between its pixels."""
        there = np.column_stack([np.diag(step), start])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        own = cv2.warpAffine(square, there, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(own, np.float32)

    invented = inner(np.where(is_known[..., None], guess, answer) * np.float32(255))
    unknown = inner((~is_known).astype(np.float32)) > 0
    sources = sources_like(invented, unknown, seed, part(progress, 0.9, 1.0))
    return with_detail(crop, hole, invented, sources, low_pass=1)


def _resized(picture: F32, side: int) -> F32:
    """(side, side) or (side, side, C) of a square."""
    kind = cv2.INTER_AREA if side < len(picture) else cv2.INTER_CUBIC
    if picture.ndim == 2 and side > len(picture):
        kind = cv2.INTER_LINEAR  # shares stay in [0, 1]
    return np.asarray(cv2.resize(picture, (side, side), interpolation=kind), np.float32)
