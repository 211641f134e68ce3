"""The Select tool's settings."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import imgui

from objectmorpher_core.document.model import EditObject
from objectmorpher_core.segment.mask_edit import LARGEST_REACH

from ...commands import COMMANDS, run, why_not
from ...editor.editor import Editor
from ...editor.view import Painted, SelectMode
from ...system.texts import t
from ...tools.navigate import LARGEST_BRUSH, SMALLEST_BRUSH
from ..dialogs.models_dialog import draw_offer
from ..widgets.segmented import Segment, segmented
from ..widgets.theme import Icon
from ..widgets.widgets import (
    Number,
    checkbox,
    command_button,
    gap,
    half_width,
    heading,
    note,
    number_field,
    take,
    tooltip,
)

# The parts shared by the Select and the Mask tool: the selection's edge, and its file.

ICONS = {
    "invert": Icon.INVERT, "clear": Icon.CLOSE, "grow": Icon.GROW, "shrink": Icon.SHRINK,
    "smooth": Icon.SMOOTH, "feather": Icon.FEATHER, "fill_holes": Icon.FILL,
    "remove_islands": Icon.BROOM, "import_mask": Icon.IMPORT, "export_mask": Icon.EXPORT,
    "harden": Icon.IMAGE, "subject": Icon.PERSON, "import_shape": Icon.CUBE,
}  # fmt: skip
HINTS = {  # what a press does, where the label does not say it
    "grow": "Add a rim of this many pixels",
    "shrink": "Take away a rim of this many pixels",
    "smooth": "Straighten the edge: teeth and specks go",
    "feather": "Make the edge soft by this many pixels to each side",
    "fill_holes": "Select what the selection encloses",
    "remove_islands": "Take away the small pieces beside the large one",
    "import_shape": "Put a 3D file (splats or a mesh) where the object is in the photo",
    "harden": "Forget the softness you painted: the edge follows the photo again",
}


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
        note(t("You softened part of this edge by hand; it is kept."))
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
    label = f"{t(COMMANDS[name].label)}##{name}"
    command_button(editor, name, label, width, ICONS[name])
    if name in HINTS and why_not(editor, name) is None:
        tooltip(t(HINTS[name]))


def draw_decontaminate(editor: Editor) -> None:
    """Draw how far the background's colour is taken out of the object's edge."""
    if not editor.is_lifted:
        note(t("Lift the object to take the background's colour out of its edge."))
        return
    number = Number(t("Clean"), "%.0f %%", 0.5, 10.0, 0.0, 0.0, 100.0)
    change = number_field(number, 100 * editor.edging.decontaminate)
    tooltip(t("Decontaminate: take the background's colour out of the object's soft edge"))
    preview = editor.edging.preview_decontaminate
    take(editor, change, lambda: preview(change.value / 100), t("Decontaminate edge"))


def draw_refinement_note(editor: Editor) -> None:
    """Draw the note on what a changed selection means for the lifted object."""
    if editor.object is not None and editor.is_lifted:
        note(t("{name} is in 3D already. Change its outline whenever you like: its shape follows, "
               "and its pose and place stay.", name=editor.object.name))  # fmt: skip


# The Mask tool's settings: the brush, and the selection's edge.


def draw_mask(editor: Editor) -> None:
    heading(t("Brush"))
    if (elsewhere := editor.visitor_note) is not None:
        note(f"{elsewhere}.")
        return
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


def draw_select(editor: Editor) -> None:
    heading(t("Select by"))
    selecting = editor.view.selecting
    selecting.mode = segmented("mode", _modes(), selecting.mode)
    if selecting.mode is SelectMode.CLICK:
        level = segmented("level", _levels(), editor.selection.level)
        if level != editor.selection.level:
            editor.selection.set_level(level)
    if (elsewhere := editor.visitor_note) is not None:
        note(f"{elsewhere}.")
        return
    draw_command(editor, "subject")
    draw_command(editor, "clear")
    _draw_facts(editor)
    gap(12)
    draw_edge(editor)


def _modes() -> tuple[Segment[SelectMode], ...]:
    return (
        Segment(
            SelectMode.CLICK, t("Click"), t("Click what belongs to the object"), icon=Icon.WAND
        ),
        Segment(SelectMode.BOX, t("Box"), t("Drag a box around the object"), icon=Icon.BOX),
        Segment(SelectMode.LASSO, t("Lasso"), t("Draw a line around it"), icon=Icon.LASSO),
    )


def _levels() -> tuple[Segment[str], ...]:
    return (
        Segment("part", t("Part"), t("A click means the part that it is on")),
        Segment("object", t("Object"), t("A click means the whole object")),
        Segment("group", t("Group"), t("A click means the object and what belongs to it")),
    )


def share_text(share: float) -> str:
    """A share of the photo, in [0, 1]; that of a small thing is not nothing."""
    return f"{100 * share:.1f} %" if not 0 < share < 0.0005 else "< 0.1 %"


def _draw_facts(editor: Editor) -> None:
    """How much is selected, by what, and what to do next."""
    prompt, mask = editor.selection.prompt, editor.mask
    adds = sum(c.is_foreground for c in prompt.clicks)
    removes = len(prompt.clicks) - adds
    facts = []
    if mask is not None:
        facts.append(
            t("{share} of the photo is selected.", share=share_text(editor.selection.share))
        )
    if removes or adds > 1:
        facts.append(t("Clicks: {adds} added, {removes} removed.", adds=adds, removes=removes))
    if editor.object is not None and editor.object.found is not None:
        facts.append(t("What you painted stays when you click again."))
    if facts:
        note(" ".join(facts))
    if mask is None and editor.view.selecting.mode is SelectMode.CLICK:
        note(t("Left click adds what belongs to the object, right click removes what does not."))
    elif mask is not None and editor.object is not None and not editor.is_lifted:
        if editor.object.stays_in_front:
            note(t("It stays where it is, in front of what is edited."))
        else:
            note(t("Right-click what does not belong to the object, then lift it."))
            draw_command(editor, "import_shape")
        _draw_front(editor, editor.object)
    draw_refinement_note(editor)
    draw_offer(editor)


def _draw_front(editor: Editor, item: EditObject) -> None:
    """Whether it is not edited and stays in front."""
    if item.is_moved:
        return
    reason = why_not(editor, "keep_in_front")
    imgui.begin_disabled(reason is not None)  # there all the same, or all below it would jump
    if checkbox(t("Keep in front"), item.stays_in_front) != item.stays_in_front:
        run(editor, "keep_in_front")
    imgui.end_disabled()
    tooltip(reason or t("It is not edited, and covers what moves behind it"))


# The brush's numbers, for every tool that paints.

STEP = 0.2  # x the radius, of the - and + buttons


def draw_radius(editor: Editor) -> None:
    radius, usual = editor.view.brush.radius, editor.view.usual_radius
    step = max(STEP * radius, 0.5)  # a fifth of a large one is seen, and of a small one is left
    number = Number(t("Radius"), "%.1f px", 0.25, step, usual, SMALLEST_BRUSH, LARGEST_BRUSH)
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
