"""Light of the new place: none without a move, and limited."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.compose import load
from objectmorpher_core.compose.composite import composite, straight_cutout
from objectmorpher_core.compose.light.harmonize import LEAST, MOST, NEUTRAL, light_gain, light_map
from objectmorpher_core.compose.plate.plate import build_plate
from objectmorpher_core.compose.shadow.shadow import GAMMA
from objectmorpher_core.compose.silhouette import Silhouette, sketch
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Placement, Prompt
from objectmorpher_core.pipeline import lift_mask, open_photo
from objectmorpher_core.scripting.outputs import Export
from tests import shapes
from tests.shapes import png


def test_without_a_move_the_light_is_the_same():
    scene = shapes.scene("ellipse")
    light = light_map(scene.document())
    here = sketch(scene.puppet.posed(None, Placement()), scene.camera)
    assert here is not None
    assert light_gain(light, shapes.WIDTH, here, here) == NEUTRAL


@pytest.mark.parametrize("ratio", [0.5, 0.8, 1.0, 1.3, 3.0])
def test_the_gain_is_the_ratio_of_the_light_within_limits(ratio):
    light = np.full((60, 80, 3), 0.2, np.float32)
    light[:, 40:] *= np.float32(ratio)
    places = [Silhouette(np.ones((10, 10), np.float32), left, 20.0, 1.0) for left in (10.0, 60.0)]
    gain = np.array(light_gain(light, 80, *places)) ** GAMMA
    expected = np.clip(ratio, LEAST, MOST)
    np.testing.assert_allclose(gain, expected, rtol=0.045)  # the difference that counts as none
    if ratio == 1.0:
        assert (gain == 1).all()


def test_an_object_in_the_dark_is_darker():
    scene = shapes.scene("ellipse")
    pixels = scene.pixels.copy()
    pixels[:, 110:] //= 3
    document = scene.document()
    picture = replace(document.photo.picture, pixels=pixels)
    document = replace(document, photo=replace(document.photo, picture=picture))
    document = edits.set_placement(document, 0, Placement(move=(55.0, 0.0), scale=0.5))
    plain = composite(document, {0: scene.puppet}).pixels.astype(int)
    lit = composite(edits.set_share(document, 0, "harmony", 1.0), {0: scene.puppet}).pixels
    assert (plain - lit).max() > 15
    assert (plain - lit).min() >= -1


def _patches(seed: int) -> np.ndarray:
    """(h, w, 3) linear: materials beside each other, in the same light."""
    colours = np.random.default_rng(seed).uniform(0.1, 0.6, (6, 8, 3))
    return colours.repeat(10, 0).repeat(10, 1).astype(np.float32)


@pytest.mark.parametrize("seed", range(6))
def test_other_materials_are_seldom_taken_for_other_light(seed):
    places = [Silhouette(np.ones((24, 24), np.float32), left, 18.0, 1.0) for left in (6.0, 50.0)]
    gain = np.array(light_gain(_patches(seed), 80, *places))
    assert np.abs(np.log(gain)).max() < 0.06


def test_light_that_falls_evenly_is_followed_from_place_to_place():
    ramp = np.linspace(1.0, 0.4, 80, dtype=np.float32)[None, :, None]
    light = np.full((60, 80, 3), 0.3, np.float32) * ramp
    places = [Silhouette(np.ones((24, 24), np.float32), left, 18.0, 1.0) for left in (6.0, 50.0)]
    true = np.log(ramp[0, 62, 0] / ramp[0, 18, 0])
    found = np.log(np.array(light_gain(light, 80, *places)) ** GAMMA)
    assert np.abs(found - true).max() < 0.25 * abs(true)


@pytest.mark.parametrize("other", [(0.5, 0.05, 0.1), (0.45, 0.16, 0.05), (0.35, 0.35, 0.5)])
def test_a_colour_that_no_light_has_is_another_material_and_changes_nothing(other):
    """A lawn beside a wall: how bright they are says nothing about the light on them."""
    light = np.full((60, 80, 3), [0.12, 0.2, 0.06], np.float32)
    light[:, 40:] = other
    places = [Silhouette(np.ones((10, 10), np.float32), left, 20.0, 1.0) for left in (10.0, 60.0)]
    assert np.abs(np.log(light_gain(light, 80, *places))).max() < 0.02


def test_light_that_is_warmer_and_darker_is_both():
    light = np.full((60, 80, 3), 0.3, np.float32)
    light[:, 40:] *= np.exp([0.0, -0.42, -1.05]).astype(np.float32)  # 4000 K, not 6500 K
    places = [Silhouette(np.ones((10, 10), np.float32), left, 20.0, 1.0) for left in (10.0, 60.0)]
    red, green, blue = np.log(light_gain(light, 80, *places))
    assert blue < green < red < -0.05


def test_a_cutout_is_lit_as_in_the_photo():
    """By what is around it there, and not by itself, where it was."""
    rng, (height, width) = np.random.default_rng(0), (240, 360)
    y, x = np.mgrid[:height, :width]
    mask = ((x - 90) / 45) ** 2 + ((y - 130) / 60) ** 2 < 1
    grey = np.where(mask, 30, np.where(x < width / 2, 150, 112))[..., None]
    pixels = np.rint(grey + rng.normal(0, 3, (height, width, 3))).clip(0, 255).astype(np.uint8)
    photo = open_photo(png(pixels), "grey.png")
    document = edits.set_mask(edits.add_object(photo), 0, mask, Prompt())
    document = edits.set_lifted(document, 0, *lift_mask(pixels, photo.photo.camera, mask))
    document = edits.set_plate(document, build_plate(pixels, mask, load("telea")))
    document = edits.set_placement(document, 0, Placement(move=(180.0, 0.0)))
    document = document.with_object(0, replace(document.objects[0], harmony=1.0))
    drawn = straight_cutout(composite(document), np.dtype(np.uint8), document.photo.size)
    found = Export(document, object=0).picture("object")
    assert (drawn[..., 3] == 255).sum() > 500
    np.testing.assert_array_equal(np.dstack([found.pixels, found.alpha]), drawn)
