"""The photo's objects as things in a list: copies, names, and which covers which."""

from __future__ import annotations

from ..editor import Editor
from ..texts import t
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
    return lambda editor: no_lift(editor) or editor.objects.why_not_raise(steps)


def _rename(editor: Editor) -> None:
    editor.objects.renaming = editor.current


COMMANDS: dict[str, Command] = {
    "another": Command("Another object", "", lambda e: e.objects.start_another(), no_lift),
    "rename": Command("Rename object", "", _rename, _no_object),
    "duplicate": Command("Duplicate object", "Ctrl+J", lambda e: e.objects.duplicate(), no_lift),
    "remove_object": Command(
        "Remove object", "Shift+Delete", lambda e: e.objects.remove(), _no_object
    ),
    "forward": _raise("Bring forward", "Ctrl+]", 1),
    "backward": _raise("Send backward", "Ctrl+[", -1),
    "to_front": _raise("Bring to front", "Ctrl+Shift+]", FAR),
    "to_back": _raise("Send to back", "Ctrl+Shift+[", -FAR),
}
