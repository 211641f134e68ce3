"""A point that is moved along a line in space, led by a place of the picture."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.camera import Camera

LEAST_SLANT = 0.3  # of a line's length that its picture shows; less, and the point would run off
UP = np.array([0.0, -1.0])  # px


def along_line(
    camera: Camera, point: np.ndarray, direction: np.ndarray, delta: np.ndarray
) -> float:
    """How far along a line a point goes when its picture is led by `delta` (2,) px.

    The line goes through `point` (3,) world, along the unit `direction` (3,). The point's picture
    goes where the led place is nearest to the line's picture. Of a line that points nearly at the
    camera the picture is too short for that: there, up is outwards, towards the camera.
    """
    focal, depth = camera.focal, float(point[2])
    start = camera.project(point)
    ray = (start - (camera.cx, camera.cy)) / focal
    rate = (direction[:2] - direction[2] * ray) * focal / depth  # px per unit of the line
    length = float(np.linalg.norm(rate))
    usual = focal / depth
    if length < LEAST_SLANT * usual:
        towards = -np.sign(direction[2]) or 1.0
        return float(delta @ UP) * towards / usual
    along = rate / length
    gone = float(delta @ along)
    at = float((start - (camera.cx, camera.cy)) @ along) + gone
    steepness = focal * float(direction[:2] @ along) - at * float(direction[2])
    if steepness * length <= 0:  # past the line's vanishing point
        return gone / length
    return gone * depth / steepness
