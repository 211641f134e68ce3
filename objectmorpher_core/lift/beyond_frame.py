"""The colours of an object beyond the photo's frame, where it leaves the photo.

Turned or moved, such an object shows a strip that no photo has (`frame_extension`). The strip is
filled with patches of the object beside it, as a background is (`compose.plate`): its mirror
image, which the cut-out has there, shows eyes and lips twice.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..base.arrays import F32, U8, Mask, Pixels, Selection
from ..base.masks import box_of
from ..base.progress import silent
from ..compose.plate.completion import complete, shrunk, smooth
from ..compose.plate.patch_detail import with_detail
from ..compose.plate.sources import Guide, PatchTone
from ..document.model import Matte
from ..segment.matting.matte import cut_out
from .relief.colours import fill_in

SEARCH = 20_000  # px of the small picture in which patches are looked for
AROUND = 4.0  # x the strip's depth, of the object from which it is filled
LEAST = 40  # px of a strip, or of what it is filled from
SURE = 0.95  # alpha of the matte, from which its colours are the object's own
HALF = 0.5  # of a small px, that must be known
FAINT = 0.02  # alpha below which nothing is seen
RIM = 2  # small px of the object's edge that are no source, for what is beyond is in their patches
COARSE = 2.0  # small px, standard deviation
STRANGE = 20_000.0  # squared levels that a source costs which is not the object
FAR = 200.0  # squared levels that a source costs for each depth of the strip that it is farther off
FARTHEST = 3.0  # x the depth, where that ends
STRIP = 256  # rows that are rounded at a time


def cut_out_beyond(pixels: Pixels, mask: Selection, mixed: Mask | None = None) -> Matte:
    """Cut out as `cut_out` does, with colours made for what is beyond the photo's frame."""
    matte, size = cut_out(pixels, mask, mixed), (mask.shape[1], mask.shape[0])
    if (made := _made_beyond(matte, size)) is not None:
        foreground = matte.foreground.view()  # nobody else has this cut-out yet: not a copy
        foreground.setflags(write=True)
        made.put_into(foreground)
    return matte


def with_beyond(matte: Matte, size: tuple[int, int]) -> Matte:
    """Return `matte` with colours made for what of it is beyond a photo of `size` (w, h) px."""
    made = _made_beyond(matte, size)
    if made is None:
        return matte
    foreground = matte.foreground.copy()
    made.put_into(foreground)
    return replace(matte, foreground=foreground)


@dataclass(frozen=True, eq=False)
class _Beyond:
    """Colours for a part of a matte."""

    window: tuple[slice, slice]  # of the matte
    there: Mask  # (h, w) of the window
    colours: U8  # (h, w, 3)

    def put_into(self, foreground: F32) -> None:
        """Change a matte's colours (H, W, 3) in place."""
        foreground[self.window][self.there] = np.float32(1 / 255) * self.colours[self.there]


def _made_beyond(matte: Matte, size: tuple[int, int]) -> _Beyond | None:
    """Colours for what of a matte is beyond a photo of `size` (w, h) px; None where nothing is."""
    x0, y0, x1, y1 = matte.box
    depth = float(max(-x0, -y0, x1 - size[0], y1 - size[1]))
    if depth <= 0:
        return None
    beyond = np.ones(matte.alpha.shape, bool)
    beyond[max(-y0, 0) : size[1] - y0, max(-x0, 0) : size[0] - x0] = False
    shown = matte.alpha > FAINT
    if (beyond & shown).sum() < LEAST or (shown & ~beyond).sum() < LEAST:
        return None
    away = cv2.distanceTransform((~(beyond & shown)).astype(np.uint8), cv2.DIST_L2, 5)
    near = (away < AROUND * depth) & shown
    x0, y0, x1, y1 = box_of(near)
    window = np.s_[y0:y1, x0:x1]
    made = _filled(matte.foreground[window], matte.alpha[window], beyond[window], depth)
    return None if made is None else _Beyond(window, beyond[window], made)


def _filled(foreground: F32, alpha: F32, beyond: Mask, depth: float) -> U8 | None:
    """(h, w, 3) `foreground` with what is `beyond` the frame (h, w) filled, or None.

    `depth` is how far the object goes on there, px.
    """
    height, width = beyond.shape
    scale = min(1.0, (SEARCH / beyond.size) ** 0.5)
    size = max(8, round(width * scale)), max(8, round(height * scale))
    crop = np.empty(foreground.shape, np.uint8)
    for first in range(0, height, STRIP):
        strip = slice(first, first + STRIP)
        crop[strip] = np.clip(255 * foreground[strip] + 0.5, 0, 255)
    # The object's own colours, and what is around it as it ends there.
    own, share = shrunk(crop, ((alpha > FAINT) & ~beyond).astype(np.float32), size)
    small = fill_in(own, share > HALF)
    values, share = shrunk(crop, (alpha > FAINT).astype(np.float32), size)
    mirrored = fill_in(values, share > HALF)
    known, solid = (
        np.asarray(
            cv2.resize(part.astype(np.float32), size, interpolation=cv2.INTER_AREA), np.float32
        )
        for part in (~beyond, (alpha > SURE) & ~beyond)
    )
    hole = known < HALF
    kernel = np.ones((2 * RIM + 1,) * 2, np.uint8)  # the frame is no edge of the object
    inner = cv2.erode(((solid > HALF) | hole).astype(np.uint8), kernel, borderValue=1) > 0
    if (inner & ~hole).sum() < LEAST:
        return None
    away = cv2.distanceTransform((~hole).astype(np.uint8), cv2.DIST_L2, 5)
    far = FAR * np.clip(away / (depth * scale) - 1, 0, FARTHEST)
    unlikely = np.where(inner, far, STRANGE).astype(np.float32)
    # What the strip's coarse colours may be: the mirror image's, which agree with what is beside
    # them, and those that go on smoothly.
    guess = 0.5 * (mirrored + smooth(small, (~hole).astype(np.float32)))
    coarse = np.asarray(cv2.GaussianBlur(guess, (0, 0), COARSE), np.float32)
    tone = PatchTone(coarse, np.ones(hole.shape, np.float32))
    completion = complete(small, known, Guide(unlikely, tone=tone), 0, silent)
    colors = np.clip(completion.colors, 0, 255).astype(np.float32)
    return np.asarray(with_detail(crop, beyond, colors, completion.sources), np.uint8)
