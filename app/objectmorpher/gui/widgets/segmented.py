"""A row of choices of which one holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from imgui_bundle import ImVec2, imgui

from ...editor.editor import Editor
from ...editor.settings import AUTO
from ...system.texts import sentence, t
from ..window.landmarks import clean, mark
from .theme import FIELD, RADIUS, theme
from .widgets import drawn_button, tooltip

# Who does a stage: a list of its backends, those that cannot run here with the reason.

NAMES = {
    "dino": "DINOv2's pieces", "grabcut": "Colours", "sam2": "SAM 2.1", "sam3": "SAM 3",
    "sam": "SAM", "sam-onnx": "Small SAMs (ONNX)",
    "relief": "Relief", "trellis": "TRELLIS", "cupid": "CUPID", "triposplat": "TripoSplat",
    "pixelhacker": "PixelHacker", "moebius": "Moebius", "lama": "LaMa", "migan": "MI-GAN",
    "patchmatch": "Patches", "telea": "Smooth",
    "qwen": "Qwen-Image-Edit", "klein": "FLUX.2 klein",
}  # fmt: skip
FILL = -1.0  # as wide as there is room


def draw_method(editor: Editor, stage: str) -> None:
    """The list of "segment", "lift", "inpaint" or "refine"; what is chosen holds from now on."""
    chosen = editor.methods.chosen(stage)
    imgui.set_next_item_width(FILL)
    is_open = imgui.begin_combo(f"##{stage}", _label(editor, stage, chosen))
    mark(stage)
    if not is_open:
        return
    for method in editor.methods.of(stage):
        is_disabled = method.why_not is not None
        flags = imgui.SelectableFlags_.disabled if is_disabled else imgui.SelectableFlags_.none
        label = _label(editor, stage, method.name)
        if imgui.selectable(label, method.name == chosen, flags)[0]:
            editor.methods.choose(stage, method.name)
        if method.name == chosen:
            imgui.set_item_default_focus()  # the arrows go on from it
        mark(f"{stage}: {method.name}")
        if method.why_not is not None:
            tooltip(sentence(method.why_not))
    if imgui.is_key_pressed(imgui.Key.escape):
        imgui.close_current_popup()
    imgui.end_combo()


def _label(editor: Editor, stage: str, name: str) -> str:
    """A backend's name for people; "auto" also names the one it stands for, once it is known."""
    if name != AUTO:
        return _named(name)
    taken = editor.methods.taken(stage)
    return t("Automatic: {name}", name=_named(taken)) if taken else t("Automatic")


def _named(name: str) -> str:
    """What a backend is called for people: a model's own id stays as it is."""
    return t(NAMES[name]) if name in NAMES else name


T = TypeVar("T")
INSET = 2.0  # points between the row's edge and the chosen part
TALL = 44.0  # points, height of a row whose words stand below their icons
WORD = 13.0  # points, size of those words
ASIDE = 1.0  # points, at least, from a word to the edge of its part


@dataclass(frozen=True)
class Segment(Generic[T]):
    """One of several values. `why_not` greys it out and is its tooltip."""

    value: T
    label: str
    hint: str = ""
    why_not: str | None = None
    icon: str = ""


def segmented(name: str, choices: Sequence[Segment[T]], chosen: T) -> T:
    """Draw values side by side, as wide as there is room, and return the chosen one."""
    start = imgui.get_cursor_screen_pos()
    across = imgui.get_content_region_avail().x
    height, part = theme.pt(FIELD), across / len(choices)
    draw = imgui.get_window_draw_list()
    end = ImVec2(start.x + across, start.y + height)
    draw.add_rect_filled(start, end, theme.u32("raised"), theme.pt(RADIUS))
    for i, choice in enumerate(choices):
        low = ImVec2(round(start.x + i * part), start.y)
        size = ImVec2(round(start.x + (i + 1) * part) - low.x, height)
        imgui.set_cursor_screen_pos(low)
        imgui.begin_disabled(choice.why_not is not None)
        if drawn_button(f"##{name}{i}", size):
            chosen = choice.value
        mark(choice.label if clean(choice.label) else choice.hint)
        imgui.end_disabled()
        is_hovered = imgui.is_item_hovered()
        if choice.hint or choice.why_not:
            tooltip("\n".join(text for text in (choice.hint, choice.why_not) if text))
        _draw_part(low, size, choice, choice.value == chosen, is_hovered)
    imgui.set_cursor_screen_pos(ImVec2(start.x, end.y))
    imgui.dummy(ImVec2(across, 0))
    return chosen


