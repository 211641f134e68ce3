"""Handles and spouts of what is turned on a lathe: round rods in a plane through its axis.

A photo shows how far a rod sticks out to the side. How far it comes towards the camera its azimuth
says: the angle of its plane about the axis, 0 where it is seen from the side. With it the rod has
its place in space, and its ends lie on the body before which they are seen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import F64, Mask
from ...base.camera import Camera
from ...base.poisson_disk import nearest_in
from ..crop import SIDE, Crop
from ..relief.body import ReliefBody
from ..relief.silhouette import ReliefSilhouette
from ..relief.thickness import Thickness

SMALLEST = 0.01  # x the silhouette, of a rod
THICKEST = 0.1  # x extent, its half width
OUT = 0.06  # x extent, that it sticks out of the body at least
SLIVER, BESIDE = 0.015, 1.5  # x extent, and x that: how much of what is beside the body is a rod's
UPRIGHT = 0.9  # cosine between the axis and the picture's upright, as those learned from stand
MOST_OBLIQUE = 0.05  # cosine between a ray and a rod's plane, from which its depth is read
BEFORE = 0.2  # x extent, over which a rod is looked for before the body
AROUND, INNER, MARGIN = 1.3, 0.8, 0.06  # x its height, and x the crop: see `_view`


@dataclass(frozen=True, eq=False)
class RodView:
    """What a photo shows of a rod, for a network that estimates its azimuth."""

    crop: Crop
    rod: Mask  # (SIDE, SIDE) of the crop, what sticks out of the body
    lean: float  # radians, of the axis's upper end towards the camera


AzimuthOf = Callable[[RodView], float | None]  # radians, above 0 towards the camera; None: unknown


@dataclass(frozen=True, eq=False)
class Axis:
    """An axis of revolution in camera axes, px."""

    centre: F64  # (3,) on it
    way: F64  # (3,) unit

    @property
    def front(self) -> F64:
        """(3,) unit, at right angles to it, towards the camera."""
        view = self.centre / np.linalg.norm(self.centre)
        front = self.way * (self.way @ view) - view
        return front / np.linalg.norm(front)


@dataclass(frozen=True, eq=False)
class TurnedBody:
    """A body of which most was turned on a lathe."""

    body: ReliefBody
    met: Mask  # (h, w) where rays meet what was turned
    axis: Axis
    camera: Camera
    share: float  # in [0, 1], of the body that becomes what is found
    thickness: float  # factor that the artist wants

    def with_rods(self, azimuth_of: AzimuthOf) -> ReliefBody:
        """Return the body whose rods lie in planes through the axis, where that is known."""
        found, way = self, self.axis.way[:2]
        if abs(way[1]) <= UPRIGHT * np.linalg.norm(way):
            return self.body
        for rod in self._rods():
            azimuth = azimuth_of(self._view(rod))
            if azimuth is not None:
                found = replace(found, body=found._placed(rod, azimuth))
        return found.body

    def _rods(self) -> list[Mask]:
        """(h, w) each: what sticks out of what was turned, and is thin."""
        outline = self.body.silhouette
        beyond = outline.inside & ~self.met
        gap = cv2.distanceTransform((~self.met).astype(np.uint8), cv2.DIST_L2, 5) * outline.cell
        # The outline of what was turned is not exact: slivers beside it are no rod's.
        sliver = SLIVER * outline.extent
        outer = (beyond & (gap > sliver)).astype(np.uint8)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(outer)
        found = []
        for label in range(1, len(stats)):
            core = labels == label
            if gap[core].max() < OUT * outline.extent:
                continue
            away = cv2.distanceTransform((~core).astype(np.uint8), cv2.DIST_L2, 5) * outline.cell
            rod = beyond & (away < BESIDE * sliver)
            is_large = rod.sum() > SMALLEST * outline.inside.sum()
            if is_large and outline.depth[rod].max() < THICKEST * outline.extent:
                found.append(rod)
        return found

    def _view(self, rod: Mask) -> RodView:
        """What is seen of a rod (h, w) and of the body beside it, on which it may end."""
        outline, camera, centre = self.body.silhouette, self.camera, self.axis.centre
        rows, columns = np.nonzero(rod)
        corners = np.array([[columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]])
        low, high = outline.photo_xy(corners.astype(np.float64) - 0.5)
        wide, tall = high - low
        side = max(AROUND * tall, (wide + INNER * tall) / (1 - 2 * MARGIN))
        is_right = 0.5 * (low[0] + high[0]) > camera.focal * centre[0] / centre[2] + camera.cx
        left = high[0] - (1 - MARGIN) * side if is_right else low[0] - MARGIN * side
        crop = Crop.at(left, 0.5 * (low[1] + high[1] - side), side, camera)
        steps = (np.arange(SIDE) + 0.5) * (crop.side / SIDE)
        at = np.stack(np.meshgrid(crop.left + steps, crop.top + steps), -1).astype(np.float64)
        x, y = np.moveaxis(outline.grid_xy(at), -1, 0).astype(np.float32)
        seen = cv2.remap(rod.astype(np.float32), x, y, cv2.INTER_LINEAR) > 0.5
        up = -np.sign(self.axis.way[1]) * self.axis.way
        return RodView(crop, seen, float(np.arcsin(-up @ centre / np.linalg.norm(centre))))

    def _placed(self, rod: Mask, azimuth: float) -> ReliefBody:
        """The body whose `rod` (h, w) has this azimuth, radians, and ends on the rest."""
        body, axis, camera = self.body, self.axis, self.camera
        outline = body.silhouette
        tangents = (outline.photo_xy(outline.cells) - [camera.cx, camera.cy]) / camera.focal
        rays = np.concatenate([tangents, np.ones((*outline.shape, 1))], -1)
        right = np.cross(axis.way, axis.front)
        is_right = (rays[rod].mean(0) * axis.centre[2] - axis.centre) @ right > 0
        side = 1.0 if is_right else -1.0
        way = side * np.cos(azimuth) * right + np.sin(azimuth) * axis.front
        normal = np.cross(axis.way, way)
        normal *= np.sign((rays[rod] @ normal).mean())
        plane = camera.focal - (normal @ axis.centre) / np.maximum(rays @ normal, MOST_OBLIQUE)
        nearest = nearest_in(rod)
        half = np.sqrt(Thickness.balls(outline)).ravel()[nearest].reshape(outline.shape)
        half *= self.thickness
        # Beside the outline, too: surfaces go on there as they are about to.
        own = rod | (~outline.inside & (nearest_in(outline.inside) == nearest))
        share = self.share * own
        front, back = (own_side.towards(half, share) for own_side in (body.front, body.back))
        middle = body.middle + share * (plane - body.middle)
        body = replace(body, middle=middle, front=front, back=back)
        ends = _swept(rod, -way[:2], outline) & outline.inside & ~own
        before = plane + half - body.middle
        own_half = body.front.half(outline.cells.reshape(-1, 2)).reshape(outline.shape)
        ends &= before > own_half
        return replace(body, front=body.front.towards(before.clip(own_half), self.share * ends))


def _swept(mask: Mask, way: F64, outline: ReliefSilhouette) -> Mask:
    """(h, w) over which `mask` (h, w) comes when it is moved in a direction (2,)."""
    x, y = way / np.linalg.norm(way)
    swept, cells = np.zeros(outline.shape, bool), mask.astype(np.uint8)
    for step in range(1, int(BEFORE * outline.extent / outline.cell)):
        moved = np.array([[1, 0, x * step], [0, 1, y * step]])
        place = cv2.warpAffine(cells, moved, outline.shape[::-1], flags=cv2.INTER_NEAREST)
        swept |= np.asarray(place) > 0
    return swept
