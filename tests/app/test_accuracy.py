"""The dragged point of the surface stays under the cursor, on photos, at every zoom."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from editor_steps import open_file, wait_for_jobs
from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.settings import Backends, Settings
from objectmorpher.editor.view import ToolName
from objectmorpher.system.resources import resource
from objectmorpher.tools.registry import TOOLS
from strokes import move, press, release

pytestmark = pytest.mark.slow

OBJECTS = {"astronaut": (224, 150), "coffee": (300, 215), "chelsea": (200, 150)}  # clicks, px
ZOOMS = (0.6, 1.7, 6.0)  # canvas px per px of the photo
POINTS = 8
FARTHEST = 90.0  # canvas px that a point is dragged
PIXEL = 1.0  # canvas px


@pytest.fixture(scope="module")
def own_editor() -> Iterator[Editor]:
    # What is behind the objects does not matter here: it is filled in a moment.
    editor = Editor(Settings(backends=Backends(inpaint="telea")))
    editor.view.resize((1092, 840), 1.0, None)
    yield editor
    editor.shut_down()


@pytest.mark.parametrize("name", OBJECTS)
def test_a_dragged_point_stays_under_the_cursor(own_editor: Editor, name: str) -> None:
    editor = own_editor
    open_file(editor, resource(f"assets/samples/{name}.jpg"))
    wait_for_jobs(editor)
    editor.selection.add_click(*OBJECTS[name], True)
    wait_for_jobs(editor)
    run(editor, "lift")
    wait_for_jobs(editor)
    assert editor.is_lifted, editor.message
    random, gaps = np.random.default_rng(5), []
    for zoom in ZOOMS:
        for _ in range(POINTS):
            start = _look_at_a_point(editor, zoom, random)
            cursor = start + random.uniform(-FARTHEST, FARTHEST, 2)
            gaps.append(_drag(editor, start, cursor))
            editor.undo()
            assert editor.object is not None and not editor.object.handles
    print(f"{name}: at most {max(gaps):.2g} px of {len(gaps)} drags")
    assert max(gaps) <= PIXEL


def _look_at_a_point(editor: Editor, zoom: float, random: np.random.Generator) -> np.ndarray:
    """Zooms to a random point of the object's surface; where it is, canvas px."""
    assert editor.mask is not None and editor.photo_size is not None
    inside = np.argwhere(editor.mask)[:, ::-1]
    while True:
        place = inside[random.integers(len(inside))] + 0.5
        editor.view.fit(editor.photo_size)
        editor.view.set_zoom(zoom, tuple(editor.view.canvas_from_image(place)), editor.photo_size)
        at = editor.view.canvas_from_image(place)
        if editor.posing.surface_at(at) is not None:
            return at


def _drag(editor: Editor, start: np.ndarray, cursor: np.ndarray) -> float:
    """Canvas px between the cursor and where the pressed point of the surface is seen then."""
    seen = editor.posing.surface_at(start)
    assert seen is not None
    press(editor, TOOLS[ToolName.POSE], start)
    move(editor, *(start + share * (cursor - start) for share in (0.3, 0.7, 1.0)))
    during = _picture_of(editor, seen.rest)
    release(editor, cursor)
    after = _picture_of(editor, seen.rest)
    return max(float(np.linalg.norm(at - cursor)) for at in (during, after))


def _picture_of(editor: Editor, rest: np.ndarray) -> np.ndarray:
    """Canvas px at which a point of the rest surface is seen now."""
    document, thing = editor.document, editor.object
    assert document is not None and thing is not None
    puppet = editor.derived.shape(document.photo, thing).puppet
    return editor.view.canvas_from_image(puppet.picture_of(rest, thing.pose, thing.placement))
