"""Commands that belong to no object: files, steps back and forth, tools, dialogs, the view."""

from __future__ import annotations

from ..canvas.painter import shown_now
from ..editor.editor import Editor
from ..editor.export_plan import What
from ..editor.filing import Dialog
from ..editor.view import Popup, Shown, ToolName
from ..system.texts import t
from ..tools import navigate
from .command import (
    Command,
    Reason,
    asks_for,
    never,
    no_lift,
    no_photo,
    no_redo,
    no_undo,
    nothing_lifted,
    unless,
)

# Panels and dialogs.


def _toggle(popup: Popup) -> Command:
    def run(editor: Editor) -> None:
        editor.view.popup = None if is_on(editor) else popup

    def is_on(editor: Editor) -> bool:
        return editor.view.popup is popup

    return Command(popup.value, _KEYS.get(popup, ""), run, never, is_on)


_KEYS = {Popup.PALETTE: "Ctrl+K", Popup.SHORTCUTS: "F1", Popup.PREFERENCES: "Ctrl+,"}

WINDOW_COMMANDS: dict[str, Command] = {popup.name.lower(): _toggle(popup) for popup in Popup}


# Opening, saving, exporting.


def _nothing_open(editor: Editor) -> str | None:
    return None if len(editor.tabs.all) > 1 else no_photo(editor)


_no_other_tab = unless(lambda e: len(e.tabs.all) > 1, lambda e: t("No other photo is open"), never)
_nothing_left = unless(
    lambda e: e.recovery.left, lambda e: t("No unsaved work of an earlier session is there"), never
)


FILE_COMMANDS: dict[str, Command] = {
    "open": Command("Open…", "Ctrl+O", asks_for(Dialog.OPEN), never),
    "recover": Command(
        "Recover unsaved work", "", lambda e: e.recovery.recover_left(), _nothing_left
    ),
    "new_tab": Command("New tab", "Ctrl+T", lambda e: e.tabs.add(), no_photo),
    "next_tab": Command("Next tab", "Ctrl+Tab", lambda e: e.tabs.step(1), _no_other_tab),
    "previous_tab": Command(
        "Previous tab", "Ctrl+Shift+Tab", lambda e: e.tabs.step(-1), _no_other_tab
    ),
    "save": Command("Save session", "Ctrl+S", lambda e: e.filing.save()),
    "save_as": Command("Save session as…", "Ctrl+Shift+S", asks_for(Dialog.SAVE)),
    "export": Command("Export photo…", "Ctrl+E", lambda e: e.exporting.open()),
    "send_back": Command(
        "Send back",
        "Ctrl+Enter",
        lambda e: e.exporting.send_back(lambda: e.filing.quit(e.quit, but=e.tab)),
        lambda e: no_photo(e) or e.exporting.why_not_back,
    ),
    "close": Command("Close", "Ctrl+W", lambda e: e.filing.close(e.tab), _nothing_open),
    "models": Command("Models…", "", lambda e: e.models.open(), never),
    "quit": Command("Quit", "Ctrl+Q", lambda e: e.filing.quit(e.quit), never),
}


def _tool(tool: ToolName, keys: str, why_not: Reason) -> Command:
    def is_on(editor: Editor) -> bool:
        return editor.view.tool is tool

    return Command(tool.value, keys, lambda editor: editor.choose_tool(tool), why_not, is_on)


def _copy(editor: Editor) -> None:
    """The object into the system's clipboard as a picture, and for other tabs as it is.

    Where none is selected, the photo.
    """
    if editor.mask is None:
        editor.exporting.copy(What.PHOTO)
    else:
        editor.pasting.copy()
        editor.exporting.copy(What.CUTOUT, editor.pasting.offered)


def _paste(editor: Editor) -> None:
    """What was copied last, here or elsewhere: an object into the photo, a photo into a tab."""
    if editor.document is not None and editor.pasting.has_copied:
        editor.pasting.paste_newest(editor.filing.paste)
    else:
        editor.filing.paste()


_nothing_copied = unless(
    lambda e: e.pasting.has_copied, lambda e: t("Lift an object and copy it first"), no_photo
)


