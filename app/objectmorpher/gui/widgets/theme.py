"""Colours, fonts, measures: the one place that decides how things look."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import imgui_bundle
from imgui_bundle import ImVec2, ImVec4, imgui

FONTS = Path(imgui_bundle.__file__).parent / "assets" / "fonts"  # which imgui-bundle comes with
REGULAR, BOLD, ICONS = (
    FONTS / "Roboto" / "Roboto-Regular.ttf",
    FONTS / "Roboto" / "Roboto-Bold.ttf",
    FONTS / "Font_Awesome_6_Free-Solid-900.otf",
)
FONT_SIZE = 16.0  # ImGui counts line height: 16 is 14-point text
SMALL_SIZE = 14.0
TITLE_SIZE = 28.0
ICON_SIZE = 15.0

MENU = 32.0  # points: heights and widths of the window's parts
TABS = 32.0
STRIP = 48.0
INSPECTOR = 300.0
FOLDED = 36.0  # the inspector where there is no room for it
LEAST_SIZE = (640, 420)  # of the window
STATUS = 28.0
FIELD = 28.0  # height of fields and buttons
PRIMARY = 40.0
RADIUS = 6.0

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Palette:
    """Colours by role, #RRGGBB."""

    surround: str
    panel: str
    raised: str
    hovered: str
    pressed: str
    line: str
    text: str
    secondary: str
    accent: str
    accent_hovered: str
    on_accent: str
    warning: str
    error: str


DARK = Palette(
    surround="#1E1F22", panel="#26282C", raised="#30333A", hovered="#3A3E46", pressed="#454A54",
    line="#34373D", text="#E6E7E9", secondary="#A9ADB5", accent="#5AA9FF",
    accent_hovered="#7BBBFF", on_accent="#0C1A29", warning="#F2B84B", error="#F2695C",
)  # fmt: skip
LIGHT = Palette(
    surround="#D9DADC", panel="#F4F5F6", raised="#E4E6E9", hovered="#D8DBDF", pressed="#C9CDD3",
    line="#D5D7DB", text="#1D1F23", secondary="#555A63", accent="#1668C8",
    accent_hovered="#0F5AB2", on_accent="#FFFFFF", warning="#8A5A00", error="#B3261E",
)  # fmt: skip
PALETTES = {"dark": DARK, "light": LIGHT}


class Icon:
    """Glyphs of Font Awesome 6 Free Solid."""

    SELECT = "\uf245"
    BRUSH = "\uf1fc"
    WAND = "\ue2ca"
    BOX = "\uf5cb"
    LASSO = "\uf5ee"
    INVERT = "\uf042"
    GROW = "\uf424"
    SHRINK = "\uf422"
    SMOOTH = "\uf55b"
    FEATHER = "\uf52d"
    FILL = "\uf576"
    BROOM = "\uf51a"
    IMPORT = "\uf56f"
    POSE = "\uf25a"
    PLACE = "\uf0b2"
    LAYERS = "\uf5fd"
    UNDO = "\uf2ea"
    REDO = "\uf2f9"
    OPEN = "\uf07c"
    IMAGE = "\uf03e"
    EXPORT = "\uf56e"
    EYE = "\uf06e"
    EYE_OFF = "\uf070"
    PLUS = "\uf067"
    MINUS = "\uf068"
    CLOSE = "\uf00d"
    TRASH = "\uf1f8"
    CUBE = "\uf1b2"
    PERSON = "\uf007"
    WARNING = "\uf071"
    INFO = "\uf05a"
    CHECK = "\uf00c"
    UP = "\uf062"
    DOWN = "\uf063"
    COPY = "\uf24d"
    LOCK = "\uf023"
    LOCK_OPEN = "\uf3c1"
    FOLDER = "\uf07b"
    FILE = "\uf15b"
    RESET = "\uf2ea"
    ERASE = "\uf12d"
    SPLIT = "\uf0db"
    ARROW = "\uf061"
    FREEZE = "\uf2dc"
    STIFFEN = "\uf44b"
    BODY = "\uf247"
    CUT = "\uf0c4"
    GLUE = "\uf0c1"


class Theme:
    """The palette in use and the scale of the monitor. One instance, `theme`."""

    def __init__(self) -> None:
        self.palette = DARK
        self.scale = 1.0  # window units per point
        self.bold: imgui.ImFont | None = None

    def pt(self, points: float) -> float:
        """Window units of a measure in points, on whole pixels."""
        return float(round(points * self.scale))

    def size(self, width: float, height: float) -> ImVec2:
        return ImVec2(self.pt(width), self.pt(height))

    def u32(self, role: str, alpha: float = 1.0) -> int:
        """A role's colour for draw lists; `role` may be #RRGGBB too."""
        return _u32(self._code(role), round(255 * alpha))

    def vec(self, role: str, alpha: float = 1.0) -> ImVec4:
        r, g, b = self.rgb(role)
        return ImVec4(r, g, b, alpha)

    def rgb(self, role: str) -> Colour:
        return rgb(self._code(role))

    def _code(self, role: str) -> str:
        return role if role.startswith("#") else getattr(self.palette, role)


