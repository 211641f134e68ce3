"""Every command by name: menu, shortcuts, buttons and tests run the same entry.

`why_not` is the sentence that a greyed-out button shows, or None where the command can run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .editor import SELECT, Editor
from .filing import Dialog
from .tasks import LIFT
from .tools import navigate
from .view import Shown, ToolName


def _always(editor: Editor) -> str | None:
    return None


def no_photo(editor: Editor) -> str | None:
    return None if editor.document else "Open a photo first"


def no_selection(editor: Editor) -> str | None:
    if editor.mask is None:
        return no_photo(editor) or "Click an object in the photo first"
    return None


def no_lift(editor: Editor) -> str | None:
    return None if editor.is_lifted else "Lift an object first"


def nothing_lifted(editor: Editor) -> str | None:
    document = editor.document
    is_there = document is not None and any(o.lifted for o in document.objects)
    return None if is_there else no_photo(editor) or "Lift an object first"


def no_handle(editor: Editor) -> str | None:
    return no_lift(editor) or (None if editor.handle is not None else "Select a handle first")


def cannot_lift(editor: Editor) -> str | None:
    if editor.jobs.is_busy(LIFT):
        return "The object is being lifted"
    if editor.jobs.is_busy(SELECT):
        return "The selection is not ready yet"
    return no_selection(editor) or ("The object is lifted already" if editor.is_lifted else None)


def no_undo(editor: Editor) -> str | None:
    if editor.pending is not None:
        return None
    has_step = editor.history is not None and editor.history.undo_label is not None
    return None if has_step else "Nothing to undo"


def no_redo(editor: Editor) -> str | None:
    has_step = editor.history is not None and editor.history.redo_label is not None
    return None if has_step else "Nothing to redo"


@dataclass(frozen=True)
class Command:
    """One thing the user can ask for."""

    label: str
    keys: str  # "Ctrl+Shift+S", or "" for none
    run: Callable[[Editor], None]
    why_not: Callable[[Editor], str | None] = no_photo


def _want(dialog: Dialog) -> Callable[[Editor], None]:
    def run(editor: Editor) -> None:
        editor.filing.wanted = dialog

    return run


def _tool(tool: ToolName) -> Callable[[Editor], None]:
    return lambda editor: editor.choose_tool(tool)


def _show(shown: Shown) -> Callable[[Editor], None]:
    def run(editor: Editor) -> None:
        editor.view.shown = shown

    return run


def _fit(editor: Editor) -> None:
    if editor.photo_size is not None:
        editor.view.fit(editor.photo_size)


def _split(editor: Editor) -> None:
    editor.view.split = 0.5 if editor.view.split is None else None


def _points(editor: Editor) -> None:
    editor.view.has_points = not editor.view.has_points


COMMANDS: dict[str, Command] = {
    "open": Command("Open…", "Ctrl+O", _want(Dialog.OPEN), _always),
    "save": Command("Save session", "Ctrl+S", lambda e: e.filing.save()),
    "save_as": Command("Save session as…", "Ctrl+Shift+S", _want(Dialog.SAVE)),
    "export": Command("Export photo…", "Ctrl+E", _want(Dialog.EXPORT)),
    "close": Command("Close", "Ctrl+W", lambda e: e.filing.guard(e.close_document)),
    "quit": Command("Quit", "Ctrl+Q", lambda e: e.filing.guard(e.quit), _always),
    "undo": Command("Undo", "Ctrl+Z", lambda e: e.undo(), no_undo),
    "redo": Command("Redo", "Ctrl+Shift+Z", lambda e: e.redo(), no_redo),
    "subject": Command("Select subject", "Ctrl+Shift+A", lambda e: e.select_subject()),
    "clear": Command("Clear selection", "Ctrl+D", lambda e: e.clear_selection(), no_selection),
    "lift": Command("Lift object", "Ctrl+L", lambda e: e.tasks.lift(), cannot_lift),
    "remove_handle": Command("Remove handle", "Delete", lambda e: e.remove_handle(), no_handle),
    "reset_pose": Command("Reset pose", "", lambda e: e.clear_handles(), no_lift),
    "reset_place": Command("Reset placement", "", lambda e: e.reset_placement(), no_lift),
    "select": Command("Select", "1", _tool(ToolName.SELECT)),
    "pose": Command("Pose", "2", _tool(ToolName.POSE), no_lift),
    "place": Command("Place", "3", _tool(ToolName.PLACE), no_lift),
    "fit": Command("Fit to window", "F", _fit),
    "actual": Command("Actual size", "Ctrl+1", lambda e: navigate.zoom_to(e, 1.0)),
    "zoom_in": Command("Zoom in", "Ctrl+=", lambda e: navigate.zoom_step(e, 1)),
    "zoom_out": Command("Zoom out", "Ctrl+-", lambda e: navigate.zoom_step(e, -1)),
    "split": Command("Split before/after", "\\", _split),
    "points": Command("Control graph", "Ctrl+Shift+P", _points, no_lift),
    **{
        f"show_{shown.name.lower()}": Command(
            shown.value, f"Alt+{number}", _show(shown), nothing_lifted if number > 1 else no_photo
        )
        for number, shown in enumerate(Shown, start=1)
    },
    "cancel": Command("Cancel the running job", "", lambda e: e.jobs.cancel(), _always),
}


def run(editor: Editor, name: str) -> None:
    """Runs a command, or says why it cannot."""
    command = COMMANDS[name]
    reason = command.why_not(editor)
    if reason is None:
        command.run(editor)
    else:
        editor.say(reason)


def next_step(editor: Editor) -> tuple[str, str | None]:
    """What the primary button says, and the command behind it (None: it only says it)."""
    if editor.document is None:
        return "Open a photo…", "open"
    if editor.jobs.is_busy(LIFT):
        return "Lifting…", None
    if editor.mask is None:
        busy = editor.jobs.is_busy(SELECT)
        return ("Selecting…" if busy else "Click an object in the photo"), None
    if not editor.is_lifted:
        return "Lift object", "lift"
    if editor.view.tool is ToolName.SELECT:
        return "Pose the object", "pose"
    thing = editor.object
    if thing is not None and not thing.is_moved:
        is_posing = editor.view.tool is ToolName.POSE
        return "Drag a point on the object" if is_posing else "Drag the object", None
    return "Export photo…", "export"
