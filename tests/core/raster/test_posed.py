"""Posed splats: what motion does to the numbers that renderers read."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.deform.skinning import Skinned
from objectmorpher_core.document.model import Placement
from objectmorpher_core.raster.posed import PosedSplats, RestSplats, projection_jacobians
from tests import shapes

F64 = 1e-9


@pytest.fixture(scope="module")
def scene() -> shapes.Scene:
    return shapes.scene("ellipse", 400)


def test_jacobians_are_the_derivative_of_the_projection():
    camera = shapes.camera()
    points = np.random.default_rng(0).normal(size=(50, 3)) * [1, 1, 0.2] + [0, 0, 3]
    jacobians = projection_jacobians(points, camera.focal)
    step = 1e-6
    for k in range(3):
        shift = step * np.eye(3)[k]
        numeric = (camera.project(points + shift) - camera.project(points - shift)) / (2 * step)
        assert np.abs(jacobians[:, :, k] - numeric).max() < 1e-5  # rounding of px / step


def test_at_rest_nothing_has_moved(scene):
    splats = scene.puppet.posed(None, Placement())
    world = scene.lifted.world_points(scene.lifted.gaussians.means.astype(np.float64))
    assert np.abs(splats.means - world).max() < F64
    assert np.abs(splats.linear - np.eye(3)).max() < F64


def test_the_rest_covariance_is_that_of_the_object_in_the_world(scene):
    splats = scene.puppet.posed(None, Placement())
    linear = scene.lifted.world_from_object[:3, :3]
    expected = linear @ scene.lifted.gaussians.covariances() @ linear.T
    assert np.abs(splats.rest.covariances - expected).max() < F64


def test_u0_is_where_each_gaussian_is_seen_in_the_photo(scene):
    splats = scene.puppet.posed(None, Placement())
    u0 = scene.lifted.texture.u0
    assert np.abs(scene.camera.project(splats.means) - u0).max() < 1e-4  # float32 px


def test_a_placement_moves_means_and_directions(scene):
    placement = Placement(move=(5.0, -3.0), turn=(20.0, 10.0, 5.0), scale=1.5)
    matrix = placement.matrix(scene.lifted, scene.camera)
    rest, moved = (scene.puppet.posed(None, p) for p in (Placement(), placement))
    assert np.abs(moved.means - rest.means @ matrix[:3, :3].T - matrix[:3, 3]).max() < F64
    assert np.abs(moved.linear - matrix[:3, :3]).max() < F64


def test_depths_that_are_one_surface_grow_with_the_object(scene):
    rest, large = (scene.puppet.posed(None, p) for p in (Placement(), Placement(scale=3.0)))
    assert large.gap == pytest.approx(3 * rest.gap)
    assert large.texture_gap == rest.texture_gap, "in px of the photo"
    fine = RestSplats(scene.lifted, shapes.camera(2 * shapes.WIDTH, 2 * shapes.HEIGHT))
    finer = PosedSplats(fine, None, np.eye(4))
    assert finer.texture_gap == pytest.approx(2 * rest.texture_gap), "and of a finer one, more px"


def test_what_faces_away_shows_the_colours_of_its_mirror_image_that_does_not():
    rest = shapes.random_splats(0)[0].rest
    ways = rest.lifted.world_points(rest.means)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    own, shown = ((normals * ways).sum(1) for normals in (rest.normals, rest.shown_normals))
    assert own.min() < -0.5 and own.max() > 0.5
    assert np.abs(shown + np.abs(own)).max() < F64
    across = rest.normals - own[:, None] * ways
    assert np.abs(rest.shown_normals - shown[:, None] * ways - across).max() < F64


def test_deforming_in_the_object_frame_is_deforming_in_the_world(scene):
    """F is conjugated by the registration: world from rest world."""
    lifted = scene.lifted
    means = lifted.gaussians.means.astype(np.float64)
    stretch = np.array([[1.5, 0.2, 0], [0, 0.8, 0], [0.1, 0, 1.0]])
    skinned = Skinned(means @ stretch.T, np.tile(stretch, (len(means), 1, 1)))
    splats = PosedSplats(RestSplats(lifted, scene.camera), skinned, np.eye(4))
    world = lifted.world_from_object[:3, :3]
    assert np.abs(splats.linear - world @ stretch @ np.linalg.inv(world)).max() < F64
    assert np.abs(splats.means - lifted.world_points(means @ stretch.T)).max() < F64
