"""The Select tool's settings."""

from __future__ import annotations

from objectmorpher_core.document.model import EditObject

from ...commands import run, why_not
from ...editor.editor import Editor
from ...editor.view import SelectMode
from ...system.texts import t
from ..dialogs.models_dialog import draw_offer
from ..widgets.segmented import Segment, segmented
from ..widgets.theme import Icon
from ..widgets.widgets import checkbox, gap, heading, note, tooltip
from .edge import draw_command, draw_edge, draw_refinement_note


def draw_select(editor: Editor) -> None:
    heading(t("Select by"))
    selecting = editor.view.selecting
    selecting.mode = segmented("mode", _modes(), selecting.mode)
    if selecting.mode is SelectMode.CLICK:
        level = segmented("level", _levels(), editor.selection.level)
        if level != editor.selection.level:
            editor.selection.set_level(level)
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


def _draw_facts(editor: Editor) -> None:
    """How much is selected, by what, and what to do next."""
    prompt, mask = editor.selection.prompt, editor.mask
    adds = sum(c.is_foreground for c in prompt.clicks)
    removes = len(prompt.clicks) - adds
    facts = []
    if mask is not None:
        share = f"{100 * editor.selection.share:.1f} %"
        facts.append(t("{share} of the photo is selected.", share=share))
    if adds or removes:
        facts.append(t("{adds} added, {removes} removed by click.", adds=adds, removes=removes))
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
    if why_not(editor, "keep_in_front") is not None:
        return
    if checkbox(t("Keep in front"), item.stays_in_front) != item.stays_in_front:
        run(editor, "keep_in_front")
    tooltip(t("It is not edited, and covers what moves behind it"))
