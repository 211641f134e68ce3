"""The Mask tool's settings: the brush, and the selection's edge."""

from __future__ import annotations

from ...editor.editor import Editor
from ...editor.view import Painted
from ...system.texts import t
from ..widgets.segmented import Segment, segmented
from ..widgets.theme import Icon
from ..widgets.widgets import command_button, gap, heading, note
from .brush import draw_brush_fields, draw_radius
from .edge import draw_command, draw_decontaminate, draw_edge, draw_refinement_note


def draw_mask(editor: Editor) -> None:
    heading(t("Brush"))
    selecting = editor.view.selecting
    selecting.painted = segmented("painted", _kinds(), selecting.painted)
    selecting.is_erasing = segmented("brush", _ways(selecting.painted), selecting.is_erasing)
    if selecting.painted is Painted.EDGE:
        _draw_edge_brush(editor)
        return
    draw_brush_fields(editor)
    if selecting.painted is not Painted.SELECTION:
        _draw_shape_facts(editor)
        return
    if editor.view.brush.hardness >= 1:
        note(t("With a fully hard brush the edge follows the photo."))
    draw_refinement_note(editor)
    gap(12)
    draw_edge(editor)
    gap(12)
    draw_command(editor, "clear")


def _kinds() -> tuple[Segment[Painted], ...]:
    return (
        Segment(Painted.SELECTION, t("Selection"), t("What belongs to the object")),
        Segment(Painted.EDGE, t("Edge"), t("Where hair, fur or a halo need a second look")),
        Segment(Painted.DEPTH, t("Depth"), t("Which parts of it are nearer than it looks")),
        Segment(Painted.HIDDEN, t("Hidden"), t("Where it goes on behind something else")),
    )


def _ways(painted: Painted) -> tuple[Segment[bool], Segment[bool]]:
    if painted is Painted.DEPTH:
        return (
            Segment(False, t("Nearer"), t("The brush brings a part nearer"), icon=Icon.UP),
            Segment(True, t("Farther"), t("The brush pushes a part back"), icon=Icon.DOWN),
        )
    if painted is Painted.EDGE:
        return (
            Segment(False, t("Find"), t("The brush looks for the edge again"), icon=Icon.BRUSH),
            Segment(True, t("Restore"), t("The edge is as it was found at first"), icon=Icon.ERASE),
        )
    if painted is Painted.HIDDEN:
        return (
            Segment(False, t("Paint"), t("The object goes on here, unseen"), icon=Icon.BRUSH),
            Segment(True, t("Erase"), t("It does not go on here"), icon=Icon.ERASE),
        )
    return (
        Segment(False, t("Paint"), t("The brush adds to the selection"), icon=Icon.BRUSH),
        Segment(True, t("Erase"), t("The brush takes away from the selection"), icon=Icon.ERASE),
    )


def _draw_edge_brush(editor: Editor) -> None:
    """The brush that finds an edge again, and what takes the background's colour out of it."""
    draw_radius(editor)
    note(t("Paint along an edge with hair, fur or a halo, wherever the object is now: it is found "
           "again there."))  # fmt: skip
    gap(12)
    heading(t("Decontaminate"))
    draw_decontaminate(editor)


def _draw_shape_facts(editor: Editor) -> None:
    """What the two brushes that tell about the shape are for."""
    is_depth = editor.view.selecting.painted is Painted.DEPTH
    if (reason := editor.shaping.why_fixed) is not None:
        note(f"{reason}.")
        return
    if is_depth:
        note(t("An arm before a body: paint it nearer. Each stroke brings it a little nearer; its "
               "edges follow the photo's."))  # fmt: skip
    else:
        note(t("Paint on, where something stands before the object: it is completed there, in 3D "
               "and in colour."))  # fmt: skip
    if not editor.is_lifted:
        note(t("It takes effect when you lift the object."))
    command_button(editor, "clear_painted")
