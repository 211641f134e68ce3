"""The relief: a closed body over a silhouette, registered to the photo."""

from __future__ import annotations

from dataclasses import fields

import cv2
import numpy as np
import pytest
from scipy.spatial import cKDTree

from objectmorpher_core.camera import Camera
from objectmorpher_core.document import LiftedObject
from objectmorpher_core.gaussians import Gaussians
from objectmorpher_core.lift import BACKENDS, LiftError, load
from objectmorpher_core.lift.relief import Inflation
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.progress import Cancelled
from objectmorpher_core.segment.matte import signed_distance
from tests import shapes

PIXEL = 1e-3  # px: u0 and means are float32

masks = pytest.mark.parametrize("name", shapes.MASKS)


def _lift(inside: np.ndarray, count: int = 800, seed: int = 0) -> LiftedObject:
    height, width = inside.shape
    camera = Camera.from_fov(width, height)
    return lift_mask(shapes.picture(inside), camera, inside, "relief", count, seed=seed)[1]


def _heights(scene: shapes.Scene) -> np.ndarray:
    """(N,) px above the middle plane, positive towards the camera."""
    world = scene.lifted.world_points(scene.lifted.gaussians.means.astype(np.float64))
    brim = scene.lifted.texture.solidity < 0.5
    depth = np.median(world[brim, 2])  # the brim lies in the middle plane
    return (depth - world[:, 2]) * scene.camera.focal / depth


@masks
def test_every_gaussian_is_seen_in_the_photo_where_its_texture_says(name):
    scene = shapes.scene(name)
    world = scene.lifted.world_points(scene.lifted.gaussians.means.astype(np.float64))
    assert np.abs(scene.camera.project(world) - scene.lifted.texture.u0).max() < PIXEL


@masks
def test_the_object_frame_is_centred_and_one_unit_large(name):
    lifted = shapes.scene(name).lifted
    low, high = lifted.gaussians.means.min(0), lifted.gaussians.means.max(0)
    assert np.abs(low + high).max() < 1e-5
    assert (high - low).max() == pytest.approx(1, abs=1e-5)
    linear = lifted.world_from_object[:3, :3]
    assert np.abs(linear - lifted.scale * np.eye(3)).max() < 1e-9, "a similarity without turn"


@masks
def test_it_has_a_front_a_back_and_a_brim(name):
    scene = shapes.scene(name)
    texture = scene.lifted.texture
    body = texture.solidity > 0.5
    front, back = body & (texture.visibility > 0.5), body & (texture.visibility < 0.5)
    assert front.sum() > 0.25 * body.sum()
    assert back.sum() > 0.25 * body.sum()
    assert (~body).any()
    outside = cv2.distanceTransform((~scene.mask).astype(np.uint8), cv2.DIST_L2, 5)
    column, row = np.floor(texture.u0[~body]).astype(int).T
    is_in = (column >= 0) & (column < 160) & (row >= 0) & (row < 120)
    assert (outside[row[is_in], column[is_in]] >= 0.5).mean() > 0.9, "the brim is around it"


@masks
def test_the_front_faces_the_camera_and_the_back_does_not(name):
    scene = shapes.scene(name)
    lifted, texture = scene.lifted, scene.lifted.texture
    world = lifted.world_points(lifted.gaussians.means.astype(np.float64))
    cosine = -(lifted.gaussians.normals * world).sum(1) / np.linalg.norm(world, axis=1)
    body = texture.solidity > 0.5
    rounding = 1e-3  # a front that is seen just edge-on, through a float32 quaternion
    assert cosine[body & (texture.visibility > 0.5)].min() > -rounding
    assert cosine[body & (texture.visibility < 0.5)].max() < 0.2  # perspective sees round the rim


@masks
def test_front_and_back_are_mirror_images_about_the_middle_plane(name):
    scene = shapes.scene(name, 2000)
    height = _heights(scene)
    body = scene.lifted.texture.solidity > 0.5
    front, back = height[body & (height > 0)], -height[body & (height < 0)]
    assert np.quantile(front, 0.9) == pytest.approx(np.quantile(back, 0.9), rel=0.15)


@masks
def test_there_are_no_spikes_at_the_rim(name):
    """Nowhere is the body thicker than the silhouette's width there allows."""
    scene = shapes.scene(name, 3000)
    height, u0 = np.abs(_heights(scene)), scene.lifted.texture.u0
    column, row = np.floor(u0).astype(int).T
    is_in = (column >= 0) & (column < 160) & (row >= 0) & (row < 120)
    distance = signed_distance(scene.mask)  # px to the edge; the frame is no edge
    near = is_in.copy()
    near[is_in] = distance[row[is_in], column[is_in]] < 4
    widest = signed_distance(scene.mask).max()
    # a surface of slope 3 at most near the edge, one grid cell of slack
    assert (height[near] <= 3 * (np.maximum(distance[row[near], column[near]], 0) + 1.5)).all()
    assert height.max() <= 1.6 * widest + 1


def _middle_height(inside: np.ndarray) -> float:
    shape = Inflation.of(inside)
    rows, columns = np.nonzero(inside)
    middle = np.array([[columns.mean() + 0.5, rows.mean() + 0.5]])
    return float(shape.sample(middle)[0][0])


def test_a_strip_becomes_a_limb_about_as_thick_as_wide():
    """Width 2 r: sqrt(2 u) is r in the middle; the crease at the rim takes up to a third."""
    inside = np.zeros((120, 400), bool)
    inside[50:70, 20:380] = True
    assert 0.65 * 10 <= _middle_height(inside) <= 1.05 * 10


