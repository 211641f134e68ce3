"""Lines and marks on the canvas, each with its dark outer line, and what all tools show there."""

from __future__ import annotations

from typing import Any

import numpy as np
from imgui_bundle import ImVec2, imgui

from objectmorpher_core.base.rotations import wrapped

from ...editor.editor import Editor
from ...editor.view import PIXELS_FROM
from ...system.texts import t
from ..widgets.panes import Rect
from ..widgets.theme import theme

DARK = "#0B0C0E"
WHITE = "#FFFFFF"
ACCENT = "#5AA9FF"  # of marks on the photo, in either theme
WARM = "#F2695C"
DOTTED = 14.0  # points that a disc before a label takes
DARKNESS, LIGHTNESS = 0.28, 0.16  # alpha of the pixel grid's lines, at their strongest
FAINTEST = 0.4  # x that, where the grid begins to show


class CanvasPainter:
    """Draws on the canvas of one frame. Places are image px or window positions (ImVec2)."""

    def __init__(self, editor: Editor, rect: Rect, pixel_ratio: float) -> None:
        """`pixel_ratio`: canvas px per window unit."""
        self.editor, self.rect, self.ratio = editor, rect, pixel_ratio
        self.draw = imgui.get_background_draw_list()

    # Places

    def at(self, image_xy: np.ndarray) -> list[Any]:
        """Window positions of image px (N, 2)."""
        return self.on_canvas(self.editor.view.canvas_from_image(image_xy))

    def on_photo(self, image_xy: np.ndarray) -> list[Any]:
        """Window positions of those image px (N, 2) that are on the photo."""
        size = self.editor.photo_size
        assert size is not None
        return self.at(image_xy[((image_xy >= 0) & (image_xy <= size)).all(1)])

    def on_canvas(self, canvas_xy: np.ndarray) -> list[Any]:
        """Window positions of canvas px (N, 2)."""
        xy = np.atleast_2d(canvas_xy) / self.ratio + (self.rect.x, self.rect.y)
        return [ImVec2(x, y) for x, y in xy.tolist()]

    # Marks; measures in points

    def line(
        self, start: ImVec2, end: ImVec2, color: str, width: float = 1.5, alpha: float = 0.9
    ) -> None:
        self.draw.add_line(start, end, theme.u32(DARK, 0.6 * alpha), theme.pt(width + 2))
        self.draw.add_line(start, end, theme.u32(color, alpha), theme.pt(width))

    def polyline(
        self,
        points: list[Any],
        color: str,
        width: float = 2.0,
        is_closed: bool = True,
        alpha: float = 1.0,
    ) -> None:
        flags = int(imgui.ImDrawFlags_.closed) if is_closed else 0
        self.draw.add_polyline(points, theme.u32(DARK, 0.7 * alpha), theme.pt(width + 2), flags)
        self.draw.add_polyline(points, theme.u32(color, alpha), theme.pt(width), flags)

    def dashes(
        self, points: list[Any], color: str = ACCENT, is_closed: bool = True, on: float = 6.0
    ) -> None:
        """A dashed line, `on` points on and two thirds of it off."""
        places = [np.array([p.x, p.y]) for p in points]
        following = places[1:] + (places[:1] if is_closed else [])
        step, left = theme.pt(on) * 5 / 3, 0.0  # `left`: of the pattern, at the piece's start
        for start, end in zip(places, following, strict=False):
            length = float(np.linalg.norm(end - start))
            along = (end - start) / max(length, 1e-6)
            for dash in np.arange(-left, length, step):
                near, far = max(dash, 0.0), min(dash + theme.pt(on), length)
                if far > near:
                    a, b = ImVec2(*(start + along * near)), ImVec2(*(start + along * far))
                    self.draw.add_line(a, b, theme.u32(DARK, 0.6), theme.pt(3))
                    self.draw.add_line(a, b, theme.u32(color), theme.pt(1.5))
            left = (left + length) % step

    def disc(self, at: ImVec2, radius: float, fill: str) -> None:
        """A filled disc with a white and a dark ring."""
        self.draw.add_circle_filled(at, theme.pt(radius + 3), theme.u32(DARK, 0.8))
        self.draw.add_circle_filled(at, theme.pt(radius + 2), theme.u32(WHITE))
        self.draw.add_circle_filled(at, theme.pt(radius), theme.u32(fill))

    def dot(self, at: ImVec2, radius: float, alpha: float = 0.9, color: str = WHITE) -> None:
        """A small dot, white or of another colour; `radius` is not rounded to whole pixels."""
        r = theme.scale * radius
        self.draw.add_circle_filled(at, 1.5 * r, theme.u32(DARK, 0.55 * alpha), 8)
        self.draw.add_circle_filled(at, r, theme.u32(color, alpha), 8)

    def ring(self, at: ImVec2, radius: float, color: str) -> None:
        self.draw.add_circle(at, theme.pt(radius), theme.u32(DARK, 0.6), 0, theme.pt(4))
        self.draw.add_circle(at, theme.pt(radius), theme.u32(color), 0, theme.pt(2))

    def diamond(self, at: ImVec2, radius: float, fill: str, alpha: float = 1.0) -> None:
        outer = theme.pt(radius + 2)
        self.draw.add_ngon_filled(at, outer, theme.u32(DARK, 0.8 * alpha), 4)
        self.draw.add_ngon_filled(at, theme.pt(radius), theme.u32(fill, alpha), 4)

    def hollow_diamonds(self, places: list[ImVec2], radius: float) -> None:
        """Many of them, and in every frame."""
        reach, wide, narrow = theme.pt(radius), theme.pt(3), theme.pt(1.4)
        dark, white, draw = theme.u32(DARK, 0.5), theme.u32(WHITE, 0.6), self.draw
        for at in places:
            draw.add_ngon(at, reach, dark, 4, wide)
            draw.add_ngon(at, reach, white, 4, narrow)

    def square(self, at: ImVec2, half: float, fill: str) -> None:
        for grow, color in ((1.5, theme.u32(DARK, 0.8)), (0.0, theme.u32(fill))):
            reach = theme.pt(half + grow)
            low, high = ImVec2(at.x - reach, at.y - reach), ImVec2(at.x + reach, at.y + reach)
            self.draw.add_rect_filled(low, high, color, theme.pt(2))

    def brush(self, is_erasing: bool = False) -> None:
        """The brush's outline around the pointer: where it covers half. An eraser has a minus."""
        pointer, view = self.editor.pointer, self.editor.view
        if pointer is None:
            return
        at, reach = self.on_canvas(pointer.xy)[0], view.zoom / self.ratio
        half = view.brush.radius * (1 + view.brush.hardness) / 2
        for radius, alpha in ((half, 1.0), (view.brush.radius, 0.45)):
            self.circle(at, max(radius * reach, 1.5), WARM if is_erasing else WHITE, alpha)
        if is_erasing:
            arm = theme.pt(4)
            self.line(ImVec2(at.x - arm, at.y), ImVec2(at.x + arm, at.y), WARM, alpha=1.0)

    def circle(self, at: ImVec2, radius: float, color: str, alpha: float = 1.0) -> None:
        """A thin one; `radius` in window units."""
        self.draw.add_circle(at, radius, theme.u32(DARK, 0.7 * alpha), 0, theme.pt(3))
        self.draw.add_circle(at, radius, theme.u32(color, alpha), 0, theme.pt(1.2))

    def label(self, text: str, x: float, y: float, side: float = 0.0, dot: str = "") -> None:
        """White on dark, at a window position or, where the canvas ends before, beside it.

        `side`: 0 begins at x, 0.5 centred, 1 ends there; `dot`: colour of a disc before it.
        """
        size, rect, pad_y = imgui.calc_text_size(text), self.rect, theme.pt(4)
        width, height = self.label_width(text), size.y + 2 * pad_y
        ahead = theme.pt(DOTTED) if dot else 0.0
        left = x + ahead - side * width
        left = max(min(left, rect.x + rect.width - width), rect.x + ahead)
        y = max(min(y, rect.y + rect.height - height), rect.y)
        if dot:
            self.disc(ImVec2(left + theme.pt(4) - ahead, y + theme.pt(8)), 4, dot)
        low, high = ImVec2(left, y), ImVec2(left + width, y + height)
        self.draw.add_rect_filled(low, high, theme.u32(DARK, 0.75), theme.pt(4))
        self.draw.add_text(ImVec2(left + theme.pt(8), y + pad_y), theme.u32(WHITE), text)

    @staticmethod
    def label_width(text: str) -> float:
        """Window units."""
        return imgui.calc_text_size(text).x + 2 * theme.pt(8)


