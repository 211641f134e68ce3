"""The photo's objects: how they are found and lifted, listed, placed and posed."""

from __future__ import annotations

from collections.abc import Callable

from objectmorpher_core.document.model import Placement

from ..editor.editor import Editor
from ..editor.filing import Dialog
from ..editor.tasks import SELECT
from ..editor.view import Painted, ToolName
from ..system.texts import t
from .command import (
    Command,
    Reason,
    asks_for,
    cannot_lift,
    no_handle,
    no_lift,
    no_photo,
    no_selection,
    no_sight,
    unless,
)

FAR = 1000  # places: past all others


def _raise(label: str, keys: str, steps: int) -> Command:
    def run(editor: Editor) -> None:
        editor.objects.raise_by(steps, t(label))

    return Command(label, keys, run, lambda e: no_photo(e) or e.objects.why_not_raise(steps))


def _cannot_keep(editor: Editor) -> str | None:
    if editor.jobs.is_busy(SELECT):
        return t("The selection is not ready yet")
    is_moved = editor.object is not None and editor.object.is_moved
    return no_selection(editor) or (t("It has moved") if is_moved else None)


def _stays(editor: Editor) -> bool:
    return editor.object is not None and editor.object.stays_in_front


def _rename(editor: Editor) -> None:
    editor.objects.renaming = editor.current


COMMANDS: dict[str, Command] = {
    "another": Command(
        "Another object",
        "",
        lambda e: e.objects.start_another(),
        lambda e: None if _stays(e) else no_lift(e),
    ),
    "rename": Command("Rename object", "", _rename, no_selection),
    "duplicate": Command("Duplicate object", "Ctrl+J", lambda e: e.objects.duplicate(), no_lift),
    "hide": Command(
        "Hide object",
        "",
        lambda e: e.objects.toggle_visible(e.current),
        no_lift,
        lambda e: e.object is not None and not e.object.is_visible,
    ),
    "take_out": Command("Take out of the photo", "", lambda e: e.objects.take_out(), no_sight),
    "remove_object": Command(
        "Put back into the photo", "Shift+Delete", lambda e: e.objects.remove(), no_selection
    ),
    "lock": Command(
        "Lock object",
        "Ctrl+Alt+L",
        lambda e: e.lock(e.current),
        no_selection,
        lambda e: e.object is not None and e.object.is_locked,
    ),
    "keep_in_front": Command(
        "Keep in front", "", lambda e: e.objects.toggle_front(), _cannot_keep, _stays
    ),
    "forward": _raise("Bring forward", "Ctrl+]", 1),
    "backward": _raise("Send backward", "Ctrl+[", -1),
    "to_front": _raise("Bring to front", "Ctrl+Shift+]", FAR),
    "to_back": _raise("Send to back", "Ctrl+Shift+[", -FAR),
}


def _where_it_was(editor: Editor) -> str:
    if editor.object is not None and editor.object.is_visitor:
        return t("The object is where it came into this photo")
    return t("The object is where it was in the photo")


def _reset(part: Callable[[Placement], object], reason: Callable[[Editor], str]) -> Reason:
    """The reason why a part of the placement that is as it was already cannot be reset."""
    return unless(
        lambda e: (p := e.placing.placement) and part(p) != part(e.placing.home), reason, no_sight
    )


_not_moved = _reset(lambda place: place, _where_it_was)
_not_shifted = _reset(lambda place: (*place.move, place.depth), _where_it_was)
_not_turned = unless(
    lambda e: (p := e.placing.placement) and any(p.turn),
    lambda e: t("The object is not turned"),
    no_sight,
)
_not_sized = _reset(lambda place: place.scale, lambda e: t("The object has its own size"))


PLACE_COMMANDS: dict[str, Command] = {
    "reset_place": Command(
        "Back to where it was", "", lambda e: e.placing.reset(), _not_moved
    ),
    "reset_position": Command(
        "Reset position", "", lambda e: e.placing.reset_position(), _not_shifted
    ),
    "reset_turn": Command(
        "Reset turn", "", lambda e: e.placing.reset_turn(), _not_turned
    ),
    "reset_size": Command(
        "Reset size", "", lambda e: e.placing.reset_size(), _not_sized
    ),
    "ground": Command(
        "Move along the ground", "G", lambda e: e.placing.toggle_ground(), no_lift,
        lambda e: e.placing.is_grounded,
    ),
}  # fmt: skip


# The selection, its edge, its file, and lifting what is selected.