theme = Theme()


@cache
def rgb(code: str) -> Colour:
    """(r, g, b) in [0, 1] of #RRGGBB."""
    return tuple(int(code[i : i + 2], 16) / 255 for i in (1, 3, 5))  # type: ignore[return-value]


@cache  # asked for a thousand times a frame, of a few dozen colours
def _u32(code: str, alpha: int) -> int:
    """`alpha` of 255."""
    return imgui.color_convert_float4_to_u32(ImVec4(*rgb(code), alpha / 255))


def load_fonts() -> None:
    """The UI family with the icons merged in, and its bold."""
    fonts = imgui.get_io().fonts
    fonts.clear()
    fonts.add_font_from_file_ttf(str(REGULAR), FONT_SIZE)
    icons = imgui.ImFontConfig()
    icons.merge_mode = True
    icons.glyph_min_advance_x = ICON_SIZE + 3
    icons.glyph_max_advance_x = ICON_SIZE + 3
    icons.glyph_offset = ImVec2(0.0, 0.5)
    fonts.add_font_from_file_ttf(str(ICONS), ICON_SIZE, icons)
    theme.bold = fonts.add_font_from_file_ttf(str(BOLD), FONT_SIZE)


def apply(name: str, scale: float) -> None:
    """Sets palette and measures; anew whenever the theme or the monitor changes."""
    theme.palette, theme.scale = PALETTES[name], scale
    style = imgui.Style()
    _set_measures(style)
    _set_colours(style)
    style.scale_all_sizes(scale)
    style.font_scale_dpi = scale
    style.font_size_base = FONT_SIZE
    style.hover_delay_short = 0.15
    style.hover_delay_normal = 0.45
    current = imgui.get_style()
    for field in _FIELDS:
        setattr(current, field, getattr(style, field))
    for i in range(imgui.Col_.count.value):
        current.set_color_(i, style.color_(i))


_FIELDS = (
    "window_padding", "window_rounding", "window_border_size", "frame_padding", "frame_rounding",
    "frame_border_size", "item_spacing", "item_inner_spacing", "popup_rounding",
    "popup_border_size", "child_rounding", "child_border_size", "scrollbar_size",
    "scrollbar_rounding", "grab_rounding", "grab_min_size", "indent_spacing", "cell_padding",
    "disabled_alpha", "font_scale_dpi", "font_size_base", "hover_delay_short",
    "hover_delay_normal", "selectable_text_align", "window_min_size", "menu_item_rounding",
    "selectable_rounding", "separator_size", "image_border_size", "image_rounding",
)  # fmt: skip


def _set_measures(style: imgui.Style) -> None:
    style.window_padding = ImVec2(12, 12)
    style.window_rounding = 0
    style.window_border_size = 0
    style.window_min_size = ImVec2(4, 4)
    style.frame_padding = ImVec2(8, 6)
    style.frame_rounding = style.popup_rounding = style.grab_rounding = RADIUS
    style.menu_item_rounding = style.selectable_rounding = 4
    style.item_spacing = ImVec2(8, 8)
    style.item_inner_spacing = ImVec2(8, 4)
    style.popup_border_size = 1
    style.child_border_size = 0
    style.child_rounding = RADIUS
    style.scrollbar_size = 10
    style.scrollbar_rounding = 5
    style.separator_size = 1
    style.disabled_alpha = 0.45
    style.image_border_size = 0
    style.image_rounding = RADIUS


def _set_colours(style: imgui.Style) -> None:
    roles = {
        "text": "text", "text_disabled": "secondary", "window_bg": "panel", "popup_bg": "panel",
        "border": "line", "frame_bg": "raised", "frame_bg_hovered": "hovered",
        "frame_bg_active": "pressed", "menu_bar_bg": "panel", "scrollbar_grab": "hovered",
        "scrollbar_grab_hovered": "pressed", "scrollbar_grab_active": "pressed",
        "check_mark": "on_accent", "checkbox_selected_bg": "accent",
        "button": "raised", "button_hovered": "hovered",
        "button_active": "pressed", "header": "raised", "header_hovered": "hovered",
        "header_active": "pressed", "separator": "line", "nav_cursor": "text",
        "title_bg": "panel", "title_bg_active": "panel", "slider_grab": "accent",
        "slider_grab_active": "accent_hovered", "plot_histogram": "accent",
        "input_text_cursor": "accent",
    }  # fmt: skip
    for name, role in roles.items():
        style.set_color_(getattr(imgui.Col_, name).value, theme.vec(role))
    style.set_color_(imgui.Col_.child_bg.value, theme.vec("panel", 0.0))
    style.set_color_(imgui.Col_.scrollbar_bg.value, theme.vec("panel", 0.0))
    style.set_color_(imgui.Col_.border_shadow.value, theme.vec("panel", 0.0))
    style.set_color_(imgui.Col_.text_selected_bg.value, theme.vec("accent", 0.35))
    style.set_color_(imgui.Col_.modal_window_dim_bg.value, theme.vec("#000000", 0.45))
