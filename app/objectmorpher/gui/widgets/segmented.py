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
    choices = [
        Segment(method.name, _label(editor, stage, method.name), why_not=method.why_not)
        for method in editor.methods.of(stage)
    ]
    chosen = editor.methods.chosen(stage)
    imgui.set_next_item_width(FILL)
    if (wanted := unfolding(stage, choices, chosen, stage)) != chosen:
        editor.methods.choose(stage, wanted)


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
    return _draw_row(name, choices, len(choices), chosen, is_tall=False)


def unfolding(name: str, choices: Sequence[Segment[T]], chosen: T, marked: str = "") -> T:
    """A list that unfolds, and the chosen one of its values; `marked`: how tests call it."""
    preview = next(choice.label for choice in choices if choice.value == chosen)
    is_open, before = imgui.begin_combo(f"##{name}", preview), chosen
    mark(marked or preview)
    if not is_open:
        return chosen
    for choice in choices:
        flags = imgui.SelectableFlags_.disabled if choice.why_not else imgui.SelectableFlags_.none
        if imgui.selectable(choice.label, choice.value == before, flags)[0]:
            chosen = choice.value
        if choice.value == before:
            imgui.set_item_default_focus()  # the arrows go on from it
        mark(f"{marked}: {choice.value}" if marked else choice.label)
        if choice.why_not:
            tooltip(sentence(choice.why_not))
    if imgui.is_key_pressed(imgui.Key.escape):
        imgui.close_current_popup()
    imgui.end_combo()
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
        chosen = _draw_row(f"{name}{first}", row, across, chosen, is_tall=True)
    return chosen


def _draw_row(
    name: str, choices: Sequence[Segment[T]], columns: int, chosen: T, is_tall: bool
) -> T:
    """`is_tall`: each icon above its word, else before it."""
    start = imgui.get_cursor_screen_pos()
    width, height = imgui.get_content_region_avail().x, theme.pt(TALL if is_tall else FIELD)
    part, end = width / columns, ImVec2(start.x + width, start.y + height)
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(start, end, theme.u32("raised"), theme.pt(RADIUS))
    for i, choice in enumerate(choices):
        low = ImVec2(round(start.x + i * part), start.y)
        size = ImVec2(round(start.x + (i + 1) * part) - low.x, height)
        imgui.set_cursor_screen_pos(low)
        imgui.begin_disabled(choice.why_not is not None)
        if drawn_button(f"##{name}{i}", size):
            chosen = choice.value
        has_word = bool(clean(choice.label)) and not (is_tall and choice.hint)
        mark(choice.label if has_word else choice.hint)
        imgui.end_disabled()
        is_hovered = imgui.is_item_hovered()
        if choice.hint or choice.why_not:
            tooltip("\n".join(text for text in (choice.hint, choice.why_not) if text))
        role = _draw_ground(low, size, choice.value == chosen, is_hovered)
        (_draw_tall if is_tall else _draw_flat)(low, size, choice, role)
    imgui.set_cursor_screen_pos(ImVec2(start.x, end.y))
    imgui.dummy(ImVec2(width, 0))
    return chosen


def _draw_flat(low: ImVec2, size: ImVec2, choice: Segment, role: str) -> None:
    alpha = imgui.get_style().disabled_alpha if choice.why_not else 1.0
    shown = f"{choice.icon}  {choice.label}" if choice.icon else choice.label
    text = imgui.calc_text_size(shown)
    at = ImVec2(round(low.x + (size.x - text.x) / 2), round(low.y + (size.y - text.y) / 2))
    imgui.get_window_draw_list().add_text(at, theme.u32(role, alpha), shown)


def _draw_tall(low: ImVec2, size: ImVec2, choice: Segment, role: str) -> None:
    draw, ink, middle = imgui.get_window_draw_list(), theme.u32(role), low.x + size.x / 2
    left = round(middle - imgui.calc_text_size(choice.icon).x / 2)
    draw.add_text(ImVec2(left, round(low.y + theme.pt(6))), ink, choice.icon)
    imgui.push_font(None, WORD)
    word = imgui.calc_text_size(choice.label)
    top = round(low.y + size.y - theme.pt(5) - word.y)
    draw.add_text(ImVec2(round(middle - word.x / 2), top), ink, choice.label)
    imgui.pop_font()


def _draw_ground(low: ImVec2, size: ImVec2, is_chosen: bool, is_hovered: bool) -> str:
    """Draw what lies behind a part; the role of the colour of what stands on it."""
    draw, inset = imgui.get_window_draw_list(), theme.pt(INSET)
    if is_chosen or is_hovered:
        inner = ImVec2(low.x + inset, low.y + inset)
        outer = ImVec2(low.x + size.x - inset, low.y + size.y - inset)
        fill = theme.u32("accent" if is_chosen else "hovered")
        draw.add_rect_filled(inner, outer, fill, theme.pt(RADIUS - INSET))
    return "on_accent" if is_chosen else "secondary"
