"""The photo's objects as things in a list: copies, names, and which covers which."""

from __future__ import annotations

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
