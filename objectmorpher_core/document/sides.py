"""The sides of an object that its photo does not show: invented, or in further photos of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import F32, F64, U8, Mask, freeze
from ..base.camera import Camera

MOST_MATCHES = 20_000  # between two photos
# Visibility of what something else hides that the photo shows; painted, it has less (`paint`).
HIDDEN = np.float32(1e-5)
INSIDE = 128  # of 255: from this alpha on a pixel shows the object


@dataclass(frozen=True, eq=False)
class Sides:
    """Invented pictures of the sides that a photo does not show, and where each Gaussian looks.

    A Gaussian takes what it shows from there once it faces the camera so much more than it faced
    the photo's that the photo would be stretched over it (`raster.rules`), and always where another
    part of the object stands before it in the photo.
    """

    pixels: U8  # (h, w, 3) sRGB
    left: int  # px of the photo, where the corner of the pixels lies in the object's texture
    top: int
    at: F32  # (N, 2) px of the photo: what each Gaussian's mean shows
    slopes: F32  # (N, 2, 3) px per world unit at rest
    # (N,) px per world unit of the picture; 0: the Gaussian is on none; less than 0: it is of a
    # soft matte's fringe, and takes what it shows from there sooner.
    zoom: F32
    real: Mask | None = None  # (N,) whose picture is of a further photo; None: all are invented

    def __post_init__(self) -> None:
        freeze(self, pixels=np.uint8, real=np.bool_)
        freeze(self, at=np.float32, slopes=np.float32, zoom=np.float32)

    def select(self, index: np.ndarray) -> Sides:
        """Of the Gaussians at `index` (integers or booleans)."""
        real = None if self.real is None else self.real[index]
        at, slopes, zoom = self.at[index], self.slopes[index], self.zoom[index]
        return replace(self, at=at, slopes=slopes, zoom=zoom, real=real)

    def followed_by(self, count: int) -> Sides:
        """With `count` more Gaussians that are on none of the pictures."""
        parts = (self.at, self.slopes, self.zoom)
        at, slopes, zoom = (
            np.concatenate([part, np.zeros((count, *part.shape[1:]), np.float32)]) for part in parts
        )
        real = None if self.real is None else np.pad(self.real, (0, count))
        return replace(self, at=at, slopes=slopes, zoom=zoom, real=real)

    def placed(self, left: int, top: int) -> Sides:
        """With their pictures elsewhere in the object's texture."""
        way = np.array([left - self.left, top - self.top], np.float32)
        at = np.where((self.zoom != 0)[:, None], self.at + way, self.at)
        return replace(self, left=left, top=top, at=at)

    def moved(self, offsets: np.ndarray, linear: np.ndarray | None = None) -> Sides:
        """Of Gaussians that lie `offsets` (N, 3) world units aside, on the same surface.

        `linear` (N, 3, 3): the surface itself was deformed so about each of them.
        """
        at, slopes = self.at, self.slopes.astype(np.float64)
        if linear is not None:
            slopes = slopes @ np.linalg.inv(linear)
        at = at + np.einsum("nij,nj->ni", slopes, offsets)
        return replace(self, at=at, slopes=slopes)


@dataclass(frozen=True, eq=False)
class FurtherView:
    """Another photo of an object: the object's cut-out, and where that photo's camera stood.

    Its world is that of its own camera. How far away the object is there nobody knows: the pose is
    a similarity.
    """

    photo: str  # file name without folder
    camera: Camera  # of that photo
    pose: F64  # (4, 4) that camera's world from the first photo's, the object at rest
    left: int  # px of that photo, the cut-out's corner
    top: int
    pixels: U8  # (h, w, 3) sRGB, the object's own colours, continued beyond it
    alpha: U8  # (h, w)
    matches: F32  # (n, 4) px of the first photo, and of this one, that show the same detail

    def __post_init__(self) -> None:
        freeze(self, pose=np.float64, pixels=np.uint8, alpha=np.uint8, matches=np.float32)
        self._check()

    @property
    def mask(self) -> Mask:
        """(h, w) of the cut-out, which pixels show the object."""
        return np.asarray(self.alpha >= INSIDE)

    def _check(self) -> None:
        """Raises ValueError where its parts do not fit each other."""
        is_finite = np.isfinite(self.pose).all() and np.isfinite(self.matches).all()
        if self.pose.shape != (4, 4) or not is_finite or np.linalg.det(self.pose[:3, :3]) <= 0:
            raise ValueError("the pose of a further photo is none")
        is_picture = self.alpha.ndim == 2 and self.alpha.size > 0
        if not is_picture or self.pixels.shape != (*self.alpha.shape, 3):
            raise ValueError(
                f"a further photo is {self.pixels.shape}, its alpha {self.alpha.shape}"
            )
        if self.matches.shape[1:] != (4,) or len(self.matches) > MOST_MATCHES:
            shape = self.matches.shape
            raise ValueError(
                f"matches are {shape}, not four numbers each of {MOST_MATCHES} at most"
            )
        own = self.camera
        if not own.focal > 0 or min(own.width, own.height) < 1:
            raise ValueError("the camera of a further photo makes no sense")
