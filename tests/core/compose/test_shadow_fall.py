"""Shadows on walls, steps and other objects, against rays traced in scenes whose shape is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F32, F64, Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose.shadow.fall import Caster
from objectmorpher_core.compose.shadow.shadow import StandingObject
from objectmorpher_core.document.placement import ground_normal
from objectmorpher_core.document.settings import Shadow
from tests.outlines import upright

CAMERA = Camera.from_fov(260, 200)
SEEN_FROM = 25.0  # degrees above the ground
SHARP = Shadow(1.0, -70.0, 1.6, 0.0, 0.0)  # away from the viewer, a little to the right
FAR = 1e6
BOX = (0, 0, CAMERA.width, CAMERA.height)


class Board:
    """A board of 36 x 60 px that stands on the ground; across, up and nearer are its axes."""

    def __init__(self) -> None:
        mask = np.zeros((200, 260), bool)
        mask[84:144, 100:136] = True
        self.normal = ground_normal(CAMERA, None, SEEN_FROM, 143.0)
        self.points = upright(mask, CAMERA, SEEN_FROM, 120)
        self.standing = StandingObject(self.points, self.normal, CAMERA)
        self.axes = np.stack([[1.0, 0.0, 0.0], -self.normal, np.cross(self.normal, [1.0, 0, 0])])
        self.foot = self.points[(self.points @ self.normal).argmax()]
        own = (self.points - self.foot) @ self.axes.T
        self.low, self.high = own.min(0), own.max(0)
        self.height = float(self.high[1])

    def hides(self, places: F64, shadow: Shadow) -> Mask:
        """Whether the light on places (h, w, 3) has come through the board."""
        ray = self.standing.ray(shadow) @ self.axes.T
        own = (places - self.foot) @ self.axes.T
        back = own[..., 2] / ray[2]  # to the board's plane, against the light
        at = own - back[..., None] * ray
        is_on = ((at > self.low - 1e-6) & (at < self.high + 1e-6))[..., :2].all(-1)
        return is_on & (back > 1e-6)


BOARD = Board()


def rays() -> F64:
    """(H, W, 3) of depth 1."""
    y, x = np.mgrid[: CAMERA.height, : CAMERA.width] + 0.5
    return CAMERA.unproject(np.stack([x, y], -1), np.ones(x.shape))


def depth_to(point: F64, normal: F64) -> F64:
    """(H, W) to a plane; `FAR` where it is not seen."""
    along = rays() @ normal
    depth = (point @ normal) / np.where(np.abs(along) < 1e-9, 1e-9, along)
    return np.where(depth > 0, depth, FAR)


def ground(rise: float = 0.0) -> F64:
    """(H, W) to a ground that lies so much higher than the board's foot, x its height."""
    return depth_to(BOARD.foot + rise * BOARD.height * BOARD.axes[1], BOARD.normal)


def away(depth: F64) -> F64:
    """(H, W) how far behind the board something is, x its height."""
    places = depth[..., None] * rays()
    return -((places - BOARD.foot) @ BOARD.axes[2]) / BOARD.height


def wall(distance: float) -> F64:
    """(H, W) to an upright wall behind the board."""
    return depth_to(BOARD.foot - distance * BOARD.height * BOARD.axes[2], BOARD.axes[2])


def shade(depth: F64, shadow: Shadow = SHARP) -> F32:
    """(H, W) the shadow where the photo is so deep, told as a network does."""
    seen = (3.0 / depth + 0.2).astype(np.float32)
    found = Caster(shadow, BOARD.standing, cells=176, seen=seen).shade
    return np.zeros(depth.shape, np.float32) if found is None else found.at(BOX)


def overlap(one: Mask, other: Mask) -> float:
    return float((one & other).sum() / max((one | other).sum(), 1))


SCENES = {
    "wall": np.minimum(ground(), wall(0.5)),
    "far wall": np.minimum(ground(), wall(1.0)),
    "step up": np.where(away(ground(0.25)) > 0.5, ground(0.25), np.minimum(ground(), wall(0.5))),
    "step down": np.where(away(ground()) < 0.5, ground(), ground(-0.25)),
}


@pytest.mark.parametrize("name", SCENES)
def test_it_falls_where_rays_say(name: str) -> None:
    depth = SCENES[name]
    truth = BOARD.hides(depth[..., None] * rays(), SHARP)
    seen = shade(depth)
    found = seen > 0.4 * seen.max()
    plain = Caster(SHARP, BOARD.standing).shade
    assert plain is not None
    before = plain.at(BOX) > 0.4 * plain.alpha.max()
    assert overlap(found, truth) > 0.75
    assert overlap(found, truth) > overlap(before, truth) + 0.1


def test_on_a_wall_it_stands_upright() -> None:
    seen = shade(SCENES["wall"])
    on_wall = wall(0.5) < ground()
    rows = [r for r in range(200) if (seen[r] > 0.4 * seen.max()).any() and on_wall[r].all()]
    truth = BOARD.hides(wall(0.5)[..., None] * rays(), SHARP)
    rows = [r for r in rows if truth[r].any()]
    both = seen > 0.4 * seen.max(), truth
    found, true = (
        np.array([np.average(np.arange(260), weights=own[r]) for r in rows]) for own in both
    )
    assert len(rows) > 30 and np.percentile(np.abs(found - true), 80) <= 1


def test_plain_ground_changes_nothing() -> None:
    plain = Caster(SHARP, BOARD.standing).shade
    noisy = ground() * (1 + 0.003 * np.sin(np.mgrid[:200, :260][1] / 9))
    for depth in (ground(), noisy):
        seen = (3 / depth + 0.2).astype(np.float32)
        found = Caster(SHARP, BOARD.standing, seen=seen).shade
        assert plain is not None and found is not None
        np.testing.assert_array_equal(found.alpha, plain.alpha)


def test_none_falls_on_the_sky_or_beyond_an_edge() -> None:
    edge = np.where(away(ground()) < 0.5, ground(), FAR)
    assert not shade(edge)[edge == FAR].any()
    assert shade(edge).max() > 0.4
    horizon = 100.0  # px: the board's foot is below it, its shadow is told to go above
    long = replace(SHARP, direction=-90.0, length=4.0, softness=1.0)
    told = Caster(long, BOARD.standing, horizon).shade
    assert told is not None and not told.at(BOX)[:100].any()
    assert Caster(long, BOARD.standing, 160.0).shade is None  # a thing in the air


def test_another_object_is_hit_where_rays_say() -> None:
    """A board behind the board; lifted at the same distance, as every lift is."""
    other = BOARD.points + 0.6 * BOARD.height * (BOARD.axes[0] - BOARD.axes[2])
    normals = np.broadcast_to(BOARD.axes[2], other.shape)
    caster = Caster(SHARP, BOARD.standing)
    truth = BOARD.hides(other[None], SHARP)[0]
    for times in (1.0, 0.8):
        found = caster.on(times * other, normals, times * other)
        assert truth.any() and overlap(found > 0.4 * found.max(), truth) > 0.75
    assert not caster.on(other, -normals, other).any()  # its far side has no light to lose
    assert not caster.on(other + [3.0, 0, 0], normals, other).any()
