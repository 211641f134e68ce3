"""The Compose tool's network, which makes the edit look as if it had been photographed."""

from __future__ import annotations

from imgui_bundle import imgui

from ...editor import Editor
from ...texts import sentence, t
from ..command_button import command_button
from ..method_choice import draw_method
from ..widgets import Number, half_width, heading, note, number_field


def draw_network(editor: Editor) -> None:
    """Which network, its buttons, and how much of what it made is shown."""
    heading(t("Network"))
    draw_method(editor, "refine")
    if (reason := editor.methods.why_not("refine")) is not None:
        note(f"{sentence(reason)}.")
        command_button(editor, "models", width=-1)
    if editor.refining.refined is None:
        command_button(editor, "refine", width=-1)
        note(t("Fits light, colour and edges of the edit; nothing outside it changes."))
        return
    half = half_width()
    command_button(editor, "refine", width=half)
    imgui.same_line()
    command_button(editor, "refine_again", width=half)
    number = Number(t("Amount"), "%.0f %%", 0.5, 5.0, 100.0, 0.0, 100.0)
    change = number_field(number, 100 * editor.refining.refined.strength)
    if change.is_changed:
        editor.refining.preview_strength(change.value / 100)
    if change.is_done:
        editor.commit(t("Amount of refinement"))
    command_button(editor, "unrefine", width=-1)
    note(t("It is removed as soon as you change the edit."))
