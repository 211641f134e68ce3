"""Boxes and cylinders are known by their silhouettes, and give back where they stand."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import LiftSettings
from objectmorpher_core.lift.relief.body import FRONT, ReliefBody
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.lift.relief.standing import PrismSides, find_prism
from tests import shapes
from tests.core.lift.standing_things import Box, View, cylinder, figure
from tests.tree import over

DEGREE = 1.0
CAMERA = Camera.from_fov(640, 480)

pitches = pytest.mark.parametrize("pitch", [8.0, 15.0, 25.0])
angles = pytest.mark.parametrize("angle", [-40.0, -25.0, 25.0, 40.0])


def _sides(silhouette: ReliefSilhouette) -> PrismSides | None:
    x, y = silhouette.lower_outline
    return PrismSides.of(silhouette, float(x[np.argmax(y)]), float(y.max()))


@over("pitch", [15.0, 20.0, 25.0])
@angles
def test_the_sides_of_a_box_tell_the_horizon_to_a_degree(pitch, angle):
    view = View(CAMERA, pitch)
    sides = _sides(ReliefSilhouette.of(view.hull(Box(view.ahead, angle=angle).points)))
    assert sides is not None
    horizon = sides.horizon(CAMERA)
    assert horizon is not None
    told = np.degrees(np.arctan((CAMERA.cy - horizon) / CAMERA.focal))
    assert told == pytest.approx(pitch, abs=DEGREE)


def test_a_level_camera_sees_no_horizon_in_the_sides():
    view = View(CAMERA, 0.0)
    sides = _sides(ReliefSilhouette.of(view.hull(Box(4.0).points)))
    assert sides is not None
    assert sides.horizon(CAMERA) is None


@pitches
@angles
def test_a_box_gives_back_its_turn(pitch, angle):
    """That of the line between the ends of its contact, which are opposite corners."""
    view = View(CAMERA, pitch)
    box = Box(view.ahead, angle=angle)
    prism = find_prism(ReliefSilhouette.of(view.hull(box.points)), CAMERA, view.horizon)
    assert prism is not None
    assert not prism.is_round
    columns = view.project(box.points[:4])[:, 0]
    left, right = box.plan[np.argmin(columns)], box.plan[np.argmax(columns)]
    expected = np.degrees(np.arctan2(right[1] - left[1], right[0] - left[0]))
    # a row of pixels is 2 degrees of the plan of what lies so flat before the camera
    assert np.degrees(np.arctan(prism.turn)) == pytest.approx(expected, abs=4)


@pitches
@angles
def test_a_box_gives_back_the_depths_of_its_sides(pitch, angle):
    """Up to one scale: how far away it is a photo does not tell."""
    view = View(CAMERA, pitch)
    box = Box(view.ahead, angle=angle)
    mask = view.hull(box.points)
    outline = ReliefSilhouette.of(mask)
    body = ReliefBody.of(outline, CAMERA, LiftSettings(horizon=view.horizon))
    rows, columns = np.nonzero(outline.depth > 6)
    xy = outline.photo_xy(np.column_stack([columns, rows]).astype(np.float64))
    truth = box.depths(view.rays(xy))
    is_side = np.isfinite(truth)
    found = 1 - body.sample(xy, FRONT)[0] / CAMERA.focal
    assert is_side.mean() > 0.3
    ratio = (found / truth)[is_side]
    ratio /= np.median(ratio)
    size = 0.6 / np.median(truth[is_side])  # of the box, over its distance
    assert np.sqrt(((ratio - 1) ** 2).mean()) < 0.06 * size
    assert np.ptp(truth[is_side]) / np.median(truth[is_side]) > 0.4 * size, "there is depth to find"


@pitches
def test_a_cylinder_is_round(pitch):
    view = View(CAMERA, pitch)
    prism = find_prism(ReliefSilhouette.of(view.hull(cylinder(view.ahead))), CAMERA, None)
    assert prism is not None
    assert prism.is_round
    assert prism.turn == 0


@pitches
def test_a_cylinder_is_as_deep_as_it_is_wide(pitch):
    view = View(CAMERA, pitch)
    prism = find_prism(ReliefSilhouette.of(view.hull(cylinder(view.ahead))), CAMERA, view.horizon)
    assert prism is not None
    away = np.hypot(view.ahead, 0.8)  # of its middle
    assert (1 - 1 / prism.nearer).max() * away == pytest.approx(0.28, rel=0.15)


@pytest.mark.parametrize("name", ["disc", "ellipse", "star", "ring", "parts", "thin"])
def test_what_is_no_prism_is_not_taken_for_one(name):
    mask = shapes.mask(name, 640, 480)
    assert find_prism(ReliefSilhouette.of(mask), CAMERA, None) is None


def test_a_person_is_no_prism():
    mask = figure()
    camera = Camera.from_fov(400, 400)
    assert find_prism(ReliefSilhouette.of(mask), camera, None) is None


def test_a_flat_card_that_faces_the_camera_has_no_corner_to_tell_of():
    mask = np.zeros((480, 640), bool)
    mask[120:400, 200:440] = True
    assert find_prism(ReliefSilhouette.of(mask), CAMERA, None) is None


@pytest.mark.parametrize("side", [5, 9, 16])
def test_small_boxes_are_left_alone(side):
    mask = np.zeros((480, 640), bool)
    mask[300 : 300 + side, 300 : 300 + side] = True
    assert find_prism(ReliefSilhouette.of(mask), CAMERA, None) is None


def test_a_handle_on_one_side_does_not_hide_a_mug():
    view = View(CAMERA, 14.0)
    mask = view.hull(cylinder(view.ahead, 0.2))
    rows, columns = np.nonzero(mask)
    right = columns.max()
    y, x = np.mgrid[:480, :640] - np.array([rows.mean(), right])[:, None, None]
    ring = np.abs(np.hypot(x, 0.8 * y) - 30) < 6
    prism = find_prism(ReliefSilhouette.of(mask | (ring & (x > -2))), CAMERA, None)
    assert prism is not None
    assert prism.is_round


@angles
def test_the_mirror_image_of_a_box_stands_mirrored(angle):
    view = View(CAMERA, 15.0)
    mask = view.hull(Box(view.ahead, angle=angle).points)
    here, there = (find_prism(ReliefSilhouette.of(m), CAMERA, None) for m in (mask, mask[:, ::-1]))
    assert here is not None
    assert there is not None
    assert here.plan.horizon == pytest.approx(there.plan.horizon, abs=12)  # a degree
    gap = np.arctan(here.turn) + np.arctan(there.turn)
    assert abs(np.degrees(gap)) < 4
