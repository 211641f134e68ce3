"""Another thickness at once: as a lift of that thickness is, and there and back is nothing."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial import cKDTree

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import LiftedObject, LiftSettings, Placement
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.relief.thickness import with_thickness
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.raster import tiles
from tests import shapes
from tests.core.lift.standing_things import Box, View
from tests.tree import quick

ROUNDING = 2e-6  # of float32, object units
PIXEL = 1e-3  # px: u0 and means are float32
CAMERA = shapes.camera()
names = pytest.mark.parametrize("name", ["disc", "star", "frame", "parts"])
factors = pytest.mark.parametrize("factor", [0.3, 1.8])


def _world(lifted: LiftedObject) -> np.ndarray:
    return lifted.world_points(lifted.gaussians.means.astype(np.float64))


@names
@factors
def test_there_and_back_is_the_identity(name, factor):
    lifted = shapes.scene(name).lifted
    back = with_thickness(with_thickness(lifted, CAMERA, factor), CAMERA, 1 / factor)
    assert np.abs(back.gaussians.means - lifted.gaussians.means).max() < ROUNDING * 5
    assert np.abs(back.control_points - lifted.control_points).max() < ROUNDING * 5
    assert np.abs(back.world_from_object - lifted.world_from_object).max() < 1e-5
    assert back.spacing == pytest.approx(lifted.spacing, rel=1e-5)
    covariances = back.gaussians.covariances(), lifted.gaussians.covariances()
    assert np.abs(covariances[0] - covariances[1]).max() < 1e-3 * np.abs(covariances[1]).max()


@names
def test_the_same_thickness_is_the_same_object(name):
    lifted = shapes.scene(name).lifted
    same = with_thickness(lifted, CAMERA, 1.0)
    assert np.abs(same.gaussians.means - lifted.gaussians.means).max() < ROUNDING


@names
@factors
def test_every_gaussian_stays_on_its_ray(name, factor):
    scene = shapes.scene(name)
    other = with_thickness(scene.lifted, CAMERA, factor)
    assert np.array_equal(other.texture.u0, scene.lifted.texture.u0)
    assert np.abs(CAMERA.project(_world(other)) - other.texture.u0).max() < PIXEL


@names
@factors
def test_its_distance_from_the_middle_is_so_much_larger(name, factor):
    lifted = shapes.scene(name).lifted
    other = with_thickness(lifted, CAMERA, factor)
    assert lifted.middle is not None
    middle = lifted.middle[:, 0]
    before, after = _world(lifted)[:, 2] - middle, _world(other)[:, 2] - middle
    assert np.abs(after - factor * before).max() < 1e-5


@cache
def _lifted(name: str, thickness: float) -> tuple[LiftedObject, Camera]:
    if name == "box":
        view = View(Camera.from_fov(320, 240), 15.0)
        mask, camera = view.hull(Box(view.ahead, angle=30.0).points), view.camera
    else:
        mask, camera = shapes.mask(name), CAMERA
    settings = LiftSettings(3000, thickness, trust=0)
    return lift_mask(shapes.picture(mask), camera, mask, "relief", settings)[1], camera


@pytest.mark.parametrize("name", quick(["star", "box", "disc", "ellipse"], 1))
@factors
def test_it_is_as_a_lift_of_that_thickness(name, factor):
    """The same surface, though other points of it."""
    (one, camera), (other, _) = _lifted(name, 1.0), _lifted(name, factor)
    changed = with_thickness(one, camera, factor)
    bodies = [_world(item)[item.texture.solidity > 0.5] for item in (changed, other)]
    spacing = max(item.spacing * item.scale for item in (changed, other, one))
    for a, b in (bodies, bodies[::-1]):
        gap = cKDTree(a).query(b)[0]
        # What slid apart leaves gaps as much wider as it is thicker.
        assert np.quantile(gap, 0.99) < 1.5 * max(factor, 1) * spacing
    assert changed.scale == pytest.approx(other.scale, rel=0.04)


@factors
def test_its_gaussians_lie_along_the_new_surface(factor):
    one, other = (_lifted("star", thickness)[0] for thickness in (1.0, factor))
    changed = with_thickness(one, CAMERA, factor)
    fronts = [(i.texture.visibility > 0.5) & (i.texture.solidity > 0.5) for i in (changed, other)]
    nearest = cKDTree(_world(other)[fronts[1]]).query(_world(changed)[fronts[0]])[1]
    cosine = (
        changed.gaussians.normals[fronts[0]] * other.gaussians.normals[fronts[1]][nearest]
    ).sum(1)
    assert np.quantile(np.abs(cosine), 0.05) > 0.93


@names
@factors
def test_the_object_frame_is_centred_and_one_unit_large(name, factor):
    other = with_thickness(shapes.scene(name).lifted, CAMERA, factor)
    low, high = other.gaussians.means.min(0), other.gaussians.means.max(0)
    assert np.abs(low + high).max() < 1e-5
    assert (high - low).max() == pytest.approx(1, abs=1e-5)


@factors
def test_at_rest_it_shows_the_photo_all_the_same(factor):
    scene = shapes.scene("ellipse", 1500)
    color, alpha = scene.cutout()
    other = with_thickness(scene.lifted, CAMERA, factor)
    puppet = Puppet(other, DeformSettings(), CAMERA)
    picture = tiles.render(puppet.posed(None, Placement()), scene.texture, CAMERA, CAMERA)
    inside = alpha > 0.99
    assert np.abs(np.asarray(picture.color) - color)[inside].mean() < 0.002
    assert np.abs(np.asarray(picture.alpha) - alpha).mean() < 0.004


def test_an_object_without_a_middle_has_no_thickness():
    lifted = replace(shapes.scene("disc").lifted, middle=None)
    with pytest.raises(LiftError, match="lifted from the photo"):
        with_thickness(lifted, CAMERA, 2.0)
