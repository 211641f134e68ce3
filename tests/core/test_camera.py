"""The pinhole: pixels to rays and back, windows that are crops."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.camera import Camera
from tests import shapes

F64 = 1e-9  # px or world units of size 1
POINTS = np.random.default_rng(0).normal(size=(50, 3)) * [1, 1, 0.3] + [0, 0, 4]


def test_projecting_takes_back_unprojecting():
    camera = shapes.camera()
    xy = camera.project(POINTS)
    assert np.abs(camera.unproject(xy, POINTS[:, 2]) - POINTS).max() < F64


def test_unprojecting_takes_any_shape():
    camera = shapes.camera()
    assert camera.unproject(np.array([10.0, 20.0]), 2.0).shape == (3,)
    assert camera.unproject(np.zeros((4, 5, 2)), np.ones((4, 5))).shape == (4, 5, 3)


def test_the_axis_is_seen_in_the_middle_of_the_picture():
    assert np.allclose(shapes.camera(160, 120).project(np.array([0.0, 0, 7])), [80, 60])


def test_right_is_right_and_down_is_down():
    x, y = shapes.camera(160, 120).project(np.array([1.0, 2.0, 7.0]))
    assert x > 80
    assert y > 60


@pytest.mark.parametrize("fov", [10.0, 50.0, 120.0])
def test_the_field_of_view_spans_the_width(fov):
    camera = Camera.from_fov(640, 480, fov)
    left = camera.unproject(np.array([0.0, 240.0]), 1.0)
    assert np.degrees(np.arctan(-left[0])) == pytest.approx(fov / 2, abs=F64)


def test_a_50_mm_lens_on_a_full_frame_photo_spans_40_degrees():
    camera = Camera.from_focal_35mm(3600, 2400, 50.0)
    assert np.degrees(2 * np.arctan(1800 / camera.focal)) == pytest.approx(39.6, abs=0.1)


@pytest.mark.parametrize("fov", [0.0, -5.0, 179.0, float("nan")])
def test_an_impossible_field_of_view_is_refused(fov):
    with pytest.raises(ValueError, match="not between 1 and 170"):
        Camera.from_fov(100, 100, fov)


@pytest.mark.parametrize("zoom", [0.5, 1.0, 3.0])
def test_a_window_is_a_magnified_crop(zoom):
    camera = shapes.camera()
    window = camera.windowed(31.0, -12.5, 77, 55, zoom)
    expected = (camera.project(POINTS) - [31.0, -12.5]) * zoom
    assert np.abs(window.project(POINTS) - expected).max() < 1e-8
    assert (window.width, window.height) == (77, 55)


def test_a_window_of_a_window_is_a_window():
    camera = shapes.camera()
    twice = camera.windowed(10, 20, 60, 50, 2.0).windowed(8, 6, 30, 20, 1.5)
    assert twice.project(POINTS) == pytest.approx(
        camera.windowed(14, 23, 30, 20, 3.0).project(POINTS)
    )
