"""A pointer on the canvas for those who have no mouse: arrows move it, keys press at it."""

from __future__ import annotations

from imgui_bundle import ImVec2

from ...editor.editor import Editor
from ...tools.pointer import Button, Pointer
from ..overlay.canvas import DARK, WHITE, CanvasPainter
from ..widgets.theme import theme
from .landmarks import mark_on_canvas
from .layout import Rect

STRIDE, FAR = 8.0, 64.0  # points that an arrow moves it, and with Shift
EDGE = 24.0  # points to the canvas's edge; nearer to it the photo moves instead
ARM, HOLE = 14.0, 4.0  # points from the middle to the end and to the start of each line


class Crosshair:
    """Unseen until an arrow is pressed, and again when the mouse moves."""

    def __init__(self) -> None:
        self._xy: tuple[float, float] | None = None  # canvas px
        self.is_down = False  # a button is held at it
        self._mouse = (0.0, 0.0)

    @property
    def is_shown(self) -> bool:
        return self._xy is not None

    def hide(self) -> None:
        self._xy, self.is_down = None, False

    def follow_mouse(self, xy: tuple[float, float], has_acted: bool) -> None:
        """The mouse, where it is used, is the pointer again. A stroke in progress goes on."""
        is_used = has_acted or xy != self._mouse
        self._mouse = xy
        if is_used and not self.is_down:
            self.hide()

    def move(self, editor: Editor, dx: float, dy: float) -> None:
        """Move by so many canvas px; at the edge of the canvas the photo scrolls."""
        view, photo = editor.view, editor.photo_size
        if photo is None:
            return
        if self._xy is None:
            self._xy = self._start(editor)
        edge = min(EDGE * view.scale, view.width / 2, view.height / 2)
        x, y = self._xy[0] + dx, self._xy[1] + dy
        inside = (
            min(max(x, edge), max(view.width - edge, edge)),
            min(max(y, edge), max(view.height - edge, edge)),
        )
        if inside != (x, y) and not view.is_fitted:
            view.pan(inside[0] - x, inside[1] - y, photo)
        self._xy = inside

    def _start(self, editor: Editor) -> tuple[float, float]:
        """Where the mouse is on the photo, else in the middle of what is seen."""
        pointer = editor.pointer
        if pointer is not None and editor.is_on_photo(pointer.xy):
            return pointer.x, pointer.y
        return editor.view.width / 2, editor.view.height / 2

    def pointer(self, button: Button | None = None) -> Pointer:
        """Return a pressed pointer as the tools see it."""
        assert self._xy is not None
        return Pointer(*self._xy, button=button, is_down=True)

    def draw(self, editor: Editor, rect: Rect, pixel_ratio: float) -> None:
        """Four lines around the place, and a square while it holds something."""
        if self._xy is None or editor.document is None:
            return
        canvas = CanvasPainter(editor, rect, pixel_ratio)
        at = canvas.on_canvas(self.pointer().xy)[0]
        near, far = theme.pt(HOLE), theme.pt(ARM)
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            start = ImVec2(at.x + dx * near, at.y + dy * near)
            end = ImVec2(at.x + dx * far, at.y + dy * far)
            canvas.draw.add_line(start, end, theme.u32(DARK), theme.pt(5))
            canvas.draw.add_line(start, end, theme.u32(WHITE), theme.pt(2))
        if self.is_down:
            low, high = ImVec2(at.x - far, at.y - far), ImVec2(at.x + far, at.y + far)
            canvas.draw.add_rect(low, high, theme.u32(DARK), 0.0, thickness=theme.pt(5))
            canvas.draw.add_rect(low, high, theme.u32(WHITE), 0.0, thickness=theme.pt(2))
        mark_on_canvas("Crosshair", at, at)
