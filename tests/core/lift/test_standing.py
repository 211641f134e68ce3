"""How an object stands: its turn follows from where it touches the ground."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64, Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.lift.relief.standing import (
    FLAT,
    LEAST_DEPTH,
    TRUST,
    GroundPlane,
    StandingSheet,
    stand,
)
from tests.core.lift.standing_things import View, figure

EXACT = 1e-9
CAMERA = Camera.from_fov(640, 480)


def _table(view: View, turn: float, span: float = 0.7) -> Mask:
    """A round body on two legs whose feet are on the line forward = 3 + turn across."""
    mask = np.zeros((480, 640), np.uint8)
    feet = []
    for across in (-span / 2, span / 2):
        foot = np.array([[across, 1.0, 3.0 + turn * across], [across, 0.4, 3.0 + turn * across]])
        low, high = view.project(foot)
        feet.append((low, high))
        ends = [tuple(int(v) for v in np.rint(p)) for p in (low, high)]
        cv2.line(mask, ends[0], ends[1], 1, 22)
        mask[int(round(low[1])) :, int(low[0]) - 14 : int(low[0]) + 15] = 0  # flat soles
    middle = np.mean([high for _, high in feet], axis=0)
    cv2.ellipse(mask, (int(middle[0]), int(middle[1] - 15)), (130, 60), 0, 0, 360, 1, -1)
    return mask > 0


def _tilt(standing: StandingSheet) -> float:
    """Forward per across of the middle sheet."""
    return float(-standing.plane[0] * CAMERA.focal / _level(standing))


def _level(standing: StandingSheet) -> float:
    """The plane's value on the camera's axis."""
    return float(standing.plane @ [CAMERA.cx, CAMERA.cy, 1.0])


@pytest.mark.parametrize("pitch", [10.0, 18.0])
@pytest.mark.parametrize("turn", [-0.6, -0.3, 0.3, 0.6])
def test_feet_on_a_slanted_line_give_its_slant(pitch, turn):
    view = View(CAMERA, pitch)
    standing = stand(ReliefSilhouette.of(_table(view, turn)), CAMERA, view.horizon)
    assert standing.is_known
    assert standing.prism is None
    assert _tilt(standing) == pytest.approx(TRUST * turn, abs=0.12)


def test_level_feet_give_no_turn():
    view = View(CAMERA, 15.0)
    standing = stand(ReliefSilhouette.of(_table(view, 0.0)), CAMERA, view.horizon)
    assert standing.is_known
    assert abs(_tilt(standing)) < 0.05


@pytest.mark.parametrize("turn", [-0.5, 0.5])
def test_the_mirror_image_is_turned_the_other_way(turn):
    mask = _table(View(CAMERA, 15.0), turn)
    here, there = (stand(ReliefSilhouette.of(m), CAMERA, None) for m in (mask, mask[:, ::-1]))
    assert np.sign(_tilt(here)) == np.sign(turn)
    assert _tilt(there) == pytest.approx(-_tilt(here), abs=0.03)


def test_without_a_horizon_the_sense_of_the_turn_is_right_all_the_same():
    for turn in (-0.5, 0.5):
        standing = stand(ReliefSilhouette.of(_table(View(CAMERA, 15.0), turn)), CAMERA, None)
        assert np.sign(_tilt(standing)) == np.sign(turn)
        assert abs(_tilt(standing)) < 2 * abs(turn)


def test_a_ball_is_not_turned():
    """It touches the ground in one place, which says nothing."""
    y, x = np.mgrid[:480, :640]
    standing = stand(ReliefSilhouette.of(np.hypot(x - 300, y - 280) < 120), CAMERA, None)
    assert abs(_tilt(standing)) < 0.02


def test_a_person_who_faces_the_camera_is_not_turned():
    camera = Camera.from_fov(400, 400)
    standing = stand(ReliefSilhouette.of(figure()), camera, None)
    assert abs(standing.plane[0]) * camera.focal < 0.05


def test_nothing_stands_when_its_foot_is_cut_off_by_the_frame():
    mask = _table(View(CAMERA, 15.0), 0.5)
    foot = int(np.flatnonzero(mask.any(1))[-1])
    cut = mask.copy()
    cut = np.roll(cut, 480 - foot + 30, axis=0)
    cut[: 480 - foot + 30] = False
    assert cut[-1].any()
    assert stand(ReliefSilhouette.of(cut), CAMERA, None) is FLAT


def test_nothing_stands_above_the_horizon():
    mask = np.roll(_table(View(CAMERA, 15.0), 0.5), -150, axis=0)
    assert stand(ReliefSilhouette.of(mask), CAMERA, 470.0) is FLAT


def test_the_sheet_is_amid_the_silhouette_and_never_behind_the_camera():
    outline = ReliefSilhouette.of(_table(View(CAMERA, 15.0), 0.6))
    standing = stand(outline, CAMERA, None)
    rows, columns = np.nonzero(outline.inside)
    middle = outline.photo_xy(np.array([[columns.mean(), rows.mean()]]))
    assert standing.inverse_depth(middle)[0] == pytest.approx(1, abs=EXACT)
    far: F64 = np.array([[-1e6, 0.0], [1e6, 0.0], [0.0, 1e6], [0.0, -1e6]])
    assert (standing.inverse_depth(far) >= LEAST_DEPTH).all()


@pytest.mark.parametrize("pitch", [0.0, 12.0, 30.0])
def test_the_plan_gives_back_the_ground(pitch):
    view = View(CAMERA, pitch)
    rng = np.random.default_rng(0)
    ground = np.column_stack([rng.uniform(-1, 1, 50), np.ones(50), rng.uniform(2, 6, 50)])
    xy = view.project(ground)
    across, forward = GroundPlane(CAMERA, view.horizon).on_ground(xy[:, 0], xy[:, 1])
    assert np.abs(np.column_stack([across, forward]) - ground[:, [0, 2]]).max() < EXACT


@pytest.mark.parametrize("pitch", [0.0, 12.0, 30.0])
def test_plumb_lines_keep_their_foot(pitch):
    view = View(CAMERA, pitch)
    plumb = np.column_stack([np.full(20, 0.7), np.linspace(-0.5, 1, 20), np.full(20, 3.0)])
    xy = view.project(plumb)
    foot = GroundPlane(CAMERA, view.horizon).foot(xy[:, 0], xy[:, 1], float(xy[-1, 1]))
    assert np.abs(foot - xy[-1, 0]).max() < EXACT * 640
