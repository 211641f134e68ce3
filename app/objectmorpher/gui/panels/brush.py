"""The brush's numbers, for every tool that paints."""

from __future__ import annotations

from dataclasses import replace

from ...editor.editor import Editor
from ...system.texts import t
from ...tools.navigate import LARGEST_BRUSH, SMALLEST_BRUSH
from ..widgets.widgets import Number, number_field

STEP = 0.2  # x the radius, of the - and + buttons


def draw_radius(editor: Editor) -> None:
    radius = editor.view.brush.radius
    step = max(STEP * radius, 0.5)  # a fifth of a large one is seen, and of a small one is left
    number = Number(t("Radius"), "%.1f px", 0.25, step, 20.0, SMALLEST_BRUSH, LARGEST_BRUSH)
    change = number_field(number, radius)
    if change.is_changed:
        editor.view.brush = replace(editor.view.brush, radius=change.value)


def draw_brush_fields(editor: Editor) -> None:
    """Draw the fields of the brush's size and hardness."""
    draw_radius(editor)
    number = Number(t("Hardness"), "%.0f %%", 0.5, 10.0, 80.0, 0.0, 100.0)
    change = number_field(number, 100 * editor.view.brush.hardness)
    if change.is_changed:
        editor.view.brush = replace(editor.view.brush, hardness=change.value / 100)
