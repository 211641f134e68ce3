"""Quaternions, matrices, and the signs of `--turn`."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.rotations import (
    CAMERA_GIMBAL,
    Gimbal,
    matrices_from_quats,
    matrix_from_vector,
    quats_from_matrices,
    turn_about,
    turn_matrix,
    turn_of,
    turned_by,
    vector_from_matrix,
)
from tests import shapes

F64 = 1e-12  # a handful of products of numbers below 1
QUATS = np.random.default_rng(0).normal(size=(500, 4))
HALF_TURNS = np.array(
    [[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 1, 1, 0], [1e-9, 0.6, 0, 0.8]], float
)


def test_matrices_are_rotations():
    matrices = matrices_from_quats(QUATS)
    assert np.abs(matrices @ matrices.transpose(0, 2, 1) - np.eye(3)).max() < F64
    assert np.abs(np.linalg.det(matrices) - 1).max() < F64


@pytest.mark.parametrize("quats", [QUATS, HALF_TURNS], ids=["random", "half turns"])
def test_a_rotation_survives_the_way_through_its_quaternion(quats):
    matrices = matrices_from_quats(quats)
    assert np.abs(matrices_from_quats(quats_from_matrices(matrices)) - matrices).max() < F64


def test_quaternions_come_out_unit_with_a_positive_real_part():
    quats = quats_from_matrices(matrices_from_quats(QUATS))
    assert np.abs(np.linalg.norm(quats, axis=1) - 1).max() < F64
    assert quats[:, 0].min() >= 0


def test_a_quaternion_and_its_opposite_are_one_rotation():
    assert np.array_equal(matrices_from_quats(QUATS), matrices_from_quats(-QUATS))


def test_products_of_matrices_are_products_of_rotations():
    a, b = shapes.rotation(1), shapes.rotation(2)
    quats = quats_from_matrices(np.stack([a, b, a @ b]))
    wa, va, wb, vb = quats[0, 0], quats[0, 1:], quats[1, 0], quats[1, 1:]
    product = np.concatenate([[wa * wb - va @ vb], wa * vb + wb * va + np.cross(va, vb)])
    assert min(np.abs(product - quats[2]).max(), np.abs(product + quats[2]).max()) < F64


# x right, y down, z away; what faces the camera points along -z
@pytest.mark.parametrize(("turn", "before", "after"), [
    ((90, 0, 0), (0, 0, -1), (-1, 0, 0)),  # yaw: what faces the camera goes to the left
    ((0, 90, 0), (0, 0, -1), (0, 1, 0)),  # pitch: it goes down
    ((0, 0, 90), (1, 0, 0), (0, 1, 0)),  # roll: clockwise in the picture
])  # fmt: skip
def test_turns_are_right_handed_about_the_camera_axes(turn, before, after):
    assert np.abs(turn_matrix(*turn) @ before - np.array(after)).max() < F64


def test_yaw_comes_first_then_pitch_then_roll():
    whole = turn_matrix(30, 40, 50)
    steps = turn_matrix(0, 0, 50) @ turn_matrix(0, 40, 0) @ turn_matrix(30, 0, 0)
    assert np.abs(whole - steps).max() < F64


def test_no_turn_is_exactly_nothing():
    assert np.array_equal(turn_matrix(0, 0, 0), np.eye(3))


@pytest.mark.parametrize("angle", [0.0, 1e-7, 1.0, 3.0, np.pi, 5.0, 20.0])
def test_a_rotation_vector_is_found_again_near_itself(angle):
    for axis in np.random.default_rng(1).normal(size=(20, 3)):
        vector = angle * axis / np.linalg.norm(axis)
        found = vector_from_matrix(matrix_from_vector(vector), vector)
        np.testing.assert_allclose(found, vector, atol=1e-7)
        short = vector_from_matrix(matrix_from_vector(vector))
        assert np.linalg.norm(short) <= np.pi + 1e-9
        matrices = matrix_from_vector(short), matrix_from_vector(vector)
        np.testing.assert_allclose(*matrices, atol=1e-7)


def test_turning_on_about_an_axis_adds_to_the_turn_about_it():
    axis = np.array([0.0, 0.0, 1.0])
    for start in np.random.default_rng(2).normal(size=(20, 3)):
        before = turn_about(start, axis)
        after = turned_by(start, 0.3 * axis)
        gap = turn_about(after, axis) - before - 0.3
        assert abs(gap - 2 * np.pi * round(gap / (2 * np.pi))) < 1e-9
        to = turned_by(start, (np.radians(-12) - before) * axis)
        assert np.degrees(turn_about(to, axis)) == pytest.approx(-12)  # and not 348
        matrices = matrix_from_vector(after), matrix_from_vector(0.3 * axis)
        np.testing.assert_allclose(matrices[0], matrices[1] @ matrix_from_vector(start), atol=1e-9)


def test_many_small_turns_add_up_to_more_than_a_whole_one():
    vector = np.zeros(3)
    for _ in range(100):
        vector = turned_by(vector, np.array([0.0, 0.0, 0.1]))
    np.testing.assert_allclose(vector, [0, 0, 10.0], atol=1e-9)


def test_a_gimbal_finds_the_angles_of_every_rotation():
    rng = np.random.default_rng(3)
    for down, vector in rng.normal(size=(200, 2, 3)):
        gimbal, matrix = Gimbal.about(down), matrix_from_vector(2 * vector)
        np.testing.assert_allclose(gimbal.matrix(*gimbal.angles(matrix)), matrix, atol=1e-9)
        turn = turn_of(matrix)
        np.testing.assert_allclose(gimbal.turn(gimbal.of(turn)), turn, atol=1e-6)


def test_yaw_alone_leaves_a_thing_standing_and_comes_back_as_it_was_put():
    """The inverse finds few degrees of pitch and roll as they are, about any upright."""
    rng = np.random.default_rng(4)
    for down in [[0, 0, 1.0], [0, 1.0, 0], *rng.normal(size=(50, 3))]:
        gimbal = Gimbal.about(np.array(down))
        yaw, pitch, roll = rng.uniform(-179, 179), *rng.uniform(-20, 20, 2)
        np.testing.assert_allclose(gimbal.matrix(yaw, 0, 0) @ gimbal.down, gimbal.down, atol=1e-9)
        if abs(gimbal.down[2]) < 0.99:  # seen from right above, yaw and roll are the same
            found = gimbal.angles(gimbal.matrix(yaw, pitch, roll))
            np.testing.assert_allclose(found, [yaw, pitch, roll], atol=1e-6)


def test_the_camera_s_gimbal_turns_as_the_command_line_does():
    for turn in np.random.default_rng(5).uniform(-80, 80, (50, 3)):
        np.testing.assert_allclose(CAMERA_GIMBAL.matrix(*turn), turn_matrix(*turn), atol=1e-12)
        np.testing.assert_allclose(CAMERA_GIMBAL.angles(turn_matrix(*turn)), turn, atol=1e-9)
