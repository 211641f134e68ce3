"""Which overlays the canvas shows now."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from imgui_bundle import ImVec2, imgui

from ...editor.editor import Editor
from ...editor.intents.landing import OF_THE_PHOTO
from ...editor.view import Popup, PoseMode, Shown, ToolName
from ...system.texts import t
from ..overlay.canvas import CanvasPainter, draw_comparison, draw_look, draw_pixel_grid
from ..overlay.compose import draw_compose, draw_offered_shadow
from ..overlay.legend import Legend
from ..overlay.place import draw_frame
from ..overlay.pose import draw_control_points, draw_pose
from ..overlay.select import draw_left_out, draw_mask, draw_selection
from ..widgets.panes import Rect
from ..widgets.theme import theme
from ..widgets.widgets import Emphasis, bold_text, button
from .landmarks import mark, mark_on_canvas

DRAWN: dict[ToolName, Callable[[CanvasPainter], None]] = {
    ToolName.SELECT: draw_selection,
    ToolName.MASK: draw_mask,
    ToolName.POSE: draw_pose,
    ToolName.PLACE: draw_frame,
    ToolName.LOOK: draw_look,
    ToolName.COMPOSE: draw_compose,
}


def draw_overlays(editor: Editor, rect: Rect, pixel_ratio: float) -> None:
    """Over the photo; `rect`: the canvas, `pixel_ratio`: canvas px per window unit."""
    view, canvas = editor.view, CanvasPainter(editor, rect, pixel_ratio)
    end = ImVec2(rect.x + rect.width, rect.y + rect.height)
    canvas.draw.push_clip_rect(ImVec2(rect.x, rect.y), end, True)
    if editor.photo_size is not None:
        mark_on_canvas("Photo", *canvas.at(np.array([(0, 0), editor.photo_size], np.float64)))
    draw_pixel_grid(canvas)
    if not view.is_before:
        if editor.looking.orbit is None:
            draw_offered_shadow(canvas)
        if view.has_points and editor.is_lifted and editor.looking.orbit is None:
            draw_control_points(canvas)
        if editor.is_lifted or view.tool in OF_THE_PHOTO:
            DRAWN[view.tool](canvas)
        draw_left_out(canvas)
        Legend(editor, rect).draw()
    is_split = view.split is not None and editor.looking.orbit is None
    if editor.looking.badge or is_split:
        draw_comparison(canvas)
    canvas.draw.pop_clip_rect()
    draw_card(canvas)


# A card over the photo that says how posing begins; it stays until the artist dismisses it.

POSING = "posing"  # its name among the settings' dismissed cards
EDGE = 16.0  # points between it and the canvas's edges
SIZE = (376.0, 158.0)  # points, about what it takes
PLACES = ((0.5, 1.0), (0.0, 1.0), (0.5, 0.0), (0.0, 0.0), (1.0, 0.0))  # shares; the first is usual
LEAST_CANVAS = 420.0  # points of the canvas each way, with less it would cover the photo


def draw_card(canvas: CanvasPainter) -> None:
    """For the Pose tool."""
    editor, rect = canvas.editor, canvas.rect
    view = editor.view
    is_posing = view.tool is ToolName.POSE and view.pose.mode is PoseMode.DRAG
    is_free = editor.is_lifted and editor.why_held is None
    is_meant = is_posing and is_free and view.shown is Shown.COMPOSITE
    if not is_meant or POSING in editor.settings.dismissed or editor.hand.is_busy:
        return
    if min(rect.width, rect.height) < theme.pt(LEAST_CANVAS) or view.is_before:
        return
    across, down = _card_place(canvas)
    edge = theme.pt(EDGE)
    x = rect.x + edge + across * (rect.width - 2 * edge)
    y = rect.y + edge + down * (rect.height - 2 * edge)
    imgui.set_next_window_pos(ImVec2(x, y), imgui.Cond_.always, ImVec2(across, down))
    imgui.push_style_var(imgui.StyleVar_.window_padding, theme.size(16, 12))
    imgui.push_style_var(imgui.StyleVar_.window_rounding, theme.pt(8))
    imgui.push_style_color(imgui.Col_.window_bg, theme.vec("panel"))
    flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.always_auto_resize
    flags |= imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_saved_settings
    flags |= imgui.WindowFlags_.no_focus_on_appearing
    imgui.begin("##card", None, flags | imgui.WindowFlags_.no_bring_to_front_on_focus)
    imgui.pop_style_color()
    imgui.pop_style_var(2)
    with bold_text():
        imgui.text_unformatted(t("Drag any point of it: the rest follows"))
    _draw_line(t("P over a point, or Alt-click"), t("pins it, so that it stays"))
    _draw_line(t("Wheel while dragging"), t("brings it nearer, or takes it farther"))
    _draw_line(t("Ctrl-drag"), t("turns the point"))
    imgui.dummy(theme.size(0, 2))
    if button(t("Got it"), Emphasis.PRIMARY_SMALL, width=88):
        dismissed = (*editor.settings.dismissed, POSING)
        editor.settings = replace(editor.settings, dismissed=dismissed)
    mark(t("Got it"))
    imgui.same_line(0, theme.pt(8))
    if button(t("Read more"), Emphasis.QUIET, width=104):
        view.help_page, view.popup = "bend", Popup.HELP
    imgui.end()


def _card_place(canvas: CanvasPainter) -> tuple[float, float]:
    """The one of PLACES at which the card covers least of the object that is to be dragged.

    During a stroke it stays where it was when the stroke began.
    """
    editor, rect, size = canvas.editor, canvas.rect, np.array(SIZE) * theme.pt(1)
    assert editor.committed is not None
    corners = canvas.at(editor.derived.frame(editor.committed, editor.current).corners)
    low, high = (np.array((corners[k].x, corners[k].y)) for k in (0, 2))
    edge, start = theme.pt(EDGE), np.array((rect.x, rect.y))
    room = np.array((rect.width, rect.height)) - 2 * edge - size

    def covered(place: tuple[float, float]) -> float:
        first = start + edge + np.array(place) * room
        common = np.minimum(first + size, high) - np.maximum(first, low)
        return float(np.prod(np.maximum(common, 0)))

    return min(PLACES, key=covered)


def _draw_line(gesture: str, meaning: str) -> None:
    imgui.text_unformatted(gesture)
    imgui.same_line(0, theme.pt(6))
    imgui.text_colored(theme.vec("secondary"), meaning)
