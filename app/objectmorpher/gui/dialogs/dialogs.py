"""File dialogs, the system's or our own, and the questions before the window closes."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Any

from imgui_bundle import imgui
from imgui_bundle import portable_file_dialogs as pfd

from ...editor.editor import Editor
from ...editor.filing import EXPORT_ENDINGS, PHOTO_ENDINGS, SESSION_ENDING, Dialog, Filing
from ...editor.intents.models import GIVEN, MODEL_ENDING
from ...editor.opening import OBJECT_ENDINGS
from ...system.texts import t
from ..widgets.modal import is_confirmed, is_dismissed, modal
from ..widgets.theme import FIELD, PRIMARY, Icon, theme
from ..widgets.widgets import Emphasis, button
from .export_dialog import draw_export
from .file_chooser import FileChooser
from .models_dialog import draw_models

HELPERS = ("zenity", "kdialog", "matedialog", "qarma")  # what the system's dialogs need on Linux
QUESTION = 400.0  # points, width
LISTED = 8  # changed photos that it names
FILTERS = {
    Dialog.OPEN: (*PHOTO_ENDINGS, SESSION_ENDING),
    Dialog.SAVE: (SESSION_ENDING,),
    Dialog.EXPORT: EXPORT_ENDINGS,
    Dialog.MASK_OPEN: PHOTO_ENDINGS,
    Dialog.MASK_SAVE: (".png",),
    Dialog.SHAPE_OPEN: OBJECT_ENDINGS,
    Dialog.VIEW_OPEN: PHOTO_ENDINGS,
    Dialog.MODEL_OPEN: (MODEL_ENDING,),
    Dialog.MODEL_FOLDER: GIVEN,
    Dialog.PROFILE_OPEN: (".icc", ".icm"),
    Dialog.PROOF_OPEN: (".icc", ".icm"),
}


def has_native_dialogs() -> bool:
    return not sys.platform.startswith("linux") or any(shutil.which(h) for h in HELPERS)


class Dialogs:
    """Shows what the editor wants to be asked."""

    def __init__(self) -> None:
        self._native: tuple[Dialog, Any] | None = None
        self._chooser = FileChooser()
        self._has_native = has_native_dialogs()

    @property
    def is_open(self) -> bool:
        return self._native is not None or self._chooser.is_open

    def draw(self, editor: Editor) -> None:
        """Draw the open dialog; once a frame, after the panels."""
        wanted = editor.filing.wanted
        if wanted is not None and not self.is_open:
            editor.filing.wanted = None
            self._open(editor, wanted)
        self._poll_native(editor)
        if editor.filing.question is not None:  # before all others, which come back after it
            self._draw_question(editor)
            return
        if editor.filing.leaving is not None or imgui.is_popup_open(_leaving()):
            _draw_leaving(editor.filing)
            return
        self._chooser.draw(editor)
        if not self.is_open:  # one at a time; the export waits for the file that is chosen for it
            draw_export(editor)
            draw_models(editor)

    def _open(self, editor: Editor, dialog: Dialog) -> None:
        suggestion = editor.filing.suggestion(dialog)
        if not self._has_native or editor.settings.dialogs == "built-in":
            self._chooser.open(dialog, suggestion, FILTERS[dialog])
            return
        patterns = " ".join(f"*{ending}" for ending in FILTERS[dialog])
        title, ask = t(dialog.value), pfd.open_file if dialog.is_opening else pfd.save_file
        native = ask(title, str(suggestion), [title, patterns, t("All files"), "*"])
        self._native = (dialog, native)

    def _poll_native(self, editor: Editor) -> None:
        if self._native is None:
            return
        dialog, native = self._native
        if not native.ready(0):
            return
        self._native = None
        result = native.result()
        chosen = (result[0] if result else "") if isinstance(result, list) else result
        if chosen:
            editor.filing.choose(dialog, Path(chosen))
        else:
            editor.filing.cancel_dialog()

    def _draw_question(self, editor: Editor) -> None:
        if editor.filing.question is None:
            return
        about = t("The session keeps the selection, the 3D object and its pose.")
        asked = editor.filing.asked
        if len(asked) > 1:
            about = "\n".join([f"{Icon.IMAGE}  {tab.name}" for tab in asked[:LISTED]])
            if (more := len(asked) - LISTED) > 0:
                about += "\n" + t(" and {count} more", count=more).strip()
        with modal(t("Save what you have changed?"), QUESTION, about) as is_shown:
            if is_shown:
                self._draw_answers(editor.filing)

    def _draw_answers(self, filing: Filing) -> None:
        answer = None
        top = imgui.get_cursor_pos_y()
        label = t("Save session") if len(filing.asked) == 1 else t("Save all")
        if button(label, Emphasis.PRIMARY, width=132) or is_confirmed():
            answer = filing.answer_save
        lower = top + theme.pt((PRIMARY - FIELD) / 2)  # in the middle of the taller button
        imgui.same_line()
        imgui.set_cursor_pos_y(lower)
        if button(t("Don't save"), width=104):
            answer = filing.answer_discard
        imgui.same_line()
        imgui.set_cursor_pos_y(lower)
        if button(t("Cancel"), width=104) or is_dismissed():
            answer = filing.answer_cancel
        if answer is not None:
            imgui.close_current_popup()
            answer()


def _leaving() -> str:
    return t("A file is still being written")


def _draw_leaving(filing: Filing) -> None:
    """What is still being written, and whether to wait for it; once more when that failed."""
    names = "\n".join(f"{Icon.EXPORT}  {name}" for name in filing.writing[:LISTED])
    about = names + "\n" + t("It is finished first; then ObjectMorpher quits.")
    with modal(_leaving(), QUESTION, about) as is_shown:
        if not is_shown:
            return
        answer = None if filing.leaving is not None else filing.answer_stay  # it could not be
        top = imgui.get_cursor_pos_y()
        if button(t("Don't quit"), Emphasis.PRIMARY, width=132) or is_confirmed() or is_dismissed():
            answer = filing.answer_stay
        imgui.same_line()
        imgui.set_cursor_pos_y(top + theme.pt((PRIMARY - FIELD) / 2))
        if button(t("Stop it and quit"), width=132):
            answer = filing.answer_stop
        if answer is not None:
            imgui.close_current_popup()
            answer()
