"""Paint on an object: it is seen where it was painted, sticks to the surface, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from objectmorpher_core.base.brush import Brush, Stroke
from objectmorpher_core.compose.composite import composite, object_texture
from objectmorpher_core.compose.paint import look, with_stroke, without_stroke
from objectmorpher_core.deform.puppet import puppet_of
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, LiftSettings, Matte, Placement
from objectmorpher_core.document.paint import SIDE
from objectmorpher_core.lift.refitting import carried_over
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.scripting.animation import shrunk
from objectmorpher_core.session.file import decode_session, encode_session
from tests import shapes

INK = np.array([0.1, 0.85, 0.2], np.float32)  # of which the made photo has nothing
NEAR = 24  # levels, of a colour that is the ink's
SEEN = 0.9  # of a stroke, at least
WITHIN = 4  # texels around a stroke, in which it may end
PLACES = {
    "at rest": Placement(),
    "turned": Placement(turn=(40.0, 0.0, 0.0)),
    "turned far": Placement(turn=(-70.0, 20.0, 0.0)),
    "its back": Placement(turn=(180.0, 0.0, 0.0)),
    "enlarged": Placement(turn=(30.0, 0.0, 0.0), scale=2.5),
    "small": Placement(turn=(0.0, 25.0, 0.0), scale=0.5),
}


@cache
def _scene(back: str = "continued") -> Document:
    scene = shapes.scene("ellipse", 2500)
    shape = LiftSettings(2500, trust=0, back=back)
    lift = lift_mask(scene.pixels, scene.camera, scene.mask, "relief", shape)
    document = edits.set_lifted(scene.document(), 0, *lift, shape)
    return replace(document, plate=shapes.grey_plate(scene.mask))


def _posed(document: Document) -> PosedSplats:
    item = document.objects[0]
    return puppet_of(item, document.photo.camera).posed(item.pose, item.placement)


def _placed(placement: Placement, document: Document | None = None) -> Document:
    return edits.set_placement(document or _scene(), 0, placement)


def _stroke(document: Document, radius: float = 5.0) -> Stroke:
    """Across the middle of what is seen of the object."""
    xy = document.photo.camera.project(_posed(document).means)
    (x0, y0), (x1, y1) = np.percentile(xy, (25, 75), axis=0)
    stroke = Stroke(document.photo.size, Brush(radius, 1.0))
    for x, y in ((x0, y0), (0.5 * (x0 + x1), y1), (x1, 0.5 * (y0 + y1))):
        stroke.move_to(float(x), float(y))
    return stroke


def _painted(document: Document, stroke: Stroke, is_erased: bool = False) -> Document:
    matte, box = document.objects[0].matte, stroke.box
    assert matte is not None and box is not None
    x0, y0, x1, y1 = box
    seen = look(_posed(document), matte, document.photo.camera, box)
    coverage = stroke.coverage[y0:y1, x0:x1]
    changed: Matte = (
        without_stroke(matte, seen, coverage)
        if is_erased
        else with_stroke(matte, seen, coverage, INK)
    )
    return document.with_object(0, replace(document.objects[0], matte=changed))


def _grown(coverage: np.ndarray, px: int) -> np.ndarray:
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * px + 1, 2 * px + 1))
    return cv2.dilate((coverage > 0).astype(np.uint8), kernel) > 0


def _alpha(matte: Matte) -> np.ndarray:
    """(h, w) of the paint on all of the texture."""
    assert matte.paint is not None
    return matte.paint.crop((-SIDE, -SIDE, 8 * SIDE, 8 * SIDE))[..., 3] / 255


@pytest.mark.parametrize("place", PLACES)
def test_a_stroke_is_seen_where_it_was_painted_and_nothing_else_changes(place: str):
    document, scale = _placed(PLACES[place]), max(PLACES[place].scale, 1.0)
    stroke = _stroke(document, 5.0 * scale)
    before, after = composite(document).pixels, composite(_painted(document, stroke)).pixels
    old, new = (shown[stroke.coverage >= 1].astype(float) for shown in (before, after))
    way = 255 * INK - old
    assert (((new - old) * way).sum(1) > 0.5 * (way * way).sum(1)).mean() > SEEN
    near = _grown(stroke.coverage, round(WITHIN * scale))
    is_other = (np.abs(after.astype(int) - before).max(-1) > NEAR) & ~near
    assert is_other.mean() < 0.02 * (stroke.coverage > 0).mean()


@pytest.mark.parametrize("place", PLACES)
def test_back_at_rest_the_photo_is_its_own_where_nothing_was_painted(place: str):
    document = _placed(PLACES[place])
    painted = _placed(Placement(), _painted(document, _stroke(document)))
    result, photo = composite(painted), painted.photo.pixels
    matte = painted.objects[0].matte
    assert matte is not None and matte.paint is not None
    there = matte.paint.crop((0, 0, *painted.photo.size))[..., 3]
    free = ~_grown(there, WITHIN)
    assert np.array_equal(result.pixels[free], photo[free])
    assert result.outside_footprint_changed == 0
    if place in ("at rest", "turned"):
        assert (result.pixels != photo).any(), "what it shows of the photo is painted"


@pytest.mark.parametrize("place", ["at rest", "turned", "its back"])
def test_painted_pixels_are_counted_as_painted_wherever_they_lie(place: str):
    """On what the photo shows, and on what was invented: they are of neither."""
    document = _placed(PLACES[place])
    stroke = _stroke(document)
    plain, painted = (composite(d) for d in (document, _painted(document, stroke)))
    assert plain.shares.from_paint == 0
    own = painted.shares
    parts = own.from_photo, own.from_lifter, own.from_inpainter, own.from_refiner, own.from_paint
    assert sum(parts) == pytest.approx(1, abs=1e-6)
    is_painted = (painted.pixels != plain.pixels).any(2) & (stroke.coverage > 0)
    share = stroke.coverage[is_painted].sum() / painted.changed
    assert own.from_paint == pytest.approx(share, rel=0.25)
    if place == "its back":
        assert own.from_lifter < plain.shares.from_lifter - 0.5 * own.from_paint


def test_a_spot_sticks_to_its_place_on_the_surface():
    document = _placed(PLACES["turned"])
    item, camera = document.objects[0], document.photo.camera
    assert item.matte is not None
    puppet = puppet_of(item, camera)
    texture = object_texture(item.matte, item.lifted)
    at = np.array([0.5 * camera.width + 8, 0.5 * camera.height])
    point = puppet.pick((float(at[0]), float(at[1])), None, item.placement, texture)
    assert point is not None
    stroke = Stroke(document.photo.size, Brush(4.0, 1.0))
    stroke.move_to(*map(float, at))
    painted = _painted(document, stroke)
    for yaw in (0.0, 20.0, 60.0):
        placement = Placement(turn=(yaw, 0.0, 0.0))
        shown, plain = (composite(_placed(placement, d)).pixels for d in (painted, document))
        row, column = np.nonzero(np.abs(shown.astype(int) - plain).max(-1) > 2 * NEAR)
        there = puppet.picture_of(point.rest, None, placement)
        assert len(row), yaw
        assert np.hypot(column.mean() + 0.5 - there[0], row.mean() + 0.5 - there[1]) < 2, yaw


def test_no_texel_within_a_stroke_is_left_out():
    """Drawn out by the turn, and enlarged: the picture has few pixels, or many, for a texel."""
    for place in ("turned", "enlarged", "small"):
        document = _placed(PLACES[place])
        matte = _painted(document, _stroke(document)).objects[0].matte
        assert matte is not None and matte.paint is not None
        whole = (_alpha(matte) > 0.5).astype(np.uint8)
        closed = cv2.morphologyEx(whole, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
        assert (closed > whole).sum() <= 0.03 * whole.sum(), place


def test_what_is_erased_is_as_it_was():
    document = _placed(PLACES["turned"])
    stroke, wide = _stroke(document, 5.0), _stroke(document, 12.0)
    back = _painted(_painted(document, stroke), wide, is_erased=True)
    pixels = composite(document).pixels
    assert np.array_equal(composite(back).pixels, pixels)
    matte = back.objects[0].matte
    assert matte is not None and matte.paint is None


def test_a_session_keeps_paint_and_an_object_lifted_anew_what_the_photo_shows_of_it():
    document = _placed(PLACES["turned"])
    painted = _painted(document, _stroke(document))
    again = decode_session(encode_session(painted))
    assert np.array_equal(composite(again).pixels, composite(painted).pixels)
    item = painted.objects[0]
    assert item.matte is not None and item.lifted is not None and item.matte.paint is not None
    plain = replace(item.lifted, sides=None)
    anew = carried_over(item, replace(item.matte, paint=None), plain, item.shape).matte
    assert anew is not None and anew.paint is not None
    assert anew.paint.spots.any()
    kept = item.matte.paint.crop(item.matte.box)
    assert np.array_equal(anew.paint.crop(item.matte.box), kept) and kept.any()
    assert _alpha(anew).sum() == pytest.approx(kept[..., 3].sum() / 255)


def test_a_mirrored_back_is_told_from_a_front():
    """It shows the photo's own texels: what is painted on it is on the front, too."""
    for place, is_back in (("at rest", False), ("its back", True)):
        document = _placed(PLACES[place], _scene("mirrored"))
        stroke, matte = _stroke(document), document.objects[0].matte
        assert matte is not None and stroke.box is not None
        x0, y0, x1, y1 = stroke.box
        seen = look(_posed(document), matte, document.photo.camera, stroke.box)
        share = seen.mirrored(stroke.coverage[y0:y1, x0:x1])
        assert share > 0.9 if is_back else share < 0.02


def test_a_small_video_shows_paint_as_the_edit_does():
    for place in ("at rest", "turned"):
        painted = _placed(PLACES[place], _painted(_placed(PLACES["at rest"]), _stroke(_scene())))
        small, large = composite(shrunk(painted, 2)).pixels, composite(painted).pixels
        plain = composite(shrunk(_placed(PLACES[place]), 2)).pixels
        large = cv2.resize(large, small.shape[1::-1], interpolation=cv2.INTER_AREA)
        is_painted = np.abs(small.astype(int) - plain).max(-1) > 4 * NEAR
        assert is_painted.sum() > 100
        assert np.abs(small.astype(int) - large)[is_painted].mean() < NEAR / 3
