"""A point on a line in space follows a place of the picture."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher.tools.pose_tool import along_line
from objectmorpher_core.base.camera import Camera
from tests.tree import over

CAMERA = Camera.from_fov(400, 300)
EXACT = 1e-9


@over("seed", range(20))
def test_the_point_is_seen_where_the_place_is_nearest_to_the_line(seed: int) -> None:
    random = np.random.default_rng(seed)
    point = np.array([0.5, -0.3, 4.0]) + random.uniform(-0.4, 0.4, 3)
    direction = random.normal(size=3) * [1, 1, 0.3]
    direction /= np.linalg.norm(direction)
    delta = random.uniform(-30, 30, 2)
    moved = point + along_line(CAMERA, point, direction, delta) * direction
    start, end = CAMERA.project(point), CAMERA.project(moved)
    line = CAMERA.project(point + 0.01 * direction) - start
    line /= np.linalg.norm(line)
    assert (end - start) @ line == pytest.approx(delta @ line, abs=1e-6)


@pytest.mark.parametrize("towards", [-1.0, 1.0])
def test_of_a_line_towards_the_camera_up_is_outwards(towards: float) -> None:
    point, direction = np.array([0.0, 0.0, 4.0]), np.array([0.0, 0.0, towards])
    gone = along_line(CAMERA, point, direction, np.array([3.0, -20.0])) * direction
    assert gone[2] == pytest.approx(-20 * 4.0 / CAMERA.focal)
