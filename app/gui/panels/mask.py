"""The Mask tool's settings: the brush, and the selection's edge."""

from __future__ import annotations

from ...editor import Editor
from ...texts import t
from ..segmented import Choice, segmented
from ..theme import Icon
from ..widgets import gap, heading, note
from .brush import draw_brush_fields
from .edge import draw_command, draw_edge, draw_lift_warning


def draw_mask(editor: Editor) -> None:
    heading(t("Brush"))
    selecting = editor.view.selecting
    modes = (
        Choice(False, t("Paint"), t("The brush adds to the selection"), icon=Icon.BRUSH),
        Choice(True, t("Erase"), t("The brush takes away from the selection"), icon=Icon.ERASE),
    )
    selecting.is_erasing = segmented("brush", modes, selecting.is_erasing)
    draw_brush_fields(editor)
    if editor.view.brush.hardness >= 1:
        note(t("A fully hard brush leaves the edge to the photo."))
    draw_lift_warning(editor)
    gap(12)
    draw_edge(editor)
    gap(12)
    draw_command(editor, "clear")
