"""Light of the new place: none without a move, and limited."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core import edits
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.harmonize import LEAST, MOST, NEUTRAL, light_gain, light_map
from objectmorpher_core.compose.shadow import GAMMA
from objectmorpher_core.compose.silhouette import Silhouette, sketch
from objectmorpher_core.document import Placement
from tests import shapes


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
    lit = composite(edits.set_harmony(document, 0, 1.0), {0: scene.puppet}).pixels
    assert (plain - lit).max() > 15
    assert (plain - lit).min() >= -1
