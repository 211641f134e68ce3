"""A command, and the usual reasons why it cannot run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..editor.editor import Editor
from ..editor.filing import Dialog
from ..editor.tasks import SELECT
from ..system.texts import t

Reason = Callable[[Editor], str | None]


def never(editor: Editor) -> str | None:
    """It can always run."""
    return None


def no_photo(editor: Editor) -> str | None:
    return None if editor.document else t("Open a photo first")


def unless(
    is_met: Callable[[Editor], object], reason: Callable[[Editor], str], first: Reason
) -> Reason:
    """What `first` has against a command; if that is nothing, the `reason`, unless `is_met`."""

    def why_not(editor: Editor) -> str | None:
        return first(editor) or (None if is_met(editor) else reason(editor))

    return why_not


no_selection = unless(
    lambda e: e.mask is not None, lambda e: t("Click an object in the photo first"), no_photo
)
no_lift = unless(lambda e: e.is_lifted, lambda e: e.why_no_shape, no_photo)
no_sight = unless(  # of what a command would move
    lambda e: e.chosen.is_visible, lambda e: t("{name} is hidden", name=e.chosen.name), no_lift
)
no_handle = unless(
    lambda e: e.posing.handle is not None, lambda e: t("Select a handle first"), no_sight
)


def nothing_lifted(editor: Editor) -> str | None:
    document = editor.document
    is_there = document is not None and any(o.lifted for o in document.objects)
    return None if is_there else no_photo(editor) or editor.why_no_shape


def cannot_lift(editor: Editor) -> str | None:
    if editor.is_lifting:
        return t("The object is being lifted")
    if editor.jobs.is_busy(SELECT):
        return t("The selection is not ready yet")
    is_lifted = editor.is_lifted
    return no_selection(editor) or (t("The object is lifted already") if is_lifted else None)


def no_undo(editor: Editor) -> str | None:
    if editor.selection.pending is not None:
        return None
    return None if editor.undo_label else t("Nothing to undo")


def no_redo(editor: Editor) -> str | None:
    has_step = editor.history is not None and editor.history.redo_label is not None
    return None if has_step else t("Nothing to redo")


@dataclass(frozen=True)
class Command:
    """Something that the user can ask for.

    `why_not` is the sentence that a greyed-out button shows, or None where it can run.
    """

    label: str  # English
    keys: str  # "Ctrl+Shift+S", or "" for none; the user may have others, see `keys_of`
    run: Callable[[Editor], None]
    why_not: Reason = no_photo
    is_on: Callable[[Editor], bool] | None = None  # of a toggle
    other_keys: tuple[str, ...] = ()  # that do the same and are not shown


def asks_for(dialog: Dialog) -> Callable[[Editor], None]:
    """Return a command's action that opens a file dialog of the window."""

    def run(editor: Editor) -> None:
        editor.filing.wanted = dialog

    return run
