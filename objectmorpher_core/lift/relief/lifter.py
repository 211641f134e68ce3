"""The relief lifter: a closed shape from the silhouette, without a download, in half a second.

Limbs are round and bodies are not balloons (`thickness`); what stands on the ground is turned as
its feet tell, and boxes and cylinders are recognised (`standing`). The front lies on the photo's
own rays, so the photo is reproduced at rest whatever the shape. A brim around the silhouette
carries the matte's soft edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask, Pixels
from ...base.camera import Camera
from ...base.progress import Progress, silent
from ...base.rotations import quats_along
from ...deform.control_points import COUNT, sample_control_points
from ...document.gaussians import Gaussians
from ...document.model import LiftedObject, LiftSettings, Matte, PhotoTexture
from ...document.sides import HIDDEN
from ...segment.matting.matte import band_width
from .. import LiftError, LiftSubject
from ..shapes import (
    Recognised,
    Rim,
    closed_ring,
    completed,
    flattened,
    laid,
    looks_drawn,
    recognised,
    rims_of,
    rod_look,
    rounded,
)
from . import shape_look
from .body import MIDDLE, ReliefBody, closed, leaning
from .canvas import ReliefCanvas, bilinear
from .colours import FINENESS, Colouring, colouring
from .depth_look import Look, look
from .depth_prior import follow
from .further_views import settled, with_views
from .fusion import fused
from .mirror import MirrorAxis, find_axis
from .sides import with_sides
from .silhouette import ReliefSilhouette, solid_part
from .spreading import SurfacePoints, spread
from .strands import with_strands
from .uncovered import with_uncovered

TANGENT_SIGMA = 0.66  # x mean spacing: neighbours overlap without gaps
NORMAL_SIGMA = 0.12  # x mean spacing: flat, but never degenerate seen edge-on
SOFTEST = 0.15  # x extent: a drawn soft edge that reaches farther out is cut there
PIXELS = 2.0  # of the canvas, at least, to one of a colour field
SOFTNESS_SIDE = 1024  # px of the extent that a soft edge is measured in
LEAST_AREA = 25  # px
SEAM = 2.0  # x mean spacing: so near to what was hidden nothing of the photo is carried
NEARNESS_RADIUS = 5  # cells: how far a painted nearness is drawn to an edge of the photo
NEARNESS_EPS = 1e-3  # variance of colours in [0, 1] that counts as flat
PROFILE = 1.2  # width over height, from which what stands is thought to be seen from the side

Shaper = Callable[[ReliefSilhouette, Camera, LiftSettings, MirrorAxis | None], ReliefBody]
See = Callable[[Pixels, Mask, Camera], shape_look.SeenShape | None]


class ReliefLifter:
    """`--lift relief`: the embedded default."""

    name = "relief"

    def __init__(
        self, look: Look = look, shape: Shaper = ReliefBody.of, see: See = shape_look.look
    ) -> None:
        """`look` estimates the depth of what is seen: by default as an installed network does.

        `shape` makes the body of a silhouette, and `see` tells more of it: by default as the
        program's own network does.
        """
        self._look, self._shape, self._see = look, shape, see

    def missing(self) -> str | None:
        return None

    def lift(
        self, subject: LiftSubject, settings: LiftSettings, progress: Progress, seed: int = 0
    ) -> LiftedObject:
        """See `Lifter`.

        Raises LiftError for an object of fewer than about 25 pixels, and for one that has no depth
        in so wide a view.
        """
        solid = solid_part(subject.mask, subject.matte)
        is_fringed = solid is not subject.mask
        subject = replace(subject, mask=solid)
        area = int(np.count_nonzero(solid))
        if area < LEAST_AREA:
            raise LiftError(f"the object is only {area} pixels, too small to lift")
        progress(0.0, "Inflating the silhouette")
        sight = self._sight(subject, settings, progress)
        mask, camera, matte = subject.mask, subject.camera, subject.matte
        hidden = _hidden(subject, settings)
        canvas = _canvas(matte, hidden, area, settings.count)
        axis = _axis(canvas, settings)
        body = self._body(subject, settings, axis, sight, progress)
        outline = body.silhouette
        if not np.isfinite(body.middle[outline.inside]).all():
            raise LiftError("the field of view is too wide for the object to have a depth")
        progress(0.3, "Building the 3D shape")
        rng = np.random.default_rng(seed)
        band = max(band_width(camera.width, camera.height), _softness(mask, matte, outline.extent))
        surface, spacing = spread(body, settings.count, band, rng, matte, is_fringed)
        if hidden is not None and hidden.any():
            surface = _unseen(surface, hidden, SEAM * spacing)
        progress(0.7, "Colouring its back")
        is_mirrored = _is_mirrored(body, settings, axis)
        colours = colouring(canvas, outline, spacing, is_mirrored, axis)
        progress(0.8, "Choosing control points")
        lifted = _assemble(surface, spacing, body, colours, camera)
        # A mirrored back shows the photo itself, as sharp as the front does.
        is_carried = is_mirrored and hidden is None and body.behind is None
        lifted = replace(lifted, splatting="edged surface" if is_carried else "edged solid")
        progress(0.85, "Filling in its sides")
        invents = body.behind is None  # else what it hides has the colours of what is like it
        if settings.views:
            return with_views(lifted, matte, camera, settings.views, seed, invents)
        if not invents:
            return with_uncovered(lifted, surface, spacing, body, matte, camera)
        return with_strands(with_sides(lifted, matte, camera, seed), matte, camera, seed)

    def body(self, subject: LiftSubject, settings: LiftSettings) -> ReliefBody:
        """The shape alone, on which `lift` spreads its Gaussians."""
        subject = replace(subject, mask=solid_part(subject.mask, subject.matte))
        sight = self._sight(subject, settings, silent)
        area = int(np.count_nonzero(subject.mask))
        canvas = _canvas(subject.matte, _hidden(subject, settings), area, settings.count)
        return self._body(subject, settings, _axis(canvas, settings), sight, silent)

    def _sight(self, subject: LiftSubject, settings: LiftSettings, progress: Progress) -> _Sight:
        """What is seen of it; nothing where it is not to be trusted."""
        if settings.trust <= 0:
            return _Sight()
        progress(0.05, "Looking at its shape")
        if (seen := self._see(subject.pixels, subject.mask, subject.camera)) is None:
            return _Sight()
        # What faces the camera may be a flower; an egg that lies as a plate does looks like
        # one, and is rarer.
        rims = rims_of(seen, subject.camera) if settings.kind == "auto" else []
        is_rim = bool(rims) and rims[0].is_steep
        shape = (
            closed_ring(seen, rims[0])
            if is_rim
            else recognised(seen, settings.kind, looks_drawn(subject.matte))
        )
        return _Sight(seen, shape, rims if is_rim and shape is None else [])

    def _body(
        self,
        subject: LiftSubject,
        settings: LiftSettings,
        axis: MirrorAxis | None,
        sight: _Sight,
        progress: Progress,
    ) -> ReliefBody:
        mask, camera, hidden = subject.mask, subject.camera, _hidden(subject, settings)
        outline = ReliefSilhouette.of(mask if hidden is None else mask | hidden)
        body = self._shape(outline, camera, settings, axis)
        if (seen := sight.seen) is not None:
            body = fused(body, seen, camera, settings.thickness, settings.trust)
            body = replace(body, doubt=seen.doubt)
            if sight.rims:
                body = laid(body, sight.rims, seen, subject, settings.thickness)
            else:
                body = _shaped(body, sight.shape, subject, settings)
        if settings.kind == "tube":
            body = rounded(body, settings.thickness)
        elif settings.kind == "flat" and body.kind != "flat":
            body = flattened(body, settings.thickness)
        if settings.uses_depth:
            progress(0.1, "Looking how deep it is")
            body = self._followed(body, subject, settings, hidden)
        if settings.views:
            progress(0.2, "Comparing with its other photos")
            body = settled(body, camera, settings.views)
        if settings.nearness is not None:
            body = body.nearer(_nearness(subject, settings.nearness, outline))
        return body

    def _followed(
        self, body: ReliefBody, subject: LiftSubject, settings: LiftSettings, hidden: Mask | None
    ) -> ReliefBody:
        """The body as deep as a depth network sees it; the same one where none is installed."""
        seen = self._look(subject.pixels, subject.mask if hidden is None else subject.mask | hidden)
        if seen is None:
            return body
        outline, cells = body.silhouette, None
        if hidden is not None:
            at = np.floor(outline.photo_xy(outline.cells)).astype(int)
            limit = np.array(hidden.shape[::-1]) - 1
            cells = hidden[tuple(np.moveaxis(np.clip(at, 0, limit), -1, 0)[::-1])]
        return follow(body, seen, subject.camera.focal, settings.thickness, cells)


@dataclass(frozen=True, eq=False)
class _Sight:
    """What the network sees of an object, and what that looks like."""

    seen: shape_look.SeenShape | None = None
    shape: Recognised | None = None
    rims: list[Rim] = field(default_factory=list)  # of what lies as plates do


def _shaped(
    body: ReliefBody, shape: Recognised | None, subject: LiftSubject, settings: LiftSettings
) -> ReliefBody:
    """`body` as the plain shape that it looks like, else leaning as far as things do."""
    camera = subject.camera
    if shape is None or _contradicts(shape, body, settings):
        body = leaning(body, camera)
        return body if body.standing.prism is not None else closed(body)
    azimuth_of = partial(rod_look.azimuth_of, subject.pixels, subject.mask)
    return completed(body, shape, camera, settings.thickness, settings.trust, azimuth_of)


def _contradicts(shape: Recognised, body: ReliefBody, settings: LiftSettings) -> bool:
    """Whether a thing that is seen as a sheet has the outline of a prism that stands upright."""
    return settings.kind == "auto" and shape.kind == "flat" and body.standing.prism is not None


def _hidden(subject: LiftSubject, settings: LiftSettings) -> Mask | None:
    """(H, W) where something stands before the object."""
    return None if settings.hidden is None else settings.hidden & ~subject.mask


def _canvas(matte: Matte, hidden: Mask | None, area: int, count: int) -> ReliefCanvas:
    """The cut-out, fine enough for `count` Gaussians on an object of `area` px."""
    spacing = np.sqrt(2 * area / count)  # at least: it has a front and a back
    return ReliefCanvas.of(matte, hidden, float(spacing / (FINENESS * PIXELS)))


def _axis(canvas: ReliefCanvas, settings: LiftSettings) -> MirrorAxis | None:
    """Of an object that looks the same left and right."""
    if settings.is_symmetric is False:
        return None
    axis = find_axis(canvas)
    return axis if settings.is_symmetric or axis.is_sure else None


def _is_mirrored(body: ReliefBody, settings: LiftSettings, axis: MirrorAxis | None) -> bool:
    """Whether the back looks like the front."""
    if settings.back != "auto":
        return settings.back == "mirrored"
    rows, columns = np.nonzero(body.silhouette.inside)
    is_wide = bool(np.ptp(columns) > PROFILE * np.ptp(rows))
    return body.standing.prism is not None or (axis is None and body.standing.is_known and is_wide)


def _nearness(subject: LiftSubject, painted: F32, outline: ReliefSilhouette) -> F64:
    """(h, w) px on the silhouette's grid of what was painted, its edges drawn to the photo's."""
    at = outline.photo_xy(outline.cells)
    height, width = subject.mask.shape
    scale = [painted.shape[1] / width, painted.shape[0] / height]
    wanted = _resampled(painted, at * scale)
    matte = subject.matte
    smooth = cv2.GaussianBlur(matte.foreground, (0, 0), max(0.4 * outline.cell, 0.3))
    guide = _resampled(smooth, at - [matte.left, matte.top])
    drawn = cv2.ximgproc.guidedFilter(guide, wanted, NEARNESS_RADIUS, NEARNESS_EPS)
    return np.asarray(drawn, np.float64) * outline.extent


def _resampled(image: np.ndarray, xy: F64) -> F32:
    """`image` (h, w, ...) at its px (m, n, 2), clamped to it."""
    at = (xy - 0.5).reshape(-1, 2)
    return bilinear(image, at).reshape(*xy.shape[:2], *image.shape[2:]).astype(np.float32)


def _unseen(surface: SurfacePoints, hidden: Mask, margin: float) -> SurfacePoints:
    """The surface of which the photo shows nothing within `margin` px of `hidden` (H, W)."""
    away = cv2.distanceTransform((~hidden).astype(np.uint8), cv2.DIST_L2, 5)
    gap = bilinear(away, surface.xy - 0.5)
    height, width = hidden.shape
    xy = surface.xy
    inside = (xy >= 0).all(1) & (xy < [width, height]).all(1)
    is_hidden = inside & (gap < margin)
    kept = np.flatnonzero(~(surface.is_brim & is_hidden))  # it carries an edge that is not there
    return replace(surface, is_seen=surface.is_seen & ~is_hidden).select(kept)


def _softness(mask: Mask, matte: Matte, extent: float) -> float:
    """How far outside the mask (H, W), in px, the matte still covers something."""
    x0, y0, x1, y1 = matte.box  # it holds the mask and what is around it
    x0, y0, x1, y1 = max(x0, 0), max(y0, 0), min(x1, mask.shape[1]), min(y1, mask.shape[0])
    alpha = matte.alpha[y0 - matte.top : y1 - matte.top, x0 - matte.left : x1 - matte.left]
    step = max(1, int(extent / SOFTNESS_SIDE))
    inside, covered = (_touched(part, step) for part in (mask[y0:y1, x0:x1], alpha))
    away = cv2.distanceTransform((~inside).view(np.uint8), cv2.DIST_L2, 5)
    farthest = float(away[covered & ~inside].max(initial=0.0))
    return min(max(step * farthest - 0.5, 0.0), SOFTEST * extent)


def _touched(share: np.ndarray, step: int) -> Mask:
    """Which blocks (h, w) of `step` px to a side hold some of `share` (H, W)."""
    height, width = (max(n // step, 1) for n in share.shape)
    if share.dtype == np.bool_:
        share = share.view(np.uint8) * np.uint8(255)
    part = share[: height * step, : width * step]
    return np.asarray(cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA)) > 0


def _assemble(
    surface: SurfacePoints, spacing: float, body: ReliefBody, colours: Colouring, camera: Camera
) -> LiftedObject:
    """Relief coordinates -> world -> object frame, with texture and control points."""
    extent = body.silhouette.extent
    depth = camera.focal / extent  # world units: the object is one unit wide at this depth
    unit = depth / camera.focal  # world units per px there
    ray = (surface.xy - [camera.cx, camera.cy]) / camera.focal
    z = depth - surface.height * unit
    world = np.column_stack([ray * z[:, None], z])
    normals = _world_normals(surface.normals, ray, z, unit, camera.focal)
    centre = 0.5 * (world.min(0) + world.max(0))
    largest = float((world.max(0) - world.min(0)).max())
    world_from_object = np.diag([largest, largest, largest, 1.0])
    world_from_object[:3, 3] = centre
    means = (world - centre) / largest
    sigma = spacing * unit / largest
    # Flat on the surface; round on the brim, whose normal lies in its plane.
    across = np.where(surface.is_brim, TANGENT_SIGMA, NORMAL_SIGMA)
    along = np.full(len(means), TANGENT_SIGMA)
    scales = np.column_stack([along, along, across]) * sigma
    gaussians = Gaussians(
        means.astype(np.float32),
        quats_along(normals).astype(np.float32),
        scales.astype(np.float32),
        np.ones(len(means), np.float32),
        colours.sample(surface.color_xy, ~surface.is_front),
    )
    solid = ~surface.is_brim
    visibility = surface.is_seen.astype(np.float32)
    if body.behind is not None:
        visibility[surface.is_front & ~surface.is_seen] = HIDDEN
    texture = PhotoTexture(
        u0=camera.project(gaussians.means @ world_from_object[:3, :3].T + centre),
        visibility=visibility,
        solidity=solid.astype(np.float32),
    )
    points = sample_control_points(gaussians.means[solid], gaussians.opacities[solid], COUNT)
    height, slope = body.sample(surface.xy, MIDDLE)
    middle = np.column_stack([depth - height * unit, -slope * unit]).astype(np.float32)
    return LiftedObject(
        gaussians,
        texture,
        points,
        world_from_object,
        sigma,
        "relief",
        middle=middle,
        kind=body.kind,
        likeness=body.likeness,
        stands=body.standing.is_known or body.up is not None,
        doubt=body.doubt,
        up=None if body.up is None else (float(body.up[0]), float(body.up[1]), float(body.up[2])),
    )  # fmt: skip


def _world_normals(normals: F64, ray: F64, z: F64, unit: float, focal: float) -> F64:
    """Outward unit normals (N, 3) in the world of relief normals (N, 3).

    The relief's axes map to the columns of J = d world / d (x, y, height); normals map by the
    inverse transpose. In closed form: a front normal stays in front of its own ray.
    """
    nx, ny, nh = normals.T
    # J = [(z/f) e_x, (z/f) e_y, -unit (ray, 1)], so J^-T n solves three triangular rows
    wx, wy = nx * focal / z, ny * focal / z
    wz = -nh / unit - wx * ray[:, 0] - wy * ray[:, 1]
    world = np.column_stack([wx, wy, wz])
    return world / np.linalg.norm(world, axis=1, keepdims=True)
