"""Solids turned about the upright: what is predicted from one photo, against the true view.

Five predictions. "network" is the product's own lift; "relief" is the same from the silhouette
alone, and "depth" is that with a perfect depth network, whose scale and shift are unknown as any
network's are. The card is the cut-out on a flat board at the solid's true distance, turned (a
homography). The affine one is the best that any warp of the picture with six numbers could do:
fitted to the true places of the points that the photo shows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import mesh_view
import numpy as np
from skimage import data
from solids import Solid, load

from objectmorpher_core.arrays import F64, Mask, Pixels
from objectmorpher_core.camera import Camera
from objectmorpher_core.compose.composite import object_texture
from objectmorpher_core.document import DeformSettings, LiftSettings, Matte, Placement
from objectmorpher_core.lift import Subject
from objectmorpher_core.lift.depth_prior import Seen
from objectmorpher_core.lift.relief import ReliefLifter
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.pixels import crop
from objectmorpher_core.progress import silent
from objectmorpher_core.puppet import Puppet
from objectmorpher_core.rotations import turn_matrix

SIDE = 512  # px
CAMERA = Camera.from_fov(SIDE, SIDE)
ANGLES = (-35, -20, -10, 10, 20, 35)  # degrees of yaw
SHARE = 0.55  # of the picture's width that a solid fills
AT = np.array([245.0, 270.0])  # px, where its middle is
WAYS = ("network", "relief", "depth", "card", "affine")
ALONE = LiftSettings(uses_depth=False, trust=0)  # the silhouette
SEEN = LiftSettings(uses_depth=False)
POINTS = 20_000  # on a solid's surface, for the affine warp
SAME_DEPTH = 0.01  # of a point and of the nearest surface: it is seen
FAINT = 0.02  # alpha, from which a pixel counts


@dataclass(frozen=True, eq=False)
class Shot:
    """The object in a picture; straight colours."""

    color: F64  # (h, w, 3) in [0, 1]
    alpha: F64  # (h, w)


@dataclass(frozen=True, eq=False)
class Scene:
    """A solid in a made photo, and what it looks like turned."""

    name: str
    photo: Shot
    turned: dict[int, Shot]  # by degrees
    centre: F64  # (3,) world, about which it turns
    shown: F64  # (n, 2) px of points that the photo shows
    moved: dict[int, F64]  # (n, 2) px of them, by degrees
    inverse: F64  # (h, w) true inverse depth of the photo; what is behind is farther away
    back: F64  # (h, w) true depth of where rays leave the solid; not finite beside it

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
    worlds = {a: (rest - centre) @ turn_matrix(a, 0, 0).T + centre for a in (0, *ANGLES)}
    views = {a: mesh_view.draw(solid, world, CAMERA) for a, world in worlds.items()}
    shots = {a: Shot(view.color, view.alpha) for a, view in views.items()}
    of, weights = _sampled(solid, rest)
    places = {a: CAMERA.project((w[of] * weights[:, :, None]).sum(1)) for a, w in worlds.items()}
    points = (rest[of] * weights[:, :, None]).sum(1)
    column, row = np.clip(places[0].astype(int), 0, SIDE - 1).T
    is_seen = np.abs(points[:, 2] - views[0].depth[row, column]) < SAME_DEPTH
    photo = shots.pop(0)
    moved = {a: places[a][is_seen] for a in ANGLES}
    inverse = np.where(np.isfinite(views[0].depth), 1 / views[0].depth, 0.5 / views[0].depth.min())
    return Scene(name, photo, shots, centre, places[0][is_seen], moved, inverse, views[0].back)


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


def measured(scene: Scene) -> dict[tuple[int, str], tuple[Shot, Score]]:
    """What each way predicts of each turn."""
    matte, lifted = lift_mask(scene.pixels, CAMERA, scene.mask, settings=ALONE)
    _, learned = lift_mask(scene.pixels, CAMERA, scene.mask, settings=SEEN)
    seen = Seen((37 * scene.inverse - 5).astype(np.float32), (0, 0, SIDE, SIDE))
    subject = Subject(scene.pixels, CAMERA, scene.mask, matte)
    deep = ReliefLifter(lambda pixels, mask: seen).lift(subject, LiftSettings(trust=0), silent)
    texture = object_texture(matte)
    puppets = {
        "network": Puppet(learned, DeformSettings(), CAMERA),
        "relief": Puppet(lifted, DeformSettings(), CAMERA),
        "depth": Puppet(deep, DeformSettings(), CAMERA),
    }

    def relief(way: str, angle: int, shift: F64) -> Shot:
        puppet = puppets[way]
        place = Placement(move=(float(shift[0]), float(shift[1])), turn=(angle, 0, 0))
        picture = puppet.draw(None, place, texture, CAMERA)
        alpha = np.asarray(picture.alpha, np.float64)
        return Shot(np.asarray(picture.color) / np.maximum(alpha, 1e-6)[..., None], alpha)

    drawers: dict[str, Callable[[int, F64], Shot]] = {
        "network": lambda angle, shift: relief("network", angle, shift),
        "relief": lambda angle, shift: relief("relief", angle, shift),
        "depth": lambda angle, shift: relief("depth", angle, shift),
        "card": lambda angle, shift: _warped(matte, _card(scene, matte, angle), shift),
        "affine": lambda angle, shift: _warped(matte, _affine(scene, angle), shift),
    }
    found = {}
    for angle, truth in scene.turned.items():
        for way in WAYS:
            shot = _aligned(lambda shift, w=way, a=angle: drawers[w](a, shift), truth)
            found[angle, way] = (shot, score(shot, truth))
    return found


def _aligned(draw: Draw, truth: Shot) -> Shot:
    """Moved so that its box is about the middle of the true one's.

    From one photo nobody knows how far behind the picture the middle of a thing is, about which
    it turns: for all ways a shift is free.
    """
    return draw(_middle(truth.alpha) - _middle(draw(np.zeros(2)).alpha))


def _middle(alpha: F64) -> F64:
    """(2,) px of the middle of the box of what is covered."""
    rows, columns = (np.flatnonzero((alpha > 0.5).any(axis)) for axis in (1, 0))
    return np.array([columns[0] + columns[-1] + 1, rows[0] + rows[-1] + 1]) / 2


def _card(scene: Scene, matte: Matte, angle: int) -> F64:
    """(3, 3) the homography of a flat board at the depth of the solid's middle."""
    turn, depth = turn_matrix(angle, 0, 0), scene.centre[2]
    intrinsics = np.array([[CAMERA.focal, 0, CAMERA.cx], [0, CAMERA.focal, CAMERA.cy], [0, 0, 1]])
    alpha = crop(matte.alpha, matte.box, (0, 0, SIDE, SIDE))
    middle = CAMERA.unproject(_middle(alpha.astype(np.float64)), depth)
    moved = turn + np.outer(middle - turn @ middle, [0, 0, 1 / depth])
    return intrinsics @ moved @ np.linalg.inv(intrinsics)


def _affine(scene: Scene, angle: int) -> F64:
    """(3, 3) the affine map that best takes what the photo shows to where it truly is then."""
    source = np.column_stack([scene.shown, np.ones(len(scene.shown))])
    fitted, *_ = np.linalg.lstsq(source, scene.moved[angle])
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
    """The scores of one solid, means over both senses of a turn."""

    name: str
    scores: dict[tuple[int, str], Score]  # by degrees and way


def row_of(name: str, found: dict[tuple[int, str], tuple[Shot, Score]]) -> Row:
    scores = {}
    for angle in sorted({abs(a) for a in ANGLES}):
        for way in WAYS:
            scores[angle, way] = mean([found[s * angle, way][1] for s in (-1, 1)])
    return Row(name, scores)


def mean(scores: Iterable[Score]) -> Score:
    chosen = list(scores)
    return Score(float(np.mean([s.iou for s in chosen])), float(np.mean([s.psnr for s in chosen])))


def means(rows: list[Row]) -> dict[tuple[int, str], Score]:
    """Over all solids."""
    return {key: mean(row.scores[key] for row in rows) for key in rows[0].scores}
