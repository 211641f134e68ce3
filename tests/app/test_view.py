"""Zoom and pan: pure arithmetic between the photo's px and the canvas's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher.commands import COMMANDS, run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import MARGIN, Shown, ToolName, ViewState
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import Document

PHOTO = (600, 400)


@pytest.fixture
def view() -> ViewState:
    view = ViewState()
    view.resize((1000, 700), 1.0, PHOTO)
    view.fit(PHOTO)
    return view


def test_a_fitted_photo_is_centred_with_its_margin(view: ViewState) -> None:
    low = view.canvas_from_image(np.array([0, 0]))
    high = view.canvas_from_image(np.array(PHOTO))
    np.testing.assert_allclose(low + high, (1000, 700))
    assert min(*low) == pytest.approx(MARGIN)


def test_zooming_keeps_the_point_under_the_pointer(view: ViewState) -> None:
    pointer = (420.0, 333.0)
    before = view.image_from_canvas(pointer)
    view.set_zoom(3.7, pointer, PHOTO)
    np.testing.assert_allclose(view.image_from_canvas(pointer), before)


def test_there_and_back_is_the_same(view: ViewState) -> None:
    view.set_zoom(2.3, (100, 100), PHOTO)
    xy = np.random.default_rng(0).uniform(0, 500, (20, 2))
    np.testing.assert_allclose(view.image_from_canvas(view.canvas_from_image(xy)), xy)


def test_the_view_camera_agrees_with_the_canvas(view: ViewState) -> None:
    view.set_zoom(1.9, (10, 20), PHOTO)
    camera = Camera.from_fov(*PHOTO)
    points = np.array([[0.1, 0.2, 2.0], [-0.3, 0.1, 1.5]])
    canvas = view.canvas_from_image(camera.project(points))
    np.testing.assert_allclose(view.camera(camera).project(points), canvas)
    part = view.camera(camera, (50, 60, 150, 200))
    np.testing.assert_allclose(part.project(points), canvas - (50, 60))
    assert (part.width, part.height) == (100, 140)


def test_panning_never_loses_the_photo(view: ViewState) -> None:
    view.pan(1e6, -1e6, PHOTO)
    low = view.canvas_from_image(np.array([0, 0]))
    high = view.canvas_from_image(np.array(PHOTO))
    assert low[0] < 1000
    assert high[1] > 0


def test_a_fitted_photo_stays_fitted_when_the_window_grows(view: ViewState) -> None:
    view.resize((1400, 900), 1.0, PHOTO)
    low = view.canvas_from_image(np.array([0, 0]))
    assert min(*low) == pytest.approx(MARGIN)


def test_a_zoomed_photo_keeps_its_zoom_when_the_window_grows(view: ViewState) -> None:
    view.set_zoom(5.0, (500, 350), PHOTO)
    middle = view.image_from_canvas((500, 350))
    view.resize((1400, 900), 1.0, PHOTO)
    assert view.zoom == 5.0
    np.testing.assert_allclose(view.image_from_canvas((700, 450)), middle)


def test_a_brush_suits_the_photo_until_somebody_sizes_it(view: ViewState) -> None:
    view.suit_brush((600, 400))
    assert view.brush.radius == 20.0
    view.suit_brush((4000, 3000))
    large = view.brush.radius
    assert 80 < large < 120
    assert view.brush.hardness == ViewState().brush.hardness
    view.suit_brush((2400, 1600))
    assert 20 < view.brush.radius < large  # each photo has its own
    view.brush = replace(view.brush, radius=33.0)
    view.suit_brush((4000, 3000))
    assert view.brush.radius == 33.0
    assert view.usual_radius == large  # that is what a double-click on the name brings back


def test_a_tool_forgets_what_was_said_of_the_last_one(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    editor.choose_tool(ToolName.POSE)
    editor.say("It is in 3D now · Drag any point of it")
    editor.choose_tool(ToolName.POSE)
    assert editor.message is not None
    editor.choose_tool(ToolName.PLACE)
    assert editor.message is None
    editor.complain("the disk is full")
    editor.choose_tool(ToolName.LOOK)
    assert editor.message is not None
    editor.lock(0)
    editor.say_locked(0)
    editor.choose_tool(ToolName.COMPOSE)
    assert editor.message is not None and editor.message.action is not None


def test_views_have_keys_of_their_own_and_are_in_the_menu() -> None:

    from objectmorpher.gui.window.menu import MENUS

    keys = [command.keys for command in COMMANDS.values() if command.keys]
    assert len(keys) == len(set(keys))
    for shown in Shown:
        name = f"show_{shown.name.lower()}"
        assert COMMANDS[name].label == shown.value
        assert name in MENUS["View"]


def test_choosing_a_view_is_no_step(editor: Editor, ball: Document) -> None:
    run(editor, "show_depth")
    assert editor.view.shown is Shown.COMPOSITE  # nothing is lifted yet, and that is said
    assert editor.message is not None
    editor.start(ball)
    run(editor, "show_depth")
    assert editor.view.shown is Shown.DEPTH
    assert editor.document is ball and editor.is_saved
    editor.start(ball)  # another document begins with the photo
    assert editor.view.shown is Shown.COMPOSITE
