"""The mirror plane of an object, however it is turned."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.rotations import matrix_from_vector
from objectmorpher_core.deform.symmetry import find_mirror, plane_through
from tests import shapes

DEGREE = 1.0
EXACT = 1e-9
SCALED = 1e-6  # x the gap: means of float64 distances


def _body(seed: int) -> F64:
    """A head, a trunk and two arms: symmetric in x, with no other plane. (N, 3)."""
    parts = [
        shapes.ball(1500, seed) * [0.5, 1.2, 0.4],
        shapes.ball(500, seed + 1) * 0.35 + [0.0, -0.75, 0.12],
    ]
    for side, other in ((-1, 2), (1, 3)):  # not the same points on both sides
        arm = shapes.ball(600, seed + other) * [0.7, 0.16, 0.16]
        parts.append(arm + [0.5 * side, -0.3, 0.05])
    return np.concatenate(parts)


@pytest.mark.parametrize("seed", range(4))
def test_the_plane_of_a_symmetric_shape_is_found_however_it_is_turned(seed: int) -> None:
    turn, shift = shapes.rotation(seed), np.array([0.3, -1.0, 2.0])
    plane = find_mirror(_body(10 * seed) @ turn.T + shift)
    assert plane is not None
    cosine = min(abs(float(plane.normal @ turn[:, 0])), 1.0)
    assert np.degrees(np.arccos(cosine)) < DEGREE
    assert plane.distance(shift) < 0.01


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_the_gap_does_not_depend_on_the_size(scale: float) -> None:
    plane, other = find_mirror(_body(0)), find_mirror(scale * _body(0))
    assert plane is not None and other is not None
    assert other.gap == pytest.approx(plane.gap, rel=SCALED)


def test_a_shape_without_a_plane_has_none() -> None:
    random = np.random.default_rng(0)
    blobs = [
        shapes.ball(300, k) * random.uniform(0.2, 0.6, 3) + random.uniform(-1, 1, 3)
        for k in range(6)
    ]
    assert find_mirror(np.concatenate(blobs)) is None


def test_the_plane_between_front_and_back_is_left_out() -> None:
    loaf = shapes.ball(3000) * [1.0, 0.6, 0.3]
    front = np.array([0.0, 0.0, 1.0])
    plane = find_mirror(loaf + [0.0, 0.0, 5.0], front)
    assert plane is not None
    assert abs(plane.normal @ front) < 0.1


def test_of_planes_that_are_as_good_the_upright_one_is_taken() -> None:
    egg = shapes.ball(3000) * [1.0, 0.9, 0.5]
    front = np.array([0.0, 0.0, 1.0])
    for across in np.eye(3)[:2]:
        plane = find_mirror(egg, front, across)
        assert plane is not None
        assert abs(plane.normal @ across) > 0.95


def test_mirroring_twice_changes_nothing_and_a_turn_goes_the_other_way() -> None:
    plane = plane_through(np.array([0.2, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    points = shapes.ball(20)
    np.testing.assert_allclose(plane.mirrored(points)[:, 0], 0.4 - points[:, 0], atol=EXACT)
    np.testing.assert_allclose(plane.mirrored(plane.mirrored(points)), points, atol=EXACT)
    turn = np.array([0.3, -0.5, 0.9])
    mirror = np.diag([-1.0, 1.0, 1.0])
    mirrored = mirror @ matrix_from_vector(turn) @ mirror
    other = matrix_from_vector(plane.mirrored_turn(turn))
    np.testing.assert_allclose(other, mirrored, atol=EXACT)
