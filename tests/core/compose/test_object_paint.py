"""Paint on an object: it is seen where it was painted, sticks to the surface, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from scipy.spatial import KDTree

from objectmorpher_core.base.brush import Brush, Stroke
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose.composite import composite, object_texture
from objectmorpher_core.compose.paint import look, with_stroke, without_stroke
from objectmorpher_core.compose.texel_owners import ShownSurface
from objectmorpher_core.deform.puppet import puppet_of
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import (
    Document,
    EditObject,
    LiftSettings,
    Matte,
    Photo,
    Placement,
)
from objectmorpher_core.document.paint import SIDE
from objectmorpher_core.lift.refitting import carried_over
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.raster import tiles
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.scripting.animation import shrunk
from objectmorpher_core.session.file import decode_session, encode_session
from tests import photos, shapes
from tests.tree import quick

INK = np.array([0.1, 0.85, 0.2], np.float32)  # of which the made photo has nothing
NEAR = 24  # levels, of a colour that is the ink's
SEEN = 0.9  # of a stroke, at least
BESIDE_OTHERS = 0.8  # of a stroke, at least, where the photo shows another surface beside it
EITHER = 0.08  # of a stroke, by Gaussians that show both sides of an edge in the photo
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


@cache
def _cup() -> Document:
    """The cup on its saucer, with a spoon that its rim hides in part."""
    pixels, mask, shape = photos.photo("coffee"), photos.outlined("coffee"), LiftSettings(8000)
    camera = Camera.from_fov(pixels.shape[1], pixels.shape[0])
    photo = Photo(Picture(pixels), camera, shapes.png(pixels), "coffee.png")
    lift = lift_mask(pixels, camera, mask, "relief", shape)
    document = Document(photo, (EditObject("Cup", mask=mask),))
    return edits.set_lifted(document, 0, *lift, shape)


def _drawn(document: Document) -> tuple[np.ndarray, np.ndarray]:
    """(h, w, 3) the object alone, premultiplied, and where (h, w, 3) its surface was at rest."""
    item, camera = document.objects[0], document.photo.camera
    assert item.matte is not None
    splats, texture = _posed(document), object_texture(item.matte, item.lifted)
    surface = ShownSurface.of(splats, texture, camera, camera, None)
    shown = tiles.draw(tiles.prepare(splats, camera, camera), texture)
    places = np.where(surface.is_there[..., None], surface.places, np.inf)
    return shown.color, places


def _inked(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """(h, w) what has taken the ink's colour."""
    way = INK - before
    return ((after - before) * way).sum(-1) > 0.3 * (way * way).sum(-1)


# The places below are the cup's as the shape network sees it.
# px of the view: on the rim and the wall that comes into view below it; on the wall; its far edge;
# the saucer behind; the spoon's end; the spoon's bowl
@pytest.mark.usefixtures("networks")
@pytest.mark.parametrize("way", quick([
    (((300, 30), (315, 70)),), (((440, 85), (459, 92)),), (((340, 120), (340, 190)),),
    (((366, 150), (375, 170)),), (((320, 310), (350, 280)),),
], 1))  # fmt: skip
def test_of_a_side_that_came_into_view_only_what_lay_under_the_brush_is_coloured(way: tuple):
    document = _placed(Placement(turn=(50.0, 0.0, 0.0)), _cup())
    stroke = Stroke(document.photo.size, Brush(8.0, 1.0))
    for x, y in way:
        stroke.move_to(float(x), float(y))
    painted = _painted(document, stroke)
    lifted = document.objects[0].lifted
    assert lifted is not None
    under = _drawn(document)[1][_grown(stroke.coverage, WITHIN)]
    tree = KDTree(under[np.isfinite(under).all(1)])
    for yaw in (50.0, 25.0, 0.0, -40.0, 80.0):
        here = Placement(turn=(yaw, 0.0, 0.0))
        before, places = _drawn(_placed(here, document))
        inked = _inked(before, _drawn(_placed(here, painted))[0])
        away, _ = tree.query(np.where(np.isfinite(places), places, 1e6))
        is_other = inked & (away > 4 * lifted.spacing)
        most = EITHER * (stroke.coverage > 0).sum()
        assert is_other.sum() < most, f"{yaw}: {is_other.sum()} px"
        if yaw == 50.0:
            is_there = np.isfinite(places).all(-1)
            assert inked[(stroke.coverage >= 1) & is_there].mean() > BESIDE_OTHERS


@pytest.mark.usefixtures("networks")
def test_an_edge_that_paint_sets_apart_is_kept_and_comes_back_when_it_is_erased():
    document = _placed(Placement(turn=(50.0, 0.0, 0.0)), _cup())
    stroke, wide = (Stroke(document.photo.size, Brush(radius, 1.0)) for radius in (8.0, 20.0))
    for x, y in ((300, 30), (315, 70), (322, 80)):
        stroke.move_to(float(x), float(y))
        wide.move_to(float(x), float(y))
    painted = _painted(document, stroke)
    matte = painted.objects[0].matte
    assert matte is not None and matte.paint is not None and matte.paint.apart is not None
    again = decode_session(encode_session(painted)).objects[0].matte
    assert again is not None and again.paint is not None
    assert again.paint.apart is not None
    assert np.array_equal(again.paint.apart, matte.paint.apart)
    erased = _painted(painted, wide, is_erased=True)
    assert np.array_equal(_drawn(erased)[0], _drawn(document)[0])
    assert erased.objects[0].matte is not None and erased.objects[0].matte.paint is None
