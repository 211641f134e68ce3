"""The camera from the places of points, against cameras that are known."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.trellis.camera import pose_in, view
from tests import shapes

INTRINSIC = np.array([[1.4, 0, 0.52], [0, 1.35, 0.47], [0, 0, 1]])
CAMERA = Camera.from_fov(400, 300, 45)


def seen(seed, intrinsic=INTRINSIC):
    """Points in a cube, a pose of the camera before it, and where it sees them."""
    points = np.random.default_rng(seed).uniform(-0.5, 0.5, (500, 3))
    turn, shift = shapes.rotation(seed), np.array([0.1, -0.05, 2.2])
    xyw = (points @ turn.T + shift) @ intrinsic.T
    return points, turn, shift, xyw[:, :2] / xyw[:, 2:]


@pytest.mark.parametrize("seed", range(5))
def test_a_camera_is_found_again(seed):
    points, turn, shift, uv = seen(seed)
    found = view(points, uv)
    assert np.allclose(found.intrinsic, INTRINSIC, atol=1e-7)
    assert np.allclose(found.camera_from_object, np.column_stack([turn, shift]), atol=1e-7)
    assert np.allclose(found.project(points), uv, atol=1e-9)


def test_noise_turns_it_little():
    points, turn, _, uv = seen(3)
    found = view(points, uv + np.random.default_rng(0).normal(0, 0.003, uv.shape))
    cosine = (np.trace(found.camera_from_object[:, :3].T @ turn) - 1) / 2
    assert np.degrees(np.arccos(min(cosine, 1))) < 1.5
    assert found.intrinsic[0, 0] == pytest.approx(1.4, rel=0.03)


def test_few_or_flat_points_are_refused():
    points, _, _, uv = seen(0)
    with pytest.raises(LiftError, match="too few"):
        view(points[:5], uv[:5])
    with pytest.raises(LiftError, match="flat"):
        view(points * [1, 1, 0], uv)


def test_the_photos_own_camera_gets_the_pose():
    inner = np.array([[CAMERA.focal, 0, CAMERA.cx], [0, CAMERA.focal, CAMERA.cy], [0, 0, 1]])
    points, turn, shift, xy = seen(4, inner)
    found = pose_in(CAMERA, points, xy)
    assert found is not None
    assert np.allclose(found[:3, :3], turn, atol=1e-6) and np.allclose(
        found[:3, 3], shift, atol=1e-5
    )


def test_a_pose_that_is_none_is_told():
    assert pose_in(CAMERA, np.zeros((2, 3)), np.zeros((2, 2))) is None
