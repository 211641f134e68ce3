"""The parts shared by the Select and the Mask tool: the selection's edge, and its file."""

from __future__ import annotations

from imgui_bundle import imgui

from objectmorpher_core.segment.mask_edit import LARGEST_REACH

from ...commands import COMMANDS, why_not
from ...editor.editor import Editor
from ...system.texts import t
from ..widgets.theme import Icon
from ..widgets.widgets import (
    Number,
    command_button,
    gap,
    half_width,
    heading,
    note,
    number_field,
    tooltip,
)

ICONS = {
    "invert": Icon.INVERT, "clear": Icon.CLOSE, "grow": Icon.GROW, "shrink": Icon.SHRINK,
    "smooth": Icon.SMOOTH, "feather": Icon.FEATHER, "fill_holes": Icon.FILL,
    "remove_islands": Icon.BROOM, "import_mask": Icon.IMPORT, "export_mask": Icon.EXPORT,
    "harden": Icon.IMAGE, "subject": Icon.PERSON, "import_shape": Icon.CUBE,
}  # fmt: skip


def draw_edge(editor: Editor) -> None:
    """The edge's buttons and the px they work with."""
    heading(t("Edge"))
    reach = Number(t("Distance"), "%.1f px", 0.1, 1.0, rest=4.0, low=0.5, high=LARGEST_REACH)
    editor.view.selecting.reach = number_field(reach, editor.view.selecting.reach).value
    draw_pair(editor, "grow", "shrink")
    draw_pair(editor, "smooth", "feather")
    draw_pair(editor, "fill_holes", "remove_islands")
    draw_command(editor, "invert")
    if editor.masking.is_soft:
        note(t("Part of this edge is soft by your hand, and stays as you painted it."))
        draw_command(editor, "harden")
    gap(12)
    heading(t("Mask file"))
    draw_pair(editor, "import_mask", "export_mask")


def draw_pair(editor: Editor, left: str, right: str) -> None:
    """Two commands side by side."""
    draw_command(editor, left, half_width())
    imgui.same_line()
    draw_command(editor, right)


def draw_command(editor: Editor, name: str, width: float = -1.0) -> None:
    """A command as a button; `width` in points, -1 fills."""
    label = f"{ICONS[name]}  {t(COMMANDS[name].label)}##{name}"
    command_button(editor, name, label, width)
    hint = _hint(name)
    if hint and why_not(editor, name) is None:
        tooltip(hint)


def _hint(name: str) -> str:
    """What a press does, where the label does not say it."""
    hints = {
        "grow": t("Add a rim of this many pixels"),
        "shrink": t("Take away a rim of this many pixels"),
        "smooth": t("Straighten the edge: teeth and specks go"),
        "feather": t("Make the edge soft by this many pixels to each side"),
        "fill_holes": t("Select what the selection encloses"),
        "remove_islands": t("Take away the small pieces beside the large one"),
        "import_shape": t("Put a 3D file (splats or a mesh) where the object is in the photo"),
        "harden": t("Forget the softness you painted: the edge follows the photo again"),
    }
    return hints.get(name, "")


def draw_decontaminate(editor: Editor) -> None:
    """Draw how far the background's colour is taken out of the object's edge."""
    if not editor.is_lifted:
        note(t("Lift the object to take the background's colour out of its edge."))
        return
    number = Number(t("Clean"), "%.0f %%", 0.5, 10.0, 0.0, 0.0, 100.0)
    change = number_field(number, 100 * editor.edging.decontaminate)
    tooltip(t("Decontaminate: take the background's colour out of the object's soft edge"))
    if change.is_changed:
        editor.edging.preview_decontaminate(change.value / 100)
    if change.is_done:
        editor.commit(t("Decontaminate edge"))


def draw_refinement_note(editor: Editor) -> None:
    """Draw the note on what a changed selection means for the lifted object."""
    if editor.object is not None and editor.is_lifted:
        note(t("{name} is in 3D already. Change its outline whenever you like: its shape follows, "
               "and its pose and place stay.", name=editor.object.name))  # fmt: skip
