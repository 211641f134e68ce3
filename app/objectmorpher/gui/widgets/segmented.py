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


def _draw_part(
    low: ImVec2, size: ImVec2, choice: Segment, is_chosen: bool, is_hovered: bool
) -> None:
    draw, inset = imgui.get_window_draw_list(), theme.pt(INSET)
    if is_chosen or is_hovered:
        inner = ImVec2(low.x + inset, low.y + inset)
        outer = ImVec2(low.x + size.x - inset, low.y + size.y - inset)
        fill = theme.u32("accent" if is_chosen else "hovered")
        draw.add_rect_filled(inner, outer, fill, theme.pt(RADIUS - INSET))
    role = "on_accent" if is_chosen else "secondary"
    alpha = imgui.get_style().disabled_alpha if choice.why_not else 1.0
    shown = f"{choice.icon}  {choice.label}" if choice.icon else choice.label
    text = imgui.calc_text_size(shown)
    at = ImVec2(round(low.x + (size.x - text.x) / 2), round(low.y + (size.y - text.y) / 2))
    draw.add_text(at, theme.u32(role, alpha), shown)
