"""Strands on newly shown sides: where there is hair, and nowhere at rest."""

from __future__ import annotations

import copy
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from objectmorpher_core.compose.light.lighting import object_texture
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.deform.resampling import thinned
from objectmorpher_core.document.model import LiftedObject, Placement
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.lift.relief.strands import hair_of
from objectmorpher_core.raster import reference, tiles
from objectmorpher_core.raster.reference import Picture3D
from tests import shapes
from tests.core.segment.test_matte import furry

SIDE = 480  # px


@pytest.fixture(scope="module")
def fur() -> shapes.Scene:
    """A ball with short hair, before a plain ground."""
    fine, middle, radius, random = 4, 2 * SIDE, 0.32 * 4 * SIDE, np.random.default_rng(5)
    large = np.zeros((fine * SIDE, fine * SIDE), np.uint8)
    cv2.circle(large, (middle, middle), round(radius), (255,), -1)
    for angle in random.uniform(0, 2 * np.pi, 800):
        out = np.array([np.cos(angle), np.sin(angle)])
        ends = radius - 4, radius + fine * random.uniform(4, 14)
        start, end = (np.rint(middle + out * far).astype(int).tolist() for far in ends)
        cv2.line(large, start, end, (255,), int(random.integers(3, 8)))
    soft = cv2.resize(large, (SIDE, SIDE), interpolation=cv2.INTER_AREA)[..., None] / 255
    noise = cv2.GaussianBlur(random.normal(size=(SIDE, SIDE, 3)), (0, 0), 2.0)
    mixed = soft * ([190, 120, 60] + 60 * noise) + (1 - soft) * [60, 95, 140]
    pixels = np.rint(mixed).clip(0, 255).astype(np.uint8)
    return shapes.lifted_scene(pixels, soft[..., 0] > 0.5, 6000, kind="tube")


def _shaved(lifted: LiftedObject) -> LiftedObject:
    """Without its strands."""
    kept = np.flatnonzero(~lifted.is_hair)
    texture, sides = copy.copy(lifted.texture), lifted.sides
    texture = replace(texture, **{name: value[kept] for name, value in vars(texture).items()})
    assert sides is not None and lifted.middle is not None
    return replace(
        lifted, gaussians=lifted.gaussians.select(kept), texture=texture,
        sides=sides.select(kept), middle=lifted.middle[kept],
    )  # fmt: skip


def _drawn(scene: shapes.Scene, lifted: LiftedObject, yaw: float) -> Picture3D:
    texture, place = object_texture(scene.matte, lifted), Placement(turn=(yaw, 0.0, 0.0))
    return Puppet(lifted, DeformSettings(), scene.camera).draw(None, place, texture, scene.camera)


def _raggedness(alpha: np.ndarray) -> float:
    """Of an outline, on average."""
    hair = hair_of(np.asarray(alpha, np.float32))
    assert hair is not None
    edge = cv2.Canny((255 * (alpha > 0.5)).astype(np.uint8), 50, 150) > 0
    y, x = np.nonzero(edge)
    return float(hair.at(np.column_stack([x, y]) + 0.5)[1].mean())


@settings(max_examples=30, deadline=None)
@given(
    st.tuples(st.floats(40, 110), st.floats(40, 110), st.floats(0, np.pi)),
    st.floats(0.6, 9.0),
    st.floats(2.0, 8.0),
)
def test_a_smooth_edge_is_no_hair_however_soft(ellipse, blur, power):
    """Round or with corners, crisp or out of focus."""
    a, b, turn = ellipse
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5 - SIDE / 2
    u, v = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
    inside = np.abs(u / a) ** power + np.abs(v / b) ** power < 1
    alpha = cv2.GaussianBlur(inside.astype(np.float32), (0, 0), blur)
    assert _raggedness(alpha) < 0.02


def test_fur_is():
    _, soft, _, _ = furry()
    assert _raggedness(soft) > 0.4
    assert hair_of(np.zeros((20, 30), np.float32)) is None


@pytest.mark.parametrize("yaw", [35.0, -35.0])
def test_what_turns_into_view_ends_in_hair(fur, yaw):
    """Beyond the smooth outline of its side, and unevenly."""
    bare, hairy = (
        _drawn(fur, lifted, yaw).alpha.sum(1) for lifted in (_shaved(fur.lifted), fur.lifted)
    )
    beyond = (hairy - bare)[SIDE // 3 : 2 * SIDE // 3]  # px, of each row
    assert beyond.min() > -0.1 and beyond.mean() > 1 and beyond.std() > 0.4


def test_strands_are_not_seen_at_rest_and_are_no_part_of_the_body(fur):
    bare = _shaved(fur.lifted)
    before, after = _drawn(fur, bare, 0.0), _drawn(fur, fur.lifted, 0.0)
    for name in ("color", "alpha", "from_photo"):
        np.testing.assert_allclose(getattr(before, name), getattr(after, name), atol=1e-5)
    assert fur.lifted.is_hair.sum() > 200
    assert len(fur.lifted.body) == len(bare.body)
    np.testing.assert_array_equal(fur.lifted.centre, bare.centre)
    fewer = [thinned(lifted, 1000) for lifted in (fur.lifted, bare)]
    assert fewer[0] is not None and fewer[1] is not None
    assert len(fewer[0][1]) == len(fewer[1][1]) + fur.lifted.is_hair.sum()
    assert fewer[0][0].spacing == fewer[1][0].spacing


def test_renderers_agree_on_them(fur):
    splats = Puppet(fur.lifted, DeformSettings(), fur.camera).posed(
        None, Placement(turn=(25.0, 0.0, 0.0))
    )
    right = fur.camera.windowed(2 * SIDE / 3, SIDE / 3, SIDE // 5, SIDE // 4, 1.0)
    slow, fast = (
        renderer.render(splats, fur.texture, right, fur.camera) for renderer in (reference, tiles)
    )
    assert (slow.alpha > 0.5).any()
    assert np.abs(slow.color - fast.color).max() < 2 / 255
