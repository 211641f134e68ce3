"""The About popup: this program, and the sources of its parts."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from .... import __version__
from ....editor.editor import Editor
from ....system.logs import log_path
from ....system.report import report
from ....system.resources import resource
from ....system.texts import t
from ...widgets.widgets import Emphasis, button, gap, note, shown_path
from .frame import popup

SIZE = (520.0, 420.0)  # points


def draw_about(editor: Editor) -> None:
    """Version, licences, and where the log is."""
    with popup(editor, t("About ObjectMorpher"), *SIZE):
        imgui.text_unformatted(t("Version {version}", version=__version__))
        gap(12)
        note(t("Open a photo, click an object, drag its points in 3D, save the photo."))
        note(t("After “ObjectMorpher” (CVPR 2026). Everything runs on this computer."))
        gap(12)
        note(t("The log is {path}", path=shown_path(log_path())))
        if button(t("Copy report"), Emphasis.PLAIN, width=200):
            imgui.set_clipboard_text(report(log_path().parent))
            editor.say(t("The report is in the clipboard, without names of folders and photos"))
        gap(12)
        imgui.begin_child("##licences", ImVec2(0, 0))
        note(resource("assets/licences.txt").read_text(encoding="utf-8"))
        imgui.end_child()
