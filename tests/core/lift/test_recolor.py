"""The colours of an object from elsewhere, in the photo's light."""

from __future__ import annotations

import time

import numpy as np

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.document.model import LiftedObject, Matte, PhotoTexture
from objectmorpher_core.lift.registration.imported import CARRIED, NEAREST, recolored

SIZE = 200  # px
CAMERA = Camera.from_fov(SIZE, SIZE, 45)
FAR = 3.0  # object units to the ball's centre
LEVEL = 1 / 255


def _grey(points: F64) -> tuple[LiftedObject, Matte]:
    """Grey Gaussians at points (N, 3), and a photo of stripes."""
    count, world_from_object = len(points), np.eye(4)
    world_from_object[2, 3] = FAR
    spacing = 0.5 * float(np.sqrt(4 * np.pi / count))
    gaussians = Gaussians(
        points.astype(np.float32), np.eye(1, 4, dtype=np.float32).repeat(count, 0),
        np.full((count, 3), spacing, np.float32), np.ones(count, np.float32),
        np.full((count, 3), 0.5, np.float32),
    )  # fmt: skip
    at = CAMERA.project(points + [0, 0, FAR])
    nothing = np.zeros(count, np.float32)
    lifted = LiftedObject(
        gaussians, PhotoTexture(at, nothing, nothing + 1), gaussians.means[:64],
        world_from_object, spacing, "imported", "solid",
    )  # fmt: skip
    stripes = 0.5 + 0.1 * np.sin(np.arange(SIZE) / 9)
    picture = np.broadcast_to(stripes[:, None, None], (SIZE, SIZE, 3)).astype(np.float32)
    matte = Matte(0, 0, np.ones((SIZE, SIZE), np.float32), np.ascontiguousarray(picture))
    return lifted, matte


def _ball(count: int) -> F64:
    """Points (count, 3) on a ball of radius 0.5."""
    way = np.random.default_rng(1).normal(size=(count, 3))
    return 0.5 * way / np.linalg.norm(way, axis=1, keepdims=True)


def _seconds(reach: float) -> float:
    """Of the processor, half of the Gaussians on a ball, and the others so far from its centre."""
    points = _ball(20_000)
    points[::2] *= reach / 0.5
    lifted, matte = _grey(points)
    seen = (np.arange(len(points)) % 2).astype(np.float32)
    start = time.process_time()
    recolored(lifted, seen, matte, CAMERA)
    return time.process_time() - start


def test_what_is_far_from_all_that_the_photo_shows_is_not_compared_with_each_of_it():
    """A tree would do so where all of it is about equally far away."""
    beside = min(_seconds(0.49) for _ in range(3))
    far = min(_seconds(0.01) for _ in range(3))
    assert far < 3 * beside, f"it takes {far / beside:.1f} times as long"


def test_what_is_left_of_the_difference_is_carried_on_as_its_formula_says():
    """The difference at the nearest Gaussians that the photo shows, fading with the distance."""
    lifted, matte = _grey(_ball(3_000))
    seen = (lifted.gaussians.means[:, 2] < -0.1).astype(np.float32)
    colors = recolored(lifted, seen, matte, CAMERA)
    points, is_seen = lifted.gaussians.means.astype(np.float64), seen > 0
    lit = np.median(colors[points[:, 2] > 0.35])  # so far away nothing of the stripes is left
    rest = colors[is_seen] - lit
    for k in np.flatnonzero(~is_seen)[::29]:
        distances = np.linalg.norm(points[is_seen] - points[k], axis=1)
        near = np.argsort(distances)[:NEAREST]
        weights = 1 - (distances[near] / (1.01 * distances[near[-1]])) ** 2
        mean = (rest[near] * weights[:, None]).sum(0) / weights.sum()
        expected = lit + mean * np.exp(-((distances[near[0]] / CARRIED) ** 2))
        assert np.abs(colors[k] - expected).max() < LEVEL
    beside = ~is_seen & (points[:, 2] < 0)
    assert np.ptp(colors[beside]) > 0.05, "the stripes go on"


def test_what_flies_far_from_the_object_costs_no_memory():
    """Floaters a thousand units away: a grid as fine as the object needs would not fit in any."""
    points = _ball(3_000)
    points[:4] = [[300, 300, 1000], [-300, 300, 1000], [300, -300, 1000], [-300, -300, 1000]]
    lifted, matte = _grey(points)
    seen = (lifted.gaussians.means[:, 2] < -0.1).astype(np.float32)
    seen[:4] = 1
    flown = recolored(lifted, seen, matte, CAMERA)
    lifted, matte = _grey(points[4:])
    alone = recolored(lifted, seen[4:], matte, CAMERA)
    assert np.abs(flown[4:] - alone).max() < 2 * LEVEL
