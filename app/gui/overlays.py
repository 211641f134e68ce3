"""What is drawn over the photo: selection, clicks, handles, anchors, frames.

Shapes differ as well as colours, and every line has a dark outer line, so that they are seen on
any photo and by everybody.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from imgui_bundle import ImVec2, imgui

from ..editor import Editor
from ..tools.place_tool import gizmo
from ..view import ToolName
from .layout import Rect
from .legend import Legend
from .theme import theme

DARK = "#0B0C0E"
WHITE = "#FFFFFF"
MAX_LINKED = 3  # links drawn from each control point


class Overlays:
    """Draws on the canvas of one frame."""

    def __init__(self, editor: Editor, rect: Rect, pixel_ratio: float) -> None:
        """`pixel_ratio`: canvas px per window unit."""
        self._editor, self._rect, self._ratio = editor, rect, pixel_ratio
        self._draw = imgui.get_background_draw_list()

    def draw(self) -> None:
        editor, view = self._editor, self._editor.view
        corner = ImVec2(self._rect.x, self._rect.y)
        end = ImVec2(self._rect.x + self._rect.width, self._rect.y + self._rect.height)
        self._draw.push_clip_rect(corner, end, True)
        if not view.is_before:
            if view.has_points and editor.is_lifted:
                self._draw_control_points()
            if view.tool is ToolName.SELECT:
                self._draw_selection()
            elif editor.is_lifted and view.tool is ToolName.POSE:
                self._draw_pose()
            elif editor.is_lifted:
                self._draw_frame()
            Legend(editor, self._rect).draw()
        if view.is_before or view.split is not None:
            self._draw_comparison()
        self._draw.pop_clip_rect()

    # Places

    def _at(self, image_xy: np.ndarray) -> list[Any]:
        """Window positions of image px (N, 2)."""
        canvas = self._editor.view.canvas_from_image(image_xy)
        return self._on_canvas(canvas)

    def _on_photo(self, image_xy: np.ndarray) -> list[Any]:
        """Window positions of those image px (N, 2) that are on the photo."""
        size = self._editor.photo_size
        assert size is not None
        return self._at(image_xy[((image_xy >= 0) & (image_xy <= size)).all(1)])

    def _on_canvas(self, canvas_xy: np.ndarray) -> list[Any]:
        xy = np.atleast_2d(canvas_xy) / self._ratio + (self._rect.x, self._rect.y)
        return [ImVec2(x, y) for x, y in xy.tolist()]

    # Select

    def _draw_selection(self) -> None:
        editor = self._editor
        if editor.mask is not None:
            for outline in editor.derived.contours(editor.mask):
                points = self._at(outline)
                closed = int(imgui.ImDrawFlags_.closed)
                width = theme.pt(2)
                dark = theme.u32(DARK, 0.7)
                self._draw.add_polyline(points, dark, width + theme.pt(2), closed)
                self._draw.add_polyline(points, theme.u32("#5AA9FF"), width, closed)
        prompt = editor.prompt
        if prompt.box is not None:
            x0, y0, x1, y1 = prompt.box
            self._draw_dashes(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]))
        for click in prompt.clicks:
            self._draw_click(self._at(np.array([click.x, click.y]))[0], click.is_foreground)
        if editor.rubber is not None:
            x0, y0, x1, y1 = editor.rubber
            low, high = self._on_canvas(np.array([[x0, y0], [x1, y1]]))
            self._draw.add_rect_filled(low, high, theme.u32("#5AA9FF", 0.12))
            self._draw.add_rect(low, high, theme.u32("#5AA9FF"), 0.0, theme.pt(1.5))

    def _draw_dashes(self, corners: np.ndarray) -> None:
        """A dashed closed line, 6 points on, 4 off."""
        places = [np.array([p.x, p.y]) for p in self._at(corners)]
        for start, end in zip(places, places[1:] + places[:1], strict=True):
            length = float(np.linalg.norm(end - start))
            along = (end - start) / max(length, 1e-6)
            for dash in np.arange(0.0, length, theme.pt(10)):
                a, b = start + along * dash, start + along * min(dash + theme.pt(6), length)
                points = ImVec2(*a), ImVec2(*b)
                self._draw.add_line(*points, theme.u32(DARK, 0.6), theme.pt(3))
                self._draw.add_line(*points, theme.u32("#5AA9FF"), theme.pt(1.5))

    def _draw_click(self, at: ImVec2, is_foreground: bool) -> None:
        """A disc with + or -: shape and colour both tell."""
        radius, arm = theme.pt(7), theme.pt(3)
        fill = "#5AA9FF" if is_foreground else "#F2695C"
        self._draw.add_circle_filled(at, radius + theme.pt(2), theme.u32(DARK, 0.7))
        self._draw.add_circle_filled(at, radius + theme.pt(0.6), theme.u32(WHITE))
        self._draw.add_circle_filled(at, radius - theme.pt(0.8), theme.u32(fill))
        dark, width = theme.u32(DARK), theme.pt(2)
        self._draw.add_line(ImVec2(at.x - arm, at.y), ImVec2(at.x + arm, at.y), dark, width)
        if is_foreground:
            self._draw.add_line(ImVec2(at.x, at.y - arm), ImVec2(at.x, at.y + arm), dark, width)

    # Pose

    def _draw_pose(self) -> None:
        editor = self._editor
        document, thing = editor.document, editor.object
        if document is None or thing is None or thing.lifted is None:
            return
        if thing.handles:
            for at in self._on_photo(editor.derived.anchors(document, editor.current)):
                self._draw_anchor(at)
            rests = np.array([h.point for h in thing.handles])
            starts = self._at(editor.derived.project(document, editor.current, rests))
            ends = self._at(editor.handle_positions())
            for start, end in zip(starts, ends, strict=True):
                self._draw_pull(start, end)
            for h, end in enumerate(ends):
                is_hovered = h == editor.hover.handle
                self._draw_handle(end, thing.handles[h].is_pin, h == editor.handle, is_hovered)
        elif editor.hover.surface is None:
            self._draw_hint_points()
        if editor.hover.surface is not None and not editor.hand.is_busy:
            self._draw_surface_point()

    def _draw_hint_points(self) -> None:
        """The control points, quietly, while there is no handle: here is something to drag."""
        editor = self._editor
        assert editor.document is not None
        for at in self._on_photo(editor.derived.control_points(editor.document, editor.current)):
            self._draw.add_circle_filled(at, theme.scale * 2.6, theme.u32(DARK, 0.5), 8)
            self._draw.add_circle_filled(at, theme.scale * 1.7, theme.u32(WHITE, 0.9), 8)

    def _draw_surface_point(self) -> None:
        editor = self._editor
        surface = editor.hover.surface
        assert surface is not None
        assert editor.document is not None
        xy = editor.document.photo.camera.project(surface.world)
        at = self._at(xy)[0]
        if editor.hover.is_pin:
            self._draw_diamond(at, theme.pt(7), WHITE, 0.75)
            return
        self._draw.add_circle(at, theme.pt(7), theme.u32(DARK, 0.7), 0, theme.pt(3.5))
        self._draw.add_circle(at, theme.pt(7), theme.u32("#5AA9FF"), 0, theme.pt(2))
        self._draw.add_circle_filled(at, theme.pt(1.6), theme.u32(WHITE))

    def _draw_pull(self, start: ImVec2, end: ImVec2) -> None:
        """From where the point was in the photo to where it must be."""
        if np.hypot(end.x - start.x, end.y - start.y) < theme.pt(3):
            return
        self._draw.add_line(start, end, theme.u32(DARK, 0.6), theme.pt(3.5))
        self._draw.add_line(start, end, theme.u32(WHITE, 0.9), theme.pt(1.5))
        self._draw.add_circle_filled(start, theme.pt(3), theme.u32(DARK, 0.7))
        self._draw.add_circle_filled(start, theme.pt(2), theme.u32(WHITE))

    def _draw_handle(self, at: ImVec2, is_pin: bool, is_selected: bool, is_hovered: bool) -> None:
        if is_selected:
            self._draw.add_circle(at, theme.pt(12), theme.u32(DARK, 0.6), 0, theme.pt(4))
            self._draw.add_circle(at, theme.pt(12), theme.u32("#5AA9FF"), 0, theme.pt(2))
        grow = theme.pt(1) if is_hovered else 0.0
        if is_pin:
            self._draw_diamond(at, theme.pt(8) + grow, WHITE, 1.0)
            return
        self._draw.add_circle_filled(at, theme.pt(8.5) + grow, theme.u32(DARK, 0.8))
        self._draw.add_circle_filled(at, theme.pt(7.5) + grow, theme.u32(WHITE))
        self._draw.add_circle_filled(at, theme.pt(5.5) + grow, theme.u32("#5AA9FF"))

    def _draw_diamond(self, at: ImVec2, radius: float, fill: str, alpha: float) -> None:
        outer = radius + theme.pt(2)
        self._draw.add_ngon_filled(at, outer, theme.u32(DARK, 0.8 * alpha), 4)
        self._draw.add_ngon_filled(at, radius, theme.u32(fill, alpha), 4)

    def _draw_anchor(self, at: ImVec2) -> None:
        """Hollow diamond: held by itself."""
        self._draw.add_ngon(at, theme.pt(4), theme.u32(DARK, 0.5), 4, theme.pt(3))
        self._draw.add_ngon(at, theme.pt(4), theme.u32(WHITE, 0.6), 4, theme.pt(1.4))

    def _draw_control_points(self) -> None:
        editor = self._editor
        assert editor.document is not None
        links = editor.derived.links(editor.document, editor.current, MAX_LINKED)
        is_there = ((links >= 0) & (links <= editor.document.photo.size)).all((1, 2))
        ends = self._at(links[is_there].reshape(-1, 2))
        dark, white = theme.u32(DARK, 0.25), theme.u32(WHITE, 0.4)
        for start, end in zip(ends[::2], ends[1::2], strict=True):
            self._draw.add_line(start, end, dark, 2.5)
            self._draw.add_line(start, end, white, 1.0)
        for at in self._on_photo(editor.derived.control_points(editor.document, editor.current)):
            self._draw.add_circle_filled(at, theme.scale * 2.6, theme.u32(DARK, 0.4), 8)
            self._draw.add_circle_filled(at, theme.scale * 1.8, theme.u32(WHITE, 0.8), 8)

    # Place

    def _draw_frame(self) -> None:
        editor = self._editor
        shown = gizmo(editor)
        if shown is None:
            return
        part = editor.hover.part
        corners = self._on_canvas(shown.corners)
        centre = self._on_canvas(shown.centre)[0]
        radius = shown.radius / self._ratio
        ring_role = WHITE if part != "roll" else "#5AA9FF"
        self._draw.add_circle(centre, radius, theme.u32(DARK, 0.5), 96, theme.pt(3.5))
        self._draw.add_circle(centre, radius, theme.u32(ring_role, 0.9), 96, theme.pt(1.5))
        closed = int(imgui.ImDrawFlags_.closed)
        self._draw.add_polyline(corners, theme.u32(DARK, 0.5), theme.pt(3), closed)
        self._draw.add_polyline(corners, theme.u32(WHITE, 0.8), theme.pt(1), closed)
        for corner in corners:
            self._draw_square(corner, part == "scale")
        arm = theme.pt(6)
        for dx, dy in ((arm, 0.0), (0.0, arm)):
            a, b = ImVec2(centre.x - dx, centre.y - dy), ImVec2(centre.x + dx, centre.y + dy)
            self._draw.add_line(a, b, theme.u32(DARK, 0.6), theme.pt(3.5))
            self._draw.add_line(a, b, theme.u32(WHITE), theme.pt(1.5))

    def _draw_square(self, at: ImVec2, is_hovered: bool) -> None:
        half = theme.pt(5)
        fill = "#5AA9FF" if is_hovered else WHITE
        for grow, colour in ((theme.pt(1.5), theme.u32(DARK, 0.8)), (0.0, theme.u32(fill))):
            low = ImVec2(at.x - half - grow, at.y - half - grow)
            high = ImVec2(at.x + half + grow, at.y + half + grow)
            self._draw.add_rect_filled(low, high, colour, theme.pt(2))

    # Before and after

    def _draw_comparison(self) -> None:
        view, rect = self._editor.view, self._rect
        if view.is_before or view.split is None:
            self._draw_label("Before", rect.x + theme.pt(12), is_left=True)
            return
        x = rect.x + view.split * rect.width
        top, bottom = ImVec2(x, rect.y), ImVec2(x, rect.y + rect.height)
        self._draw.add_line(top, bottom, theme.u32(DARK, 0.6), theme.pt(4))
        self._draw.add_line(top, bottom, theme.u32(WHITE), theme.pt(2))
        grip = ImVec2(x, rect.y + rect.height / 2)
        self._draw.add_circle_filled(grip, theme.pt(9), theme.u32(DARK, 0.7))
        self._draw.add_circle_filled(grip, theme.pt(7), theme.u32(WHITE))
        self._draw_label("Before", x - theme.pt(12), is_left=False)
        self._draw_label("After", x + theme.pt(12), is_left=True)

    def _draw_label(self, text: str, x: float, is_left: bool) -> None:
        """White on dark, at the canvas's top; `is_left`: it begins at x, else it ends there."""
        size = imgui.calc_text_size(text)
        pad_x, pad_y = theme.pt(8), theme.pt(4)
        left = x if is_left else x - size.x - 2 * pad_x
        top = self._rect.y + theme.pt(12)
        low, high = ImVec2(left, top), ImVec2(left + size.x + 2 * pad_x, top + size.y + 2 * pad_y)
        self._draw.add_rect_filled(low, high, theme.u32(DARK, 0.75), theme.pt(4))
        self._draw.add_text(ImVec2(left + pad_x, top + pad_y), theme.u32(WHITE), text)