COMMANDS: dict[str, Command] = {
    "undo": Command("Undo", "Ctrl+Z", lambda e: e.undo(), no_undo),
    "redo": Command("Redo", "Ctrl+Shift+Z", lambda e: e.redo(), no_redo, other_keys=("Ctrl+Y",)),
    "copy_object": Command("Copy", "Ctrl+C", _copy),
    "copy": Command("Copy photo", "Ctrl+Shift+C", lambda e: e.exporting.copy(What.PHOTO)),
    "paste_object": Command(
        "Paste object", "Ctrl+Shift+V", lambda e: e.pasting.paste(), _nothing_copied
    ),
    "paste": Command("Paste", "Ctrl+V", _paste, never),
    "select": _tool(ToolName.SELECT, "1", no_photo),
    "mask": _tool(ToolName.MASK, "2", no_photo),
    "pose": _tool(ToolName.POSE, "3", no_lift),
    "place": _tool(ToolName.PLACE, "4", no_lift),
    "look": _tool(ToolName.LOOK, "5", no_lift),
    "compose": _tool(ToolName.COMPOSE, "6", no_lift),
    "smaller_brush": Command("Smaller brush", "[", lambda e: navigate.size_brush(e, -1)),
    "larger_brush": Command("Larger brush", "]", lambda e: navigate.size_brush(e, 1)),
    "softer_brush": Command("Softer brush", "Shift+[", lambda e: navigate.harden_brush(e, -1)),
    "harder_brush": Command("Harder brush", "Shift+]", lambda e: navigate.harden_brush(e, 1)),
    "cancel": Command("Cancel the running job", "", lambda e: e.jobs.cancel(), never),
}


# Commands that change what is shown, and from how near.


def _show(shown: Shown, number: int) -> Command:
    def run(editor: Editor) -> None:
        editor.view.shown = shown
        if shown is Shown.COMPOSITE:  # which there is from the photo's view only
            editor.looking.reset()

    def is_on(editor: Editor) -> bool:
        return shown_now(editor.document, editor.view) is shown

    why_not = nothing_lifted if number > 1 else no_photo
    return Command(shown.value, f"Alt+{number}", run, why_not, is_on)


def _fit(editor: Editor) -> None:
    if editor.photo_size is not None:
        editor.view.fit(editor.photo_size)


def _split(editor: Editor) -> None:
    editor.view.split = 0.5 if editor.view.split is None else None


_not_turned = unless(
    lambda e: e.looking.orbit is not None, lambda e: t("The photo's own view is shown"), no_lift
)


def _points(editor: Editor) -> None:
    editor.view.has_points = not editor.view.has_points


def _proof(editor: Editor) -> None:
    if editor.settings.proof_profile:
        editor.looking.toggle_proof()
    else:
        editor.filing.wanted = Dialog.PROOF_OPEN


def _panel(editor: Editor) -> None:
    editor.view.wants_panel = not editor.view.has_panel


def _history(editor: Editor) -> None:
    editor.view.has_history = not editor.view.has_history


LOOK_COMMANDS: dict[str, Command] = {
    "panel": Command("Panel", "F8", _panel, is_on=lambda e: e.view.has_panel),
    "snapshot": Command("Keep a snapshot", "Ctrl+Alt+S", lambda e: e.keep_snapshot()),
    "history": Command("History", "Ctrl+H", _history, is_on=lambda e: e.view.has_history),
    "fit": Command("Fit to window", "F", _fit),
    "actual": Command("Actual size", "Ctrl+1", lambda e: navigate.zoom_to(e, 1.0)),
    "double": Command("Double size", "Ctrl+2", lambda e: navigate.zoom_to(e, 2.0)),
    "pixels": Command("Pixel level", "Ctrl+8", lambda e: navigate.zoom_to(e, 8.0)),
    "zoom_in": Command("Zoom in", "Ctrl+=", lambda e: navigate.zoom_step(e, 1)),
    "zoom_out": Command("Zoom out", "Ctrl+-", lambda e: navigate.zoom_step(e, -1)),
    "reset_look": Command(
        "Back to the photo's view", "", lambda e: e.looking.reset(), _not_turned
    ),
    "split": Command(
        "Split before/after", "\\", _split, is_on=lambda e: e.view.split is not None
    ),
    "proof": Command("Proof colours", "Ctrl+Shift+Y", _proof, is_on=lambda e: e.view.is_proof),
    "proof_profile": Command("Proof profile…", "", asks_for(Dialog.PROOF_OPEN)),
    "points": Command(
        "Control graph", "Ctrl+Shift+P", _points, no_lift, lambda e: e.view.has_points
    ),
    **{f"show_{s.name.lower()}": _show(s, n) for n, s in enumerate(Shown, start=1)},
}  # fmt: skip