def draw_look(canvas: CanvasPainter) -> None:
    """Draw the note that the object is seen from elsewhere."""
    editor, rect = canvas.editor, canvas.rect
    orbit = editor.looking.orbit
    if orbit is not None:
        yaw, pitch = round(wrapped(orbit.yaw)), round(orbit.pitch)
        text = t("Preview, turned by {yaw}° and {pitch}°", yaw=yaw, pitch=pitch)
        canvas.label(text, rect.x + theme.pt(12), rect.y + theme.pt(12))


def draw_pixel_grid(canvas: CanvasPainter) -> None:
    """Hairlines between the photo's pixels, dark and light, so that they are seen on any photo."""
    editor, view = canvas.editor, canvas.editor.view
    size = editor.photo_size
    if size is None or not view.is_at_pixels:
        return
    low = np.clip(np.floor((view.left, view.top)), 0, size).astype(int)
    shown = (view.width, view.height)
    high = np.clip(np.ceil(view.image_from_canvas(shown)), 0, size).astype(int)
    start, end = canvas.at(np.array([low, high], np.float64))
    strength = float(np.clip((view.zoom - PIXELS_FROM) / PIXELS_FROM, FAINTEST, 1.0))
    dark, light = theme.u32(DARK, DARKNESS * strength), theme.u32(WHITE, LIGHTNESS * strength)
    for color, shift in ((dark, 0.0), (light, 1.0)):
        for point in canvas.at(np.array([(x, 0) for x in range(low[0], high[0] + 1)], float)):
            x = round(point.x) + shift
            canvas.draw.add_line(ImVec2(x, start.y), ImVec2(x, end.y), color, 1.0)
        for point in canvas.at(np.array([(0, y) for y in range(low[1], high[1] + 1)], float)):
            y = round(point.y) + shift
            canvas.draw.add_line(ImVec2(start.x, y), ImVec2(end.x, y), color, 1.0)


# Before and after.


def draw_comparison(canvas: CanvasPainter) -> None:
    """The line between before and after, or what else than the edit alone is shown."""
    view, rect = canvas.editor.view, canvas.rect
    top = rect.y + theme.pt(12)
    if view.is_before or view.split is None:
        canvas.label(canvas.editor.looking.badge, rect.x + theme.pt(12), top)
        return
    x = rect.x + view.split * rect.width
    high, low = ImVec2(x, rect.y), ImVec2(x, rect.y + rect.height)
    canvas.line(high, low, WHITE, width=2, alpha=1.0)
    grip = ImVec2(x, rect.y + rect.height / 2)
    canvas.draw.add_circle_filled(grip, theme.pt(9), theme.u32(DARK, 0.7))
    canvas.draw.add_circle_filled(grip, theme.pt(7), theme.u32(WHITE))
    left = x - rect.x
    for text, side, room in ((t("Before"), 1.0, left), (t("After"), 0.0, rect.width - left)):
        if canvas.label_width(text) + theme.pt(12) <= room:
            canvas.label(text, x + theme.pt(12) * (1 - 2 * side), top, side)
