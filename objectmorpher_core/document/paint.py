"""Paint on an object, as the artist has laid it on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import F32, U8, frozen
from ..base.pixels import crop


@dataclass(frozen=True, eq=False)
class Paint:
    """Paint over an object's texture: over its colours, and the invented pictures beside them.

    And over the plain colours of its Gaussians, which show where it has neither.
    """

    left: int  # px of the photo, its corner in the texture
    top: int
    rgba: U8  # (h, w, 4) sRGB, straight
    spots: U8  # (N, 4) on each Gaussian, likewise

    def __post_init__(self) -> None:
        for name in ("rgba", "spots"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.uint8))

    @property
    def box(self) -> tuple[int, int, int, int]:
        """x0, y0, x1, y1 px of the photo."""
        height, width = self.rgba.shape[:2]
        return self.left, self.top, self.left + width, self.top + height

    @property
    def alpha(self) -> F32:
        """(h, w) in [0, 1]."""
        return self.rgba[..., 3].astype(np.float32) / np.float32(255)

    def over(self, colours: F32, left: int, top: int) -> F32:
        """Straight `colours` (h, w, 3) in [0, 1] under it; `left`, `top`: px of their corner."""
        height, width = colours.shape[:2]
        return _over(crop(self.rgba, self.box, (left, top, left + width, top + height)), colours)

    def on_spots(self, colours: F32) -> F32:
        """(N, 3) the Gaussians' plain `colours` (N, 3) under it."""
        return _over(self.spots, colours)


def _over(rgba: U8, colours: F32) -> F32:
    paint = np.asarray(rgba / np.float32(255), np.float32)
    return np.asarray(colours + paint[..., 3:] * (paint[..., :3] - colours), np.float32)
