"""Commands that change what is shown, and from how near."""

from __future__ import annotations

from ..canvas.painter import shown_now
from ..editor.editor import Editor
from ..editor.view import Shown
from ..system.texts import t
from ..tools import navigate
from .command import Command, no_lift, no_photo, nothing_lifted


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


def _not_turned(editor: Editor) -> str | None:
    is_turned = editor.looking.orbit is not None
    return None if is_turned else no_lift(editor) or t("The photo's own view is shown")


def _points(editor: Editor) -> None:
    editor.view.has_points = not editor.view.has_points


def _panel(editor: Editor) -> None:
    editor.view.wants_panel = not editor.view.has_panel


def _history(editor: Editor) -> None:
    editor.view.has_history = not editor.view.has_history


COMMANDS: dict[str, Command] = {
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
    "points": Command(
        "Control graph", "Ctrl+Shift+P", _points, no_lift, lambda e: e.view.has_points
    ),
    **{f"show_{s.name.lower()}": _show(s, n) for n, s in enumerate(Shown, start=1)},
}  # fmt: skip
