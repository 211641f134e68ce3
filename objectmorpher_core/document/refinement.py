"""What a learned refiner has made of an edit, as the document keeps it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import F32, U8, Pixels, frozen


@dataclass(frozen=True, eq=False)
class Refined:
    """The edit as a learned refiner made it look, shown over the composite inside its footprint."""

    left: int  # px, crop's corner in the photo
    top: int
    pixels: Pixels  # (h, w, 3) the photo's bit depth
    alpha: U8  # (h, w) how much of the edit is seen: 0 outside the footprint
    backend: str
    seed: int = 0
    strength: float = 1.0  # in [0, 1], how much of it is shown

    def __post_init__(self) -> None:
        # What is frozen stays the same array: of another strength it is known by its identity.
        if self.pixels.flags.writeable:
            object.__setattr__(self, "pixels", frozen(self.pixels))
        if self.alpha.flags.writeable:
            object.__setattr__(self, "alpha", frozen(self.alpha, np.uint8))

    @property
    def box(self) -> tuple[int, int, int, int]:
        """x0, y0, x1, y1 px of the crop in the photo."""
        height, width = self.alpha.shape
        return self.left, self.top, self.left + width, self.top + height

    @property
    def weights(self) -> F32:
        """(h, w) in [0, 1]: how much of it is shown."""
        return self.alpha.astype(np.float32) * np.float32(self.strength / 255)
