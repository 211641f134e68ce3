"""A lifted object made ready: drawing it, and picking points of it under the cursor."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from objectmorpher_core.deform.control_points import MIN_COUNT
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import Handle, Placement, Pose
from objectmorpher_core.document.settings import DeformSettings
from tests import shapes

PIXEL = 1e-3  # px
OBJECT = 1e-6  # object units
PLACEMENTS = {
    "at rest": Placement(),
    "turned": Placement(turn=(20.0, -15.0, 30.0)),
    "moved": Placement(move=(30.0, -20.0), depth=0.4, scale=1.3),
}


@pytest.fixture(scope="module")
def scene() -> shapes.Scene:
    return shapes.scene("star", 2000)


@pytest.fixture(scope="module")
def pose(scene) -> Pose:
    """One arm of the star bent."""
    right = int(scene.lifted.control_points[:, 0].argmax())
    left = int(scene.lifted.control_points[:, 0].argmin())
    handles = (
        shapes.handle(scene.lifted, left, np.zeros(3)),
        shapes.handle(scene.lifted, right, np.array([-0.05, 0.25, -0.1])),
    )
    return scene.puppet.deformer.solve(handles).pose


def _pick(scene, xy, pose, placement):
    return scene.puppet.pick(xy, pose, placement, scene.texture)


@pytest.mark.parametrize("placement", PLACEMENTS)
@pytest.mark.parametrize("is_posed", [False, True])
def test_the_picked_point_is_seen_where_it_was_picked(scene, pose, placement, is_posed):
    """On a deformed object, too: the skinning is inverted."""
    place, used = PLACEMENTS[placement], pose if is_posed else None
    picture = scene.puppet.draw(used, place, scene.texture, scene.camera)
    rows, columns = np.nonzero(picture.alpha > 0.99)
    chosen = np.random.default_rng(0).choice(len(rows), 15, replace=False)
    for row, column in zip(rows[chosen], columns[chosen], strict=True):
        xy = (column + 0.3, row + 0.6)
        picked = _pick(scene, xy, used, place)
        assert np.abs(scene.puppet.picture_of(picked.rest, used, place) - xy).max() < PIXEL
        again = scene.puppet.world_point(picked.rest, used, place)
        assert np.abs(again - picked.world).max() < OBJECT


def test_a_picked_point_lies_on_the_rest_surface(scene):
    picked = _pick(scene, (80.5, 60.5), None, Placement())
    gaps = np.linalg.norm(scene.lifted.gaussians.means - picked.rest, axis=1)
    assert gaps.min() < 1.5 * scene.lifted.spacing


def test_beside_the_object_nothing_is_picked(scene):
    assert _pick(scene, (3.0, 3.0), None, Placement()) is None
    assert _pick(scene, (-40.0, 900.0), None, Placement()) is None


def test_a_pick_that_depth_agrees_with_the_picture(scene):
    picture = scene.puppet.draw(None, Placement(), scene.texture, scene.camera)
    picked = _pick(scene, (80.5, 60.5), None, Placement())
    assert picked.depth == pytest.approx(float(picture.depth[60, 80]), abs=1e-5)


@pytest.mark.parametrize("placement", PLACEMENTS)
def test_taking_a_placement_back_is_its_inverse(scene, placement):
    point = scene.lifted.gaussians.means[11].astype(np.float64)
    world = scene.puppet.world_point(point, None, PLACEMENTS[placement])
    assert np.abs(scene.puppet.unplaced(world, PLACEMENTS[placement]) - point).max() < OBJECT


def test_a_handle_reaches_its_target_on_the_picture(scene):
    picked = _pick(scene, (110.5, 60.5), None, Placement())
    target_px = np.array([104.0, 40.0])
    target = scene.lifted.object_points(scene.camera.unproject(target_px, picked.depth))
    node = scene.puppet.deformer.nearest_control_point(picked.rest)
    solution = scene.puppet.deformer.solve((Handle(node, picked.rest, target),))
    seen = scene.puppet.picture_of(picked.rest, solution.pose, Placement())
    assert np.abs(seen - target_px).max() < PIXEL


def test_the_rest_pose_draws_the_rest(scene):
    rest = scene.puppet.deformer.rest()
    one = scene.puppet.draw(None, Placement(), scene.texture, scene.camera)
    two = scene.puppet.draw(rest, Placement(), scene.texture, scene.camera)
    # a stray pixel of the edge may fall to the other side of a layer's limit
    assert (np.abs(one.alpha - two.alpha) > 2 / 255).sum() <= 4


def test_exported_gaussians_are_the_bodys_where_they_are_drawn(scene, pose):
    place = PLACEMENTS["turned"]
    gaussians = scene.puppet.posed_gaussians(pose, place)
    body = scene.lifted.texture.solidity > 0.5
    splats = scene.puppet.posed(pose, place)
    assert len(gaussians) == body.sum()
    assert np.abs(gaussians.means - splats.means[body]).max() < 1e-5
    expected = splats.linear @ splats.rest.covariances @ splats.linear.transpose(0, 2, 1)
    assert np.abs(gaussians.covariances() - expected[body]).max() < 1e-6


def test_the_graph_is_made_only_when_it_is_needed():
    fresh = shapes.lifted_scene(
        shapes.picture(shapes.mask("disc")), shapes.mask("disc"), 200
    ).puppet
    fresh.posed(None, Placement(turn=(10.0, 0.0, 0.0)))
    assert vars(fresh)["_deformer"] is None
    assert len(fresh.deformer.points) >= MIN_COUNT
    assert vars(fresh)["_deformer"] is fresh.deformer


def _pulled(scene: shapes.Scene) -> Pose:
    """Two arms of the star pulled far apart."""
    points = scene.lifted.control_points
    left, right = int(points[:, 0].argmin()), int(points[:, 0].argmax())
    far = 0.6 * scene.lifted.diameter
    handles = (
        shapes.handle(scene.lifted, left, np.array([-far, 0, 0])),
        shapes.handle(scene.lifted, right, np.array([far, 0, 0])),
    )
    return scene.puppet.deformer.solve(handles).pose


def test_stretched_gaussians_split_and_show_the_same_object(scene):
    pose, place = _pulled(scene), Placement(scale=0.6)
    splitting = Puppet(scene.lifted, DeformSettings(is_splitting=True), scene.camera)
    whole, pieces = scene.puppet.posed(pose, place), splitting.posed(pose, place)
    assert len(pieces) > 1.1 * len(whole)
    stretches = [np.linalg.svd(s.linear, compute_uv=False)[:, 0] for s in (whole, pieces)]
    assert stretches[0].max() > 2
    pictures = [p.draw(pose, place, scene.texture, scene.camera) for p in (scene.puppet, splitting)]
    inside = cv2.erode((pictures[0].alpha > 0.99).astype(np.uint8), np.ones((5, 5))) > 0
    assert pictures[1].alpha[inside].min() > 0.98, "no gap"
    gap = np.abs(pictures[0].color - pictures[1].color)[inside]
    assert gap.mean() < 1 / 255


def test_nothing_splits_where_nothing_is_stretched(scene, pose):
    rest = Pose(scene.lifted.control_points, np.tile(np.eye(3), (len(pose.points), 1, 1)))
    splitting = Puppet(scene.lifted, DeformSettings(is_splitting=True), scene.camera)
    assert len(splitting.posed(rest, Placement())) == len(scene.lifted.gaussians)
