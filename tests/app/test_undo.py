"""Undo covers everything that changes an edit: every command, and every control of every panel."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from editor_steps import not_lifted, wait_for_jobs, wait_until
from hands import PATIENCE, ROOT
from objectmorpher.commands import COMMANDS, GROUPS, run, why_not
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import Painted, ToolName
from objectmorpher.tools.brush_tools import ComposeTool, MaskTool
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from strokes import stroke
from tests.tree import PYTHONPATH

ELSEWHERE = {  # not about an edit
    "undo", "redo", "quit", "close", "revert", "open", "paste", "new_tab", "next_tab",
    "previous_tab",
}  # fmt: skip
CHANGING = {  # commands of which a change is known: nobody may forget to look
    "grow", "shrink", "smooth", "feather", "remove_handle", "reset_handle",
    "reset_handles", "reset_pose", "reset_place", "reset_position", "reset_turn", "reset_size",
    "ground", "duplicate", "remove_object", "take_out", "forward", "shadow", "decontaminate",
    "to_front",
}  # fmt: skip
ALIKE = {"shrink", "smooth", "feather"}  # as "grow": a shape that follows the mask takes seconds


def worked_on(ball: Document) -> Document:
    """The ball bent by a handle, held by a pin, turned and moved; a copy of it lies beside."""
    lifted = ball.objects[0].lifted
    assert lifted is not None
    first, second = lifted.control_points[0], lifted.control_points[-1]
    document = edits.add_handle(ball, 0, first, first + 0.1)
    document = edits.add_handle(document, 0, second, is_pin=True)
    document = edits.set_placement(
        document, 0, Placement(move=(20.0, -4.0), turn=(10.0, 0.0, 0.0), scale=0.9)
    )
    document = edits.duplicate(document, 0)
    return edits.set_placement(document, 1, Placement(move=(-45.0, 6.0)))


@pytest.fixture
def quick_fills(editor: Editor) -> Iterator[None]:
    """What is behind objects is filled in a moment: what it looks like does not matter here."""
    settings = editor.settings
    editor.settings = replace(settings, backends=replace(settings.backends, inpaint="telea"))
    yield
    editor.settings = settings


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fills")
def test_every_command_that_changes_the_edit_is_one_step_that_undo_takes_back(
    editor: Editor, ball: Document
) -> None:
    document, bare, changing = worked_on(ball), not_lifted(ball), set()
    tools = {"Pose": ToolName.POSE, "Place": ToolName.PLACE, "Compose": ToolName.COMPOSE}
    for group, commands in GROUPS.items():
        for name in commands:
            if name in ELSEWHERE or "…" in COMMANDS[name].label:
                continue
            editor.start(bare if name in ALIKE else document)
            editor.current, editor.view.tool = 0, tools.get(group, ToolName.SELECT)
            editor.posing.select(0)
            wait_for_jobs(editor)
            before = editor.committed
            if why_not(editor, name) is not None:
                continue
            run(editor, name)
            wait_for_jobs(editor)
            assert editor.preview is None, name
            after, history = editor.committed, editor.history
            if after is before:
                continue
            changing.add(name)
            assert history is not None
            assert history.cursor == 1, (name, history.steps)
            run(editor, "undo")
            wait_for_jobs(editor)
            assert editor.committed is before, name
            run(editor, "redo")
            wait_for_jobs(editor)
            assert editor.committed is after, name
    assert changing >= CHANGING, CHANGING - changing


def test_a_snapshot_is_gone_back_to_as_a_step(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    editor.placing.move_to(Placement(move=(9.0, 0.0)))
    editor.commit("Move object")
    moved = editor.committed
    run(editor, "snapshot")
    editor.keep_snapshot("To the left ")
    assert editor.history is not None
    names = [step.label for step in editor.history.snapshots]
    assert names == ["Snapshot 1", "To the left"]
    run(editor, "undo")
    editor.take_snapshot("Snapshot 1")
    assert editor.committed is moved
    run(editor, "undo")
    assert editor.committed is ball


@pytest.mark.parametrize("kind", ["edge", "selection", "background"])
def test_undo_goes_by_the_order_in_which_things_were_done(
    editor: Editor, ball: Document, kind: str
) -> None:
    """What is still computed is taken back where it was begun last, and not before its turn."""
    tools = {"edge": MaskTool(), "background": ComposeTool()}
    labels = {
        "edge": "Edge brush",
        "selection": "Grow selection",
        "background": "Repair background",
    }
    editor.start(ball)
    editor.view.tool = ToolName.COMPOSE if kind == "background" else ToolName.MASK
    editor.view.compose.is_bare = kind == "background"
    editor.view.selecting.painted = Painted.EDGE

    def begin() -> None:
        if kind == "selection":
            run(editor, "grow")
        else:
            at = editor.view.canvas_from_image(np.array([(60.0, 60.0), (60.0, 80.0)]))
            stroke(editor, tools[kind], *at)

    editor.placing.nudge(5.0, 0.0)
    first = editor.committed
    begin()
    editor.placing.nudge(0.0, 5.0)
    assert editor.undo_label == "Nudge object"
    run(editor, "undo")
    assert editor.committed is first and editor.undo_label == labels[kind]
    run(editor, "undo")
    wait_for_jobs(editor)
    assert editor.committed is first, "nothing comes of what was taken back"
    assert editor.history is not None and editor.history.redo_label == "Nudge object"
    begin()
    begin()
    wait_until(editor, lambda: editor.committed is not first)
    assert editor.undo_label == labels[kind]
    run(editor, "undo")
    wait_for_jobs(editor)
    assert editor.history.steps == ("Open", "Nudge object", labels[kind]), "the second is gone"
    run(editor, "undo")
    assert editor.committed is first


@pytest.mark.window
@pytest.mark.slow
def test_every_control_of_every_panel_is_undone(without_networks: dict[str, str]) -> None:
    """Each is clicked and dragged in the real window, in each tool and in what a tool unfolds."""
    command = [sys.executable, "tests/app/flip_controls.py"]
    said = subprocess.run(
        command, cwd=ROOT, env=without_networks | {"PYTHONPATH": PYTHONPATH},
        capture_output=True, text=True, timeout=5 * PATIENCE,
    )  # fmt: skip
    assert said.returncode == 0, said.stderr[-3000:]
    rows = [json.loads(line) for line in said.stdout.splitlines()]
    assert [row for row in rows if row["wrong"]] == []
    assert len({(row["state"], row["label"]) for row in rows}) > 80
    assert len({row["label"] for row in rows if row["changed"]}) > 50
