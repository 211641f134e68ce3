"""Gaussians where the edit has put them: what every renderer reads."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..base.arrays import F32, F64, frozen
from ..base.camera import Camera
from ..deform.binding import LANES
from ..deform.skinning import Skin, Skinned
from ..document.model import LiftedObject
from ..document.sides import HIDDEN
from .rules import SPLATTINGS, Splatting

SURFACE_GAP = 5.0  # x spacing: samples farther apart in depth are different surfaces
TEXTURE_GAP = 3.0  # x spacing in the photo: likewise for what they show of it

# Rows of a block of Gaussians at rest, see `RestSplats.blocks`.
COVARIANCE = 3  # after the mean: xx, xy, xz, yy, yz, zz
PICTURE = COVARIANCE + 6  # covariance of the rest picture with the rest object, row by row
NORMAL = PICTURE + 6
U0 = NORMAL + 3
VISIBILITY, SOLIDITY, OPACITY, ZOOM, COSINE = range(U0 + 2, U0 + 7)
COLOUR = COSINE + 1
REST_ROWS = COLOUR + 3
# Rows of a block of where they look in invented pictures, see `RestSplats.side_blocks`.
SIDE_U0 = 6  # after the covariance of the picture with the rest object
SIDE_ZOOM = SIDE_U0 + 2
SIDE_ROWS = SIDE_ZOOM + 1

ENDLESS = 1e12  # px per world unit, of a photo that cannot be carried along
UNFADED = 3.0  # x as far may the photo be drawn out, see `RestSplats.unfaded`
BEYOND = 1.3  # x half the photo: Jacobians are taken no farther out (Kerbl et al. 2023)


class RestSplats:
    """A lifted object in the photo, with everything that does not depend on its motion."""

    def __init__(self, lifted: LiftedObject, camera: Camera) -> None:
        """`camera` is the photo's, unless the object brings its own."""
        self.lifted = lifted
        self.camera = camera = lifted.photo_camera(camera)
        self.splatting: Splatting = SPLATTINGS[lifted.splatting]
        self.world_from_object = lifted.world_from_object
        self.means = frozen(lifted.gaussians.means, np.float64)  # (N, 3) object frame
        world = lifted.world_points(self.means)
        self.zoom = frozen(camera.focal / world[:, 2])  # (N,) px per world unit
        self.sides = lifted.sides
        self.spacing = lifted.spacing * lifted.scale  # world units
        self.spacing_px = self.spacing * float(np.median(self.zoom))
        self._jacobians = projection_jacobians(world, camera.focal)

    def __len__(self) -> int:
        return len(self.means)

    def carried(self, photo_camera: Camera) -> Camera:
        """Return the camera of the photo that the object carries, by default the document's."""
        return self.lifted.photo_camera(photo_camera)

    @cached_property
    def is_textured(self) -> bool:
        """Whether any of the Gaussians shows the photo."""
        return bool(self.lifted.texture.visibility.any())

    def painted(self, colors: np.ndarray, has_edge: bool = True) -> RestSplats:
        """Return the same object in plain `colors` (N, 3), with nothing of the photo on it.

        Without what carries its soft edge if not `has_edge`.
        """
        other = copy.copy(self)
        gaussians = replace(self.lifted.gaussians, colors=np.asarray(colors, np.float32))
        if not has_edge:
            is_solid = self.lifted.texture.solidity > 0.5
            gaussians = replace(gaussians, opacities=gaussians.opacities * is_solid)
        other.lifted = replace(self.lifted, gaussians=gaussians)
        # The photo's part ends where the motion stretches it too much: here everywhere.
        other.zoom = frozen(np.full(len(self), ENDLESS))
        other.is_textured, other.sides = False, None
        other.__dict__.pop("side_blocks", None)  # of the invented pictures, if they were asked for
        blocks = self.blocks.copy()
        table = np.zeros((blocks.shape[0] * LANES, 4))
        table[: len(self)] = np.column_stack([gaussians.colors, gaussians.opacities])
        table = table.reshape(-1, LANES, 4).transpose(0, 2, 1)
        blocks[:, COLOUR:], blocks[:, OPACITY] = table[:, :3], table[:, 3]
        blocks[:, ZOOM] = ENDLESS
        other.blocks = frozen(blocks)
        return other

    def unfaded(self) -> RestSplats:
        """Return the same object whose motion may draw the photo out threefold more."""
        other = copy.copy(self)
        other.zoom = frozen(self.zoom / UNFADED)
        other.__dict__.pop("blocks", None)
        return other

    def recoloured(self, colors: np.ndarray) -> RestSplats:
        """Return the same object in own `colors` (N, 3); it shows the photo as it did."""
        gaussians = replace(self.lifted.gaussians, colors=np.asarray(colors, np.float32))
        return self.changed_to(replace(self.lifted, gaussians=gaussians))

    def changed_to(self, lifted: LiftedObject) -> RestSplats:
        """Return the object as `lifted`, which differs in own colours and visibility only."""
        other = copy.copy(self)
        other.lifted = lifted
        other.__dict__.pop("is_textured", None)
        blocks = self.blocks.copy()
        table = np.zeros((blocks.shape[0] * LANES, 4), np.float32)
        table[: len(self), :3] = lifted.gaussians.colors
        table[: len(self), 3] = lifted.texture.visibility
        rows = table.reshape(-1, LANES, 4).transpose(0, 2, 1)
        blocks[:, COLOUR:], blocks[:, VISIBILITY] = rows[:, :3], rows[:, 3]
        other.blocks = frozen(blocks)
        return other

    @cached_property
    def covariances(self) -> F64:
        """Sigma (N, 3, 3), world."""
        linear = self.world_from_object[:3, :3]
        return frozen(linear @ self.lifted.gaussians.covariances() @ linear.T)

    @cached_property
    def pictures(self) -> F64:
        """J0 Sigma (N, 2, 3): covariance of the rest picture, px, with the rest world."""
        return frozen(self._jacobians @ self.covariances)

    @cached_property
    def side_pictures(self) -> F64:
        """(N, 2, 3) the same of the invented picture that each may look into."""
        assert self.sides is not None, "there are some"
        return frozen(self.sides.slopes.astype(np.float64) @ self.covariances)

    @cached_property
    def normals(self) -> F64:
        """(N, 3) outward, world, unit."""
        normals = self.lifted.gaussians.normals.astype(np.float64)
        normals = normals @ self.world_from_object[:3, :3].T
        return frozen(normals / np.linalg.norm(normals, axis=1, keepdims=True))

    @cached_property
    def shown_normals(self) -> F64:
        """(N, 3) normals of what their colours are of, world, unit.

        What the photo did not show has the colours of the front: there it is the mirrored normal.
        """
        views = self.lifted.world_points(self.means)
        away = (self.normals * views).sum(1) / (views * views).sum(1)
        return frozen(self.normals - (2 * np.maximum(away, 0))[:, None] * views)

    @cached_property
    def cosines(self) -> F64:
        """(N,) of the normal with the direction to the camera.

        What something else hides, and a picture shows, is as if it faced away: it never shows the
        photo, which has something else there.
        """
        world = self.lifted.world_points(self.means)
        found = -(self.normals * world).sum(1) / np.linalg.norm(world, axis=1)
        if self.sides is not None:
            seen = self.lifted.texture.visibility
            found[(self.sides.zoom != 0) & np.isclose(seen, HIDDEN, atol=0)] = -1.0
        return frozen(found)

    @cached_property
    def side_blocks(self) -> F32:
        """(blocks, SIDE_ROWS, LANES) where they look in invented pictures; empty without any."""
        if self.sides is None:
            return frozen(np.zeros((0, SIDE_ROWS, LANES), np.float32))
        pictures = self.sides.slopes.astype(np.float64) @ self.world_from_object[:3, :3]
        pictures = pictures @ self.lifted.gaussians.covariances()
        rows = [pictures[:, 0], pictures[:, 1], self.sides.at, self.sides.zoom[:, None]]
        return _in_blocks(np.hstack(rows))

    @cached_property
    def blocks(self) -> F32:
        """(blocks, REST_ROWS, LANES): 64 Gaussians side by side, in the object's frame.

        As `projection` reads them, for vector instructions, in half the memory of what it computes
        with; the rest of the last block is 0.
        """
        gaussians, texture = self.lifted.gaussians, self.lifted.texture
        covariances = gaussians.covariances()
        pictures = self._jacobians @ self.world_from_object[:3, :3] @ covariances
        rows = [
            self.means, covariances[:, 0], covariances[:, 1, 1:], covariances[:, 2, 2:],
            pictures[:, 0], pictures[:, 1], gaussians.normals, texture.u0,
            texture.visibility[:, None], texture.solidity[:, None], gaussians.opacities[:, None],
            self.zoom[:, None], self.cosines[:, None], gaussians.colors,
        ]  # fmt: skip
        return _in_blocks(np.hstack(rows))


