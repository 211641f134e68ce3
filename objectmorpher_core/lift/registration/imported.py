"""An object from elsewhere as a lifted object: registered, textured with the photo, ready to move.

What the photo shows of it carries the photo; the rest has the object's own colours, brought into
the photo's light. The silhouettes never agree to the pixel. Where the object reaches a little
beyond the cut-out it is cut off by the matte; where the cut-out reaches beyond the object, a brim
in the depth of the rim carries it along (as the relief's brim carries a soft edge). So at rest the
object is the photo's cut-out, all of it and nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import KDTree

from ...base.arrays import F32, F64, Mask, Pixels, Selection
from ...base.camera import Camera
from ...base.progress import Progress, part, silent
from ...base.rotations import matrices_from_quats, quats_along, quats_from_matrices
from ...base.threads import LEAST_ROWS, in_threads
from ...deform.control_points import COUNT, sample_control_points
from ...document.gaussians import Gaussians
from ...document.model import LiftedObject, Matte, PhotoTexture
from ...segment.mask_edit import is_selected
from ...splat_files import COUNT as MESH_COUNT
from ...splat_files import read_object
from .. import LiftError
from ..beyond_frame import cut_out_beyond
from ..relief.canvas import bilinear
from ..relief.colours import BLUR, in_light
from ..relief.lifter import TANGENT_SIGMA
from .placement import Hints, Proposal, Registrar, Registration, register
from .shown import Brim, brim_around, rest_picture, visibilities
from .sketch import OUTLIER, own_frame
from .view import Target

# An object from a file instead of a lifted one: read, registered to the photo, textured.

UP = (0.0, -1.0, 0.0)  # of the object frame: y is down


@dataclass(frozen=True, eq=False)
class ImportTarget:
    """The target of an import: a photo, and the mask that the object stands for."""

    pixels: Pixels  # (H, W, 3)
    camera: Camera
    mask: Selection  # (H, W) bool, or soft u8
    is_focal_free: bool = False  # whether the camera's focal length is only a guess
    mixed: Mask | None = None  # (H, W) where the edge brush has found the mask's softness

    @property
    def target(self) -> Target:
        return Target(self.pixels, is_selected(self.mask), self.camera)


@dataclass(frozen=True, eq=False)
class Import:
    """A file's Gaussians, and the poses in which they look like the photo."""

    gaussians: Gaussians
    registration: Registration


@dataclass(frozen=True)
class Source:
    """An object's file, and how it is read."""

    path: Path
    count: int = MESH_COUNT  # Gaussians of a mesh
    is_flipped: bool = False  # stands on its head in the file


def register_file(
    source: Source, scene: ImportTarget, progress: Progress = silent, seed: int = 0
) -> Import:
    """Reads an object and finds out where it stands in the photo.

    Raises SplatFileError, LiftError.
    """
    progress(0.0, "Reading the object")
    gaussians = read_object(source.path, source.count, source.is_flipped)
    hints = Hints(is_focal_free=scene.is_focal_free, up=UP)
    found = register(gaussians, scene.target, hints, part(progress, 0.1, 1.0), seed)
    return Import(gaussians, found)


def fit_near(
    scene: ImportTarget,
    gaussians: Gaussians,
    start: F64,
    progress: Progress = silent,
    seed: int = 0,
) -> Import:
    """The best pose near `start` (4, 4 world from object); that one where none is better."""
    progress(0.0, "Fitting the object")
    registrar = Registrar(gaussians, scene.target, seed)
    best = registrar.improved(registrar.rated(start), scene.is_focal_free)
    return Import(gaussians, Registration((best,), False, ""))


def place_import(
    scene: ImportTarget,
    gaussians: Gaussians,
    proposal: Proposal,
    progress: Progress = silent,
    seed: int = 0,
) -> tuple[Matte, LiftedObject]:
    """The object in a proposed pose, with the photo on what the photo shows of it.

    The document's camera must become `proposal.camera`. Raises LiftError.
    """
    progress(0.0, "Cutting out the object")
    matte = cut_out_beyond(scene.pixels, scene.mask, scene.mixed)
    rest = part(progress, 0.4, 1.0)
    return matte, lift_imported(gaussians, proposal, matte, progress=rest, seed=seed)


# The colours of an object from elsewhere, brought into the light of the photo it stands in.
#
# One exposure for each channel is fitted where the photo shows the object. What is left of the
# difference there continues over what the photo does not show, and fades with the distance: the two
# meet without a seam.

