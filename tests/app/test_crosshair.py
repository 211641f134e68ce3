"""Keys that point: the crosshair clicks, drags and pans as a mouse would."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from imgui_bundle import imgui

from editor_steps import CENTRE, wait_for_jobs
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.shortcuts import Shortcuts
from objectmorpher.editor.view import ToolName
from objectmorpher.gui.widgets.panes import Rect
from objectmorpher.gui.window.input import Input
from objectmorpher.tools.pose_tool import DEPTH_STEP
from objectmorpher_core.document.model import Document


@contextmanager
def held_ball(editor: Editor, ball: Document) -> Iterator[tuple[imgui.IO, np.ndarray, Rect]]:
    """ImGui without a window, a place on the ball that Place moves, and the canvas."""
    editor.start(ball)
    editor.view.tool = ToolName.PLACE
    imgui.create_context()
    try:
        io = imgui.get_io()
        io.set_ini_filename("")
        io.display_size = imgui.ImVec2(editor.view.width, editor.view.height)
        io.backend_flags |= imgui.BackendFlags_.renderer_has_textures.value
        middle = editor.view.canvas_from_image(np.array([90.0, 60.0]))
        yield io, middle, Rect(0.0, 0.0, editor.view.width, editor.view.height)
    finally:
        imgui.destroy_context()


@pytest.fixture
def keys(editor: Editor) -> Input:
    return Input(Shortcuts(editor))


def press(keys: Input, editor: Editor, *chords: str) -> None:
    for chord in chords:
        keys._run_key(editor, chord)


def place(keys: Input, editor: Editor) -> np.ndarray:
    """(2,) image px of the crosshair."""
    return editor.view.image_from_canvas(keys.crosshair.pointer().xy)


def test_the_three_paces_of_an_arrow(keys: Input, editor: Editor) -> None:
    press(keys, editor, "Right", "Left")
    start = keys.crosshair.pointer().xy
    for chord, far in (("Right", 8), ("Shift+Down", 64), ("Alt+Left", editor.view.zoom)):
        before = keys.crosshair.pointer().xy
        press(keys, editor, chord)
        moved = float(np.abs(keys.crosshair.pointer().xy - before).sum())
        assert moved == pytest.approx(max(far, 1.0)), chord
    assert not np.array_equal(start, keys.crosshair.pointer().xy)


def test_taking_hold_draws_a_box_and_escape_takes_it_back(keys: Input, editor: Editor) -> None:
    for _ in range(2):
        press(keys, editor, "Left", *["Shift+Left"] * 3, *["Shift+Up"] * 3, "Shift+Enter")
        assert editor.hand.is_busy
        press(keys, editor, *["Shift+Right"] * 5)
        press(keys, editor, "Escape")
        assert not editor.hand.is_busy
        keys.crosshair.hide()
    press(keys, editor, "Left", *["Shift+Left"] * 3, *["Shift+Up"] * 3)
    low = place(keys, editor)
    press(keys, editor, "Shift+Enter", *["Shift+Right"] * 6, *["Shift+Down"] * 6)
    high = place(keys, editor)
    press(keys, editor, "Shift+Enter")
    wait_for_jobs(editor)
    assert editor.mask is not None
    assert editor.selection.prompt.box is not None
    np.testing.assert_allclose(editor.selection.prompt.box, (*low, *high), atol=1.0)


def test_space_adds_and_with_shift_takes_away(keys: Input, editor: Editor) -> None:
    there = editor.view.canvas_from_image(np.array(CENTRE))
    press(keys, editor, "Right", "Left")
    keys.crosshair.move(editor, *(there - keys.crosshair.pointer().xy))
    press(keys, editor, "Enter")
    wait_for_jobs(editor)
    press(keys, editor, *["Shift+Left"] * 2, "Shift+Space")
    wait_for_jobs(editor)
    clicks = editor.selection.prompt.clicks
    assert [click.is_foreground for click in clicks] == [True, False]
    np.testing.assert_allclose((clicks[0].x, clicks[0].y), CENTRE, atol=0.5)


def test_at_the_edge_a_zoomed_photo_moves_along(keys: Input, editor: Editor) -> None:
    assert editor.photo_size is not None
    editor.view.set_zoom(16.0, (360.0, 280.0), editor.photo_size)
    left = editor.view.left
    press(keys, editor, *["Shift+Right"] * 9)
    assert editor.view.left > left
    assert keys.crosshair.pointer().x < editor.view.width


def test_page_keys_move_in_depth_and_undo_is_one_step(
    keys: Input, editor: Editor, ball: Document
) -> None:
    editor.start(ball)
    editor.view.tool = ToolName.PLACE
    press(keys, editor, "Shift+PageUp", "PageDown", "Alt+Right")
    assert editor.placing.placement is not None
    assert editor.placing.placement.depth == pytest.approx(9 * DEPTH_STEP)
    assert editor.placing.placement.move[0] == pytest.approx(0.1)
    for _ in range(3):
        editor.undo()
    assert editor.placing.placement.is_identity


def test_a_stroke_goes_on_from_where_the_mouse_left_the_window(
    keys: Input, editor: Editor, ball: Document
) -> None:
    """ImGui then says that it is at minus 3e38, of which a tool makes numbers that are none."""
    with held_ball(editor, ball) as (io, middle, rect):
        for place in (middle, middle + 1, middle + 40, np.full(2, -float(np.finfo("f4").max))):
            io.add_mouse_pos_event(*place)
            io.add_mouse_button_event(0, place is not middle)
            for _ in range(2):
                imgui.new_frame()
                keys.update(editor, rect, 1.0)
                imgui.end_frame()
            if place[0] > 0 and place is not middle:
                before = editor.placing.placement
        assert editor.hand.is_busy
        assert before is not None and before.move[0] > 5
        assert editor.placing.placement == before


def test_a_stroke_ends_where_its_button_went_up_also_where_it_is_down_again(
    keys: Input, editor: Editor, ball: Document
) -> None:
    """In one slow frame a drag ends, and another press comes elsewhere: the mouse is there now."""
    with held_ball(editor, ball) as (io, middle, rect):

        def draw(at: np.ndarray | None = None) -> None:
            imgui.new_frame()
            keys.update(editor, rect, 1.0, None if at is None else (float(at[0]), float(at[1])))
            imgui.end_frame()

        io.add_mouse_pos_event(*middle)
        draw()
        io.add_mouse_button_event(0, True)
        draw()
        end, other = np.floor(middle + 40), np.full(2, 3.0)
        io.add_mouse_pos_event(*end)
        draw(end)
        for is_down, place in ((False, end), (True, other)):
            io.add_mouse_pos_event(*place)
            io.add_mouse_button_event(0, is_down)
        before = editor.placing.placement
        while len(imgui.get_current_context().input_events_queue):
            draw(other)
        assert editor.placing.placement == before and before is not None and before.move[0] > 5
