"""An object from elsewhere as a lifted object: registered, textured with the photo, ready to move.

What the photo shows of it carries the photo; the rest has the object's own colours, brought into
the photo's light. The silhouettes never agree to the pixel. Where the object reaches a little
beyond the cut-out it is cut off by the matte; where the cut-out reaches beyond the object, a brim
in the depth of the rim carries it along (as the relief's brim carries a soft edge). So at rest the
object is the photo's cut-out, all of it and nothing else.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from ...base.arrays import F32, F64
from ...base.camera import Camera
from ...base.progress import Progress, silent
from ...base.rotations import matrices_from_quats, quats_along, quats_from_matrices
from ...deform.control_points import COUNT, sample_control_points
from ...document.gaussians import Gaussians
from ...document.model import LiftedObject, Matte, PhotoTexture
from .. import LiftError
from ..relief.lifter import TANGENT_SIGMA
from .placement import Proposal
from .recolor import recolored
from .shown import Brim, brim_around, rest_picture, visibilities
from .sketch import OUTLIER, own_frame

FAINTEST = 1 / 255  # opacity below which a Gaussian never shows
SURFEL = 0.5  # x its second axis: a Gaussian of a surface is thinner
MOSTLY = 0.95  # share of the Gaussians that are surfels: the object is a surface
NEIGHBOURS = 6
ASKED = 20_000  # Gaussians whose neighbours are measured
MIN_COUNT = 16  # Gaussians


def lift_imported(
    gaussians: Gaussians,
    proposal: Proposal,
    matte: Matte,
    splatting: str | None = None,
    progress: Progress = silent,
    seed: int = 0,
) -> LiftedObject:
    """`gaussians` where `proposal` of their registration puts them, with the photo of `matte`.

    `splatting` is how they are meant to be drawn; None: "solid" for surfels that know their
    normals, such as a mesh's, else "classic". The photo's camera must be the proposal's.
    Raises LiftError.
    """
    progress(0.0, "Preparing the object")
    gaussians, world_from_object = _in_own_frame(gaussians, proposal.world_from_object)
    splatting = splatting or ("solid" if _is_surface(gaussians) else "classic")
    spacing = _spacing(gaussians)
    plain = _lifted(gaussians, world_from_object, spacing, splatting, proposal.camera)
    progress(0.3, "Finding what the photo shows")
    picture = rest_picture(plain, proposal.camera, matte)
    seen = visibilities(plain, picture, matte)
    progress(0.6, "Matching its colours to the photo")
    colors = recolored(plain, seen, matte, proposal.camera)
    progress(0.8, "Carrying the photo's edge")
    brim = brim_around(plain, picture, matte, np.random.default_rng(seed))
    progress(0.9, "Choosing control points")
    return _assembled(plain, seen, colors, brim, proposal.camera)


def rematted(lifted: LiftedObject, matte: Matte, camera: Camera, seed: int = 0) -> LiftedObject:
    """An object from elsewhere with another `matte` of the photo on it; its shape stays."""
    body = np.flatnonzero(lifted.texture.solidity > 0.5)
    nothing = np.zeros(len(body), np.float32)
    texture = PhotoTexture(lifted.texture.u0[body], nothing, nothing + 1)
    plain = replace(lifted, gaussians=lifted.gaussians.select(body), texture=texture, sides=None)
    picture = rest_picture(plain, camera, matte)
    seen = visibilities(plain, picture, matte)
    brim = brim_around(plain, picture, matte, np.random.default_rng(seed))
    return _assembled(plain, seen, plain.gaussians.colors, brim, camera)


def _in_own_frame(gaussians: Gaussians, world_from_file: F64) -> tuple[Gaussians, F64]:
    """The Gaussians centred, their largest extent 1, and where they stand then."""
    gaussians = gaussians.select(gaussians.opacities >= FAINTEST)
    if len(gaussians) < MIN_COUNT:
        raise LiftError(f"the object has {len(gaussians)} Gaussians, too few to be moved")
    first = own_frame(gaussians)
    means = gaussians.means @ first[:3, :3].T + first[:3, 3]
    gaussians = gaussians.select(np.flatnonzero((np.abs(means) < 0.5 + OUTLIER).all(1)))
    low, high = gaussians.means.min(0).astype(np.float64), gaussians.means.max(0).astype(np.float64)
    extent = float((high - low).max())
    file_from_object = np.eye(4) * extent
    file_from_object[:3, 3], file_from_object[3, 3] = 0.5 * (low + high), 1.0
    means = (gaussians.means - 0.5 * (low + high)) / extent
    scales = np.sort(gaussians.scales, axis=1)[:, ::-1] / extent
    axes = _thinnest_last(gaussians)
    # Of a closed surface the integral of p n is three times its volume: some are inside out.
    if ((means * axes[:, :, 2]).sum(1) * scales[:, 0] * scales[:, 1]).sum() < 0:
        axes[:, :, 1:] *= -1
    quats = quats_from_matrices(axes)
    own = Gaussians(
        np.asarray(means, np.float32), np.asarray(quats, np.float32),
        np.asarray(scales, np.float32), gaussians.opacities, gaussians.colors,
    )  # fmt: skip
    return own, world_from_file @ file_from_object


def _thinnest_last(gaussians: Gaussians) -> F64:
    """Axes (N, 3, 3) with the thinnest as local +z; where it was z already, its sign is kept."""
    axes = matrices_from_quats(gaussians.quats.astype(np.float64))
    order = np.argsort(-gaussians.scales, axis=1, kind="stable")
    turned = np.take_along_axis(axes, order[:, None, :], axis=2)
    mirrored = np.linalg.det(turned) < 0
    turned[mirrored, :, 0] *= -1
    return turned


def _is_surface(gaussians: Gaussians) -> bool:
    """Whether they are opaque surfels."""
    scales = gaussians.scales
    is_surfel = (scales[:, 2] < SURFEL * scales[:, 1]) & (gaussians.opacities > 0.9)
    return float(is_surfel.mean()) > MOSTLY


def _spacing(gaussians: Gaussians) -> float:
    """Mean distance of neighbours on the surface, object units."""
    points = gaussians.means.astype(np.float64)
    count = min(NEIGHBOURS, len(points) - 1)
    asked = points[:: len(points) // ASKED + 1]
    reach = KDTree(points).query(asked, k=count + 1)[0][:, -1]
    even = float(np.median(reach)) * np.sqrt(np.pi / (count + 1))
    return max(even, 1e-4)


def _lifted(
    gaussians: Gaussians, world_from_object: F64, spacing: float, splatting: str, camera: Camera
) -> LiftedObject:
    """The object where it stands, with nothing of the photo on it."""
    world = gaussians.means @ world_from_object[:3, :3].T + world_from_object[:3, 3]
    if (world[:, 2] <= 0).any():
        raise LiftError("a part of the object would be behind the camera")
    nothing = np.zeros(len(gaussians), np.float32)
    texture = PhotoTexture(camera.project(world), nothing, nothing + 1)
    try:
        points = sample_control_points(gaussians.means, gaussians.opacities, COUNT)
    except ValueError as error:
        raise LiftError(str(error)) from error
    return LiftedObject(
        gaussians, texture, points, world_from_object, spacing, "imported", splatting
    )


def _assembled(
    plain: LiftedObject, seen: F32, colors: F32, brim: Brim, camera: Camera
) -> LiftedObject:
    """The object and its brim."""
    body, count = plain.gaussians, len(brim.world)
    means = plain.object_points(brim.world)
    turn = plain.world_from_object[:3, :3] / plain.scale
    sigma = TANGENT_SIGMA * brim.spacing / plain.scale
    gaussians = Gaussians(
        *(
            np.concatenate([own, more]).astype(np.float32)
            for own, more in (
                (body.means, means),
                (body.quats, quats_along(brim.normals @ turn) if count else np.zeros((0, 4))),
                (body.scales, np.full((count, 3), sigma)),
                (body.opacities, np.ones(count)),
                (colors, brim.colors),
            )
        )
    )
    texture = PhotoTexture(
        np.concatenate([plain.texture.u0, camera.project(brim.world)]),
        np.concatenate([seen, np.ones(count, np.float32)]),
        np.concatenate([np.ones(len(body), np.float32), np.zeros(count, np.float32)]),
    )
    return LiftedObject(
        gaussians, texture, plain.control_points, plain.world_from_object, plain.spacing,
        plain.backend, plain.splatting,
    )  # fmt: skip
