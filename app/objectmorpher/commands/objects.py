"""The photo's objects: copies, names, which covers which, and where each one is."""

from __future__ import annotations

from collections.abc import Callable

from objectmorpher_core.document.model import Placement

from ..editor.editor import Editor
from ..editor.tasks import SELECT
from ..system.texts import t
from .command import Command, Reason, no_lift, no_photo

FAR = 1000  # places: past all others


def _no_object(editor: Editor) -> str | None:
    is_there = editor.object is not None and editor.mask is not None
    return None if is_there else no_photo(editor) or t("Click an object in the photo first")


def _raise(label: str, keys: str, steps: int) -> Command:
    def run(editor: Editor) -> None:
        editor.objects.raise_by(steps, t(label))

    return Command(label, keys, run, _cannot_raise(steps))


def _cannot_raise(steps: int) -> Reason:
    return lambda editor: no_photo(editor) or editor.objects.why_not_raise(steps)


def _cannot_add(editor: Editor) -> str | None:
    return None if _stays(editor) else no_lift(editor)


def _cannot_keep(editor: Editor) -> str | None:
    if editor.jobs.is_busy(SELECT):
        return t("The selection is not ready yet")
    is_moved = editor.object is not None and editor.object.is_moved
    return _no_object(editor) or (t("It has moved") if is_moved else None)


def _stays(editor: Editor) -> bool:
    return editor.object is not None and editor.object.stays_in_front


def _is_locked(editor: Editor) -> bool:
    return editor.object is not None and editor.object.is_locked


def _rename(editor: Editor) -> None:
    editor.objects.renaming = editor.current


COMMANDS: dict[str, Command] = {
    "another": Command("Another object", "", lambda e: e.objects.start_another(), _cannot_add),
    "rename": Command("Rename object", "", _rename, _no_object),
    "duplicate": Command("Duplicate object", "Ctrl+J", lambda e: e.objects.duplicate(), no_lift),
    "remove_object": Command(
        "Remove object", "Shift+Delete", lambda e: e.objects.remove(), _no_object
    ),
    "lock": Command(
        "Lock object", "Ctrl+Alt+L", lambda e: e.lock(e.current), _no_object, _is_locked
    ),
    "keep_in_front": Command(
        "Keep in front", "", lambda e: e.objects.toggle_front(), _cannot_keep, _stays
    ),
    "forward": _raise("Bring forward", "Ctrl+]", 1),
    "backward": _raise("Send backward", "Ctrl+[", -1),
    "to_front": _raise("Bring to front", "Ctrl+Shift+]", FAR),
    "to_back": _raise("Send to back", "Ctrl+Shift+[", -FAR),
}


def _where_it_was() -> str:
    return t("The object is where it was in the photo")


def _unless(
    is_reset: Callable[[Placement], bool], reason: Callable[[], str]
) -> Callable[[Editor], str | None]:
    """The reason why what is reset already cannot be reset."""

    def why_not(editor: Editor) -> str | None:
        placement = editor.placing.placement
        if placement is None:
            return no_lift(editor)
        return reason() if is_reset(placement) else None

    return why_not


_not_moved = _unless(lambda place: place.is_identity, _where_it_was)
_not_shifted = _unless(lambda place: place.move == (0.0, 0.0) and place.depth == 0, _where_it_was)
_not_turned = _unless(lambda place: not any(place.turn), lambda: t("The object is not turned"))
_not_sized = _unless(lambda place: place.scale == 1, lambda: t("The object has its own size"))


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
        "Move over the ground", "G", lambda e: e.placing.toggle_ground(), no_lift,
        lambda e: e.placing.is_grounded,
    ),
}  # fmt: skip
