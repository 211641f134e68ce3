"""Invented sides: as fine as what the photo shows, seed-stable, and never seen at rest."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from objectmorpher_core.compose.light.lighting import object_texture
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import DeformSettings, LiftedObject, Placement
from objectmorpher_core.lift.relief.sides import with_sides
from objectmorpher_core.lift.relief.thickness import with_thickness
from objectmorpher_core.raster import reference, tiles
from objectmorpher_core.raster.reference_layers import Picture3D
from objectmorpher_core.raster.trust import trust_in
from tests import shapes

LEVEL = 2 / 255
TURN = Placement(turn=(45.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def scene() -> shapes.Scene:
    """A ball in a grain as coarse as a few Gaussians."""
    y, x = np.mgrid[:200, :240]
    noise = np.random.default_rng(0).random((200, 240, 3)).astype(np.float32)
    grain = cv2.GaussianBlur(noise, (0, 0), 1.5)
    grain = 0.5 + (grain - grain.mean()) / (4 * grain.std())
    inside = (x - 120) ** 2 + (y - 100) ** 2 < 80**2
    pixels = np.where(inside[..., None], grain, 0.2).clip(0, 1)
    return shapes.lifted_scene((255 * pixels).astype(np.uint8), inside, 4000)


def _drawn(scene: shapes.Scene, lifted: LiftedObject, place: Placement) -> Picture3D:
    texture = object_texture(scene.matte, lifted)
    return Puppet(lifted, DeformSettings(), scene.camera).draw(None, place, texture, scene.camera)


def _contrast(picture: Picture3D, where: np.ndarray) -> float:
    """Mean step between neighbours."""
    grey = picture.color.mean(-1)
    steps = np.abs(np.diff(grey, axis=0))[:, :-1] + np.abs(np.diff(grey, axis=1))[:-1]
    return float(steps[where[:-1, :-1]].mean())


def test_a_newly_shown_side_is_as_rough_as_the_object_itself(scene):
    plain = replace(scene.lifted, sides=None)
    pictures = [_drawn(scene, lifted, TURN) for lifted in (plain, scene.lifted)]
    new = (pictures[0].from_photo < 0.1) & (pictures[0].alpha > 0.99)
    own = (pictures[0].from_photo > 0.9) & (pictures[0].alpha > 0.99)
    assert new.sum() > 300
    before, after = (_contrast(picture, new) for picture in pictures)
    assert after > max(0.5 * _contrast(pictures[0], own), 2 * before)
    # Nothing of it counts as the photo's, and the outline is what it was.
    assert pictures[1].from_photo[new].mean() < 0.1
    assert np.abs(pictures[1].alpha - pictures[0].alpha).mean() < 0.02


def test_at_rest_nothing_of_it_is_seen(scene):
    plain = _drawn(scene, replace(scene.lifted, sides=None), Placement())
    sided = _drawn(scene, scene.lifted, Placement())
    assert np.abs(sided.color - plain.color).max() < LEVEL
    np.testing.assert_array_equal(sided.from_photo, plain.from_photo)


def test_the_same_seed_invents_the_same(scene):
    plain = replace(scene.lifted, sides=None)
    first, second = (with_sides(plain, scene.matte, scene.camera, 3).sides for _ in range(2))
    assert first is not None and second is not None
    np.testing.assert_array_equal(first.pixels, second.pixels)
    np.testing.assert_array_equal(first.at, second.at)


def test_tiles_draw_sides_as_the_reference_does(scene):
    splats = scene.puppet.posed(None, TURN)
    view = scene.camera.windowed(140.0, 60.0, 60, 60)
    fast = tiles.render(splats, scene.texture, view, scene.camera)
    slow = reference.render(splats, scene.texture, view, scene.camera)
    assert np.abs(fast.color - slow.color).max() < 3 * LEVEL
    assert np.abs(fast.from_photo - slow.from_photo).max() < 0.02


def test_a_thicker_shape_shows_the_same_side(scene):
    """Each Gaussian slides along its ray and takes its piece along, drawn out as it was."""
    thicker = with_thickness(scene.lifted, scene.camera, 1.5)
    assert thicker.sides is not None and scene.lifted.sides is not None
    np.testing.assert_array_equal(thicker.sides.at, scene.lifted.sides.at)
    new = _drawn(scene, thicker, TURN)
    own = (new.from_photo > 0.9) & (new.alpha > 0.99)
    side = (new.from_photo < 0.1) & (new.alpha > 0.99)
    assert _contrast(new, side) > 0.4 * _contrast(new, own)


def test_trust_falls_with_every_degree(scene):
    angles = (0, 10, 20, 35, 60, 90, 180)
    found = [trust_in(scene.puppet.posed(None, Placement(turn=(a, 0.0, 0.0)))) for a in angles]
    assert found[0].sign == "fine" and found[0].invented < 0.02 and found[0].astray < 1e-3
    assert np.all(np.diff([trust.invented for trust in found]) > 0)
    assert found[-1].sign == "guesswork" and found[-1].invented > 0.95
