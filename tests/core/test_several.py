"""Scripts with several objects: copies, what is removed, what stays in front, who covers whom."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.rotations import turn_about, turn_matrix, vector_from_matrix
from objectmorpher_core.deform.puppet import puppet_of
from objectmorpher_core.document.model import EditObject
from objectmorpher_core.document.placement import foot_of, gimbal_of
from objectmorpher_core.pipeline import Edited, replay, run_script
from objectmorpher_core.scripting.options import ScriptError
from objectmorpher_core.scripting.script import BatchItem, parse_scripts
from objectmorpher_core.session.file import decode_session, encode_session
from objectmorpher_core.splat_files.meshes.textured import textured_glb
from tests import shapes
from tests.tree import over

pytestmark = pytest.mark.usefixtures("lifted_once")

PARTS = shapes.mask("parts")
LEFT, RIGHT = PARTS.copy(), PARTS.copy()
LEFT[:, 80:] = False
RIGHT[:, :80] = False
PIXELS = shapes.picture(PARTS)
PHOTO = shapes.png(PIXELS)
QUICK = {"gaussians": 300, "trust": 0, "inpaint": "telea"}
SMALL = {"gaussians": 300, "trust": 0}  # of a further object


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("masks")
    (path / "left.png").write_bytes(shapes.mask_png(LEFT))
    (path / "right.png").write_bytes(shapes.mask_png(RIGHT))
    return path


def _item(**script) -> BatchItem:
    (item,) = parse_scripts(json.dumps(QUICK | script))
    return item


def _run(item: BatchItem) -> Edited:
    mask = shapes.mask_png(LEFT)
    return run_script(PHOTO, "made.png", item.script, mask, others=item.others)


def _exact(edited: Edited) -> None:
    """Outside the footprint every value is the photo's."""
    away = ~edited.composite.footprint
    assert away.any() and edited.composite.changed > 0
    assert np.array_equal(edited.picture.pixels[away], PIXELS[away])
    assert edited.composite.outside_footprint_changed == 0


def test_a_copy_is_spun_as_what_it_is_a_copy_of_stands():
    copies = [{"duplicate": 1, "spin": 30, "move": [60, 20]}]
    edited = _run(_item(**{"seen-from": 50}, objects=copies))
    _, copy = edited.document.objects
    assert copy.seen_from == 50.0
    down = gimbal_of(copy, edited.document).down
    matrix = turn_matrix(*copy.placement.turn)
    np.testing.assert_allclose(matrix @ down, down, atol=1e-9)
    assert np.degrees(turn_about(vector_from_matrix(matrix), down)) == pytest.approx(30)


@pytest.mark.slow
def test_each_object_does_as_it_is_told_alone(folder):
    """Two edits that do not touch are the two edits by themselves, each on its side."""
    right = SMALL | {"mask": str(folder / "right.png"), "turn": [20, 0, 0]}
    both = _run(_item(move=[-6, 5], objects=[right]))
    _exact(both)
    assert len(both.document.objects) == 2
    left_alone = _run(_item(move=[-6, 5]))
    sides = both.picture.pixels, left_alone.picture.pixels
    assert (sides[0][:, 90:] != PIXELS[:, 90:]).any()
    difference = np.abs(sides[0][:, :70].astype(int) - sides[1][:, :70])
    assert difference.max() <= 1, "the plate is another one, no pixel of the object is"


@pytest.mark.slow
def test_an_object_is_the_same_whichever_comes_first(folder):
    """The list says who covers whom only where nothing else does."""
    one, two = {"move": [6, 5]}, {"turn": [20, 0, 0]}
    right = SMALL | {"mask": str(folder / "right.png")}
    first = _run(_item(**one, objects=[right | two]))
    other = _item(**two, objects=[SMALL | {"mask": str(folder / "left.png")} | one])
    second = run_script(PHOTO, "a.png", other.script, shapes.mask_png(RIGHT), others=other.others)
    assert np.array_equal(first.picture.pixels, second.picture.pixels)


def test_a_copy_has_what_it_is_not_told_from_its_original():
    copy = {"duplicate": 1, "move": [60, 20]}
    edited = _run(_item(turn=[10, 0, 0], scale=0.8, floating=True, objects=[copy]))
    _exact(edited)
    own, copy = edited.document.objects
    assert copy.lifted is own.lifted and copy.mask is own.mask
    assert (copy.placement.turn, copy.placement.scale) == (own.placement.turn, 0.8)
    assert copy.placement.move == (60.0, 20.0) and own.placement.move == (0.0, 0.0)
    assert [o["role"] for o in edited.report()["objects"]] == ["edited", "copy"]


