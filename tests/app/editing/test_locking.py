"""A locked object is not changed by a slip: not by a stroke, a field, a command or a job."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from editor_steps import CENTRE, duplicate
from objectmorpher.commands import run, why_not
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import ToolName
from objectmorpher.gui.window.input import _is_locked
from objectmorpher.tools.pointer import Pointer
from objectmorpher_core.document import edits, hold_edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.document.settings import Finish
from objectmorpher_core.session.file import decode_session, encode_session


@pytest.fixture
def locked(editor: Editor, ball: Document) -> Iterator[Editor]:
    """The ball, locked, and a copy of it at the left, which is free."""
    duplicate(editor, ball, -60.0, 0.0)
    editor.current = 0
    run(editor, "lock")
    return editor


def test_nothing_changes_it_but_its_name_and_whether_it_is_seen(locked: Editor) -> None:
    editor, before = locked, locked.committed
    assert before is not None and editor.object is not None and editor.object.is_locked
    editor.placing.move_to(Placement(move=(9.0, 0.0)))
    assert editor.preview is None
    editor.commit("Move object")
    editor.composing.preview_finish(Finish(opacity=0.5))
    editor.commit("Look of object")
    for name in ("grow", "keep_in_front", "shadow", "reset_pose", "remove_object"):
        run(editor, name)
    assert editor.committed is before
    assert "locked" in editor.message.text
    editor.objects.rename(0, "Moon")
    editor.objects.toggle_visible(0)
    item = editor.object
    assert (item.name, item.is_visible, item.is_locked) == ("Moon", False, True)
    again = decode_session(encode_session(editor.committed))
    assert [o.is_locked for o in again.objects] == [True, False]


def test_a_hidden_one_is_not_moved_unseen(locked: Editor) -> None:
    """What moves it is greyed out; its look and its outline may be changed."""
    editor = locked
    editor.objects.choose(1)
    editor.view.tool = ToolName.PLACE
    assert editor.why_held is None and why_not(editor, "reset_place") is None
    editor.objects.toggle_visible(1)
    hidden = f"{editor.chosen.name} is hidden"
    for name in ("reset_place", "reset_position", "reset_pose", "reset_handles"):
        assert why_not(editor, name) == hidden
    for tool in ToolName:
        editor.view.tool = tool
        is_moving = tool in (ToolName.POSE, ToolName.PLACE)
        assert editor.why_held == (hidden if is_moving else None)
    editor.objects.say_hidden(1)
    editor.objects.toggle_visible(1)
    assert why_not(editor, "reset_place") is None
    assert editor.message is None, "its button would hide it again"


def test_it_cannot_be_pointed_at_and_the_others_can_be_changed(locked: Editor) -> None:
    editor = locked
    editor.view.tool = ToolName.PLACE
    at = Pointer(*editor.view.canvas_from_image(CENTRE), is_down=True)
    assert _is_locked(editor, at)
    editor.objects.choose(1)
    assert not _is_locked(editor, at) and editor.objects.other_at(at.xy) is None
    editor.placing.move_to(Placement(move=(-50.0, 5.0)))
    editor.commit("Move object")
    assert editor.object.placement.move == (-50.0, 5.0)


def test_key_poses_are_kept_and_shown_of_the_others(locked: Editor) -> None:
    """What is locked stays in its place, and does not keep them from theirs."""
    editor = locked
    editor.objects.choose(1)
    places = [editor.object.placement.move, (-50.0, 5.0)]
    editor.keying.add()
    editor.placing.move_to(Placement(move=places[1]))
    editor.commit("Move object")
    editor.keying.add()
    assert editor.keying.count == 2 and editor.keying.shown == 1
    assert editor.message is not None and editor.message.text == "Key pose 2 is kept"
    editor.message = None
    for number in (0, 1):
        editor.keying.step(1)
        assert editor.keying.shown == number and editor.object.placement.move == places[number]
        assert editor.message is None
    editor.keying.replace()
    editor.lock(0)
    document = edits.set_placement(editor.committed, 0, Placement(move=(9.0, 0.0)))
    editor.apply("Move object", document)
    editor.lock(0)
    editor.keying.show(0)
    moves = [item.placement.move for item in editor.committed.objects]
    assert moves == [(9.0, 0.0), places[0]]
    assert "locked" in editor.message.text and editor.message.action is not None
    steps = editor.history.steps
    editor.keying.show(0)
    editor.keying.remove()
    assert editor.history.steps == (*steps, "Remove key pose 1") and editor.keying.count == 1


def test_its_button_unlocks_it_and_undo_covers_both(locked: Editor) -> None:
    editor, before = locked, locked.committed
    run(editor, "remove_object")
    assert editor.message is not None and editor.message.action is not None
    editor.message.action.run()
    assert not editor.object.is_locked
    run(editor, "undo")
    assert editor.committed is before
    run(editor, "undo")
    assert not editor.object.is_locked
    assert hold_edits.locked_change(before, edits.remove_object(before, 0)) is before.objects[0]
