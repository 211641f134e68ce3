"""Pictures in and out of files: upright, profile, metadata and bit depth kept. (in work)"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Pixels, frozen


class ImageError(ValueError):
    """The bytes are not a picture that can be read, or cannot be written so; one sentence."""


@dataclass(frozen=True, eq=False)
class Picture:
    """Upright RGB pixels and everything of the file that must survive the edit."""

    pixels: Pixels  # (H, W, 3) u8 or u16, RGB
    alpha: np.ndarray | None = None  # (H, W) same dtype, kept aside and never edited
    is_grey: bool = False  # the file had one colour channel; so will the export
    icc: bytes | None = None  # colour profile
    exif: bytes | None = None  # raw EXIF block, its orientation set to 1 (upright)
    focal_35mm: float | None = None  # mm, EXIF's 35-mm equivalent focal length

    def __post_init__(self) -> None:
        object.__setattr__(self, "pixels", frozen(self.pixels))


def read_picture(data: bytes) -> Picture: ...
def encode_picture(picture: Picture, ending: str, quality: int = 95) -> bytes: ...
