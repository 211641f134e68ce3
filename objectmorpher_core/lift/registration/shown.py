"""The photo on a registered object, and the parts of the cut-out that the object misses."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask, crop
from ...base.camera import Camera
from ...base.poisson_disk import distance_inside, scattered, thin_to_spacing
from ...document.model import LiftedObject, Matte
from ...raster import tiles
from ...raster.posed import PosedSplats, RestSplats
from ...raster.texture import build_levels
from ..relief.canvas import bilinear
from ..relief.spreading import BRIM, OVERSAMPLING, PACKING

LONGEST = 1024  # px, longer side of the picture whose depths tell what hides what
SLACK, CLOUD_SLACK = 2.5, 5.0  # x spacing behind what is seen there: still the same surface
BESIDE = 0.6  # x spacing: how far around its mean a Gaussian is looked for
WAYS = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])  # the first one: where it is
# Cosines of normal and view ray: nothing shown, and all. What is seen at a glance is the photo's,
# too; that its pixels are too few for it when it turns is for the rules of the picture to see.
AWAY, FACING = -0.05, 0.0
STEEP = 12.0  # x spacing: how much nearer or farther a steep plane may be there
COVERED = 0.5  # alpha of the object from which a pixel belongs to it
SOFTEST = 0.02  # alpha of the matte that is worth being carried
CUT = 0.04  # x extent: so far beyond the cut-out the object is cut off by it, not shown plain
EDGE_BLUR = 2.0  # px of the rest picture: the rim's direction


@dataclass(frozen=True, eq=False)
class RestPicture:
    """The object at rest as the photo's camera sees it, in a window of the photo."""

    camera: Camera  # the window's
    left: float  # px of the photo, its corner
    top: float
    zoom: float  # px of the window per photo px
    alpha: F32  # (h, w)
    depth: F32  # (h, w) world units; inf where nothing is

    def at(self, xy: np.ndarray) -> F64:
        """Window px (N, 2) of photo px."""
        return (xy - [self.left, self.top]) * self.zoom


def rest_picture(lifted: LiftedObject, camera: Camera, matte: Matte) -> RestPicture:
    """The object, whose Gaussians show nothing of the photo, and all around that the matte has."""
    pad = BRIM * lifted.spacing * lifted.scale * camera.focal / float(lifted.centre[2]) + 2
    corners = np.array(matte.box, np.float64).reshape(2, 2)
    u0 = lifted.texture.u0
    # What lies far outside the cut-out is not carried, and not looked at.
    reach = np.ptp(corners, axis=0)
    low = np.maximum(np.minimum(corners[0], u0.min(0) - pad), corners[0] - reach)
    high = np.minimum(np.maximum(corners[1], u0.max(0) + pad), corners[1] + reach)
    zoom = min(1.0, LONGEST / float((high - low).max()))
    low = np.floor(low)
    width, height = (int(v) for v in np.ceil((high - low) * zoom))
    window = camera.windowed(float(low[0]), float(low[1]), width, height, zoom)
    nothing = np.zeros((4, 4), np.float32)
    texture = build_levels(np.dstack([nothing] * 3), nothing, 0, 0)
    splats = PosedSplats(RestSplats(lifted, camera), None, np.eye(4))
    drawn = tiles.render(splats, texture, window, camera)
    return RestPicture(window, float(low[0]), float(low[1]), zoom, drawn.alpha, drawn.depth)


def visibilities(lifted: LiftedObject, picture: RestPicture, matte: Matte) -> F32:
    """(N,) how much of each Gaussian the photo shows."""
    world = lifted.world_points(lifted.gaussians.means.astype(np.float64))
    has_normals = lifted.splatting not in ("mip", "classic")
    normals = lifted.gaussians.normals.astype(np.float64) @ lifted.world_from_object[:3, :3].T
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    shown = _unhidden(lifted, picture, world, normals if has_normals else None)
    if has_normals:
        cosine = -(normals * world).sum(1) / np.linalg.norm(world, axis=1)
        shown *= np.clip((cosine - AWAY) / (FACING - AWAY), 0, 1)
    shown[_far_outside(lifted, matte)] = 0.0
    return shown.astype(np.float32)


def _unhidden(
    lifted: LiftedObject, picture: RestPicture, world: F64, normals: F64 | None
) -> F64:  # fmt: skip
    """(N,) how much of a Gaussian, and of its plane around it, nothing is in front of."""
    spacing = lifted.spacing * lifted.scale
    step = BESIDE * spacing * picture.camera.focal / world[:, 2:]
    slack = (SLACK if normals is not None else CLOUD_SLACK) * spacing
    at, seen = picture.at(lifted.texture.u0), np.zeros((len(WAYS), len(world)))
    if normals is not None:  # within a pixel the depth of a steep surface is as uncertain
        cosine = np.abs((normals * world).sum(1)) / np.linalg.norm(world, axis=1)
        pixel = world[:, 2] / picture.camera.focal
        slack = slack + pixel * np.minimum(1 / np.maximum(cosine, 1e-6), STEEP)
    depth = np.where(picture.alpha > COVERED, picture.depth, np.inf)
    height, width = depth.shape
    for k, way in enumerate(WAYS):
        column, row = np.floor(at + way * step).astype(int).T
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        front = depth[row.clip(0, height - 1), column.clip(0, width - 1)]
        own = world[:, 2]
        if normals is not None:  # where the plane is at that pixel
            rays = picture.camera.unproject(np.column_stack([column, row]) + 0.5, np.ones(len(own)))
            across = (normals * rays).sum(1)
            across = np.where(np.abs(across) > 1e-6, across, 1e-6)
            plane = (normals * world).sum(1) / across
            own = np.clip(plane, own - STEEP * spacing, own + STEEP * spacing)
        seen[k] = inside & (own < front + slack)
    # What is hidden shows nothing, even if it reaches out beside what hides it.
    return seen[0] * seen.mean(0) ** 2


