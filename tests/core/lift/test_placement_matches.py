"""Details that two pictures show, and what they say of a pose."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.rotations import matrix_from_vector
from objectmorpher_core.lift.registration.placement import Hints, Registrar, register
from objectmorpher_core.lift.registration.sketch import LEAST, SIDE, Matches, alike
from objectmorpher_core.lift.registration.sketch import NEAR_MATCH as NEAR
from tests.core.lift import registered
from tests.core.lift.registered import CAMERA, Body, Scene

TURN = 25.0  # degrees about the upright axis, between the two photos
FINE = 2.5  # x as fine as the usual pattern


def _ball() -> Body:
    """A ball whose pattern has details."""
    plain = registered.ball()

    class Marked(Body):
        def colors(self, points: F64) -> F64:
            return registered.pattern(FINE * points)

    return Marked(plain.points, plain.normals, plain.cast, True)


def _turned(matrix: F64, degrees: float) -> F64:
    turned = matrix.copy()
    turned[:3, :3] = matrix_from_vector(np.radians([0.0, degrees, 0.0])) @ matrix[:3, :3]
    return turned


@cache
def _two() -> tuple[Scene, Scene]:
    """Photos of the ball before and after a turn, the second one darker and the other way lit."""
    matrix = registered.pose(5)
    before, after = (registered.photo(_ball(), m) for m in (matrix, _turned(matrix, TURN)))
    ramp = np.linspace(0.35, 0.9, registered.WIDTH)[None, :, None]
    return before, replace(after, pixels=np.rint(ramp * after.pixels).astype(np.uint8))


@cache
def _matches() -> Matches:
    """Their details as points of the ball."""
    before, after = _two()
    at, seen = alike((before.pixels, before.mask), (after.pixels, after.mask))
    ways = CAMERA.unproject(at, np.ones(len(at)))
    turn, move = before.world_from_object[:3, :3], before.world_from_object[:3, 3]
    distance = registered.ball().cast(-move @ turn, ways @ turn)
    hit = np.isfinite(distance)
    points = -move @ turn + distance[hit, None] * (ways @ turn)[hit]
    return Matches(points, seen[hit], float(np.sqrt(after.mask.sum())))


def test_details_are_found_again_after_a_turn_in_another_light():
    after, matches = _two()[1], _matches()
    assert len(matches) > 3 * LEAST
    gaps = np.linalg.norm(matches.gaps(after.world_from_object, CAMERA), axis=1)
    assert (gaps < 1).mean() > 0.6
    assert np.median(gaps[gaps < 1]) * NEAR * matches.size < 1.5  # px


def test_the_pose_on_which_most_agree_is_the_true_one():
    after, matches = _two()[1], _matches()
    found = matches.pose(CAMERA)
    assert found is not None
    assert registered.turn_error(found, after.world_from_object) < 5
    before = _two()[0].world_from_object
    assert matches.support(found, CAMERA) > 3 * matches.support(before, CAMERA)


def test_matches_of_another_picture_tell_no_pose():
    matches = _matches()
    rng = np.random.default_rng(0)
    seen = np.array([120, 90]) + rng.uniform(-0.5, 0.5, matches.seen.shape) * matches.size
    wrong = Matches(matches.points, seen, matches.size)
    found = wrong.pose(CAMERA)
    assert found is None or wrong.support(found, CAMERA) < 0.25
    few = Matches(matches.points[: LEAST - 1], matches.seen[: LEAST - 1], matches.size)
    assert few.pose(CAMERA) is None


def test_few_matches_say_less_than_many():
    true, matches = _two()[1].world_from_object, _matches()
    gaps = np.linalg.norm(matches.gaps(true, CAMERA), axis=1)
    near = np.argsort(gaps)[: 3 * LEAST]
    said = [
        Matches(matches.points[near[:n]], matches.seen[near[:n]], matches.size).support(
            true, CAMERA
        )
        for n in (0, 2, LEAST, 3 * LEAST)
    ]
    assert said[0] == 0
    assert said == sorted(said)
    assert said[-1] < 1


def test_matches_say_the_same_in_any_frame():
    true, matches = _two()[1].world_from_object, _matches()
    frame = 3.0 * registered.pose(8)
    frame[3] = [0, 0, 0, 1]
    moved = matches.moved(frame)
    assert np.isclose(
        moved.support(true @ np.linalg.inv(frame), CAMERA), matches.support(true, CAMERA)
    )


def test_pictures_without_details_match_nothing():
    plain = registered.photo(registered.ball(), registered.pose(2))
    flat = np.full_like(plain.pixels, 128)
    for pixels in (flat, plain.pixels):
        at, seen = alike((flat, plain.mask), (pixels, plain.mask))
        assert at.shape == seen.shape == (len(at), 2)
        assert len(at) < LEAST


@pytest.mark.slow
def test_matches_tell_the_turn_that_outline_and_colours_do_not():
    body, matrix = registered.cylinder(), np.eye(4)
    matrix[:3, :3] = matrix_from_vector(np.radians([20.0, 0.0, 5.0]))
    matrix[:3, 3] = [0, 0, 2.4]
    matrix[:3, :3] = matrix[:3, :3] @ matrix_from_vector(np.radians([0.0, 40.0, 0.0]))
    scene = registered.photo(body, matrix)
    rng = np.random.default_rng(1)
    facing = (body.normals @ matrix[:3, :3].T * (body.points @ matrix[:3, :3].T + [0, 0, 2.4])).sum(
        1
    ) < -0.5
    points = body.points[rng.choice(np.flatnonzero(facing), 40, replace=False)]
    seen = CAMERA.project(points @ matrix[:3, :3].T + matrix[:3, 3])
    seen[::4] += rng.uniform(-30, 30, seen[::4].shape)  # a quarter of them is wrong
    matches = Matches(points, seen, float(np.sqrt(scene.mask.sum())))
    blind = register(registered.gaussians(body), scene.target)
    found = register(registered.gaussians(body), scene.target, Hints(matches=matches))
    assert blind.is_ambiguous
    assert not found.is_ambiguous
    assert registered.turn_error(found.best.world_from_object, matrix) < 3
    told = Registrar(registered.gaussians(body), scene.target, matches=matches)
    for other in blind.proposals:  # the accepted pose is never worse
        assert found.best.score >= told.rated(other.world_from_object).score


def test_a_large_photo_is_not_aliased_before_details_are_sought(coffee):
    """Its noise is averaged as it becomes smaller, and the same places are found again."""
    rng = np.random.default_rng(0)
    large = cv2.resize(coffee[60:340, 150:450], None, fx=10, fy=10, interpolation=cv2.INTER_CUBIC)
    mask = np.zeros(large.shape[:2], bool)
    mask[300:2500, 300:2700] = True
    seen = [np.clip(large + rng.normal(0, 12, large.shape), 0, 255).astype(np.uint8) for _ in "ab"]
    at, there = alike((seen[0], mask), (seen[1], mask))
    off = np.linalg.norm(at - there, axis=1) * SIDE / 2400
    assert (off < 1).sum() > 150
    assert np.median(off) < 0.25, "px of the smaller picture"
