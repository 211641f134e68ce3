"""Depth maps of objects that were moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Placement
from objectmorpher_core.scripting.outputs import depth_map, nearness
from tests import shapes


def test_what_goes_away_is_so_much_farther():
    scene = shapes.scene("ellipse")
    document = scene.document()
    here = depth_map(document, {0: scene.puppet})
    there = np.isfinite(here)
    assert (there & scene.mask).sum() > 0.97 * there.sum()
    away = edits.set_placement(document, 0, Placement(depth=0.5))
    step = 0.5 * scene.lifted.diameter * scene.lifted.scale
    farther = depth_map(away)
    gained = np.median(farther[np.isfinite(farther)]) - np.median(here[there])
    assert gained == pytest.approx(step, rel=0.05)


def test_the_nearest_of_two_counts_and_hidden_ones_do_not():
    document = shapes.scene("ellipse").document()
    near = replace(document.objects[0], name="near", placement=Placement(depth=-0.4))
    both = replace(document, objects=(*document.objects, near))
    alone = depth_map(replace(document, objects=(near,)))
    seen = np.isfinite(alone)
    assert np.array_equal(depth_map(both)[seen], alone[seen])
    hidden = replace(both, objects=(document.objects[0], replace(near, is_visible=False)))
    assert np.array_equal(depth_map(hidden), depth_map(document))


def test_nearness_keeps_ratios():
    depth = np.array([[2.0, 4.0, 8.0, np.inf]], np.float32)
    assert nearness(depth).tolist() == [[65535, 32768, 16384, 0]]
    assert nearness(np.full((2, 2), np.inf, np.float32)).max() == 0


def test_outside_the_photo_there_is_none():
    document = shapes.scene("ellipse").document()
    gone = edits.set_placement(document, 0, Placement(move=(5000.0, 0.0)))
    assert not np.isfinite(depth_map(gone)).any()
