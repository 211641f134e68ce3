"""Layers over one another are the export, and what each of them is."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from objectmorpher_core.base.arrays import Pixels
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.layers import BACKGROUND, EMPTY, PHOTO, UNTOUCHED, Layer, layers
from objectmorpher_core.document import edits
from objectmorpher_core.document.bounds import MODES
from objectmorpher_core.document.model import Document, Photo, Placement
from objectmorpher_core.document.settings import Finish, Shadow
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.session.file import decode_session, encode_session
from tests import shapes
from tests.core.compose.stacked import stacked
from tests.tree import over

OFF = 2.0  # of 255: each of the layers is rounded
MOVES = {
    "moved": Placement(move=(18.0, -7.0)),
    "turned": Placement(turn=(25.0, 10.0, -15.0)),
    "out of the photo": Placement(move=(900.0, 0.0)),
    "half out of the photo": Placement(move=(70.0, 40.0)),
    "large": Placement(scale=6.0),
    "a little": Placement(move=(1.5, 2.5)),
}


def moved(document: Document, placement: Placement, k: int = 0) -> Document:
    return edits.set_placement(document, k, placement)


def off(document: Document) -> tuple[np.ndarray, Pixels, list[Layer]]:
    result, pile = layers(document)
    top = float(np.iinfo(result.pixels.dtype).max)
    return np.abs(stacked(pile) - result.pixels * (255 / top)), result.pixels, pile


@over("move", MOVES)
@over("name", ["ellipse", "frame", "ring"])
def test_layers_over_one_another_are_the_export(name, move):
    difference, _, pile = off(moved(shapes.scene(name).document(), MOVES[move]))
    assert difference.max() <= OFF
    assert difference.mean() < 0.1
    assert [layer.name for layer in pile[:2]] == [PHOTO, BACKGROUND]


def test_where_nothing_moved_they_are_the_photo_and_the_objects_are_layers_too():
    scene = shapes.scene("ellipse")
    difference, pixels, pile = off(scene.document())
    assert difference.max() == 0
    assert np.array_equal(pixels, scene.pixels)
    assert [layer.name for layer in pile] == [PHOTO, BACKGROUND, "Object 1", UNTOUCHED]
    without = stacked(pile[:-1])  # the object over the plate instead of the photo itself
    is_solid = scene.cutout()[1] >= 1
    assert np.abs(without - scene.pixels)[is_solid].max() <= 1


def test_a_shadow_is_a_layer_of_its_own():
    document = moved(shapes.scene("ellipse").document(), MOVES["moved"])
    item = replace(document.objects[0], shadow=Shadow(strength=0.8))
    difference, _, pile = off(replace(document, objects=(item,)))
    assert difference.max() <= OFF
    (shadow,) = [layer for layer in pile if layer.name == "Shadow of Object 1"]
    assert shadow.pixels[..., 3].max() > 60


def test_a_shadow_on_another_thing_is_in_its_layer():
    resting = shapes.scene("disc").document()
    document = edits.set_placement(
        edits.duplicate(resting, 0), 1, Placement(move=(-45.0, 35.0), scale=0.55)
    )
    shaded = edits.set_shadow(document, 1, Shadow(1.0, -40.0, 1.5, 0.1))
    difference, pixels, _ = off(shaded)
    assert difference.max() <= OFF
    plain = composite(document).pixels.astype(int)
    solid = shapes.scene("disc").cutout()[1] >= 1
    darker = (plain - pixels)[solid].mean(-1)
    assert (darker > 20).sum() > 100 and darker.min() > -1
    assert (darker < 1).mean() > 0.4, "beside the shadow it is as it was"
    assert composite(shaded).outside_footprint_changed == 0
    opened = decode_session(encode_session(shaded))
    assert np.array_equal(composite(opened).pixels, pixels)


def test_copies_are_layers_and_what_is_hidden_is_none():
    document = moved(shapes.scene("ellipse").document(), MOVES["moved"])
    copy = replace(document.objects[0], name="Copy", placement=Placement(move=(-22.0, 9.0)))
    both = replace(document, objects=(*document.objects, copy))
    difference, _, pile = off(both)
    assert difference.max() <= OFF
    assert {"Object 1", "Copy"} <= {layer.name for layer in pile}
    hidden = replace(both, objects=(document.objects[0], replace(copy, is_visible=False)))
    difference, _, pile = off(hidden)
    assert difference.max() <= OFF
    assert "Copy" not in {layer.name for layer in pile}


def test_one_that_rests_near_a_moved_one_stays_where_it_is():
    document = shapes.scene("ellipse").document()
    copy = replace(document.objects[0], name="Copy", placement=Placement(move=(12.0, 5.0)))
    difference, _, pile = off(replace(document, objects=(*document.objects, copy)))
    assert difference.max() <= OFF
    names = [layer.name for layer in pile]
    assert "Object 1" in names and "Copy" in names
    assert [layer.name for layer in pile if not layer.is_shown] == [EMPTY] or EMPTY not in names


def test_sixteen_bits_stay_sixteen_and_are_more_exact():
    scene = shapes.scene("ellipse")
    wide = scene.pixels.astype(np.uint16) * np.uint16(257)
    document = scene.document()
    assert document.plate is not None
    plate = replace(document.plate, pixels=document.plate.pixels.astype(np.uint16) * 257)
    photo = Photo(Picture(wide), scene.camera, shapes.png(scene.pixels), "made.png")
    document = moved(replace(document, photo=photo, plate=plate), MOVES["turned"])
    difference, _, pile = off(document)
    assert difference.max() < 0.05
    assert all(layer.pixels.dtype == np.uint16 for layer in pile)


@over("finish", [Finish(opacity=0.4), Finish(exposure=-1.0), Finish(0.7, 0.3, 1.0, 0.5)])
def test_an_object_of_another_finish_is_seen_so_where_it_is_and_in_its_layer(finish):
    """At rest, too: exactly its own pixels change, by the gain and the share that are asked for."""
    scene = shapes.scene("ellipse")
    document = edits.set_finish(scene.document(), 0, finish)
    difference, pixels, pile = off(document)
    assert difference.max() <= OFF
    colour, alpha = scene.cutout()
    inside = cv2.erode((alpha >= 1).astype(np.uint8), np.ones((9, 9))) > 0
    plate = document.plate
    assert plate is not None
    own = np.minimum(colour[inside] * finish.gain, 1)
    grey = own @ [[0.299], [0.587], [0.114]]
    own = np.clip(grey + finish.saturation * (own - grey), 0, 1)
    wanted = 255 * finish.opacity * own + (1 - finish.opacity) * plate.pixels[inside]
    assert np.abs(pixels[inside] - wanted).max() <= OFF
    far = cv2.dilate((alpha > 0).astype(np.uint8), np.ones((41, 41))) == 0
    assert (pixels[far] == scene.pixels[far]).all()
    layer = next(layer for layer in pile if layer.name == "Object 1")
    assert abs(int(layer.pixels[..., 3].max()) - 255 * finish.opacity) <= 1
    moved_too, _, _ = off(moved(document, MOVES["moved"]))
    assert moved_too.max() <= OFF


@over("mode", MODES)
def test_an_object_is_mixed_with_what_is_behind_it(mode):
    """The export is the pile as any paint program mixes it, also over another object."""
    document = shapes.scene("ellipse").document()
    copy = replace(document.objects[0], name="Copy", placement=Placement(move=(22.0, 9.0)))
    document = replace(document, objects=(*document.objects, copy))
    plain, _, _ = off(document)
    document = edits.set_finish(document, 1, Finish(0.8, blend_mode=mode))
    difference, pixels, pile = off(document)
    assert difference.max() <= OFF + 1 and plain.max() <= OFF
    assert [layer.mode for layer in pile if layer.name == "Copy"] == [mode]
    again = decode_session(encode_session(document))
    assert again.objects[1].finish == document.objects[1].finish
    assert np.array_equal(composite(again).pixels, pixels)


def test_sharper_and_softer_is_finer_and_coarser_detail_and_keeps_the_edge():
    """Sharpened, the object's detail is stronger and its silhouette the same; blurred, weaker."""
    document = shapes.scene("ellipse").document()
    alpha = shapes.scene("ellipse").cutout()[1]
    inside = cv2.erode((alpha >= 1).astype(np.uint8), np.ones((15, 15))) > 0

    def seen(finish):
        difference, pixels, pile = off(edits.set_finish(document, 0, finish))
        assert difference.max() <= OFF
        grey = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY).astype(np.float32)
        detail = np.abs(grey - cv2.GaussianBlur(grey, (0, 0), 1.5))[inside].mean()
        return detail, next(layer for layer in pile if layer.name == "Object 1").pixels[..., 3]

    (plain, cover), (sharp, same), (soft, wider) = map(
        seen, (Finish(exposure=1e-6), Finish(sharpness=1.5), Finish(blur=2.0))
    )
    assert sharp > 1.5 * plain and soft < 0.6 * plain
    assert np.array_equal(cover, same) and wider.size > cover.size
