"""Known objects in made photos, for the tests of the registration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F64, RGB, Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.poisson_disk import thin_to_spacing
from objectmorpher_core.base.rotations import quats_along
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.lift.registration.view import Target
from tests import shapes

WIDTH, HEIGHT = 240, 180  # px
CAMERA = Camera.from_fov(WIDTH, HEIGHT, 45)
SURFELS = 6_000
CANDIDATES = 60_000  # points before they are thinned
RAYS = 3  # by as many in a pixel
Cast = Callable[[F64, F64], F64]
"""Distances (n,) along rays from one point (3,) by ways (n, 3) to the surface; inf beside it."""


@dataclass(frozen=True, eq=False)
class Body:
    """A surface: points all over it, and where rays meet it; object units."""

    points: F64  # (n, 3)
    normals: F64  # (n, 3)
    cast: Cast
    is_patterned: bool

    def colors(self, points: F64) -> F64:
        """sRGB (n, 3) of points of the surface."""
        return pattern(points) if self.is_patterned else np.full((len(points), 3), 0.6)


BOXES = np.array(  # low and high corners of three boxes that meet: no symmetry
    [[[0, 0, 0], [1, 0.25, 0.3]], [[0, 0, 0], [0.25, 0.7, 0.3]], [[0, 0, 0], [0.25, 0.25, 0.55]]]
) - [0.5, 0.35, 0.275]  # fmt: skip


def bracket() -> Body:
    """Three boxes of different lengths that meet in a corner, patterned."""
    rng = np.random.default_rng(1)
    points, normals = [], []
    for low, high in BOXES:
        size, count = high - low, CANDIDATES // 3
        areas = np.array([size[1] * size[2], size[0] * size[2], size[0] * size[1]])
        axis, side = rng.choice(3, count, p=areas / areas.sum()), rng.integers(0, 2, count)
        own = low + rng.random((count, 3)) * size
        own[np.arange(count), axis] = np.where(side, high[axis], low[axis])
        inside = [((own > a + 1e-9) & (own < b - 1e-9)).all(1) for a, b in BOXES]
        kept = ~np.any(inside, axis=0)
        points.append(own[kept])
        normals.append((np.eye(3)[axis] * (2.0 * side - 1)[:, None])[kept])

    def cast(start: F64, ways: F64) -> F64:
        return np.min([_between(start, ways, low, high) for low, high in BOXES], axis=0)

    return Body(np.concatenate(points), np.concatenate(normals), cast, True)


def _between(start: F64, ways: F64, low: F64, high: F64) -> F64:
    """Where rays enter a box."""
    with np.errstate(divide="ignore"):
        ends = np.sort([(low - start) / ways, (high - start) / ways], axis=0)
    enter, leave = ends[0].max(1), ends[1].min(1)
    return np.where(enter < leave, enter, np.inf)


def _round(start: F64, ways: F64, radius: float) -> tuple[F64, F64]:
    """Where rays enter and leave what is `radius` around the origin, in as many dimensions."""
    a, b, c = (ways**2).sum(1), ways @ start, start @ start - radius**2
    root = np.sqrt(np.maximum(b * b - a * c, 0))
    hit = b * b > a * c
    return np.where(hit, (-b - root) / a, np.inf), np.where(hit, (-b + root) / a, -np.inf)


def ball(is_patterned: bool = False) -> Body:
    points = shapes.ball(CANDIDATES, seed=2)
    return Body(points, 2 * points, lambda start, ways: _round(start, ways, 0.5)[0], is_patterned)


def cylinder() -> Body:
    """Plain, upright along y."""
    rng = np.random.default_rng(4)
    angle, y = rng.uniform(0, 2 * np.pi, CANDIDATES), rng.uniform(-0.5, 0.5, CANDIDATES)
    is_cap, top = rng.random(CANDIDATES) < 0.2, np.sign(y)
    out = np.column_stack([np.cos(angle), np.zeros(CANDIDATES), np.sin(angle)])
    radius = 0.25 * np.where(is_cap, np.sqrt(rng.random(CANDIDATES)), 1.0)
    points = out * radius[:, None] + np.outer(np.where(is_cap, 0.5 * top, y), [0, 1, 0])
    normals = np.where(is_cap[:, None], np.outer(top, [0, 1, 0]), out)

    def cast(start: F64, ways: F64) -> F64:
        enter, leave = _round(start[[0, 2]], ways[:, [0, 2]], 0.25)
        ends = np.sort([(-0.5 - start[1]) / ways[:, 1], (0.5 - start[1]) / ways[:, 1]], axis=0)
        enter, leave = np.maximum(enter, ends[0]), np.minimum(leave, ends[1])
        return np.where(enter < leave, enter, np.inf)

    return Body(points, normals, cast, False)


def pattern(points: F64) -> F64:
    """sRGB (n, 3): waves through space."""
    rng = np.random.default_rng(3)
    ways = rng.normal(size=(16, 3)) * rng.uniform(3, 10, (16, 1))
    waves = np.sin(points @ ways.T + rng.uniform(0, 6, 16)) @ rng.normal(size=(16, 3))
    return 0.5 + 0.4 * np.tanh(0.5 * waves)


def gaussians(body: Body, count: int = SURFELS) -> Gaussians:
    """Even surfels of a body."""
    rng = np.random.default_rng(0)
    cells = np.unique(np.floor(body.points / 0.02).astype(int), axis=0)
    spacing = float(np.sqrt(len(cells) * 0.02**2 / 1.5 / count))
    kept = thin_to_spacing(body.points, 0.82 * spacing, rng.permutation(len(body.points)))
    arrays = (
        body.points[kept], quats_along(body.normals[kept]),
        np.tile(np.array([0.66, 0.66, 0.12]) * spacing, (len(kept), 1)), np.ones(len(kept)),
        body.colors(body.points[kept]),
    )  # fmt: skip
    return Gaussians(*(np.asarray(a, np.float32) for a in arrays))


@dataclass(frozen=True, eq=False)
class Scene:
    """A photo of a body whose pose is known."""

    pixels: RGB
    mask: Mask
    camera: Camera
    world_from_object: F64

    @property
    def target(self) -> Target:
        return Target(self.pixels, self.mask, self.camera)


def pose(seed: int, depth: float = 2.4, x: float = 0.0, y: float = 0.0) -> F64:
    """(4, 4) turned at random, `x` and `y` px beside the middle of the photo."""
    matrix = np.eye(4)
    matrix[:3, :3] = shapes.rotation(seed)
    middle = np.array([WIDTH / 2 + x, HEIGHT / 2 + y])
    matrix[:3, 3] = CAMERA.unproject(middle, depth)
    return matrix


def photo(body: Body, matrix: F64, camera: Camera = CAMERA) -> Scene:
    """Ray cast, nine rays in a pixel; darker and warmer than the body is."""
    fine = camera.windowed(0, 0, RAYS * camera.width, RAYS * camera.height, RAYS)
    y, x = np.mgrid[: fine.height, : fine.width] + 0.5
    turn = matrix[:3, :3]
    ways = fine.unproject(np.column_stack([x.ravel(), y.ravel()]), np.ones(x.size)) @ turn
    start = -matrix[:3, 3] @ turn
    distance = body.cast(start, ways)
    hit = np.isfinite(distance)
    image = np.zeros((len(ways), 4), np.float32)
    image[hit, :3] = body.colors(start + distance[hit, None] * ways[hit])
    image[hit, 3] = 1.0
    image = image.reshape(fine.height, fine.width, 4)
    image = cv2.resize(image, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    alpha, own = image[..., 3:], image[..., :3]
    rng = np.random.default_rng(9)
    ground = cv2.GaussianBlur(rng.random((camera.height, camera.width, 3)), (0, 0), 3)
    shown = own * [0.9, 0.85, 0.75] + (1 - alpha) * (0.2 + 0.5 * ground)
    shown = shown + rng.normal(0, 0.01, shown.shape)
    pixels = np.rint(255 * shown.clip(0, 1)).astype(np.uint8)
    return Scene(pixels, alpha[..., 0] > 0.5, camera, matrix)


@cache
def known_bracket() -> tuple[Gaussians, Scene]:
    """The bracket and a photo of it."""
    return gaussians(bracket()), photo(bracket(), pose(3, x=12, y=-5))


def turn_error(found: F64, true: F64) -> float:
    """Degrees between the rotations of two similarities (4, 4)."""
    turns = [m[:3, :3] / np.cbrt(np.linalg.det(m[:3, :3])) for m in (found, true)]
    cosine = (np.trace(turns[0].T @ turns[1]) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


LENS_CAMERA = Camera.from_fov(480, 360, 45)
AWAY = 2.4  # object units
TURN = 35.0  # degrees between the photos of the lens


def turned(degrees: float) -> F64:
    """(4, 4) about an upright axis through a thing at the usual distance."""
    angle, matrix = np.radians(degrees), np.eye(4)
    matrix[0, 0] = matrix[2, 2] = np.cos(angle)
    matrix[0, 2], matrix[2, 0] = np.sin(angle), -np.sin(angle)
    matrix[:3, 3] = [0, 0, AWAY] - matrix[:3, :3] @ [0, 0, AWAY]
    return matrix


@cache
def two_sides() -> tuple[Scene, Scene]:
    """A patterned lens, much flatter than its outline suggests, and it from a side by `TURN`."""
    round_one, radii = ball(is_patterned=True), np.array([1.0, 0.8, 0.35])
    lens = replace(round_one, cast=lambda start, ways: round_one.cast(start / radii, ways / radii))
    first = np.eye(4)
    first[:3, 3] = [0, 0, AWAY]
    return photo(lens, first, LENS_CAMERA), photo(lens, turned(TURN) @ first, LENS_CAMERA)