def named_icons(name: str, choices: Sequence[Segment[T]], chosen: T) -> T:
    """Draw values side by side, each an icon above its word, and return the chosen one.

    Words that are too long for that, in another language, stand in two rows.
    """
    room = theme.pt(2 * (ASIDE + INSET))
    imgui.push_font(None, WORD)
    widest = max(imgui.calc_text_size(choice.label).x for choice in choices)
    imgui.pop_font()
    fits = len(choices) * (widest + room) <= imgui.get_content_region_avail().x
    across = len(choices) if fits else -(-len(choices) // 2)
    for first in range(0, len(choices), across):
        row = choices[first : first + across]
        chosen = _draw_row_of_icons(f"{name}{first}", row, across, chosen)
    return chosen


def _draw_row_of_icons(name: str, choices: Sequence[Segment[T]], columns: int, chosen: T) -> T:
    start = imgui.get_cursor_screen_pos()
    width, height = imgui.get_content_region_avail().x, theme.pt(TALL)
    part, end = width / columns, ImVec2(start.x + width, start.y + height)
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(start, end, theme.u32("raised"), theme.pt(RADIUS))
    for i, choice in enumerate(choices):
        low = ImVec2(round(start.x + i * part), start.y)
        size = ImVec2(round(start.x + (i + 1) * part) - low.x, height)
        imgui.set_cursor_screen_pos(low)
        if drawn_button(f"##{name}{i}", size):
            chosen = choice.value
        mark(choice.hint or choice.label)
        is_chosen, is_hovered = choice.value == chosen, imgui.is_item_hovered()
        if choice.hint:
            tooltip(choice.hint)
        role = _draw_ground(low, size, is_chosen, is_hovered)
        middle = low.x + size.x / 2
        icon = imgui.calc_text_size(choice.icon)
        draw.add_text(
            ImVec2(round(middle - icon.x / 2), round(low.y + theme.pt(6))), theme.u32(role),
            choice.icon,
        )  # fmt: skip
        imgui.push_font(None, WORD)
        word = imgui.calc_text_size(choice.label)
        at = ImVec2(round(middle - word.x / 2), round(end.y - theme.pt(5) - word.y))
        draw.add_text(at, theme.u32(role), choice.label)
        imgui.pop_font()
    imgui.set_cursor_screen_pos(ImVec2(start.x, end.y))
    imgui.dummy(ImVec2(width, 0))
    return chosen


def _draw_part(
    low: ImVec2, size: ImVec2, choice: Segment, is_chosen: bool, is_hovered: bool
) -> None:
    role = _draw_ground(low, size, is_chosen, is_hovered)
    alpha = imgui.get_style().disabled_alpha if choice.why_not else 1.0
    shown = f"{choice.icon}  {choice.label}" if choice.icon else choice.label
    text = imgui.calc_text_size(shown)
    at = ImVec2(round(low.x + (size.x - text.x) / 2), round(low.y + (size.y - text.y) / 2))
    imgui.get_window_draw_list().add_text(at, theme.u32(role, alpha), shown)


def _draw_ground(low: ImVec2, size: ImVec2, is_chosen: bool, is_hovered: bool) -> str:
    """Draw what lies behind a part; the role of the colour of what stands on it."""
    draw, inset = imgui.get_window_draw_list(), theme.pt(INSET)
    if is_chosen or is_hovered:
        inner = ImVec2(low.x + inset, low.y + inset)
        outer = ImVec2(low.x + size.x - inset, low.y + size.y - inset)
        fill = theme.u32("accent" if is_chosen else "hovered")
        draw.add_rect_filled(inner, outer, fill, theme.pt(RADIUS - INSET))
    return "on_accent" if is_chosen else "secondary"
