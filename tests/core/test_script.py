"""The edit script: JSON and back, and one sentence for everything that is wrong."""

from __future__ import annotations

import json
from dataclasses import fields

import pytest

from objectmorpher_core.api import Shape
from objectmorpher_core.document.settings import Finish
from objectmorpher_core.scripting.options import (
    FINISH,
    OPTIONS,
    PARTS,
    SHAPE,
    EditScript,
    HandleMove,
    ScriptError,
    options_of,
    script_from,
)
from objectmorpher_core.scripting.script import BatchItem, parse_scripts

FULL = {
    "key": [{"turn": [5.0, 0.0, 0.0], "pin": [[1.0, 2.0]]}, {}],
    "click": [[1, 2], [3.5, 4]], "not-click": [[5, 6]], "box": [1, 2, 30, 40], "subject": True,
    "mask": "m.png", "segment": "grabcut", "lift": "relief", "inpaint": "telea", "refine": "none",
    "splats": "s.ply", "gaussians": 500, "pin": [[7, 8]],
    "handle": [{"at": [1, 2], "to": [3, 4], "dz": -0.5}, {"at": [5, 6], "to": [7, 8]}],
    "move": [1, -2, 0.5], "turn": [10, 20, 30], "spin": -15.0,
    "seen-from": 40.0, "scale": 1.5, "deform": "laplacian",
    "links": "euclidean", "faithful": True, "nodes": 300, "stiffness": 0.5, "stretch-limit": 1.5,
    "split": True, "shadow": "none", "fov": 60, "seed": 7,
    "flip": True, "thickness": 0.5, "back": "mirrored", "symmetry": "no", "floating": True,
    "shape": "box", "trust": 0.5, "no-depth": True, "hidden": "h.png", "front": [[9, 9]],
    "front-mask": "f.png", "remove": True, "refine-strength": 0.5, "decontaminate": 0.5,
    "opacity": 0.5, "exposure": -1.0, "warmth": 0.25, "saturation": 0.5, "sharpness": 1.5,
    "blur": 2.0, "blend-mode": "soft light",
    "more-views": [{"photo": "b.png", "at": [3, 4]}, {"photo": "c.png"}],
    "fill-from": [{"source": [1, 2], "to": [3, 4], "radius": 5}, {"source": [1, 2], "to": [3, 4]}],
}  # fmt: skip


def test_every_option_has_a_place():
    keys = {name.replace("_", "-") for name in EditScript.__dataclass_fields__}
    assert keys == set(FULL)
    script = script_from(FULL)
    assert all(
        getattr(script, name) != getattr(EditScript(), name)
        for name in EditScript.__dataclass_fields__
    )


def test_the_parts_of_an_edit_are_those_of_the_document_and_the_library():
    assert options_of(FINISH) == {field.name for field in fields(Finish)}
    assert options_of(SHAPE) == set(Shape.__annotations__)
    assert set().union(*(options_of(part) for part in PARTS)) == set(OPTIONS)


def test_a_script_in_a_file_says_the_same():
    (item,) = parse_scripts(json.dumps(FULL))
    assert item == BatchItem(script_from(FULL))


def test_places_to_fill_from_may_be_those_of_another_script():
    places = script_from(FULL).fill_from
    assert len(places) == 2 and script_from({"fill_from": list(places)}).fill_from == places


def test_a_move_without_depth_stays_at_its_depth():
    assert script_from({"move": [3, 4]}).move == (3.0, 4.0, 0.0)


def test_a_turn_of_one_number_is_a_yaw():
    assert script_from({"turn": 25}) == script_from({"turn": [25]}) == EditScript(turn=(25, 0, 0))


def test_a_handle_without_depth_keeps_its_depth():
    script = script_from({"handle": [{"at": [1, 2], "to": [3, 4]}]})
    assert script.handle == (HandleMove((1.0, 2.0), (3.0, 4.0), 0.0),)


def test_what_is_said_later_wins_even_where_it_is_the_default():
    file = script_from({"move": [1, 2], "scale": 2, "seed": 3})
    merged = file.merged(EditScript(scale=0.5), ("scale", "seed"))
    assert (merged.move, merged.scale, merged.seed) == ((1.0, 2.0, 0.0), 0.5, 0)


def test_a_batch_names_photos_and_outputs():
    items = parse_scripts('[{"photo": "a.png", "out": "b.png", "scale": 2}, {"photo": "c.png"}]')
    assert [(i.photo, i.out) for i in items] == [("a.png", "b.png"), ("c.png", None)]
    assert items[0].script.scale == 2


@pytest.mark.parametrize(("text", "sentence"), [
    ("{", "not JSON"),
    ("", "not JSON"),
    ("[]", "empty"),
    ("3", "not a JSON object"),
    ("[[]]", "not a JSON object"),
    ('{"photo": 3}', "'photo' is not a file name"),
    ('{"clik": [[1, 2]]}', "no option 'clik', did you mean click?"),
])  # fmt: skip
def test_what_is_no_script_is_refused(text, sentence):
    with pytest.raises(ScriptError, match=sentence):
        parse_scripts(text)


@pytest.mark.parametrize(("key", "value"), [
    ("click", [1, 2]), ("click", [[1]]), ("click", "1,2"), ("box", [1, 2, 3]), ("subject", 1),
    ("mask", ""), ("mask", 3), ("segment", None), ("gaussians", 99), ("gaussians", 1e5),
    ("gaussians", True), ("handle", [[1, 2]]), ("handle", [{"at": [1, 2]}]),
    ("handle", [{"at": [1, 2], "to": [1, 2], "dx": 1}]), ("move", [1]), ("move", [1, 2, 3, 4]),
    ("turn", [1, 2, 3, 4]), ("turn", [1, 2, "3"]), ("turn", "25"), ("turn", True),
    ("scale", "2"), ("scale", 0), ("scale", float("inf")), ("scale", float("nan")),
    ("deform", "jelly"), ("links", None), ("faithful", "yes"),
    ("nodes", 3), ("nodes", 5000), ("nodes", 1.5), ("stiffness", 9),
    ("fill-from", [[1, 2]]), ("fill-from", [{"source": [1, 2]}]),
    ("fill-from", [{"source": [1, 2], "to": [3, 4], "radius": 0}]),
    ("shadow", "dark"), ("fov", True), ("seed", -1), ("seed", 1.5), ("seed", 2**40),
])  # fmt: skip
def test_wrong_values_are_refused_with_the_option_and_the_value(key, value):
    with pytest.raises(ScriptError, match=f"^{key}: ") as caught:
        script_from({key: value})
    assert "\n" not in str(caught.value)
