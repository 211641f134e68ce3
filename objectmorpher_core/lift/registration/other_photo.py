"""Another photo of the same object: where its camera stood, and what both photos show.

The details that look alike in both say where the other camera may have stood. From there the
object is drawn as it was lifted from the first photo, and what of that picture is elsewhere in the
other photo is followed by its optical flow (model-based stereo, Debevec et al. 1996): so dense
matches are found though the two look at the object from quite different sides. The shape and the
pose are found by turns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import cv2
import numpy as np
from scipy.spatial import KDTree

from ...base.arrays import F64, U8, Mask, Pixels, Selection
from ...base.camera import Camera
from ...base.masks import box_of
from ...base.progress import Progress, part, silent
from ...document.bounds import MOST_VIEWS
from ...document.model import LiftedObject, LiftSettings, Matte
from ...document.sides import FurtherView
from ...pictures.image import to_u8
from ...raster import tiles
from ...raster.posed import PosedSplats, RestSplats
from ...raster.reference import Picture3D
from ...raster.texture import build_levels
from ...segment.mask_edit import is_selected
from ...segment.matting.matte import cut_out
from .. import Lifter, LiftError, LiftSubject, lift_subject
from .placement import Hints, Registrar
from .search import angles
from .sketch import Matches, alike
from .view import Target

ROUNDS = 3  # in which the shape and the pose are found by turns
MOST_TURN = 100.0  # degrees between two photos that can show the same details
NEAR = 2.0  # x spacing: how far from a detail the surface is looked for
AROUND = 4  # Gaussians that say how deep it is there
LONGEST = 1536  # px, longer side of a cut-out that is kept
# A photo is taken for one of the object where so much of what the first shows was found in it, and
# where that is so much of the object there. Of nine solids (docs/lifting) that turned by 50 degrees
# it was .89 to .98 and .46 or more where the pose was right; .12, .67 and .70 where it was wrong.
CONFIRMED, SHARED = 0.8, 0.3
TOO_FEW = (
    "the photos share too few details of the object: take the other from a nearer side, or in a "
    "light that is more alike"
)
FLOWN = 256  # px, longer side of the object in the pictures between which details are followed
ASIDE = 0.15  # x that side, around it
EVERY = 3  # px of those, between the details that are kept
BACK = 1.5  # px of those, by which the way there and the way back may be off
WHOLE, INVENTED = 0.95, 0.05  # alpha of the drawn object, and share of what no photo shows, there


@dataclass(frozen=True, eq=False)
class OtherPhoto:
    """Another photo, and where the object is in it."""

    name: str  # file name without folder
    pixels: Pixels  # (H, W, 3)
    camera: Camera
    mask: Selection  # (H, W) bool, or soft u8

    def shrunk(self, longest: int) -> OtherPhoto:
        """The same photo, so small that the object's longer side is `longest` px at most."""
        x0, y0, x1, y1 = box_of(is_selected(self.mask))
        if x0 == x1:
            raise LiftError(f"no object is selected in {self.name}")
        scale = longest / max(x1 - x0, y1 - y0)
        if scale >= 1:
            return self
        height, width = self.mask.shape
        size = max(1, round(scale * width)), max(1, round(scale * height))
        is_soft = self.mask.dtype == np.uint8
        coverage = self.mask if is_soft else 255 * self.mask.astype(np.uint8)
        pixels, mask = (
            cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in (self.pixels, coverage)
        )
        camera = self.camera.windowed(0.0, 0.0, *size, scale)
        own = np.asarray(mask, np.uint8)
        return OtherPhoto(
            self.name, cast(Pixels, pixels), camera, own if is_soft else is_selected(own)
        )