def test_a_disc_becomes_a_body_half_as_deep_as_wide():
    """Radius R: sqrt(2 u) is 0.707 R in the middle; crease and flattening take up to a third."""
    y, x = np.mgrid[:220, :220] - 109.5
    assert 0.65 * 0.707 * 80 <= _middle_height(np.hypot(x, y) < 80) <= 1.05 * 0.707 * 80


def test_a_wide_limb_is_thicker_than_a_narrow_one():
    heights = []
    for half in (5, 10, 20):
        inside = np.zeros((120, 600), bool)
        inside[60 - half : 60 + half, 20:580] = True
        heights.append(_middle_height(inside))
    assert heights[0] * 1.6 < heights[1]
    assert heights[1] * 1.6 < heights[2]


def test_the_same_object_at_twice_the_resolution_has_the_same_shape():
    small, large = shapes.mask("star"), shapes.mask("star", 320, 240)
    a, b = Inflation.of(small), Inflation.of(large)
    xy = shapes.scene("star").lifted.texture.u0.astype(np.float64)
    inside = signed_distance(small)[tuple(np.floor(xy).astype(int).T[::-1])] > 3
    one, two = a.sample(xy[inside])[0], b.sample(2 * xy[inside])[0] / 2
    assert np.abs(one - two).max() < 1.5  # px of 30: the coarser grid's staircase


def test_the_same_seed_gives_the_same_object_and_another_seed_another():
    inside = shapes.mask("ellipse")
    one, two, other = _lift(inside, seed=3), _lift(inside, seed=3), _lift(inside, seed=4)
    for name in (f.name for f in fields(Gaussians)):
        assert np.array_equal(getattr(one.gaussians, name), getattr(two.gaussians, name))
    assert np.array_equal(one.control_points, two.control_points)
    assert not np.array_equal(one.gaussians.means[:50], other.gaussians.means[:50])


@pytest.mark.parametrize("count", [300, 1000, 4000])
def test_about_as_many_gaussians_as_asked(count):
    got = (_lift(shapes.mask("disc", 640, 480), count).texture.solidity > 0.5).sum()
    assert 0.6 * count <= got <= 1.4 * count


def test_the_gaussians_are_evenly_spread():
    scene = shapes.scene("disc", 1000)
    texture, means = scene.lifted.texture, scene.lifted.gaussians.means
    front = means[(texture.visibility > 0.5) & (texture.solidity > 0.5)]
    gaps = cKDTree(front).query(front, k=2)[0][:, 1]
    assert gaps.min() > 0.5 * scene.lifted.spacing
    assert gaps.max() < 2.0 * scene.lifted.spacing


def test_control_points_lie_on_the_body_and_not_on_the_brim():
    scene = shapes.scene("ellipse")
    means, body = scene.lifted.gaussians.means, scene.lifted.texture.solidity > 0.5
    assert cKDTree(means[body]).query(scene.lifted.control_points)[0].max() < 1e-6


def test_a_hole_of_the_mask_stays_a_hole():
    scene = shapes.scene("ring", 2000)
    u0, body = scene.lifted.texture.u0, scene.lifted.texture.solidity > 0.5
    assert np.hypot(u0[body, 0] - 80, u0[body, 1] - 60).min() > 18


def test_parts_of_the_mask_become_parts_of_the_object():
    scene = shapes.scene("parts", 2000)
    body = scene.lifted.texture.solidity > 0.5
    x = scene.lifted.texture.u0[body, 0]
    assert not ((x > 72) & (x < 92)).any()
    assert scene.puppet.deformer.graph.component_count == 2


def test_where_the_object_leaves_the_photo_it_does_not_close():
    """At the frame the body is as thick as a little further in."""
    shape = Inflation.of(shapes.mask("frame"))
    at_frame, inner = shape.sample(np.array([[130.0, 119.0], [130.0, 105.0]]))[0]
    assert at_frame > 0.7 * inner


def test_an_object_that_fills_one_row_less_than_the_photo_lifts():
    inside = np.ones((60, 80), bool)
    inside[0] = False
    lifted = _lift(inside, 400)
    assert np.isfinite(lifted.gaussians.means).all()


@pytest.mark.parametrize("side", [5, 7, 12])
def test_a_tiny_object_lifts(side):
    inside = np.zeros((120, 160), bool)
    inside[50 : 50 + side, 60 : 60 + side] = True
    lifted = _lift(inside, 2000)
    assert len(lifted.control_points) >= 4
    assert (lifted.gaussians.scales > 0).all()


def test_too_small_an_object_is_refused():
    inside = np.zeros((120, 160), bool)
    inside[50:54, 60:66] = True
    with pytest.raises(LiftError, match="only 24 pixels, too small to lift"):
        _lift(inside)


def test_cancelling_ends_the_lift():
    def stop(fraction: float, note: str) -> None:
        raise Cancelled

    inside = shapes.mask("disc")
    with pytest.raises(Cancelled):
        lift_mask(shapes.picture(inside), shapes.camera(), inside, "relief", 300, stop)


def test_progress_runs_from_nothing_towards_one():
    told: list[float] = []
    inside = shapes.mask("disc")
    lift_mask(
        shapes.picture(inside), shapes.camera(), inside, "relief", 300,
        lambda fraction, note: told.append(fraction),
    )  # fmt: skip
    assert told == sorted(told)
    assert told[0] >= 0
    assert told[-1] <= 1


def test_an_unknown_lifter_is_refused_by_name():
    with pytest.raises(LiftError, match="'magic' is not installed; installed: relief"):
        load("magic")
    assert load("auto").name in BACKENDS
