"""Silhouettes: read between their pixels, and the quick one is nearly the exact one."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.compose.silhouette import sampled, sketch
from objectmorpher_core.document.model import Placement
from tests import shapes
from tests.outlines import silhouette

MOVE = Placement(move=(14.0, -9.0), scale=0.7)
F32_ROUNDING = 1e-5


def test_a_grid_is_read_between_its_pixels():
    rows = np.arange(12, dtype=np.float32)[:, None]
    values = np.repeat(rows, 9, 1)
    whole = sampled(values, (3.0, 5.0), 2.0, (0, 0, 40, 40))
    part = sampled(values, (3.0, 5.0), 2.0, (7, 11, 20, 25))
    assert np.array_equal(whole[11:25, 7:20], part)
    assert not whole[:3].any() and not whole[:, 23:].any()
    np.testing.assert_allclose(whole[11, 10], ((11.5 - 5) / 2 - 0.5), atol=F32_ROUNDING)


def test_silhouette_and_sketch_agree():
    scene = shapes.scene("ellipse")
    splats = scene.puppet.posed(None, MOVE)
    fine = silhouette(splats, scene.texture, scene.camera)
    coarse = sketch(splats, scene.camera)
    assert fine is not None and coarse is not None
    box = (0, 0, shapes.WIDTH, shapes.HEIGHT)
    pictures = [sampled(s.alpha, (s.left, s.top), s.pitch, box) > 0.5 for s in (fine, coarse)]
    shared = (pictures[0] & pictures[1]).sum() / (pictures[0] | pictures[1]).sum()
    assert shared > 0.7