SURE = 0.5  # visibility of a Gaussian that shows something of the light
OPAQUE = 0.95  # alpha of the matte, likewise
LEAST = 12  # such Gaussians
GLANCE = 4.0  # what is seen at a glance only has the photo's colour all the same
CARRIED = 0.10  # object units: how far what is left of the difference is carried on
REACH = 0.28  # object units, beyond which less than 1/2000 of it is left: nothing is looked for
TELLING = 20_000  # Gaussians that are asked at most: the difference is smooth
NEAREST = 12  # Gaussians that it is the mean of
GRID = 8  # cells in REACH
MOST_CELLS = 128  # along what is known: fewer are in REACH where that is far apart
PIECE = 1 << 16  # Gaussians that are looked up at once: some 40 MB


def recolored(lifted: LiftedObject, seen: F32, matte: Matte, camera: Camera) -> F32:
    """(N, 3) colours: the photo's where it is `seen` (N,), else the object's in its light."""
    spacing_px = lifted.spacing * lifted.scale * camera.focal / float(lifted.centre[2])
    at = lifted.texture.u0.astype(np.float64) - [matte.left + 0.5, matte.top + 0.5]
    blurred = cv2.GaussianBlur(matte.foreground, (0, 0), max(BLUR * spacing_px, 0.5))
    photo = bilinear(blurred, at)
    alpha = bilinear(cv2.erode(matte.alpha, np.ones((3, 3), np.uint8)), at)
    inside = ((at > 0) & (at < [matte.alpha.shape[1] - 1, matte.alpha.shape[0] - 1])).all(1)
    sure = (seen > SURE) & (alpha > OPAQUE) & inside
    own = lifted.gaussians.colors.astype(np.float64)
    if sure.sum() < LEAST:
        return lifted.gaussians.colors
    lit = in_light(own, own[sure], photo[sure])
    points = lifted.gaussians.means.astype(np.float64)
    share = np.where(inside & (alpha > OPAQUE), np.minimum(GLANCE * seen, 1), 0.0)
    own_part = np.flatnonzero(share < 1)  # the rest is the photo's, whatever its light
    lit[own_part] += _carried_on(points[own_part], points[sure], (photo - lit)[sure])
    return np.clip(lit + share[:, None] * (photo - lit), 0, 1).astype(np.float32)


def _carried_on(points: F64, known: F64, rest: F64) -> F64:
    """(N, 3) `rest` (n, 3) at the `known` points (n, 3), continued to `points` (N, 3).

    Neighbours are looked for within REACH only. From the far side of an object all that is known
    is about equally far: a tree would look at nearly all of it for each point.
    """
    step = len(known) // TELLING + 1
    known, rest = known[::step], rest[::step]
    tree, count = KDTree(known), min(NEAREST, len(known))
    rest = np.vstack([rest, np.zeros(3)])  # the last one: of neighbours that are not there
    carried, reached = np.zeros_like(points), np.flatnonzero(_may_reach(points, known))

    def run(first: int, last: int) -> None:
        for start in range(first, last, PIECE):
            piece = reached[start : min(start + PIECE, last)]
            distance, near = tree.query(points[piece], k=count, distance_upper_bound=REACH)
            distance = distance.reshape(-1, count)
            width = np.clip(distance[:, -1:], 1e-9, REACH)
            weight = np.maximum(1 - (distance / (1.01 * width)) ** 2, 0)
            total = np.maximum(weight.sum(1, keepdims=True), 1e-300)
            mean = (rest[near.reshape(-1, count)] * weight[..., None]).sum(1) / total
            carried[piece] = mean * np.exp(-((distance[:, :1] / CARRIED) ** 2))

    in_threads(run, len(reached), least=LEAST_ROWS)
    return carried


def _may_reach(points: F64, known: F64) -> Mask:
    """(N,) False where no `known` point (n, 3) is within REACH, by a grid."""
    cell = max(REACH / GRID, float(np.ptp(known, axis=0).max()) / MOST_CELLS)
    low = known.min(0) - 2 * REACH
    marked = np.zeros(((np.ptp(known, axis=0) + 4 * REACH) / cell).astype(int) + 1, bool)
    marked[tuple(((known - low) / cell).astype(int).T)] = True
    apart = np.asarray(distance_transform_edt(~marked))  # between the cells' centres, in cells
    own = ((points - low) / cell).clip(0, np.array(marked.shape) - 1).astype(int)
    return np.asarray(apart[tuple(own.T)] <= REACH / cell + np.sqrt(3))


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
        gaussians, texture, points, world_from_object, spacing, "imported", splatting, up=UP
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
        plain.backend, plain.splatting, up=plain.up,
    )  # fmt: skip
