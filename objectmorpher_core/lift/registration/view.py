"""The photo as a registration looks at it, how a pose is written, and how well they agree."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask, Pixels, crop, frozen, unit_pixels
from ...base.camera import Camera
from ...base.masks import box_of
from ...base.rotations import matrix_from_vector
from .. import LiftError
from .sketch import COLOR, COVERAGE, NORMAL, Surfels, sketch

LEAST_AREA = 64  # px: a smaller mask shows no pose
MARGIN = 0.12  # x the mask's longer side: what is seen around it
BEYOND = (0.05, 0.4, 1.0)  # x its size: how far an object may go on outside the photo
EDGE = 3.0  # x its slope: how much sharper edges are made before silhouettes are compared
# Of the light that is fitted, x the evidence: an exposure of 1, no directed light, no veil.
EXPOSURE_PRIOR, LIGHT_PRIOR, VEIL_PRIOR = 1e-3, 2e-2, 0.2


@dataclass(frozen=True, eq=False)
class RegistrationView:
    """The mask's surroundings at a low resolution."""

    camera: Camera  # the window's
    mask: F32  # (h, w) share of a pixel that is inside
    pixels: F32  # (h, w, 3) sRGB in [0, 1] of what is inside
    within: F32  # (h, w) 1 inside the photo, 0 beyond its frame


@dataclass(frozen=True, eq=False)
class Target:
    """The target of a match: the mask in the photo, and the photo's camera."""

    pixels: Pixels  # (H, W, 3)
    mask: Mask  # (H, W)
    camera: Camera

    def __post_init__(self) -> None:
        if self.mask.shape != self.pixels.shape[:2]:
            raise LiftError(f"mask is {self.mask.shape}, photo is {self.pixels.shape[:2]}")
        if self.mask.sum() < LEAST_AREA:
            area = int(self.mask.sum())
            raise LiftError(f"the mask has {area} pixels, too few to register an object to")

    @property
    def box(self) -> tuple[int, int, int, int]:
        """x0, y0, x1, y1 px around the mask."""
        return box_of(self.mask)

    @property
    def boxes(self) -> tuple[tuple[float, float, float, float], ...]:
        """Boxes that the whole object may have: more than one where it leaves the photo."""
        x0, y0, x1, y1 = self.box
        height, width = self.mask.shape
        touches = np.array([x0 == 0, y0 == 0, x1 == width, y1 == height])
        if not touches.any():
            return ((x0, y0, x1, y1),)
        beyond = touches * np.array([-1, -1, 1, 1]) * max(x1 - x0, y1 - y0)
        grown = [np.array([x0, y0, x1, y1]) + share * beyond for share in BEYOND]
        return tuple((float(a), float(b), float(c), float(d)) for a, b, c, d in grown)

    def view(self, size: int) -> RegistrationView:
        """A square picture of `size` px around the mask."""
        x0, y0, x1, y1 = self.box
        side = (1 + 2 * MARGIN) * max(x1 - x0, y1 - y0)
        zoom = size / side
        left, top = 0.5 * (x0 + x1 - side), 0.5 * (y0 + y1 - side)
        camera = self.camera.windowed(left, top, size, size, zoom)
        # A window at the photo's own pixels, then averaged: no resampling looks beyond a pixel.
        corner = int(np.floor(left)), int(np.floor(top))
        box = (*corner, corner[0] + int(np.ceil(side)) + 2, corner[1] + int(np.ceil(side)) + 2)
        mask = crop(self.mask.astype(np.float32), (0, 0, *self.mask.shape[::-1]), box)
        within = crop(np.ones(self.mask.shape, np.float32), (0, 0, *self.mask.shape[::-1]), box)
        colors = crop(unit_pixels(self.pixels), (0, 0, *self.mask.shape[::-1]), box)
        warp = np.array([[zoom, 0, 0.0], [0, zoom, 0.0]])
        warp[:, 2] = zoom * (np.array(corner) + 0.5 - [left, top]) - 0.5
        own = np.dstack([colors * mask[..., None], mask, within])
        if zoom < 1:
            own = cv2.GaussianBlur(own, (0, 0), 0.4 / zoom)
        own = cv2.warpAffine(own, warp, (size, size), flags=cv2.INTER_LINEAR)
        share = own[..., 3]
        straight = own[..., :3] / np.maximum(share, 1e-3)[..., None]
        return RegistrationView(
            camera, *(frozen(a, np.float32) for a in (share, straight, own[..., 4]))
        )


