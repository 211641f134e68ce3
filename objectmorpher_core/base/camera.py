"""The pinhole camera, and THE page about frames.

Image: px, x right, y down, the centre of the first pixel is (0.5, 0.5).
Camera: OpenCV, x right, y down, z forward.
World: the photo camera's own frame.
Object: a lifted model's frame, centred on the model, its largest extent 1.
Transforms are 4x4 and named `b_from_a`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

DEFAULT_FOV = 50.0  # degrees, horizontal; when neither EXIF nor the user says better
FULL_FRAME_DIAGONAL = 43.27  # mm, of the 36 x 24 mm frame that EXIF's 35-mm focal length refers to


@dataclass(frozen=True)
class Camera:
    """A pinhole with square pixels at the world's origin, looking along +z."""

    focal: float  # px
    cx: float  # px, principal point
    cy: float
    width: int  # px
    height: int

    @staticmethod
    def from_fov(width: int, height: int, fov: float = DEFAULT_FOV) -> Camera:
        """A camera with horizontal field of view `fov` degrees and a centred principal point."""
        if not 1.0 <= fov <= 170.0:
            raise ValueError(f"a field of view of {fov:g} degrees is not between 1 and 170")
        focal = 0.5 * width / np.tan(np.radians(fov) / 2)
        return Camera(float(focal), width / 2, height / 2, width, height)

    @staticmethod
    def from_focal_35mm(width: int, height: int, focal_mm: float) -> Camera:
        """A camera from EXIF's 35-mm equivalent focal length."""
        focal = focal_mm / FULL_FRAME_DIAGONAL * float(np.hypot(width, height))
        return Camera(focal, width / 2, height / 2, width, height)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Image px (..., 2) of world points (..., 3) in front of the camera."""
        xy = points[..., :2] / points[..., 2:3] * self.focal
        return xy + np.array([self.cx, self.cy])

    def unproject(self, xy: np.ndarray, depth: np.ndarray | float) -> np.ndarray:
        """World points (..., 3) seen at image px (..., 2) at depth (...) along z."""
        depth = np.asarray(depth, dtype=np.float64)
        ray = (np.asarray(xy, dtype=np.float64) - [self.cx, self.cy]) / self.focal
        return np.concatenate([ray * depth[..., None], depth[..., None]], axis=-1)

    def windowed(
        self, left: float, top: float, width: int, height: int, zoom: float = 1.0
    ) -> Camera:
        """The camera of the window whose corner is (left, top) in this image, magnified by `zoom`.

        `width` and `height` are px of the window, after magnification. An off-centre frustum:
        every window is a crop of the same picture.
        """
        return replace(
            self,
            focal=self.focal * zoom,
            cx=(self.cx - left) * zoom,
            cy=(self.cy - top) * zoom,
            width=width,
            height=height,
        )
