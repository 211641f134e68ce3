"""Another object is chosen where it is seen: by a click in Pose, by a click or a drag in Place."""

from __future__ import annotations

import numpy as np
import pytest

from editor_steps import duplicate
from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import ToolName
from objectmorpher.tools.pointer import Button, Pointer, PointerShape
from objectmorpher.tools.registry import TOOLS, Tool
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document

FIRST, BOTH, SECOND, BESIDE = (75.0, 100.0), (115.0, 75.0), (155.0, 72.0), (12.0, 12.0)  # px
LEFT = (-40.0, -10.0)  # px that the objects are moved


@pytest.fixture
def two(editor: Editor, ball: Document) -> Editor:
    """The ball, and before it a copy that was moved to the right; the ball is current."""
    duplicate(editor, ball, 50.0, 0.0)
    editor.objects.choose(0)
    return editor


def tool_of(editor: Editor) -> Tool:
    return TOOLS[editor.view.tool]


def hover(editor: Editor, place: tuple[float, float]) -> PointerShape:
    return tool_of(editor).hover(editor, Pointer(*editor.view.canvas_from_image(np.array(place))))


def press(editor: Editor, *places: tuple[float, float], is_released: bool = True) -> None:
    """Presses at the first of these image px, goes through the others, and lets go."""
    canvas = [editor.view.canvas_from_image(np.array(place)) for place in places]
    hover(editor, places[0])
    pointer = Pointer(*canvas[0], button=Button.LEFT, is_down=True)
    editor.hand.press(tool_of(editor).press(editor, pointer), Button.LEFT)
    for at in canvas[1:]:
        editor.hand.move(Pointer(*at, is_down=True))
    if is_released:
        editor.hand.move(Pointer(*canvas[-1], is_down=False))


def test_the_topmost_is_found_and_nothing_where_the_current_one_is(two: Editor) -> None:
    def found(place: tuple[float, float]) -> int | None:
        return two.objects.other_at(two.view.canvas_from_image(np.array(place)))

    assert [found(place) for place in (FIRST, BOTH, SECOND, BESIDE)] == [None, 1, 1, None]
    two.objects.choose(1)
    assert [found(place) for place in (FIRST, BOTH, SECOND, BESIDE)] == [0, None, None, None]
    run(two, "to_back")
    assert [found(place) for place in (FIRST, BOTH, SECOND, BESIDE)] == [0, 0, None, None]


def test_what_is_hidden_cannot_be_pointed_at(two: Editor) -> None:
    two.objects.toggle_visible(1)
    hover(two, SECOND)
    assert two.hover.other is None


def test_a_copy_that_lies_over_the_current_one_does_not_take_the_pointer(
    editor: Editor, ball: Document
) -> None:
    editor.start(edits.duplicate(ball, 0))
    editor.objects.choose(0)
    editor.view.tool = ToolName.PLACE
    press(editor, FIRST, (FIRST[0] + LEFT[0], FIRST[1] + LEFT[1]))
    assert editor.current == 0
    assert editor.object is not None and not editor.object.placement.is_identity


@pytest.mark.parametrize("tool", [ToolName.PLACE, ToolName.POSE])
def test_a_click_chooses_it_and_is_no_step(two: Editor, tool: ToolName) -> None:
    two.choose_tool(tool)
    before = two.document
    assert hover(two, SECOND) is (
        PointerShape.MOVE if tool is ToolName.PLACE else PointerShape.HAND
    )
    assert two.hover.other == 1
    assert "chooses this object" in tool_of(two).hint(two)
    press(two, SECOND)
    assert two.current == 1
    assert two.document is before
    assert two.view.tool is tool
    hover(two, SECOND)
    assert two.hover.other is None


def test_a_drag_in_place_moves_what_is_under_the_pointer(two: Editor) -> None:
    before = two.document
    assert before is not None and two.document is not None
    press(two, SECOND, (SECOND[0] + LEFT[0], SECOND[1] + LEFT[1]))
    assert two.current == 1
    assert two.document.objects[0] is before.objects[0]
    move = two.document.objects[1].placement.move
    assert 5 < move[0] < 20 and -15 < move[1] < -5, "a near point moves farther in the picture"
    assert two.history is not None and two.history.undo_label == "Move object"
    two.objects.choose(0)
    two.undo()
    assert two.document is before
    assert two.current == 1, "the tools follow what the step had changed"
    two.redo()
    assert two.document.objects[1].placement.move == move


def test_escape_gives_the_object_back_that_was_current(two: Editor) -> None:
    before = two.document
    press(two, SECOND, (SECOND[0] + LEFT[0], SECOND[1]), is_released=False)
    assert (two.current, two.document is before) == (1, False)
    two.escape()
    assert (two.current, two.document) == (0, before)


def test_a_drag_in_pose_from_another_object_draws_a_box(two: Editor) -> None:
    two.choose_tool(ToolName.POSE)
    press(two, FIRST)
    press(two, SECOND, (60.0, 120.0))
    assert two.current == 0
    assert two.posing.selected == (0,)
    assert two.object is not None and len(two.object.handles) == 1


def test_handles_of_the_current_object_come_before_others(two: Editor) -> None:
    two.choose_tool(ToolName.POSE)
    two.objects.choose(1)
    press(two, BOTH)
    two.objects.raise_by(-1, "Send backward")
    hover(two, BOTH)
    assert two.hover.other is None
    assert two.hover.handle == 0
