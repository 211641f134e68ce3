"""The left-right symmetry of an object: its mirror axis in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64
from .canvas import ReliefCanvas

SIDE = 96  # px, longer side of the reduced picture in which the axis is looked for
ANGLES = np.radians(np.arange(-40, 41, 5.0))  # of the axis from the upright
SHIFTS = np.linspace(-0.15, 0.15, 13)  # x width, of the axis from the silhouette's middle
LEAST_OVERLAP = 0.85  # of the silhouette with its mirror image, over both together
LEAST_SHOWN = 16  # px of the reduced picture, that can be compared
LEAST_LIKENESS = 0.35  # correlation of the colours with those of the mirror image


@dataclass(frozen=True)
class MirrorAxis:
    """A line in the photo: the points p with normal . p = offset, and how well it divides."""

    normal: tuple[float, float]  # unit
    offset: float  # px
    overlap: float  # in [0, 1], of the silhouettes
    likeness: float  # in [-1, 1], of the colours

    @property
    def is_sure(self) -> bool:
        return self.overlap >= LEAST_OVERLAP and self.likeness >= LEAST_LIKENESS

    def mirrored(self, xy: F64) -> F64:
        """The mirror images (..., 2) of photo px (..., 2)."""
        normal = np.array(self.normal)
        return xy - 2 * ((xy @ normal)[..., None] - self.offset) * normal


def find_axis(canvas: ReliefCanvas) -> MirrorAxis:
    """The best axis of the object; what is hidden of it belongs to it.

    The axis is upright within 40 degrees. Colours count where they are shown.
    """
    left, top = canvas.corner
    scale = SIDE / max(canvas.alpha.shape)
    size = tuple(max(2, round(n * scale)) for n in canvas.alpha.shape[::-1])
    area = cv2.INTER_AREA
    solid = np.asarray(cv2.resize(canvas.whole, size, interpolation=area), np.float32)
    shown = np.asarray(cv2.resize(canvas.alpha, size, interpolation=area), np.float32)
    small = cv2.resize(canvas.foreground, size, interpolation=area)
    scales = size / (canvas.step * np.array(canvas.alpha.shape[::-1]))  # both are rounded
    colour = np.asarray(cv2.GaussianBlur(small, (0, 0), 1.0), np.float32)
    picture = np.dstack([colour, shown])
    y, x = np.mgrid[: size[1], : size[0]] + 0.5
    total = max(float(solid.sum()), 1e-6)
    middle = np.array([(x * solid).sum(), (y * solid).sum()]) / total
    spread = np.sqrt(np.array([(((x - middle[0]) ** 2) * solid).sum() / total]))[0]
    trials = []
    for angle in ANGLES:
        normal = np.array([np.cos(angle), np.sin(angle)])
        for shift in SHIFTS:
            offset = float(normal @ middle + shift * 4 * spread)
            warp = _reflection(normal, offset)
            trials.append((_overlap(solid, warp), normal, offset, warp))
    best = MirrorAxis((1.0, 0.0), left + middle[0] / scales[0], 0.0, -1.0)
    highest = -1.0
    for overlap, normal, offset, warp in sorted(trials, key=lambda trial: -trial[0]):
        if 2 * overlap <= highest:
            break  # however alike the colours are
        likeness = _likeness(picture, warp)
        if overlap * (1 + likeness) > highest:
            highest = overlap * (1 + likeness)
            across = normal * scales
            length = float(np.linalg.norm(across))
            x, y = (across / length).tolist()
            in_photo = offset / length + x * left + y * top
            best = MirrorAxis((x, y), in_photo, overlap, likeness)
    return best


def _reflection(normal: F64, offset: float) -> F64:
    """(2, 3) the map of pixel indices to those of their mirror images."""
    matrix = np.eye(2) - 2 * np.outer(normal, normal)
    return np.column_stack([matrix, 2 * offset * normal - 0.5 + matrix @ [0.5, 0.5]])


def _overlap(solid: F32, warp: F64) -> float:
    """Of a silhouette (h, w) with its mirror image, over both together."""
    other = cv2.warpAffine(solid, warp, (solid.shape[1], solid.shape[0]), flags=cv2.INTER_LINEAR)
    common = float(cv2.min(solid, other).sum())
    return common / max(float(solid.sum()) + float(other.sum()) - common, 1e-6)


def _likeness(picture: F32, warp: F64) -> float:
    """Correlation of a picture (h, w, 4), colour and shown, with its mirror image; -1: unknown."""
    size = (picture.shape[1], picture.shape[0])
    image = cv2.warpAffine(picture, warp, size, flags=cv2.INTER_LINEAR)
    both = np.flatnonzero((picture[..., 3] > 0.9) & (image[..., 3] > 0.9))
    if len(both) < LEAST_SHOWN:
        return -1.0
    a, b = (np.ascontiguousarray(part.reshape(-1, 4)[both, :3].T) for part in (picture, image))
    a, b = (part - part.mean(1, keepdims=True) for part in (a, b))
    return float((a * b).sum() / max(np.sqrt((a * a).sum() * (b * b).sum()), 1e-9))