def _far_outside(lifted: LiftedObject, matte: Matte) -> Mask:
    """(N,) which Gaussians the photo shows background for, and not only beside the object."""
    there = (matte.alpha > SOFTEST).astype(np.uint8)
    pad = 2 + int(CUT * max(there.shape))
    distance = distance_inside(1 - np.pad(there, pad))
    at = lifted.texture.u0 - [matte.left - pad, matte.top - pad]
    column, row = np.floor(at).astype(int).T
    height, width = distance.shape
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    far = distance[row.clip(0, height - 1), column.clip(0, width - 1)] > CUT * max(there.shape)
    return ~inside | far


@dataclass(frozen=True, eq=False)
class Brim:
    """Gaussians around the object's silhouette that carry what the object does not cover."""

    world: F64  # (M, 3)
    normals: F64  # (M, 3) world, unit, away from the object in the picture
    colors: F64  # (M, 3)
    spacing: float  # world units


def brim_around(
    lifted: LiftedObject, picture: RestPicture, matte: Matte, rng: np.random.Generator
) -> Brim:
    """See `Brim`: at the depth of the nearest rim, all over the cut-out that is not covered."""
    spacing = lifted.spacing * lifted.scale
    spacing_px = spacing * picture.camera.focal / float(lifted.centre[2])
    covered = (picture.alpha > COVERED) & np.isfinite(picture.depth)
    if not covered.any():
        return Brim(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), spacing)
    matted = _matte_in(matte, picture) > SOFTEST
    # The same reach beyond the cut-out as the relief's: kernels that end do not thin its edge.
    reach = BRIM * spacing_px
    beyond = cv2.distanceTransform((~matted).astype(np.uint8), cv2.DIST_L2, 5) < reach
    missed = matted & ~covered
    near = cv2.distanceTransform((~missed).astype(np.uint8), cv2.DIST_L2, 5) < reach
    ring = beyond & ~covered & near if missed.any() else np.zeros_like(covered)
    step = spacing_px * np.sqrt(PACKING)
    expected = np.where(ring, OVERSAMPLING / max(spacing_px, 1.0) ** 2, 0.0)
    xy = scattered(expected, rng)
    if len(xy):
        flat = np.column_stack([xy, np.zeros(len(xy))])
        xy = xy[thin_to_spacing(flat, max(step, 0.8), rng.permutation(len(xy)))]
    depth, away = _rim(covered, picture.depth)
    column, row = np.floor(xy).astype(int).T.reshape(2, -1)
    world = picture.camera.unproject(xy, depth[row, column].astype(np.float64))
    normals = np.column_stack([away[row, column], np.zeros(len(xy))]).astype(np.float64)
    photo_xy = xy / picture.zoom + [picture.left, picture.top]
    colors = bilinear(matte.foreground, photo_xy - [matte.left + 0.5, matte.top + 0.5])
    return Brim(world, normals, colors, max(spacing, spacing * 0.8 / max(step, 1e-9)))


def _matte_in(matte: Matte, picture: RestPicture) -> F32:
    """(h, w) the matte's alpha in the window of the rest picture."""
    height, width = picture.alpha.shape
    own = int(np.ceil(width / picture.zoom)), int(np.ceil(height / picture.zoom))
    left, top = int(picture.left), int(picture.top)
    whole = crop(matte.alpha, matte.box, (left, top, left + own[0], top + own[1]))
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), np.float32)


def _rim(covered: Mask, depth: F32) -> tuple[F32, F32]:
    """(h, w) depth of the nearest covered pixel, and (h, w, 2) the way from there, unit."""
    distance, labels = cv2.distanceTransformWithLabels(
        (~covered).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    labels = labels.astype(np.int64)
    at_rim = np.zeros(labels.max() + 1, np.float32)
    at_rim[labels[covered]] = depth[covered]
    dy, dx = np.gradient(cv2.GaussianBlur(distance, (0, 0), EDGE_BLUR))
    away = np.dstack([dx, dy])
    length = np.linalg.norm(away, axis=2, keepdims=True)
    away = np.where(length > 1e-6, away / np.maximum(length, 1e-6), [0.0, -1.0])
    return at_rim[labels], away.astype(np.float32)
