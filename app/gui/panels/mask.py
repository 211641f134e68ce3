"""The Mask tool's settings: the brush, and the selection's edge."""

from __future__ import annotations

from dataclasses import replace

from ...editor import Editor
from ...texts import t
from ...tools.navigate import LARGEST_BRUSH, SMALLEST_BRUSH
from ..segmented import Choice, segmented
from ..theme import Icon
from ..widgets import Number, gap, heading, note, number_field
from .edge import draw_command, draw_edge, draw_lift_warning


def draw_mask(editor: Editor) -> None:
    heading(t("Brush"))
    selecting, brush = editor.view.selecting, editor.view.brush
    modes = (
        Choice(False, t("Paint"), t("The brush adds to the selection"), icon=Icon.BRUSH),
        Choice(True, t("Erase"), t("The brush takes away from the selection"), icon=Icon.ERASE),
    )
    selecting.is_erasing = segmented("brush", modes, selecting.is_erasing)
    size = Number(
        t("Radius"), "%.1f px", 0.25, 5.0, rest=20.0, low=SMALLEST_BRUSH, high=LARGEST_BRUSH
    )
    hardness = Number(t("Hardness"), "%.0f %%", 0.5, 10.0, rest=80.0, high=100.0)
    radius = number_field(size, brush.radius).value
    hard = number_field(hardness, 100 * brush.hardness).value / 100
    editor.view.brush = replace(brush, radius=radius, hardness=hard)
    if hard >= 1:
        note(t("A fully hard brush leaves the edge to the photo."))
    draw_lift_warning(editor)
    gap(12)
    draw_edge(editor)
    gap(12)
    draw_command(editor, "clear")
