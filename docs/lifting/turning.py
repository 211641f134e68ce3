"""Solids turned, moved and bent: what is predicted from one photo, against the true view.

Six predictions. "network" is the product's own lift; "relief" is the same from the silhouette
alone, "inflation" that without looking how things stand, and "depth" is the relief with a perfect
depth network, whose scale and shift are unknown as any network's are. The card is the cut-out on a
flat board at the solid's true distance, turned (a homography). The affine one is the best that any
warp of the picture with six numbers could do: fitted to the true places of the points that the
photo shows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import mesh_view
import numpy as np
from skimage import data
from solids import Solid, load, upright

from objectmorpher_core.base.arrays import F64, Mask, Pixels, crop
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.progress import silent
from objectmorpher_core.base.rotations import CAMERA_GIMBAL, Gimbal, turn_matrix, turn_of
from objectmorpher_core.compose.composite import object_texture
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import LiftSettings, Matte, Placement, Pose
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.lift import LiftSubject
from objectmorpher_core.lift.relief.depth_prior import NetworkDepth
from objectmorpher_core.lift.relief.lifter import ReliefLifter
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.raster.texture import TextureLevels

SIDE = 512  # px
CAMERA = Camera.from_fov(SIDE, SIDE)
SHARE = 0.55  # of the picture's width that a solid fills
AT = np.array([245.0, 270.0])  # px, where its middle is
WAYS = ("network", "relief", "inflation", "depth", "card", "affine")
ALONE = LiftSettings(uses_depth=False, trust=0)  # the silhouette
SEEN = LiftSettings(uses_depth=False)
INFLATED = LiftSettings(uses_depth=False, trust=0, is_standing=False)
POINTS = 20_000  # on a solid's surface, for the affine warp
SAME_DEPTH = 0.01  # of a point and of the nearest surface: it is seen
FAINT = 0.02  # alpha, from which a pixel counts


@dataclass(frozen=True)
class Edit:
    """A motion of a solid about its middle."""

    group: str  # of edits whose scores are averaged
    yaw: float = 0.0  # degrees
    pitch: float = 0.0
    spin: float = 0.0  # degrees about its own upright
    nearer: float = 0.0  # x its distance
    bend: float = 0.0  # degrees between its upper and its lower end, away from the camera

    def turn(self, gimbal: Gimbal) -> F64:
        """(3, 3) of a solid that stands as a gimbal says."""
        return turn_matrix(self.yaw, self.pitch, 0) @ gimbal.matrix(self.spin, 0, 0)

    def moved(self, points: F64, centre: F64, gimbal: Gimbal) -> F64:
        """Where world points (n, 3) of a solid about `centre` (3,) go."""
        around = (points - centre) @ self.turn(gimbal).T
        if self.bend:
            around, _ = bent(around, float(np.ptp(around[:, 1])), self.bend)
        return around + (1 - self.nearer) * centre


EDITS = {
    **{f"yaw {a}": Edit(f"turn {abs(a)}", yaw=a) for a in (-35, -20, -10, 10, 20, 35)},
    **{f"pitch {a}": Edit("pitch 20", pitch=a) for a in (-20, 20)},
    **{f"spin {a}": Edit(f"spin {abs(a)}", spin=a) for a in (-35, -20, 20, 35)},
    "nearer": Edit("nearer by 0.3", nearer=0.3),
    **{f"bend {a}": Edit("bend 40", bend=a) for a in (-40, 40)},
}
GROUPS = tuple(dict.fromkeys(edit.group for edit in EDITS.values()))


def bent(around: F64, height: float, degrees: float) -> tuple[F64, F64]:
    """Points (n, 3) bent backwards, and the rotations (n, 3, 3) there; `height` is of the whole."""
    radius = height / np.radians(degrees)
    angle = around[:, 1] / radius
    sine, cosine, far = np.sin(angle), np.cos(angle), around[:, 2] + radius
    places = np.column_stack([around[:, 0], far * sine, far * cosine - radius])
    turns = np.zeros((len(around), 3, 3))
    turns[:, 0, 0], turns[:, 1, 1], turns[:, 2, 2] = 1, cosine, cosine
    turns[:, 1, 2], turns[:, 2, 1] = sine, -sine
    return places, turns


@dataclass(frozen=True, eq=False)
class Shot:
    """The object in a picture; straight colours."""

    color: F64  # (h, w, 3) in [0, 1]
    alpha: F64  # (h, w)


@dataclass(frozen=True, eq=False)
class Scene:
    """A solid in a made photo, and what it looks like after edits."""

    name: str
    photo: Shot
    edited: dict[str, Shot]  # by name
    centre: F64  # (3,) world, about which it turns
    gimbal: Gimbal  # how it stands
    shown: F64  # (n, 2) px of points that the photo shows
    moved: dict[str, F64]  # (n, 2) px of them, by the edit's name
    inverse: F64  # (h, w) true inverse depth of the photo; what is behind is farther away

    @property
    def pixels(self) -> Pixels:
        """The photo (h, w, 3): the solid over a blurred picture."""
        return np.clip(over_plate(self.photo) * 255 + 0.5, 0, 255).astype(np.uint8)

    @property
    def mask(self) -> Mask:
        return self.photo.alpha > 0.5


@dataclass(frozen=True)
class Score:
    """How near a prediction is to the truth."""

    iou: float  # of the coverages
    psnr: float  # dB, over the plate, where either covers something


Draw = Callable[[F64], Shot]  # a prediction moved by (2,) px


def make_scene(name: str, meshes: Path) -> Scene:
    solid = load(name, meshes)
    depth = CAMERA.focal / (SHARE * SIDE)
    rest = solid.vertices + CAMERA.unproject(AT, depth)
    centre = 0.5 * (rest.min(0) + rest.max(0))
    view = mesh_view.draw(solid, rest, CAMERA)
    of, weights = _sampled(solid, rest)
    points = (rest[of] * weights[:, :, None]).sum(1)
    column, row = np.clip(CAMERA.project(points).astype(int), 0, SIDE - 1).T
    points = points[np.abs(points[:, 2] - view.depth[row, column]) < SAME_DEPTH]
    gimbal = Gimbal.about(upright(name))
    shots, moved = {}, {}
    for key, edit in EDITS.items():
        world = edit.moved(np.concatenate([rest, points]), centre, gimbal)
        shots[key] = _shot(mesh_view.draw(solid, world[: len(rest)], CAMERA))
        moved[key] = CAMERA.project(world[len(rest) :])
    inverse = np.where(np.isfinite(view.depth), 1 / view.depth, 0.5 / view.depth.min())
    shown = CAMERA.project(points)
    return Scene(name, _shot(view), shots, centre, gimbal, shown, moved, inverse)


def _shot(view: mesh_view.View) -> Shot:
    return Shot(view.color, view.alpha)


def _sampled(solid: Solid, world: F64) -> tuple[np.ndarray, F64]:
    """Corners (n, 3) of the triangles of points spread over a solid, and their weights there."""
    rng = np.random.default_rng(0)
    corners = world[solid.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    faces = rng.choice(len(area), POINTS, p=area / area.sum())
    return solid.faces[faces], rng.dirichlet([1, 1, 1], POINTS)


def plate() -> F64:
    """(h, w, 3) what the solids stand before."""
    photo = cv2.resize(data.coffee()[:, 50:450], (SIDE, SIDE)).astype(np.float64) / 255
    return np.asarray(cv2.GaussianBlur(photo, (0, 0), 1.5), np.float64)


PLATE = plate()


def over_plate(shot: Shot) -> F64:
    """(h, w, 3)"""
    alpha = shot.alpha[..., None]
    return shot.color * alpha + PLATE * (1 - alpha)


def score(shot: Shot, truth: Shot) -> Score:
    smaller, larger = np.minimum(shot.alpha, truth.alpha), np.maximum(shot.alpha, truth.alpha)
    error = (over_plate(shot) - over_plate(truth))[larger > FAINT]
    return Score(
        float(smaller.sum() / larger.sum()), float(-10 * np.log10(max((error**2).mean(), 1e-12)))
    )


def measured(scene: Scene, ways: Sequence[str] = WAYS) -> dict[tuple[str, str], tuple[Shot, Score]]:
    """What each of the ways predicts of each edit."""
    matte, lifted = lift_mask(scene.pixels, CAMERA, scene.mask, settings=ALONE)
    lifts = {"relief": lifted}
    for way, settings in (("network", SEEN), ("inflation", INFLATED)):
        if way in ways:
            _, lifts[way] = lift_mask(scene.pixels, CAMERA, scene.mask, settings=settings)
    if "depth" in ways:
        seen = NetworkDepth((37 * scene.inverse - 5).astype(np.float32), (0, 0, SIDE, SIDE))
        subject = LiftSubject(scene.pixels, CAMERA, scene.mask, matte)
        deep = ReliefLifter(lambda pixels, mask: seen)
        lifts["depth"] = deep.lift(subject, LiftSettings(trust=0), silent)
    puppets = {way: Puppet(own, DeformSettings(), CAMERA) for way, own in lifts.items()}
    textures = {way: object_texture(matte, own) for way, own in lifts.items()}
    found = {}
    for key, truth in scene.edited.items():
        edit = EDITS[key]
        drawers: dict[str, Draw] = {
            way: lambda shift, p=puppet, t=textures[way], e=edit: _drawn(p, t, e, shift)
            for way, puppet in puppets.items()
        }
        if not edit.bend:
            drawers["card"] = lambda shift, e=edit: _warped(matte, _card(scene, matte, e), shift)
        drawers["affine"] = lambda shift, k=key: _warped(matte, _affine(scene, k), shift)
        for way in (way for way in ways if way in drawers):
            shot = _aligned(drawers[way], truth)
            found[key, way] = (shot, score(shot, truth))
    return found


def _drawn(puppet: Puppet, texture: TextureLevels, edit: Edit, shift: F64) -> Shot:
    """The lift after an edit, moved by a shift (2,) px."""
    lifted = puppet.lifted
    away = -edit.nearer * lifted.centre[2] / (lifted.diameter * lifted.scale)
    move = (float(shift[0]), float(shift[1]))
    # The product's own turn: about what is upright where its shape says so, else the camera's axis.
    up = None if lifted.up is None else -np.array(lifted.up)
    gimbal = CAMERA_GIMBAL if up is None else Gimbal.about(up)
    place = Placement(move=move, depth=float(away), turn=turn_of(edit.turn(gimbal)))
    pose = None
    if edit.bend:
        height = float(np.ptp(lifted.gaussians.means[:, 1]))
        pose = Pose(*bent(lifted.control_points.astype(np.float64), height, edit.bend))
    picture = puppet.draw(pose, place, texture, CAMERA)
    alpha = np.asarray(picture.alpha, np.float64)
    return Shot(np.asarray(picture.color) / np.maximum(alpha, 1e-6)[..., None], alpha)


def _aligned(draw: Draw, truth: Shot) -> Shot:
    """Moved so that its box is about the middle of the true one's.

    From one photo nobody knows how far behind the picture the middle of a thing is, about which
    it turns: for all ways a shift is free.
    """
    return draw(middle_of(truth.alpha) - middle_of(draw(np.zeros(2)).alpha))


def middle_of(alpha: F64) -> F64:
    """(2,) px of the middle of the box of what is covered."""
    rows, columns = (np.flatnonzero((alpha > 0.5).any(axis)) for axis in (1, 0))
    return np.array([columns[0] + columns[-1] + 1, rows[0] + rows[-1] + 1]) / 2


def _card(scene: Scene, matte: Matte, edit: Edit) -> F64:
    """(3, 3) the homography of a flat board at the depth of the solid's middle."""
    turn, depth = edit.turn(scene.gimbal), scene.centre[2]
    intrinsics = np.array([[CAMERA.focal, 0, CAMERA.cx], [0, CAMERA.focal, CAMERA.cy], [0, 0, 1]])
    alpha = crop(matte.alpha, matte.box, (0, 0, SIDE, SIDE))
    middle = CAMERA.unproject(middle_of(alpha.astype(np.float64)), depth)
    step = (1 - edit.nearer) * middle - turn @ middle
    moved = turn + np.outer(step, [0, 0, 1 / depth])
    return intrinsics @ moved @ np.linalg.inv(intrinsics)