def with_photo(
    subject: LiftSubject,
    settings: LiftSettings,
    lifter: Lifter,
    other: OtherPhoto,
    progress: Progress = silent,
    seed: int = 0,
) -> tuple[LiftSettings, LiftedObject]:
    """The object lifted with what `other` shows of it, too, and the settings that say so.

    Raises LiftError where the photos share too few details.
    """
    if len(settings.views) >= MOST_VIEWS:
        raise LiftError(f"an object has {MOST_VIEWS} further photos at most")
    progress(0.0, "Comparing the photos")
    other = other.shrunk(min(max(subject.matte.alpha.shape), LONGEST))
    mask = is_selected(other.mask)
    target = Target(other.pixels, mask, other.camera)
    matches = np.hstack(alike((subject.pixels, subject.mask), (other.pixels, mask)))
    cut = cut_out(other.pixels, other.mask)
    lifted = lift_subject(lifter, subject, settings, part(progress, 0.1, 0.3), seed)
    found, pose = settings, None
    for k in range(ROUNDS):
        step = part(progress, 0.3 + 0.7 * k / ROUNDS, 0.3 + 0.7 * (k + 1) / ROUNDS)
        step(0.0, "Finding where it was taken from")
        pose = _pose(lifted, subject.camera, target, matches, pose, seed)
        followed = _followed(lifted, subject, target, pose)
        if k == ROUNDS - 1 and not followed.is_sure:
            raise LiftError(TOO_FEW)
        view = FurtherView(
            other.name, other.camera, pose, cut.left, cut.top,
            np.rint(255 * cut.foreground.clip(0, 1)).astype(np.uint8),
            np.rint(255 * cut.alpha).astype(np.uint8),
            np.concatenate([matches, followed.matches]).astype(np.float32),
        )  # fmt: skip
        found = replace(settings, views=(*settings.views, view))
        lifted = lift_subject(lifter, subject, found, part(step, 0.5, 1.0), seed)
    return found, lifted


def _pose(
    lifted: LiftedObject, camera: Camera, target: Target, matches: F64, known: F64 | None, seed: int
) -> F64:
    """(4, 4) the other photo's world from the first's; no worse than the one `known`, if one is.

    `matches` (n, 4) px of both. Raises LiftError.
    """
    points, is_on = _on_surface(lifted, camera, matches[:, :2])
    own = Matches(points, matches[is_on, 2:], float(np.sqrt(target.mask.sum())))
    registrar = Registrar(lifted.body, target, seed, own)
    if known is not None:
        near = [registrar.improved(registrar.rated(known @ lifted.world_from_object))]
    else:
        near = [
            each for each in registrar.propose(Hints()).proposals
            if _turn(each.world_from_object, lifted) < MOST_TURN
        ]  # fmt: skip
    if not near:
        raise LiftError(TOO_FEW)
    return np.asarray(near[0].world_from_object @ np.linalg.inv(lifted.world_from_object))


def _turn(world_from_object: F64, lifted: LiftedObject) -> float:
    """Degrees by which the two cameras see an object from different sides."""
    turn = world_from_object[:3, :3] @ np.linalg.inv(lifted.world_from_object[:3, :3])
    return float(np.degrees(angles(np.eye(3), turn[None] / np.cbrt(np.linalg.det(turn)))[0]))


def _on_surface(lifted: LiftedObject, camera: Camera, at: F64) -> tuple[F64, np.ndarray]:
    """Points (n, 3), object frame, of the front at px (m, 2), and of which (m,) there are any."""
    is_front = (lifted.texture.visibility > 0.5) & lifted.is_body
    if is_front.sum() < AROUND or not len(at):
        return np.zeros((0, 3)), np.zeros(len(at), bool)
    spots = lifted.texture.u0[is_front].astype(np.float64)
    away, near = KDTree(spots).query(at, k=AROUND)
    depth = lifted.world_points(lifted.gaussians.means[is_front])[:, 2]
    weight = 1 / np.maximum(away, 1e-3) ** 2
    middle = (depth[near] * weight).sum(1) / weight.sum(1)
    spacing = lifted.spacing * lifted.scale * camera.focal / float(lifted.centre[2])
    is_on = away[:, 0] < NEAR * max(spacing, 1.0)
    return lifted.object_points(camera.unproject(at[is_on], middle[is_on])), is_on