@dataclass(frozen=True, eq=False)
class Stance:
    """A pose in terms of the picture: what it changes there is about one px each."""

    turn: F64  # (3, 3) as seen along the ray through `centre`
    centre: F64  # (2,) photo px at which the object's centre is
    size: float  # photo px that the object's extent has at the centre's depth
    focal: float  # photo px

    def matrix(self, camera: Camera) -> F64:
        """(4, 4) world from the surfels' frame, whose extent stays 1; `camera` is the photo's."""
        ray = np.append((self.centre - [camera.cx, camera.cy]) / self.focal, 1.0)
        matrix = np.eye(4)
        matrix[:3, :3] = towards(ray) @ self.turn
        matrix[:3, 3] = ray * (self.focal / self.size)
        return matrix

    @staticmethod
    def of(matrix: F64, camera: Camera) -> Stance:
        """The stance of an object that stands at `matrix` (4, 4), a similarity."""
        scale = float(np.cbrt(np.linalg.det(matrix[:3, :3])))
        centre = matrix[:3, 3]
        turn = towards(centre / centre[2]).T @ matrix[:3, :3] / scale
        size = camera.focal * scale / centre[2]
        return Stance(turn, camera.project(centre), float(size), camera.focal)

    def moved(self, step: F64, radius: float) -> Stance:
        """The stance after a `step` (7,): turn, centre, size in px at `radius` px; log focal."""
        return Stance(
            matrix_from_vector(step[:3] / radius) @ self.turn,
            self.centre + step[3:5],
            self.size * float(np.exp(step[5] / radius)),
            self.focal * float(np.exp(step[6])),
        )


def towards(ray: np.ndarray) -> F64:
    """The least rotation (3, 3) that takes the z axis to `ray` (3,)."""
    x, y, z = ray / np.linalg.norm(ray)
    # Rodrigues' formula for axis (-y, x, 0) and cosine z, which is above 0: the camera sees it
    k = 1.0 / (1.0 + z)
    return np.array([[1 - k * x * x, -k * x * y, x], [-k * x * y, 1 - k * y * y, y], [-x, -y, z]])


def window_of(camera: Camera, photo: Camera, focal: float) -> Camera:
    """The window `camera` of the photo's camera, the photo taken with another `focal`."""
    return replace(camera, focal=camera.focal * focal / photo.focal)


def sketched(surfels: Surfels, stance: Stance, view: RegistrationView, photo: Camera) -> F32:
    """(h, w, CHANNELS) the object in the view."""
    window = window_of(view.camera, photo, stance.focal)
    return sketch(surfels, stance.matrix(photo), window)


@dataclass(frozen=True)
class Agreement:
    """The agreement of a sketch with the view."""

    iou: float  # of the silhouettes
    colour_error: float  # RMS sRGB where they overlap, under the light that explains it best
    score: float  # IoU less colour error, and the support of matches where there are any


def agreement(picture: F32, view: RegistrationView, support: float = 0.0) -> Agreement:
    """See `Agreement`; what would be beyond the photo's frame does not count."""
    coverage, mask = sharpened(picture[..., COVERAGE]) * view.within, sharpened(view.mask)
    both = np.minimum(coverage, mask)
    iou = float(both.sum() / max(float(np.maximum(coverage, mask).sum()), 1e-9))
    rest = lit(picture, fitted_light(picture, view, both)) - view.pixels
    total = max(float(both.sum()), 1e-9)
    error = float(np.sqrt((both[..., None] * rest**2).sum() / (3 * total)))
    return Agreement(iou, error, iou - error + support)


def sharpened(coverage: F32) -> F32:
    """(h, w) with an edge as narrow as a pixel: how soft two edges are is no disagreement."""
    return np.clip((coverage - 0.5) * EDGE + 0.5, 0, 1)


def fitted_light(picture: F32, view: RegistrationView, weight: F32) -> F32:
    """(3, 5) for each channel an exposure, the slope of a directed light, and a veil.

    Least squares; weak priors keep a colour that is missing from turning into light.
    """
    at = weight > 0.05
    if at.sum() < 8:
        return np.tile(np.array([1, 0, 0, 0, 0], np.float32), (3, 1))
    w, colors = weight[at], picture[..., COLOR : COLOR + 3][at]
    normals, seen = picture[..., NORMAL : NORMAL + 3][at], view.pixels[at]
    light = np.zeros((3, 5), np.float32)
    total = float(w.sum())
    for c in range(3):
        own = colors[:, c : c + 1]
        basis = np.hstack([own, own * normals, np.ones_like(own)]).astype(np.float64)
        scale = total * max(float((w * own[:, 0] ** 2).sum()) / total, 1e-4)
        prior = scale * np.array([EXPOSURE_PRIOR, LIGHT_PRIOR, LIGHT_PRIOR, LIGHT_PRIOR, 0.0])
        prior[4] = total * VEIL_PRIOR
        matrix = (basis * w[:, None]).T @ basis + np.diag(prior)
        right = (basis * w[:, None]).T @ seen[:, c]
        right[0] += prior[0]
        light[c] = np.linalg.solve(matrix, right).astype(np.float32)
    return light


def lit(picture: F32, light: F32) -> F32:
    """(h, w, 3) the colours of a sketch in that light."""
    colors, normals = picture[..., COLOR : COLOR + 3], picture[..., NORMAL : NORMAL + 3]
    gain = light[:, 0] + normals @ light[:, 1:4].T
    return np.asarray(colors * gain + light[:, 4], np.float32)
