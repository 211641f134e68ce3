"""An edit script written as JSON is read as what it was."""

from __future__ import annotations

import json

import pytest

from objectmorpher_core.scripting.options import EditScript
from objectmorpher_core.scripting.script import BatchItem, parse_scripts, script_text

SCRIPTS = (
    {},
    {"photo": "a.png", "out": "b.png", "click": [[1, 2], [3, 4.5]], "subject": True, "seed": 0},
    {"handle": [{"at": [1, 2], "to": [3, 4], "dz": -0.5}], "pin": [[0, 0]], "stiffness": 2},
    {"fill_from": [{"source": [1, 2], "to": [3, 4]}], "move": [1, 2], "box": [0, 0, 9, 9]},
    {"fill-from": [{"source": [1, 2], "to": [3, 4], "radius": 5}], "shadow": "none", "fov": 40},
    {"objects": [{"mask": "m.png", "stiffness": 1.0}, {"duplicate": 1, "turn": [1, 2, 3]},
                 {"click": [[5, 5]], "stay_in_front": True}], "order": [3, 1, 2, 4]},
)  # fmt: skip


@pytest.mark.parametrize("script", SCRIPTS)
def test_what_is_written_is_read_as_it_was(script: dict) -> None:
    (item,) = parse_scripts(json.dumps(script))
    assert parse_scripts(script_text(item)) == (item,)
    assert parse_scripts("\ufeff" + json.dumps(script)) == (item,), "marked as UTF-8"


def test_defaults_are_not_written() -> None:
    assert script_text(BatchItem(EditScript())) == "{}"
