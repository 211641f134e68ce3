"""Further photos: where they were taken, what they say of the shape, and what they show."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose.light.lighting import object_texture
from objectmorpher_core.document.edits import add_object, set_lifted, set_mask
from objectmorpher_core.document.model import Document, LiftedObject, LiftSettings, Photo, Prompt
from objectmorpher_core.document.views import FurtherView
from objectmorpher_core.lift import LiftError, LiftSubject
from objectmorpher_core.lift.registration.further import OtherPhoto, with_photo
from objectmorpher_core.lift.relief.lifter import ReliefLifter
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.raster import tiles
from objectmorpher_core.raster.posed import PosedSplats, RestSplats
from objectmorpher_core.raster.reference_layers import Picture3D
from objectmorpher_core.raster.trust import trust_in
from objectmorpher_core.segment.matting.matte import cut_out
from objectmorpher_core.session.file import decode_session, encode_session
from tests import shapes
from tests.core.lift.registered import Body, Scene, ball, photo, pose

CAMERA = Camera.from_fov(480, 360, 45)
AWAY = 2.4  # object units
ALONE = LiftSettings(count=4000, uses_depth=False, trust=0)  # of the outline
TURN = 35.0  # degrees between the two photos


def _turned(degrees: float) -> np.ndarray:
    """(4, 4) about an upright axis through a thing at the usual distance."""
    angle = np.radians(degrees)
    matrix = np.eye(4)
    matrix[0, 0] = matrix[2, 2] = np.cos(angle)
    matrix[0, 2], matrix[2, 0] = np.sin(angle), -np.sin(angle)
    matrix[:3, 3] = [0, 0, AWAY] - matrix[:3, :3] @ [0, 0, AWAY]
    return matrix


def _lens() -> Body:
    """A patterned ellipsoid, much flatter than its outline suggests."""
    round_one, radii = ball(is_patterned=True), np.array([1.0, 0.8, 0.35])
    return replace(round_one, cast=lambda start, ways: round_one.cast(start / radii, ways / radii))


@cache
def scenes() -> tuple[Scene, Scene]:
    """A lens from its flat side, and `TURN` degrees further around."""
    first = np.eye(4)
    first[:3, 3] = [0, 0, AWAY]
    return photo(_lens(), first, CAMERA), photo(_lens(), _turned(TURN) @ first, CAMERA)


def subject() -> LiftSubject:
    one = scenes()[0]
    return LiftSubject(one.pixels, one.camera, one.mask, cut_out(one.pixels, one.mask))


def other(scene: Scene) -> OtherPhoto:
    return OtherPhoto("side.png", scene.pixels, scene.camera, scene.mask)


@cache
def lifted() -> tuple[LiftedObject, LiftedObject, FurtherView]:
    """From one photo, and from both."""
    one = ReliefLifter().lift(subject(), ALONE, lambda *_: None)
    settings, both = with_photo(subject(), ALONE, ReliefLifter(), other(scenes()[1]))
    return one, both, settings.views[0]


def _seen(item: LiftedObject, motion: np.ndarray, camera: Camera = CAMERA) -> Picture3D:
    splats = PosedSplats(RestSplats(item, CAMERA), None, motion)
    return tiles.render(splats, object_texture(subject().matte, item), camera, CAMERA)


def test_where_the_other_photo_was_taken():
    view = lifted()[2]
    turn = view.pose[:3, :3] / np.cbrt(np.linalg.det(view.pose[:3, :3]))
    off = turn @ _turned(TURN)[:3, :3].T
    assert (
        np.degrees(np.arccos((np.trace(off) - 1) / 2)) < 15
    )  # flatter and turned less far looks nearly the same


def test_from_there_it_looks_as_in_the_other_photo():
    one, both, view = lifted()
    true = scenes()[1]
    errors, overlaps = [], []
    for item in (one, both):
        drawn = _seen(item, view.pose)
        covered = drawn.alpha > 0.5
        inside = covered & true.mask
        overlaps.append(inside.sum() / (covered | true.mask).sum())
        errors.append(np.abs(drawn.color[inside] - true.pixels[inside] / 255).mean())
    assert overlaps[1] > 0.93 and 1 - overlaps[1] < 0.6 * (1 - overlaps[0])
    assert errors[1] < 0.6 * errors[0]


def test_at_rest_it_is_the_first_photo_still():
    one, both, _ = lifted()
    first, second = (_seen(item, np.eye(4)) for item in (one, both))
    whole = np.minimum(first.alpha, second.alpha) > 0.99
    assert np.abs(first.color - second.color)[whole].max() <= 2 / 255


def test_what_another_photo_shows_is_not_invented():
    one, both, view = lifted()
    invented = [
        trust_in(PosedSplats(RestSplats(item, CAMERA), None, view.pose)).invented
        for item in (one, both)
    ]
    assert both.sides is not None and both.sides.real is not None and both.sides.real.any()
    assert invented[1] < 0.5 * invented[0]


def test_a_photo_of_another_thing_is_refused():
    unlike = photo(ball(is_patterned=True), pose(5), CAMERA)
    with pytest.raises(LiftError, match="share too few details"):
        with_photo(subject(), ALONE, ReliefLifter(), other(unlike))


def test_a_session_keeps_further_photos():
    scene, (_, both, view) = scenes()[0], lifted()
    picture = Photo(Picture(scene.pixels), CAMERA, shapes.png(scene.pixels), "front.png")
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
