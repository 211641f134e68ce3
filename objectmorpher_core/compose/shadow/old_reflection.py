"""Old reflections: an object's mirror image on a table or water, and the ground without it.

Where the mirror image is known, it is taken off in linear light: the photo's own texture stays
(promise 2). Only what that does not explain is invented.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arrays import F32, Mask, Pixels
from ...base.pixels import pixels_from_unit, unit_pixels
from ...document.model import Matte
from ..plate.plate import Box
from ..silhouette import cells_bounds, sampled
from .mirroring import MirrorLine, premultiplied
from .shadow import GAMMA

ROWS = 512  # px, taken at once: less memory
BLURS = 4  # x the blur, that its kernel reaches


@dataclass(frozen=True, eq=False)
class TakingOff:
    """A mirror image on a grid over a box of the photo."""

    mirroring: MirrorLine
    matte: Matte  # of what is mirrored
    smooth: F32  # (h, w, 3) linear light of the ground, without texture
    unexplained: F32  # (h, w) 1 where it cannot be taken off
    left: float  # photo px, its corner
    top: float
    pitch: float  # photo px per px of it


@dataclass(frozen=True, eq=False)
class OldReflection:
    """The place of a mirror image in the photo, and the part of it that can be taken off."""

    cover: F32  # (h, w) in [0, 1], 0 along its border
    left: float  # photo px, its corner
    top: float
    pitch: float  # photo px per px of it
    known: TakingOff | None  # None: all of it is invented

    def covers(self, box: Box) -> Mask:
        """(h, w) where it is seen, in a box of the photo."""
        return sampled(self.cover, (self.left, self.top), self.pitch, box) > 0.5

    def lost(self, box: Box) -> Mask:
        """(h, w) where nothing of the ground is kept."""
        covered, known = self.covers(box), self.known
        if known is None:
            return covered
        corner = (known.left, known.top)
        return covered & (sampled(known.unexplained, corner, known.pitch, box) > 0.5)

    def bounds(self, width: int, height: int) -> Box:
        """x0, y0, x1, y1 px around it, within a photo of that size."""
        return cells_bounds(self.cover, (self.left, self.top), self.pitch, (width, height))


def without_reflection(pixels: Pixels, old: OldReflection, box: Box) -> tuple[Pixels, Mask]:
    """The pixels (h, w, 3) of a `box` of the photo without it, and where they are others."""
    x0, y0, x1, y1 = box
    result = pixels[y0:y1, x0:x1].copy()
    known = old.known
    if known is None or not result.size:
        return result, np.zeros(result.shape[:2], bool)
    picture, covered = premultiplied(known.matte), old.covers(box)
    corner, more = (known.matte.left, known.matte.top), int(BLURS * known.mirroring.blur) + 1
    for top in range(y0, y1, ROWS):
        strip = (x0, top, x1, min(top + ROWS, y1))
        wider = (x0 - more, top - more, x1 + more, strip[3] + more)
        laid = known.mirroring.laid(picture, corner, wider)[more:-more, more:-more]
        smooth = np.dstack(
            [
                sampled(known.smooth[..., n], (known.left, known.top), known.pitch, strip)
                for n in range(3)
            ]
        )
        part = result[top - y0 : strip[3] - y0]
        light = unit_pixels(part) ** np.float32(GAMMA)
        light = known.mirroring.without(light, laid, known.mirroring.below(strip), smooth)
        own = pixels_from_unit(np.clip(light, 0, 1) ** np.float32(1 / GAMMA), pixels.dtype)
        np.copyto(part, own, where=covered[top - y0 : strip[3] - y0, :, None])
    return result, (result != pixels[y0:y1, x0:x1]).any(-1)
