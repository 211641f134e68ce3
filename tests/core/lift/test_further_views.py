"""Further photos: where they were taken, what they say of the shape, and what they show."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose.light.lighting import object_texture
from objectmorpher_core.document.edits import (
    add_object,
    set_camera,
    set_lifted,
    set_mask,
    set_shape,
)
from objectmorpher_core.document.model import Document, LiftedObject, LiftSettings, Photo, Prompt
from objectmorpher_core.document.sides import FurtherView
from objectmorpher_core.lift import LiftError, LiftSubject
from objectmorpher_core.lift.registration.other_photo import OtherPhoto, with_photo
from objectmorpher_core.lift.relief.lifter import ReliefLifter
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.raster import tiles
from objectmorpher_core.raster.posed import PosedSplats, RestSplats
from objectmorpher_core.raster.reference import Picture3D
from objectmorpher_core.raster.trust import trust_in
from objectmorpher_core.segment.matting.matte import cut_out
from objectmorpher_core.session.file import decode_session, encode_session
from tests import shapes
from tests.core.lift.registered import (
    LENS_CAMERA,
    TURN,
    Scene,
    ball,
    photo,
    pose,
    turned,
    two_sides,
)

ALONE = LiftSettings(count=4000, uses_depth=False, trust=0)  # of the outline


@cache
def subject() -> LiftSubject:
    one = two_sides()[0]
    return LiftSubject(one.pixels, one.camera, one.mask, cut_out(one.pixels, one.mask))


def other(scene: Scene) -> OtherPhoto:
    return OtherPhoto("side.png", scene.pixels, scene.camera, scene.mask)


@cache
def lifted() -> tuple[LiftedObject, LiftedObject, FurtherView]:
    """From one photo, and from both."""
    one = ReliefLifter().lift(subject(), ALONE, lambda *_: None)
    settings, both = with_photo(subject(), ALONE, ReliefLifter(), other(two_sides()[1]))
    return one, both, settings.views[0]


def _seen(item: LiftedObject, motion: np.ndarray, camera: Camera = LENS_CAMERA) -> Picture3D:
    splats = PosedSplats(RestSplats(item, LENS_CAMERA), None, motion)
    return tiles.render(splats, object_texture(subject().matte, item), camera, LENS_CAMERA)


@pytest.mark.slow
def test_where_the_other_photo_was_taken():
    view = lifted()[2]
    turn = view.pose[:3, :3] / np.cbrt(np.linalg.det(view.pose[:3, :3]))
    off = turn @ turned(TURN)[:3, :3].T
    # A flatter thing that is turned less far looks nearly the same.
    assert np.degrees(np.arccos((np.trace(off) - 1) / 2)) < 15


def test_from_there_it_looks_as_in_the_other_photo():
    one, both, view = lifted()
    true = two_sides()[1]
    errors, overlaps = [], []
    for item in (one, both):
        drawn = _seen(item, view.pose)
        covered = drawn.alpha > 0.5
        inside = covered & true.mask
        overlaps.append(inside.sum() / (covered | true.mask).sum())
        errors.append(np.abs(drawn.color[inside] - true.pixels[inside] / 255).mean())
    assert overlaps[1] > 0.95 and 1 - overlaps[1] < 0.7 * (1 - overlaps[0])
    assert errors[1] < 0.6 * errors[0]


def test_at_rest_it_is_the_first_photo_still():
    one, both, _ = lifted()
    first, second = (_seen(item, np.eye(4)) for item in (one, both))
    whole = np.minimum(first.alpha, second.alpha) > 0.99
    assert np.abs(first.color - second.color)[whole].max() <= 2 / 255


def test_what_another_photo_shows_is_not_invented():
    one, both, view = lifted()
    invented = [
        trust_in(PosedSplats(RestSplats(item, LENS_CAMERA), None, view.pose)).invented
        for item in (one, both)
    ]
    assert both.sides is not None and both.sides.real is not None and both.sides.real.any()
    assert invented[1] < 0.5 * invented[0]


@pytest.mark.slow
def test_a_photo_of_another_thing_is_refused():
    unlike = photo(ball(is_patterned=True), pose(5), LENS_CAMERA)
    with pytest.raises(LiftError, match="share too few details"):
        with_photo(subject(), ALONE, ReliefLifter(), other(unlike))


def test_another_focal_length_forgets_further_photos():
    one, camera = two_sides()[0], LENS_CAMERA
    document = add_object(Document(Photo(Picture(one.pixels), camera, b"", "front.png")))
    views = LiftSettings(views=(lifted()[2],))
    document = set_shape(set_mask(document, 0, one.mask, Prompt()), 0, views)
    assert set_camera(document, camera, 0).objects[0].shape.views == views.views
    longer = set_camera(document, replace(camera, focal=2 * camera.focal), 0)
    assert longer.objects[0].shape.views == () and longer.objects[0].mask is not None


def test_a_session_keeps_further_photos():
    scene, (_, both, view) = two_sides()[0], lifted()
    picture = Photo(Picture(scene.pixels), LENS_CAMERA, shapes.png(scene.pixels), "front.png")
    document = set_mask(add_object(Document(picture)), 0, scene.mask, Prompt())
    settings = replace(ALONE, views=(view,))
    saved = set_lifted(document, 0, subject().matte, both, settings)
    again = decode_session(encode_session(saved)).objects[0]
    found = again.shape.views[0]
    assert found.photo == "side.png" and found.camera == view.camera
    for name in ("pose", "pixels", "alpha", "matches"):
        assert np.array_equal(getattr(found, name), getattr(view, name))
    assert again.lifted is not None and again.lifted.sides is not None and both.sides is not None
    assert np.array_equal(again.lifted.sides.real, both.sides.real)
    lifted_again = ReliefLifter().lift(subject(), again.shape, lambda *_: None)
    assert np.array_equal(lifted_again.gaussians.means, both.gaussians.means)