@dataclass(frozen=True, eq=False)
class _Followed:
    """What the first photo shows, followed into the other."""

    matches: F64  # (n, 4) px of both
    confirmed: float  # share of what could be followed that was found
    shared: float  # of the object in the other photo, that the first shows, too

    @property
    def is_sure(self) -> bool:
        return self.confirmed > CONFIRMED and self.shared > SHARED


def _followed(lifted: LiftedObject, subject: LiftSubject, target: Target, pose: F64) -> _Followed:
    """Follow the object, drawn at `pose` (4, 4) as the other camera sees it, into the other photo.

    What is left between the two is by how much its depth is wrong.
    """
    x0, y0, x1, y1 = target.box
    side = max(x1 - x0, y1 - y0)
    corner, zoom = np.array([x0, y0]) - ASIDE * side, FLOWN / side
    size = tuple(int(zoom * (n + 2 * ASIDE * side)) + 1 for n in (x1 - x0, y1 - y0))
    window = target.camera.windowed(float(corner[0]), float(corner[1]), size[0], size[1], zoom)
    drawn, is_shown = _drawn(lifted, subject.matte, subject.camera, pose, window)
    warp = np.array([[zoom, 0, 0.0], [0, zoom, 0.0]])
    warp[:, 2] = zoom * (0.5 - corner) - 0.5
    photo = cv2.warpAffine(to_u8(target.pixels), warp, size, flags=cv2.INTER_AREA)
    mask = cv2.warpAffine(target.mask.astype(np.float32), warp, size, flags=cv2.INTER_LINEAR)
    straight = drawn.color / np.maximum(drawn.alpha, 1e-6)[..., None]
    one, other = _grey(straight, drawn.alpha), _grey(photo / 255, mask)
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    way, back = flow.calc(one, other, None), flow.calc(other, one, None)  # type: ignore[call-overload]
    xy = np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), -1).astype(np.float32)
    at = xy + way
    home, inside = (
        cv2.remap(part, at[..., 0], at[..., 1], cv2.INTER_LINEAR) for part in (back, mask)
    )
    is_found = is_shown & (np.linalg.norm(way + home, axis=-1) < BACK) & (inside > WHOLE)
    zoomed = subject.camera.focal / window.focal
    first = (xy + 0.5 - [window.cx, window.cy]) * zoomed
    first += np.array([subject.camera.cx, subject.camera.cy]) + drawn.shift
    second = (at + 0.5) / zoom + corner
    kept = is_found & (xy % EVERY == 0).all(-1)
    shown = float(is_shown.sum())
    return _Followed(
        np.concatenate([first, second], -1)[kept].astype(np.float64),
        float(is_found.sum()) / max(shown, 1.0), shown / max(float(mask.sum()), 1.0),
    )  # fmt: skip


def _drawn(
    lifted: LiftedObject, matte: Matte, camera: Camera, pose: F64, window: Camera
) -> tuple[Picture3D, Mask]:
    """The object at a pose, and where (h, w) its picture is of the photo of `camera`."""
    splats = PosedSplats(RestSplats(replace(lifted, sides=None), camera), None, pose)
    texture = build_levels(matte.foreground, matte.alpha, matte.left, matte.top)
    drawn, invented = tiles.draw_with_share(tiles.prepare(splats, window, camera), texture)
    return drawn, (drawn.alpha > WHOLE) & (invented < INVENTED * drawn.alpha)


def _grey(colors: np.ndarray, coverage: np.ndarray) -> U8:
    """(h, w) of colours (h, w, 3), the same beyond the object of which `coverage` (h, w) is."""
    grey = cv2.cvtColor(np.asarray(colors.clip(0, 1), np.float32), cv2.COLOR_RGB2GRAY)
    return np.where(coverage > 0.5, np.rint(255 * grey), 127).astype(np.uint8)