_no_soft_edge = unless(
    lambda e: e.masking.is_soft, lambda e: t("The edge is found in the photo already"), no_selection
)
_nothing_left_out = unless(
    lambda e: e.leaving_out.pieces,
    lambda e: t("Nothing beside it looks like a part of it"),
    no_lift,
)
_not_a_file = unless(
    lambda e: e.shaping.why_fixed is not None,
    lambda e: t("It was lifted from this photo"),
    no_lift,
)


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


SELECT_COMMANDS: dict[str, Command] = {
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
    "add_photo": Command(
        "Add a photo from another side…",
        "",
        asks_for(Dialog.VIEW_OPEN),
        lambda e: no_lift(e) or e.shaping.why_no_photo,
    ),
    "fit_again": Command("Fit to the photo", "", lambda e: e.shaping.fit_again(), _not_a_file),
    "clear_painted": Command(
        "Clear what is painted", "", lambda e: e.shaping.clear_painted(), _nothing_painted
    ),
}


# Handles and what holds the object.


_no_handles = unless(
    lambda e: e.object is not None and e.object.handles,
    lambda e: t("There is no handle yet"),
    no_sight,
)
_no_place_for_a_pin = unless(
    lambda e: e.hover.surface is not None or e.hover.handle is not None,
    lambda e: t("Point at the object to pin it there"),
    no_lift,
)
_no_key = unless(lambda e: e.keying.count > 0, lambda e: t("There is no key pose yet"), no_lift)
_nothing_to_replace = unless(
    lambda e: e.keying.shown is None, lambda e: t("Nothing has changed since"), _no_key
)


def _no_pose(editor: Editor) -> str | None:
    is_posed = editor.object is not None and editor.object.pose is not None
    return no_sight(editor) if is_posed else _no_handles(editor)


def _toggle_ring(editor: Editor) -> None:
    editor.view.pose.has_ring = not editor.view.pose.has_ring


def _toggle_influence(editor: Editor) -> None:
    editor.view.pose.has_influence = not editor.view.pose.has_influence


def _remove(editor: Editor) -> None:
    """What is chosen in this tool: in Place it is the object."""
    if editor.view.tool is ToolName.PLACE:
        editor.objects.remove()
    else:
        editor.posing.remove()


def _nothing_to_remove(editor: Editor) -> str | None:
    return no_lift(editor) if editor.view.tool is ToolName.PLACE else no_handle(editor)


def _send_back(editor: Editor) -> None:
    editor.posing.send_back(editor.posing.selected, t("Reset handle"))


def _send_all_back(editor: Editor) -> None:
    thing = editor.object
    count = len(thing.handles) if thing else 0
    editor.posing.send_back(tuple(range(count)), t("Reset all handles"))


POSE_COMMANDS: dict[str, Command] = {
    "remove_handle": Command(
        "Remove handle", "Delete", _remove, _nothing_to_remove,
        other_keys=("Backspace",),
    ),
    "pin": Command("Pin under the pointer", "P", lambda e: e.posing.pin(), _no_place_for_a_pin),
    "select_handles": Command(
        "Select all handles", "Ctrl+A", lambda e: e.posing.select_all(), _no_handles
    ),
    "reset_handle": Command("Reset handle", "", _send_back, no_handle),
    "reset_handles": Command("Reset all handles", "", _send_all_back, _no_handles),
    "reset_pose": Command("Reset pose", "", lambda e: e.posing.reset(), _no_pose),
    "ring": Command(
        "Rotation ring", "R", _toggle_ring, no_lift, lambda e: e.view.pose.has_ring
    ),
    "mirror": Command(
        "Symmetry", "", lambda e: e.posing.mirroring.toggle(), no_lift,
        lambda e: e.posing.mirroring.is_on,
    ),
    "influence": Command(
        "Influence of the handle", "", _toggle_influence, no_lift,
        lambda e: e.view.pose.has_influence,
    ),
    "add_key": Command(
        "Add key pose", "", lambda e: e.keying.add(), lambda e: e.keying.why_not_add
    ),
    "next_key": Command("Next key pose", "", lambda e: e.keying.step(1), _no_key),
    "previous_key": Command("Previous key pose", "", lambda e: e.keying.step(-1), _no_key),
    "replace_key": Command(
        "Replace key pose", "", lambda e: e.keying.replace(), _nothing_to_replace
    ),
    "remove_key": Command("Remove key pose", "", lambda e: e.keying.remove(), _no_key),
}  # fmt: skip