def _in_blocks(rows: np.ndarray) -> F32:
    """(blocks, R, LANES) of rows (N, R), the rest of the last block 0."""
    count = -(-len(rows) // LANES)
    table = np.zeros((count * LANES, rows.shape[1]), np.float32)
    table[: len(rows)] = rows
    return frozen(table.reshape(count, LANES, -1).transpose(0, 2, 1))


@dataclass(frozen=True, eq=False)
class PosedSplats:
    """An object's Gaussians after the edit, with what each carries of the photo."""

    rest: RestSplats
    motion: Skin | Skinned | None  # in the object's frame; None: as they were lifted
    placement: F64  # (4, 4) world motion after it

    def __len__(self) -> int:
        return len(self.rest)

    def painted(self, colors: np.ndarray, has_edge: bool = True) -> PosedSplats:
        """Return the same object in plain `colors` (N, 3), see `RestSplats.painted`."""
        return replace(self, rest=self.rest.painted(colors, has_edge))

    def recoloured(self, colors: np.ndarray) -> PosedSplats:
        """Return the same object in own `colors` (N, 3), see `RestSplats.recoloured`."""
        return replace(self, rest=self.rest.recoloured(colors))

    @property
    def is_layered(self) -> bool:
        """Whether the picture is made of layers, and not of Gaussians one by one."""
        return self.rest.splatting.is_surface or self.rest.is_textured

    @property
    def scale(self) -> float:
        """Return the factor by which the placement enlarges."""
        return float(np.cbrt(np.linalg.det(self.placement[:3, :3])))

    @property
    def gap(self) -> float:
        """World units, see SURFACE_GAP."""
        return SURFACE_GAP * self.rest.spacing * self.scale

    @property
    def texture_gap(self) -> float:
        """Px of the photo, see TEXTURE_GAP."""
        return TEXTURE_GAP * self.rest.spacing_px

    @property
    def world_from_object(self) -> F64:
        """(4, 4) where the deformed object stands."""
        return self.placement @ self.rest.world_from_object

    @cached_property
    def skinned(self) -> Skinned:
        """The deformation alone, object frame."""
        if isinstance(self.motion, Skin):
            return self.motion.run()
        if self.motion is None:
            turns = np.broadcast_to(np.eye(3), (len(self), 3, 3))
            return Skinned(self.rest.means, turns)
        return self.motion

    @cached_property
    def means(self) -> F64:
        """(N, 3) world."""
        matrix = self.world_from_object
        return self.skinned.points @ matrix[:3, :3].T + matrix[:3, 3]

    @cached_property
    def linear(self) -> F64:
        """F (N, 3, 3): motion of the surroundings of each mean, world from rest world."""
        world = self.rest.world_from_object[:3, :3]
        return self.world_from_object[:3, :3] @ self.skinned.linear @ np.linalg.inv(world)

    @cached_property
    def nodes(self) -> F64:
        """(M, 3) world: the control points; of pieces, which have none of their own, the means."""
        points = self.rest.lifted.control_points
        if isinstance(self.motion, Skin):
            points = self.motion.motion.points
        elif self.motion is not None:
            points = self.motion.points
        matrix = self.world_from_object
        return points @ matrix[:3, :3].T + matrix[:3, 3]


def projection_jacobians(points: np.ndarray, focal: float) -> F64:
    """d image px / d world (N, 2, 3) at world points (N, 3): the J of EWA splatting."""
    x, y, z = points.T
    jacobians = np.zeros((len(points), 2, 3))
    jacobians[:, 0, 0] = jacobians[:, 1, 1] = focal / z
    jacobians[:, 0, 2] = -focal * x / z**2
    jacobians[:, 1, 2] = -focal * y / z**2
    return jacobians


def view_limits(camera: Camera) -> tuple[float, float]:
    """|x / z| and |y / z| of the directions in which `camera` sees at most, and a little more."""
    across = max(camera.cx, camera.width - camera.cx)
    down = max(camera.cy, camera.height - camera.cy)
    return BEYOND * across / camera.focal, BEYOND * down / camera.focal