def _affine(scene: Scene, key: str) -> F64:
    """(3, 3) the affine map that best takes what the photo shows to where it truly is then."""
    source = np.column_stack([scene.shown, np.ones(len(scene.shown))])
    fitted, *_ = np.linalg.lstsq(source, scene.moved[key])
    return np.vstack([fitted.T, [0, 0, 1]])


def _warped(matte: Matte, to_place: F64, shift: F64) -> Shot:
    """The cut-out under a map (3, 3) of the photo's px."""
    into_photo = np.array([[1, 0, matte.left + 0.5], [0, 1, matte.top + 0.5], [0, 0, 1]])
    into_cells = np.array([[1, 0, shift[0] - 0.5], [0, 1, shift[1] - 0.5], [0, 0, 1]])
    warp, size = into_cells @ to_place @ into_photo, (SIDE, SIDE)
    alpha = cv2.warpPerspective(matte.alpha, warp, size, flags=cv2.INTER_CUBIC)
    color = cv2.warpPerspective(
        matte.foreground, warp, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    return Shot(np.clip(color, 0, 1).astype(np.float64), np.clip(alpha, 0, 1).astype(np.float64))


@dataclass(frozen=True)
class Row:
    """The scores of one solid, means over the edits of a group."""

    name: str
    scores: dict[tuple[str, str], Score]  # by group and way


def row_of(name: str, found: dict[tuple[str, str], tuple[Shot, Score]]) -> Row:
    scores = {}
    for group in GROUPS:
        for way in WAYS:
            own = [each for (key, w), (_, each) in found.items()
                   if w == way and EDITS[key].group == group]  # fmt: skip
            if own:
                scores[group, way] = mean(own)
    return Row(name, scores)


def mean(scores: Iterable[Score]) -> Score:
    chosen = list(scores)
    return Score(float(np.mean([s.iou for s in chosen])), float(np.mean([s.psnr for s in chosen])))


def means(rows: list[Row]) -> dict[tuple[str, str], Score]:
    """Over all solids."""
    return {key: mean(row.scores[key] for row in rows) for key in rows[0].scores}
