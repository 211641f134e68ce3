"""Keeping a selection in front of what is edited, in the window's words."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from editor_steps import wait_for_jobs
from objectmorpher.canvas.frame import drawn_order
from objectmorpher.cli import parser as cli
from objectmorpher.commands import next_step, run, why_not
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import Shown, ToolName
from objectmorpher_core.base.arrays import crop
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement, Prompt

STRIP = slice(128, 142)  # columns of the wall that stay in front


@pytest.fixture
def keeping(editor: Editor, ball: Document) -> Editor:
    """The ball, and a strip of the wall beside it that was told to stay in front."""
    editor.start(ball)
    mask = np.zeros(ball.photo.size[::-1], bool)
    mask[:, STRIP] = True
    run(editor, "another")
    editor.apply("Select", edits.set_mask(edits.add_object(ball), 1, mask, Prompt()))
    assert why_not(editor, "keep_in_front") is None
    run(editor, "keep_in_front")
    wait_for_jobs(editor)
    return editor


def _moved(editor: Editor) -> Document:
    editor.objects.choose(0)
    editor.view.tool = ToolName.PLACE
    editor.placing.move_to(Placement(move=(30.0, 0.0), depth=-0.3))
    editor.commit("Move object")
    assert editor.document is not None
    return editor.document


def test_it_is_one_step_and_its_edge_comes_by_itself(keeping: Editor) -> None:
    document, history = keeping.document, keeping.history
    assert document is not None and history is not None
    assert document.objects[1].stays_in_front and document.objects[1].matte is not None
    assert history.undo_label == "Keep in front"
    assert next_step(keeping) == ("Another object", "another")
    assert keeping.objects.listed() == [1, 0]
    keeping.undo()
    assert keeping.document is not None and not keeping.document.objects[1].stays_in_front


def test_view_and_export_show_it_before_what_moves(keeping: Editor, tmp_path: Path) -> None:
    document = _moved(keeping)
    posed = partial(keeping.derived.posed, document)
    assert drawn_order(document, Shown.COMPOSITE, posed) == [0, 1]
    keeping.exporting.export_to(tmp_path / "out.png")
    wait_for_jobs(keeping)
    pixels, photo = np.asarray(Image.open(tmp_path / "out.png")), document.photo.pixels
    matte = document.objects[1].matte
    assert matte is not None
    whole = crop(matte.alpha, matte.box, (0, 0, *document.photo.size)) >= 1
    assert whole.sum() > 200  # a wall in a wall: little of it is told to be opaque
    assert np.array_equal(pixels[whole], photo[whole])
    assert pixels[72, STRIP.stop + 6, 0] > photo[72, STRIP.stop + 6, 0] + 60, "the ball beside it"
    keeping.tasks.save(tmp_path / "s.omorph")
    wait_for_jobs(keeping)
    assert cli.main(["replay", str(tmp_path / "s.omorph"), "-o", str(tmp_path / "again.png")]) == 0
    assert np.array_equal(np.asarray(Image.open(tmp_path / "again.png")), pixels)


def test_the_order_can_put_an_object_before_it(keeping: Editor) -> None:
    document = _moved(keeping)
    assert keeping.objects.order() == [0, 1]
    run(keeping, "to_front")
    assert keeping.objects.order() == [1, 0]
    assert keeping.document is not None
    changed = composite(keeping.document).pixels
    assert (changed != composite(document).pixels).any()


@pytest.mark.slow
def test_it_can_be_let_go_and_what_moved_cannot_be_kept(keeping: Editor) -> None:
    keeping.objects.choose(1)
    run(keeping, "keep_in_front")
    assert keeping.document is not None and not keeping.document.objects[1].stays_in_front
    assert keeping.document.objects[1].matte is None
    _moved(keeping)
    assert why_not(keeping, "keep_in_front") == "It has moved"


@pytest.mark.slow
def test_a_changed_selection_is_cut_out_anew(keeping: Editor) -> None:
    document = keeping.document
    assert document is not None and document.objects[1].matte is not None
    before, mask = document.objects[1].matte, np.zeros(document.photo.size[::-1], bool)
    mask[:, 150:160] = True
    keeping.apply("Change mask", edits.change_mask(document, 1, mask))
    wait_for_jobs(keeping)
    assert keeping.document is not None
    item = keeping.document.objects[1]
    assert item.stays_in_front and item.matte is not None and item.matte is not before
    assert item.matte.left > before.left
