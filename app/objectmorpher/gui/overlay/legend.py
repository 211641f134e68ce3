"""The legend of the view's colours: a small panel in the canvas's corner."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from imgui_bundle import ImVec2, imgui

from ...canvas.painter import DEPTH_STOPS, FULL_STRAIN, STRAIN_STOPS, Stops, shown_now
from ...canvas.shares import shares
from ...editor.editor import Editor
from ...editor.view import Shown
from ...render.scene import Hatch
from ...system.texts import t
from ..widgets.panes import Rect
from ..widgets.theme import PRIMARY, theme
from ..widgets.widgets import bold_text, small_text
from ..window.scenes import INPAINTED, LIFTED, REFINED
from .canvas import DARK, WHITE

WIDTH = 216.0  # points
LINE = 20.0
BAR = 12.0
PAD = 12.0
SWATCH = 14.0
GREY = "#B9BDC5"


class Legend:
    """Draws the panel of one frame. What it says grows upwards from the corner."""

    def __init__(self, editor: Editor, rect: Rect) -> None:
        """`rect`: the canvas."""
        self._editor, self._draw = editor, imgui.get_background_draw_list()
        self._shown = shown_now(editor.document, editor.view)
        rows: dict[Shown, tuple[float, Callable[[], None]]] = {
            Shown.OBJECT: (0.0, lambda: None),
            Shown.DEPTH: (BAR + 2 * LINE, self._draw_depth),
            Shown.NORMALS: (3 * LINE, self._draw_normals),
            Shown.PROVENANCE: (self._provenance_rows * LINE, self._draw_provenance),
            Shown.STRAIN: (BAR + 2 * LINE, self._draw_strain),
        }
        self._height, self._draw_rows = rows.get(self._shown, (0.0, lambda: None))
        self._left = rect.x + rect.width - theme.pt(PAD + WIDTH)
        folded = 0.0 if editor.view.has_panel else PRIMARY + PAD  # the next step has the corner
        self._top = rect.y + rect.height - theme.pt(PAD + self._panel_height + folded)
        self._y = self._top

    @property
    def _provenance_rows(self) -> int:
        document = self._editor.document
        if document is None:
            return 4
        is_painted = any(item.is_painted for item in document.objects)
        return 4 + is_painted + (document.refined is not None)

    @property
    def _panel_height(self) -> float:
        """Points."""
        return self._height + LINE + PAD + (4.0 if self._height else 0.0)

    def draw(self) -> None:
        if self._shown is Shown.COMPOSITE:
            return
        low = ImVec2(self._left, self._top)
        high = ImVec2(self._left + theme.pt(WIDTH), self._top + theme.pt(self._panel_height))
        self._draw.add_rect_filled(low, high, theme.u32(DARK, 0.85), theme.pt(6))
        self._y += theme.pt(PAD / 2)
        with bold_text():
            self._text(t(self._shown.value), WHITE)
        with small_text():
            self._text(t("Alt+1: photo"), GREY, side=1.0)
            self._y += theme.pt(LINE + 4)
            self._draw_rows()

    # Rows

    def _draw_depth(self) -> None:
        document = self._editor.opened
        half = self._editor.cache.painter.spread(document).half
        self._bar(DEPTH_STOPS)
        self._text(t("near  −{half}", half=f"{half:.2f}"), WHITE)
        self._text(t("+{half}  far", half=f"{half:.2f}"), WHITE, side=1.0)
        self._y += theme.pt(LINE)
        self._text(t("object diameters from its middle"), GREY)

    def _draw_strain(self) -> None:
        self._bar(STRAIN_STOPS)
        self._text("0 %", WHITE)
        self._text(f"{50 * FULL_STRAIN:.0f} %", WHITE, side=0.5)
        self._text(t("{percent} % or more", percent=f"{100 * FULL_STRAIN:.0f}"), WHITE, side=1.0)
        self._y += theme.pt(LINE)
        self._text(t("longer or shorter than in the photo"), GREY)

    def _draw_normals(self) -> None:
        rows = (
            ((1.0, 0.5, 0.5), t("facing right")),
            ((0.5, 1.0, 0.5), t("facing up")),
            ((0.5, 0.5, 1.0), t("facing the camera")),
        )
        for color, text in rows:
            self._swatch(color, None)
            self._row(text)

    def _draw_provenance(self) -> None:
        editor = self._editor
        assert editor.history is not None
        counted = shares(editor.history.document, editor.cache)  # too slow for a drag
        grey = (0.55, 0.55, 0.55)
        rows: list[tuple[Hatch | None, str, float]] = [
            (None, t("from the photo"), counted.from_photo),
            (LIFTED, t("invented on the object"), counted.from_lifter),
            (INPAINTED, t("invented behind it"), counted.from_inpainter),
        ]
        document = editor.document or editor.history.document  # whose rows were counted
        if any(item.is_painted for item in document.objects):
            rows.insert(2, (LIFTED, t("painted on it"), counted.from_paint))
        if document.refined is not None:
            rows.append((REFINED, t("refined by the network"), counted.from_refiner))
        for hatch, text, share in rows:
            self._swatch(grey, hatch)
            self._text(f"{share:.0%}".replace("%", " %"), WHITE, side=1.0)
            self._row(text)
        is_changed = counted.changed > 0
        said = t("of the changed pixels")
        if editor.preview is not None:
            said = t("of the changed pixels, before this drag")
        self._text(said if is_changed else t("nothing is changed"), GREY)

    # Parts of rows

    def _text(self, text: str, color: str, side: float = 0.0, indent: float = 0.0) -> None:
        """On the current line; `side`: 0 at its left end, 1 at its right."""
        room = theme.pt(WIDTH - 2 * PAD) - imgui.calc_text_size(text).x
        x = self._left + theme.pt(PAD + indent) + side * room
        middle = self._y + (theme.pt(LINE) - imgui.get_font_size()) / 2
        self._draw.add_text(ImVec2(round(x), round(middle)), theme.u32(color), text)

    def _row(self, text: str) -> None:
        """Beside a swatch; the line ends."""
        self._text(text, WHITE, indent=SWATCH + 8)
        self._y += theme.pt(LINE)

    def _bar(self, stops: Stops) -> None:
        left, width = self._left + theme.pt(PAD), theme.pt(WIDTH - 2 * PAD)
        step = width / (len(stops) - 1)
        colors = [_u32(stop) for stop in stops]
        for k, (a, b) in enumerate(pairwise(colors)):
            low = ImVec2(left + k * step, self._y)
            high = ImVec2(left + (k + 1) * step, self._y + theme.pt(BAR))
            self._draw.add_rect_filled_multi_color(low, high, a, b, b, a)
        self._y += theme.pt(BAR)

    def _swatch(self, color: tuple[float, float, float], hatch: Hatch | None) -> None:
        side, gap = theme.pt(SWATCH), theme.pt((LINE - SWATCH) / 2)
        low = ImVec2(self._left + theme.pt(PAD), self._y + gap)
        high = ImVec2(low.x + side, low.y + side)
        if hatch is None:
            self._draw.add_rect_filled(low, high, _u32(color))
            return
        dimmed = tuple(c * hatch.brightness for c in color)
        self._draw.add_rect_filled(low, high, _u32((dimmed[0], dimmed[1], dimmed[2])))
        self._draw.push_clip_rect(low, high, True)
        ink, width = _u32(hatch.ink), theme.scale * 2.2
        for k in range(-1, 4):  # as the shader draws them: x + slant y constant along a stripe
            x = low.x + (k + 0.25) * side / 2
            bottom, top = ImVec2(x, high.y + 1), ImVec2(x + side + 1, low.y)
            if hatch.slant < 0:
                bottom, top = ImVec2(x + side + 1, high.y + 1), ImVec2(x, low.y)
            if hatch.slant == 0:
                top = ImVec2(x, low.y)
            self._draw.add_line(bottom, top, ink, width)
        self._draw.pop_clip_rect()


def _u32(color: tuple[float, float, float]) -> int:
    return imgui.color_convert_float4_to_u32(imgui.ImVec4(*color, 1.0))
