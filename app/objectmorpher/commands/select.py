"""The selection, its edge, its file, and lifting what is selected."""

from __future__ import annotations

from ..editor.editor import Editor
from ..editor.filing import Dialog
from ..editor.view import Painted, ToolName
from ..system.texts import t
from .command import Command, asks_for, cannot_lift, no_lift, no_selection


def _no_soft_edge(editor: Editor) -> str | None:
    is_soft = editor.masking.is_soft
    return no_selection(editor) or (
        None if is_soft else t("The edge is found in the photo already")
    )


def _nothing_left_out(editor: Editor) -> str | None:
    is_any = bool(editor.leaving_out.pieces)
    return no_lift(editor) or (None if is_any else t("Nothing beside it looks like a part of it"))


def _not_a_file(editor: Editor) -> str | None:
    is_file = editor.shaping.why_fixed is not None
    return no_lift(editor) or (None if is_file else t("It was lifted from this photo"))


def _nothing_painted(editor: Editor) -> str | None:
    shape, painted = editor.shaping.settings, editor.view.selecting.painted
    field = shape.hidden if painted is Painted.HIDDEN else shape.nearness
    return no_selection(editor) or (None if field is not None else t("Nothing is painted yet"))


def _is_edge_brush(editor: Editor) -> bool:
    return editor.view.tool is ToolName.MASK and editor.view.selecting.painted is Painted.EDGE


def _toggle_edge_brush(editor: Editor) -> None:
    """To the edge brush, or from it back to the brush of the selection."""
    is_on = _is_edge_brush(editor)
    editor.choose_tool(ToolName.MASK)
    editor.view.selecting.painted = Painted.SELECTION if is_on else Painted.EDGE


COMMANDS: dict[str, Command] = {
    "subject": Command("Select subject", "Ctrl+Shift+A", lambda e: e.selection.select_subject()),
    "invert": Command(
        "Invert selection", "Ctrl+Shift+I", lambda e: e.masking.invert(), no_selection
    ),
    "clear": Command("Clear selection", "Ctrl+D", lambda e: e.selection.clear(), no_selection),
    "grow": Command("Grow", "", lambda e: e.masking.grow(), no_selection),
    "shrink": Command("Shrink", "", lambda e: e.masking.shrink(), no_selection),
    "smooth": Command("Smooth", "", lambda e: e.masking.smooth(), no_selection),
    "feather": Command("Feather", "", lambda e: e.masking.feather(), no_selection),
    "fill_holes": Command("Fill holes", "", lambda e: e.masking.fill_holes(), no_selection),
    "remove_islands": Command(
        "Remove islands", "", lambda e: e.masking.remove_islands(), no_selection
    ),
    "add_left_out": Command(
        "Add what was left out", "", lambda e: e.leaving_out.add(), _nothing_left_out
    ),
    "harden": Command("Edge from the photo", "", lambda e: e.masking.harden(), _no_soft_edge),
    "edge_brush": Command("Edge brush", "E", _toggle_edge_brush, no_selection, _is_edge_brush),
    "decontaminate": Command(
        "Decontaminate edge",
        "",
        lambda e: e.edging.toggle_decontaminate(),
        no_lift,
        lambda e: e.edging.decontaminate > 0,
    ),
    "import_mask": Command("Import mask…", "", asks_for(Dialog.MASK_OPEN)),
    "export_mask": Command("Export mask…", "", asks_for(Dialog.MASK_SAVE), no_selection),
    "lift": Command("Lift object", "Ctrl+L", lambda e: e.tasks.lift(), cannot_lift),
    "import_shape": Command("Use a 3D file…", "", asks_for(Dialog.SHAPE_OPEN), no_selection),
    "fit_again": Command("Fit to the photo", "", lambda e: e.shaping.fit_again(), _not_a_file),
    "clear_painted": Command(
        "Clear what is painted", "", lambda e: e.shaping.clear_painted(), _nothing_painted
    ),
}