@pytest.mark.slow
def test_beside_a_copy_the_original_keeps_its_bytes():
    edited = _run(_item(objects=[{"duplicate": 1, "move": [0, 62], "scale": 0.5}]))
    _exact(edited)
    above = edited.picture.pixels[:60]
    assert np.array_equal(above[LEFT[:60]], PIXELS[:60][LEFT[:60]])
    assert edited.document.plate is not None


@pytest.mark.slow
def test_a_copy_can_be_bent_otherwise():
    bend = [{"at": [45, 55], "to": [60, 45]}]
    edited = _run(_item(objects=[{"duplicate": 1, "move": [60, 30], "handle": bend}]))
    own, copy = edited.document.objects
    assert own.pose is None and copy.pose is not None
    told = edited.report()["objects"]
    assert told[0]["handles"] == [] and told[1]["handles"][0]["error_px"] < 1.0
    assert told[1]["energy"]["iterations"] > 0


@over("place", [{"move": [9, 4, 0.2]}, {"turn": [20, 0, 8]}, {"spin": 30, "move": [5, 5]}])
def test_what_is_scaled_stands_where_it_stood_and_what_floats_keeps_its_centre(place):
    """Wherever it is. A copy has the size that it is told, on the foot of its original."""
    copies = [{"duplicate": 1, "scale": 0.5}, {"duplicate": 1, "scale": 1}]
    (large,) = _run(_item(**place)).document.objects
    edited = _run(_item(scale=0.7, objects=copies, **place))
    assert [item.placement.scale for item in edited.document.objects] == [0.7, 0.5, 1]
    foot = _foot(large, edited)
    for item in edited.document.objects:
        assert item.lifted is not None and item.lifted.stands
        np.testing.assert_allclose(_foot(item, edited), foot, atol=1e-9)
    (large,) = _run(_item(floating=True, **place)).document.objects
    (small,) = _run(_item(floating=True, scale=0.7, **place)).document.objects
    assert small.placement == replace(large.placement, scale=0.7)


def _foot(item: EditObject, edited: Edited) -> F64:
    """(3,) world: of what it stands on."""
    lifted = item.lifted
    assert lifted is not None
    points, down = lifted.world_points(lifted.body.means), gimbal_of(item, edited.document).down
    return foot_of(item.placement, points, lifted, edited.document.photo.camera, down)


def test_a_further_object_may_have_its_shape_from_a_file(folder):
    """The camera is the one in which the first was lifted."""
    lone = _run(_item(move=[5, 0])).document
    item = lone.objects[0]
    path = folder / "left.glb"
    path.write_bytes(textured_glb(item, puppet_of(item, lone.photo.camera)))
    right = SMALL | {"mask": str(folder / "right.png"), "splats": str(path), "move": [2, 0]}
    edited = _run(_item(move=[5, 0], objects=[right]))
    _exact(edited)
    assert edited.document.photo.camera == lone.photo.camera
    assert edited.document.objects[1].lifted is not None


def test_what_is_removed_shows_what_is_behind_it():
    edited = _run(_item(remove=True))
    _exact(edited)
    plate = edited.document.plate
    assert plate is not None
    x0, y0, x1, y1 = plate.box
    inside = LEFT[y0:y1, x0:x1]
    assert np.array_equal(edited.picture.pixels[y0:y1, x0:x1][inside], plate.pixels[inside])


def test_one_plate_is_without_all_of_them(folder):
    right = SMALL | {"mask": str(folder / "right.png"), "remove": True}
    edited = _run(_item(remove=True, objects=[right]))
    _exact(edited)
    plate = edited.document.plate
    assert plate is not None
    hole = np.zeros_like(PARTS)
    hole[plate.box[1] : plate.box[3], plate.box[0] : plate.box[2]] = plate.hole
    assert hole[PARTS].all()


@pytest.mark.parametrize("order", [[1, 2], [2, 1]])
def test_the_order_says_who_covers_whom(folder, order):
    right = SMALL | {"mask": str(folder / "right.png"), "move": [-35, -5]}
    edited = _run(_item(move=[30, 5], objects=[right], order=order))
    _exact(edited)
    drawn = [edited.document.objects.index(thing.item) + 1 for thing in edited.composite.moved]
    assert drawn == order


@pytest.mark.slow
def test_what_stays_in_front_keeps_its_bytes(folder):
    stays = {"mask": str(folder / "right.png"), "stay_in_front": True}
    edited = _run(_item(move=[62, 8, -0.4], objects=[stays]))
    _exact(edited)
    item = edited.document.objects[1]
    assert item.stays_in_front and item.lifted is None and item.matte is not None
    x0, y0, x1, y1 = item.matte.box
    whole = item.matte.alpha >= 1
    own = edited.picture.pixels[y0:y1, x0:x1], PIXELS[y0:y1, x0:x1]
    assert whole.any() and np.array_equal(own[0][whole], own[1][whole])
    by_option = _run(_item(move=[62, 8, -0.4], front_mask=str(folder / "right.png")))
    assert np.array_equal(by_option.picture.pixels, edited.picture.pixels)
    before = _run(_item(move=[62, 8, -0.4], objects=[stays], order=[2, 1]))
    assert (before.picture.pixels != edited.picture.pixels).any()


