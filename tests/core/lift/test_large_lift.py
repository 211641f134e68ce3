"""What fills tens of megapixels is lifted from a smaller picture, as it is from the whole one."""

from __future__ import annotations

import tracemalloc
from functools import cache

import cv2
import numpy as np
import pytest
from scipy.spatial import KDTree

from objectmorpher_core.base import masks
from objectmorpher_core.base.arrays import crop
from objectmorpher_core.base.progress import silent
from objectmorpher_core.compose.light.lighting import object_texture
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import LiftedObject, LiftSettings, Matte, Placement
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.lift import LiftSubject, lift_subject
from objectmorpher_core.lift.relief.lifter import ReliefLifter
from objectmorpher_core.lift.relief.thickness import with_thickness
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.raster.reference import Picture3D
from tests import shapes

TIMES = 3
SETTINGS = LiftSettings(3000, trust=0, back="continued")
LEVEL = 2 / 255  # 8-bit rounding


@cache
def _subject() -> tuple[LiftSubject, LiftedObject]:
    """An ellipse in a large photo that leaves it at the left, and its lift at full size."""
    inside = shapes.mask("ellipse", 320, 240)
    inside = np.roll(inside, -100, axis=1)
    inside[:, 220:] = False
    small = shapes.picture(inside)
    size = (320 * TIMES + 1, 240 * TIMES + 2)  # no multiple of any reduction
    pixels = cv2.resize(small, size, interpolation=cv2.INTER_CUBIC)
    mask = cv2.resize(inside.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    camera = shapes.camera(*size)
    matte, lifted = lift_mask(pixels, camera, mask, "relief", SETTINGS)
    assert matte.left < 0 and matte.top % 2 == 1, "its corner lies within a block"
    return LiftSubject(pixels, camera, mask, matte), lifted


@pytest.fixture(scope="module")
def reduced() -> LiftedObject:
    """The same from half the size."""
    subject, _ = _subject()
    with pytest.MonkeyPatch.context() as patch:
        _take_for_large(patch)
        assert masks.reduction(subject.matte.alpha.shape) == 2
        return lift_subject(ReliefLifter(), subject, SETTINGS, silent)


def _take_for_large(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(masks, "ENOUGH", 100_000)


def _drawn(lifted: LiftedObject, turn: tuple[float, float, float]) -> Picture3D:
    subject, _ = _subject()
    texture = object_texture(subject.matte, lifted)
    puppet = Puppet(lifted, DeformSettings(), subject.camera)
    return puppet.draw(None, Placement(turn=turn), texture, subject.camera)


def test_it_has_the_shape_that_the_full_size_gives(reduced):
    _, lifted = _subject()
    assert reduced.kind == lifted.kind and len(reduced.gaussians) > 0.9 * len(lifted.gaussians)
    own, other = (each.world_points(each.body.means) for each in (reduced, lifted))
    apart = KDTree(other).query(own)[0], KDTree(own).query(other)[0]
    spacing = lifted.spacing * lifted.scale
    assert max(np.percentile(each, 95) for each in apart) < 1.5 * spacing


def test_what_is_in_px_of_the_photo_is_at_its_size(reduced):
    subject, lifted = _subject()
    seen = subject.camera.project(reduced.world_points(reduced.gaussians.means))
    is_front = reduced.texture.visibility > 0.5
    gap = np.linalg.norm(seen - reduced.texture.u0, axis=1)[is_front]
    assert np.percentile(gap, 95) < 1.0
    assert reduced.middle is not None and lifted.middle is not None
    assert reduced.sides is not None and lifted.sides is not None
    matte, sides = subject.matte, reduced.sides
    assert (sides.left, sides.top) == (lifted.sides.left, lifted.sides.top)
    assert sides.top > matte.box[3]
    on = sides.zoom != 0
    height, width = sides.pixels.shape[:2]
    inside = (sides.at[on] >= [sides.left, sides.top]).all(1)
    inside &= (sides.at[on] < [sides.left + width, sides.top + height]).all(1)
    assert on.any() and inside.all()


def test_another_thickness_moves_its_front_as_far(reduced):
    """That follows from the middle sheet, whose slopes are by px of the photo."""
    subject, lifted = _subject()
    own, other = (
        np.abs(
            with_thickness(each, subject.camera, 0.5).gaussians.means - each.gaussians.means
        ).max(1)
        for each in (reduced, lifted)
    )
    assert np.percentile(own, 90) == pytest.approx(np.percentile(other, 90), rel=0.1)


def test_at_rest_and_turned_it_looks_as_the_full_size_does(reduced):
    subject, lifted = _subject()
    still = _drawn(reduced, (0.0, 0.0, 0.0))
    height, width = subject.mask.shape
    solid = crop(subject.matte.alpha, subject.matte.box, (0, 0, width, height)) > 0.99
    solid = cv2.erode(solid.view(np.uint8), np.ones((9, 9), np.uint8)) > 0
    photo = subject.pixels / np.float32(255)
    assert np.abs(still.color - photo)[solid].max() < LEVEL
    one, other = _drawn(reduced, (30.0, 10.0, 0.0)), _drawn(lifted, (30.0, 10.0, 0.0))
    one_is, other_is = one.alpha > 0.5, other.alpha > 0.5
    both = one_is & other_is
    assert both.sum() > 0.95 * (one_is | other_is).sum()
    assert np.median(np.abs(one.color - other.color)[both]) < 4 * LEVEL


@pytest.mark.slow
def test_its_memory_grows_by_little_more_than_the_smaller_picture(monkeypatch):
    subject, _ = _subject()

    def peak(times: int) -> float:
        """Bytes of NumPy for each px of the photo."""
        height, width = subject.mask.shape
        size = (times * width, times * height)
        mask = cv2.resize(subject.mask.view(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
        pixels = cv2.resize(subject.pixels, size)
        matte = subject.matte
        wide = (times * matte.alpha.shape[1], times * matte.alpha.shape[0])
        alpha, foreground = (cv2.resize(p, wide) for p in (matte.alpha, matte.foreground))
        whole = LiftSubject(
            pixels, shapes.camera(*size), mask,
            Matte(times * matte.left, times * matte.top, alpha, foreground),
        )  # fmt: skip
        tracemalloc.start()
        try:
            lift_subject(ReliefLifter(), whole, SETTINGS, silent)
            return tracemalloc.get_traced_memory()[1] / mask.size
        finally:
            tracemalloc.stop()

    _take_for_large(monkeypatch)
    assert peak(2) < 0.5 * peak(1)  # the smaller picture is of the same size
