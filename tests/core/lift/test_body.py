"""The body: two sheets about a middle one, which stands as the object does."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import LiftSettings
from objectmorpher_core.lift.relief.body import BACK, FRONT, MIDDLE, ReliefBody
from objectmorpher_core.lift.relief.mirror import MirrorAxis
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from tests import shapes
from tests.core.lift.standing_things import Box, View, cylinder
from tests.tree import over

EXACT = 1e-9
CAMERA = Camera.from_fov(640, 480)
masks = pytest.mark.parametrize("name", shapes.MASKS)


def _body(name: str, **settings) -> ReliefBody:
    outline = ReliefSilhouette.of(shapes.mask(name))
    return ReliefBody.of(outline, shapes.camera(), LiftSettings(**settings))


def _inside(body: ReliefBody) -> F64:
    rows, columns = np.nonzero(body.silhouette.inside)
    return body.silhouette.photo_xy(np.column_stack([columns, rows]).astype(np.float64))


def _heights(body: ReliefBody, xy: F64) -> tuple[F64, F64, F64]:
    return tuple(body.sample(xy, side)[0] for side in (FRONT, BACK, MIDDLE))  # type: ignore


@masks
def test_the_front_is_before_the_back_and_the_middle_between(name):
    body = _body(name)
    front, back, middle = _heights(body, _inside(body))
    assert (front >= middle).all()
    assert (middle >= back).all()
    assert (front > back).mean() > 0.95


@masks
def test_any_share_of_the_thickness_lies_in_proportion(name):
    body = _body(name)
    xy = _inside(body)
    front, back, middle = _heights(body, xy)
    share = np.random.default_rng(0).uniform(-1, 1, len(xy))
    height, _ = body.sample(xy, share)
    expected = middle + np.where(share > 0, share * (front - middle), -share * (back - middle))
    assert np.abs(height - expected).max() < EXACT * body.silhouette.extent


@masks
@over("thickness", [0.3, 1.8])
def test_the_thickness_is_what_the_user_says(name, thickness):
    one, other = _body(name), _body(name, thickness=thickness)
    xy = _inside(one)
    gaps = [np.subtract(*_heights(body, xy)[:2]) for body in (one, other)]
    assert np.abs(gaps[1] - thickness * gaps[0]).max() < 1e-2
    assert np.abs(one.middle - other.middle).max() < EXACT, "the middle sheet stays"


@masks
def test_an_object_that_need_not_stand_is_not_tilted(name):
    body = _body(name, is_standing=False)
    assert not body.middle.any()
    front, back, _ = _heights(body, _inside(body))
    assert np.abs(front + back).max() < EXACT


@pytest.mark.parametrize("points", [Box(2.36, angle=30.0).points, cylinder(2.36)])
def test_a_prism_has_a_front_and_the_same_front_behind(points):
    """Turned half around: a box has four sides, a cylinder is as round behind."""
    view = View(CAMERA, 15.0)
    outline = ReliefSilhouette.of(view.hull(points))
    body = ReliefBody.of(outline, CAMERA, LiftSettings(horizon=view.horizon))
    assert body.standing.prism is not None
    row = outline.shape[0] // 2
    columns = np.flatnonzero(outline.inside[row])[6:-6]
    xy = outline.photo_xy(np.column_stack([columns, np.full(len(columns), row)]).astype(float))
    front, back, middle = _heights(body, xy)
    before, behind = front - middle, (middle - back)[::-1]
    assert before.max() > 0.15 * outline.extent
    assert np.abs(before - behind).max() < 0.15 * before.max()  # perspective


def test_something_beside_a_prism_is_round_again():
    view = View(CAMERA, 14.0)
    mask = view.hull(cylinder(view.ahead, 0.2))
    rows, columns = np.nonzero(mask)
    y, x = np.mgrid[:480, :640] - np.array([rows.mean(), columns.max()])[:, None, None]
    ring = (np.abs(np.hypot(x, 0.8 * y) - 30) < 6) & (x > -2)
    outline = ReliefSilhouette.of(mask | ring)
    body = ReliefBody.of(outline, CAMERA, LiftSettings(horizon=view.horizon))
    assert body.standing.prism is not None
    at = np.array([[columns.max() + 30.5, rows.mean()]])
    front, back, _ = _heights(body, at)
    assert 3 < (front - back)[0] < 18  # px, of a handle 12 wide


def test_a_body_that_looks_the_same_left_and_right_is_as_thick_on_both_sides():
    """Though one arm of it is wider in the picture."""
    mask = np.zeros((200, 200), bool)
    mask[40:180, 80:120] = True
    mask[60:76, 30:80] = mask[60:84, 120:170] = True
    outline = ReliefSilhouette.of(mask)
    axis = MirrorAxis((1.0, 0.0), 100.0, 1.0, 1.0)
    camera = Camera.from_fov(200, 200)
    xy = np.array([[45.0, 68.0], [155.0, 68.0]])
    gaps = []
    for told in (None, axis):
        body = ReliefBody.of(outline, camera, LiftSettings(is_standing=False), told)
        gaps.append(body.sample(xy, FRONT)[0] - body.sample(xy, BACK)[0])
    assert gaps[0][1] - gaps[0][0] > 3
    assert abs(gaps[1][1] - gaps[1][0]) < 0.5 * (gaps[0][1] - gaps[0][0])


def test_nearer_moves_all_sheets_alike():
    body = _body("star")
    lift = np.random.default_rng(0).normal(size=body.silhouette.shape)
    xy = _inside(body)
    near = body.nearer(lift)
    moved = [a - b for a, b in zip(_heights(near, xy), _heights(body, xy), strict=True)]
    assert np.abs(moved[0] - moved[2]).max() < EXACT * 100
    assert np.abs(moved[1] - moved[2]).max() < EXACT * 100


def test_the_sheet_goes_on_beyond_the_grid():
    body = _body("star")
    slope = body.sample(np.array([[200.0, 60.0]]), MIDDLE)[1][0]
    a, b = body.sample(np.array([[200.0, 60.0], [230.0, 70.0]]), MIDDLE)[0]
    assert b - a == pytest.approx(slope @ [30, 10], abs=1.5)