@pytest.mark.slow
def test_a_session_of_several_is_replayed_to_the_byte(folder):
    right = SMALL | {"mask": str(folder / "right.png"), "move": [-25, 0]}
    objects = [right, {"duplicate": 2, "turn": [20, 0, 0], "move": [-50, 30]}]
    edited = _run(_item(move=[10, 5], objects=objects, order=[3, 1, 2], refine="harmonise"))
    again = replay(decode_session(encode_session(edited.document)))
    assert np.array_equal(again.picture.pixels, edited.picture.pixels)
    assert [o["number"] for o in again.report()["objects"]] == [1, 2, 3]


@pytest.mark.slow
def test_the_keys_of_one_object_are_those_of_the_first():
    one = _run(_item(move=[6, 5])).report()
    assert "objects" not in one
    several = _run(_item(move=[6, 5], objects=[{"duplicate": 1, "move": [60, 30]}])).report()
    assert set(several) == set(one) | {"objects"}
    for key in ("object", "handles", "energy"):
        assert several[key] == several["objects"][0][key] == one[key]


BAD = {
    "a further object that is none": ({"objects": [3]}, "object 2: it is not a JSON object"),
    "objects that are no list": ({"objects": {}}, "the script's 'objects' are not a list"),
    "an unknown key": ({"objects": [{"colour": 3}]}, "object 2: there is no option 'colour'"),
    "a wrong value": ({"objects": [{"duplicate": 1}, {"scale": "x"}]}, "object 3: scale: 'x'"),
    "a copy of a later one": ({"objects": [{"duplicate": 2}]}, "object 2: duplicate: 2 is not"),
    "a copy chosen anew": (
        {"objects": [{"duplicate": 1, "click": [[1, 2]]}]}, "object 2: 'click' is nothing that a",
    ),
    "a front that moves": (
        {"objects": [{"stay_in_front": True, "move": [1, 2]}]}, "object 2: 'move' is nothing that",
    ),
    "a camera of its own": ({"objects": [{"fov": 50}]}, "object 2: 'fov' is of the whole photo"),
    "a fill of its own": (
        {"objects": [{"fill_from": [{"source": [1, 2], "to": [3, 4]}]}]},
        "object 2: 'fill_from' is of the whole photo",
    ),
    "an order of what is not there": ({"order": [1, 2]}, "order: 2 is not a whole number from 1"),
    "one twice in the order": ({"order": [1, 1]}, "order: an object stands there twice"),
}  # fmt: skip


@over("case", BAD)
def test_what_makes_no_sense_is_one_sentence_with_its_number(case):
    script, sentence = BAD[case]
    with pytest.raises(ScriptError) as caught:
        _item(**script)
    assert str(caught.value).startswith(sentence)
    assert "\n" not in str(caught.value)


FAILING = {
    "nothing chosen": ([{"move": [1, 2]}], "object 2: no object is chosen"),
    "a handle beside it": (
        [{"duplicate": 1, "handle": [{"at": [2, 2], "to": [3, 3]}]}], "object 2: handle 2,2",
    ),
    "no such lifter": ([{"lift": "magic", "click": [[1, 1]]}], "object 2: there is no lifter"),
    "behind the camera": ([{"duplicate": 1, "move": [0, 0, -99]}], "object 2: a depth of -99"),
}  # fmt: skip


@pytest.mark.parametrize("case", FAILING)
def test_what_fails_says_which_object(case):
    objects, sentence = FAILING[case]
    with pytest.raises(ScriptError, match=sentence):
        _run(_item(objects=objects))


def test_a_click_says_what_stays_in_front():
    edited = _run(_item(move=[62, 8, -0.4], front=[[115, 65]], segment="grabcut"))
    _exact(edited)
    item = edited.document.objects[1]
    assert item.name == "Front 1" and item.stays_in_front and item.mask is not None
    assert (item.mask & RIGHT).sum() > 0.7 * (item.mask | RIGHT).sum()
    with pytest.raises(ScriptError, match="front 1: "):
        _run(_item(front=[[-5, 2]], segment="grabcut"))


def test_a_copy_takes_light_and_shadow_from_its_original_unless_it_says_so():
    copies = [
        {"duplicate": 1, "move": [60, 20]},
        {"duplicate": 1, "move": [0, 40], "refine": "none"},
    ]
    edited = _run(_item(move=[5, 5], refine="harmonise", shadow="none", objects=copies))
    own, copy, plain = edited.document.objects
    assert own.harmony == copy.harmony > 0 == plain.harmony
    assert [item.shadow.strength for item in (own, copy, plain)] == [0, 0, 0]
