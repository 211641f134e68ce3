"""Matches between an object and a photo: pairs of details that look alike in two pictures.

Outline and colours hardly tell a jar that is turned a little from one that is not; where the
details of its surface have gone does. SIFT (Lowe 2004) describes them by the directions of their
gradients, which another light hardly changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask, Pixels, frozen
from ...base.camera import Camera
from ...pictures.image import to_u8

SIDE = 448  # px, to which the longer side of either object is resized before details are sought
MARGIN = 0.05  # x that side, around the object
INSIDE = 3  # px of that picture: nearer to the outline a detail is of the background
CONTRAST = 0.01  # of a detail, x the whole range: what is faint helps too, wrong pairs are few
MOST = 2000  # details of a picture
RATIO = 0.85  # x the distance to the second best detail, above which nobody knows which it is
NEAR = 0.04  # x the object's size in the photo: a point that is farther off is not where it is seen
LEAST = 8  # pairs that must agree on a pose: fewer agree by chance
TRIES, SURE = 2000, 0.9999  # of RANSAC


@dataclass(frozen=True, eq=False)
class Matches:
    """Points of an object and where a photo shows them; some are wrong."""

    points: F64  # (n, 3) in the object's frame
    seen: F64  # (n, 2) photo px
    size: float  # photo px, square root of the object's area

    def __len__(self) -> int:
        return len(self.points)

    def moved(self, matrix: F64) -> Matches:
        """Return the same points in another frame, to which `matrix` (4, 4) leads."""
        points = self.points @ matrix[:3, :3].T + matrix[:3, 3]
        return Matches(frozen(points, np.float64), self.seen, self.size)

    def gaps(self, matrix: F64, camera: Camera) -> F64:
        """(n, 2) by how much each is beside where it is seen, x `NEAR` of the size."""
        world = self.points @ matrix[:3, :3].T + matrix[:3, 3]
        world[:, 2] = np.maximum(world[:, 2], 1e-6)
        return (camera.project(world) - self.seen) / (NEAR * self.size)

    def support(self, matrix: F64, camera: Camera) -> float:
        """Return the agreement of matches with a pose, beyond chance `reliable`, in [0, 1)."""
        gaps = self.gaps(matrix, camera)
        return float(np.maximum(1.0 - (gaps * gaps).sum(1), 0.0).sum() / self.reliable)

    @property
    def reliable(self) -> int:
        """Return how many matches may agree by chance and therefore say little."""
        return len(self) + LEAST

    def pose(self, camera: Camera) -> F64 | None:
        """(4, 4) world from object, of scale 1: the pose on which most agree, if enough do."""
        if len(self) < LEAST:
            return None
        lens = np.array([[camera.focal, 0, camera.cx], [0, camera.focal, camera.cy], [0, 0, 1]])
        found, turn, move, agreed = cv2.solvePnPRansac(
            self.points, self.seen, lens, None, iterationsCount=TRIES,
            reprojectionError=NEAR * self.size, confidence=SURE, flags=cv2.SOLVEPNP_EPNP,
        )  # fmt: skip
        if not found or agreed is None or len(agreed) < LEAST:
            return None
        own = agreed.ravel().astype(np.int64)
        turn, move = cv2.solvePnPRefineLM(self.points[own], self.seen[own], lens, None, turn, move)
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = cv2.Rodrigues(turn)[0], move.ravel()
        world = self.points[own] @ matrix[:3, :3].T + matrix[:3, 3]
        return matrix if (world[:, 2] > 0).all() else None


def alike(one: tuple[Pixels, Mask], other: tuple[Pixels, Mask]) -> tuple[F64, F64]:
    """Find the places (n, 2), px, that look alike in two pictures, each with its object's mask."""
    found = [_details(*picture) for picture in (one, other)]
    (at, own), (there, others) = found
    if len(own) < 2 or len(others) < 2:
        return np.empty((0, 2)), np.empty((0, 2))
    likeness = own @ others.T
    best = likeness.argmax(1)
    two = np.sqrt(np.maximum(2 - 2 * -np.partition(-likeness, 1, axis=1)[:, :2], 0))
    is_mutual = likeness.argmax(0)[best] == np.arange(len(best))
    kept = is_mutual & (two[:, 0] < RATIO * two[:, 1])
    return at[kept], there[best[kept]]


def _details(pixels: Pixels, mask: Mask) -> tuple[F64, F32]:
    """Where (n, 2) px they are, and what they look like (n, 128), of unit length."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    x0, x1, y0, y1 = columns[0], columns[-1] + 1, rows[0], rows[-1] + 1
    side = (1 + 2 * MARGIN) * max(x1 - x0, y1 - y0)
    zoom = SIDE / side
    corner = 0.5 * np.array([x0 + x1 - side, y0 + y1 - side])
    warp = np.array([[zoom, 0, 0.0], [0, zoom, 0.0]])
    warp[:, 2] = zoom * (0.5 - corner) - 0.5
    grey = cv2.cvtColor(to_u8(pixels), cv2.COLOR_RGB2GRAY)
    own = np.where(mask, grey, np.uint8(grey[mask].mean()))  # no background, no edge beyond it
    way = cv2.INTER_CUBIC if zoom > 1 else cv2.INTER_AREA
    own = cv2.warpAffine(own, warp, (SIDE, SIDE), flags=way, borderMode=cv2.BORDER_REPLICATE)
    inside = cv2.warpAffine(mask.astype(np.uint8), warp, (SIDE, SIDE), flags=cv2.INTER_NEAREST)
    inside = cv2.erode(inside, np.ones((2 * INSIDE + 1, 2 * INSIDE + 1), np.uint8))
    sift = cv2.SIFT.create(nfeatures=MOST, contrastThreshold=CONTRAST)
    spots, looks = sift.detectAndCompute(own, inside)
    if looks is None or not len(spots):
        return np.empty((0, 2)), np.empty((0, 128), np.float32)
    at = (np.array([spot.pt for spot in spots]) + 0.5) / zoom + corner
    looks = np.sqrt(looks / np.maximum(looks.sum(1, keepdims=True), 1e-9))  # Arandjelovic 2012
    return at, np.asarray(looks, np.float32)
