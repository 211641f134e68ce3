"""Paint on an object, as the artist has laid it on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import F32, U8, Mask, crop, freeze

Box = tuple[int, int, int, int]  # x0, y0, x1, y1 px of the photo
SIDE = 512  # px, of a tile
# Visibility of what does not show the photo: more than 0, which hides at rest what faces the camera
HARDLY = np.float32(1e-6)


@dataclass(frozen=True, eq=False)
class PaintTile:
    """A square of the texture on which something is painted."""

    left: int  # px of the photo, its corner in the texture; a multiple of SIDE
    top: int
    rgba: U8  # (SIDE, SIDE, 4) sRGB, straight

    def __post_init__(self) -> None:
        freeze(self, rgba=np.uint8)

    @property
    def box(self) -> Box:
        return self.left, self.top, self.left + SIDE, self.top + SIDE


@dataclass(frozen=True, eq=False)
class Paint:
    """Paint over an object's texture: over its colours, and the invented pictures beside them.

    And over the plain colours of its Gaussians, which show where it has neither. Where the soft
    edge shows the texels of another surface of the object, it would show that one's paint, and
    hide its own: where either is painted it is `apart`, and shows nothing.
    """

    tiles: tuple[PaintTile, ...]
    spots: U8  # (N, 4) on each Gaussian, sRGB, straight
    apart: Mask | None = None  # (N,) which of them do not show the texture any more; None: none

    def __post_init__(self) -> None:
        freeze(self, spots=np.uint8, apart=np.bool_)

    def crop(self, box: Box) -> U8:
        """(h, w, 4) what of it lies in a box of the texture, px of the photo."""
        x0, y0, x1, y1 = box
        found: U8 = np.zeros((y1 - y0, x1 - x0, 4), np.uint8)
        for tile in self.tiles:
            if (inner := _common(tile.box, box)) is not None:
                left, top, right, bottom = inner
                found[top - y0 : bottom - y0, left - x0 : right - x0] = crop(
                    tile.rgba, tile.box, inner
                )
        return found

    def with_pixels(self, box: Box, rgba: U8) -> Paint:
        """The same with `rgba` (h, w, 4) in `box`."""
        others = [tile for tile in self.tiles if _common(tile.box, box) is None]
        x0, y0, x1, y1 = box
        for top in range(SIDE * (y0 // SIDE), y1, SIDE):
            for left in range(SIDE * (x0 // SIDE), x1, SIDE):
                own = left, top, left + SIDE, top + SIDE
                inner, whole = _common(own, box), self.crop(own)
                assert inner is not None
                part = np.s_[inner[1] - top : inner[3] - top, inner[0] - left : inner[2] - left]
                whole[part] = crop(rgba, box, inner)
                if whole[..., 3].any():
                    others.append(PaintTile(left, top, whole))
        return replace(self, tiles=tuple(others))

    def over(self, colours: F32, left: int, top: int) -> F32:
        """Straight `colours` (h, w, 3) in [0, 1] under it; `left`, `top`: px of their corner."""
        painted = np.array(colours, np.float32)
        whole = left, top, left + colours.shape[1], top + colours.shape[0]
        for tile in self.tiles:
            if (inner := _common(tile.box, whole)) is not None:
                part = np.s_[inner[1] - top : inner[3] - top, inner[0] - left : inner[2] - left]
                painted[part] = _over(crop(tile.rgba, tile.box, inner), painted[part])
        return painted

    def on_spots(self, colours: F32) -> F32:
        """(N, 3) the Gaussians' plain `colours` (N, 3) under it."""
        return _over(self.spots, colours)

    def visible(self, visibility: F32) -> F32:
        """(N,) `visibility` in the photo (N,) of those that still show the texture."""
        if self.apart is None:
            return visibility
        return np.where(self.apart, np.minimum(visibility, HARDLY), visibility)


def _over(rgba: U8, colours: F32) -> F32:
    paint = np.asarray(rgba / np.float32(255), np.float32)
    return np.asarray(colours + paint[..., 3:] * (paint[..., :3] - colours), np.float32)


def _common(a: Box, b: Box) -> Box | None:
    box = max(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), min(a[3], b[3])
    return box if box[0] < box[2] and box[1] < box[3] else None
