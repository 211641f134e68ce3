"""Silhouettes of things whose place on level ground is known, seen by a camera that looks down.

Level frame: x right, y down, z forward, the camera at the origin, its height above the ground 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F64, Mask
from objectmorpher_core.base.camera import Camera

SHIFT = 6  # binary digits of a pixel in which polygons are drawn


@dataclass(frozen=True)
class View:
    """A camera over the ground that looks down by `pitch` degrees."""

    camera: Camera
    pitch: float

    @property
    def horizon(self) -> float:
        """px, the row it lies in."""
        return self.camera.cy - self.camera.focal * float(np.tan(np.radians(self.pitch)))

    @property
    def camera_from_level(self) -> F64:
        """(3, 3)"""
        c, s = np.cos(np.radians(self.pitch)), np.sin(np.radians(self.pitch))
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])

    @property
    def ahead(self) -> float:
        """Forward distance of ground that it sees a little below the picture's middle."""
        return float(1 / np.tan(np.radians(self.pitch + 8)))

    def project(self, points: F64) -> F64:
        """px (n, 2) of points (n, 3) of the level frame."""
        return self.camera.project(points @ self.camera_from_level.T)

    def rays(self, xy: F64) -> F64:
        """(n, 3) in the level frame, of depth 1 along the camera's axis, through px (n, 2)."""
        return self.camera.unproject(xy, np.ones(len(xy))) @ self.camera_from_level

    def hull(self, points: F64) -> Mask:
        """(H, W) the convex silhouette of points (n, 3) of the level frame."""
        outline = cv2.convexHull(self.project(points).astype(np.float32))[:, 0] - 0.5
        picture = np.zeros((self.camera.height, self.camera.width), np.uint8)
        cv2.fillConvexPoly(
            picture, np.rint(outline * 2**SHIFT).astype(np.int32), 1, cv2.LINE_8, SHIFT
        )
        return picture > 0


@dataclass(frozen=True)
class Box:
    """An upright box on the ground: the middle of its plan, and its angle to the picture."""

    forward: float
    across: float = 0.0
    width: float = 0.6
    depth: float = 0.35
    height: float = 0.7
    angle: float = 30.0  # degrees, positive takes its right side away from the camera

    @property
    def plan(self) -> F64:
        """(4, 2) corners, across and forward, anticlockwise from above."""
        c, s = np.cos(np.radians(self.angle)), np.sin(np.radians(self.angle))
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [self.width / 2, self.depth / 2]
        return corners @ np.array([[c, s], [-s, c]]) + [self.across, self.forward]

    @property
    def points(self) -> F64:
        """(8, 3) corners, the lower four first."""
        lower = np.column_stack([self.plan[:, 0], np.ones(4), self.plan[:, 1]])
        return np.concatenate([lower, lower - [0, self.height, 0]])

    def depths(self, rays: F64) -> F64:
        """(n,) how far along each of the rays (n, 3) a side of the box is first met; inf: none."""
        found = np.full(len(rays), np.inf)
        for a, b in zip(self.plan, np.roll(self.plan, -1, axis=0), strict=True):
            along = b - a
            # t (ray.x, ray.z) = a + u along
            determinant = rays[:, 0] * -along[1] + rays[:, 2] * along[0]
            t = (a[0] * -along[1] + a[1] * along[0]) / determinant
            u = (rays[:, 0] * a[1] - rays[:, 2] * a[0]) / determinant
            level = t * rays[:, 1]
            is_met = (t > 0) & (u >= 0) & (u <= 1) & (level <= 1) & (level >= 1 - self.height)
            found = np.where(is_met, np.minimum(found, t), found)
        lid = (1 - self.height) / np.where(rays[:, 1] == 0, 1e-9, rays[:, 1])
        return np.where((lid > 0) & (lid < found - 1e-9) & _is_in(self, lid, rays), np.inf, found)


def _is_in(box: Box, depth: F64, rays: F64) -> np.ndarray:
    at = rays[:, [0, 2]] * depth[:, None] - [box.across, box.forward]
    c, s = np.cos(np.radians(box.angle)), np.sin(np.radians(box.angle))
    own = at @ np.array([[c, -s], [s, c]])
    return (np.abs(own) <= [box.width / 2, box.depth / 2]).all(1)


def cylinder(forward: float, radius: float = 0.28, height: float = 0.7) -> F64:
    """(n, 3) points around the rims of an upright cylinder on the ground, level frame."""
    angle = np.linspace(0, 2 * np.pi, 240, endpoint=False)
    rim = np.column_stack([radius * np.cos(angle), np.ones(240), forward + radius * np.sin(angle)])
    return np.concatenate([rim, rim - [0, height, 0]])


def figure(height: int = 400) -> Mask:
    """A standing person from the front, (height, height)."""
    y, x = np.mgrid[:height, :height] / height
    head = np.hypot(x - 0.5, y - 0.2) < 0.07
    body = (np.abs(x - 0.5) < 0.1) & (y > 0.25) & (y < 0.6)
    arms = (np.abs(np.abs(x - 0.5) - 0.1 - 0.5 * (y - 0.3)) < 0.025) & (y > 0.28) & (y < 0.58)
    legs = (np.abs(np.abs(x - 0.5) - 0.05) < 0.03) & (y > 0.55) & (y < 0.92)
    return head | body | arms | legs
