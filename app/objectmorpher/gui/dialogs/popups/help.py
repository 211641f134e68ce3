"""The tutorial and the how-to pages, read in the window."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from .... import __version__
from ....editor.editor import Editor
from ....system.help_pages import Block, Kind, pages
from ....system.logs import log_path
from ....system.report import report
from ....system.resources import resource
from ....system.texts import t
from ...widgets import widgets
from ...widgets.modal import popup
from ...widgets.theme import theme
from ...widgets.widgets import Emphasis, bold_text, button, gap, note, shown_path
from ...window.landmarks import mark

# The About popup: this program, and the sources of its parts.

ABOUT_SIZE = (520.0, 420.0)  # points


def draw_about(editor: Editor) -> None:
    """Version, licences, and where the log is."""
    with popup(editor, t("About ObjectMorpher"), *ABOUT_SIZE):
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


SIZE = (920.0, 720.0)  # points
LIST = 232.0  # points, width of the list of pages


def draw_help(editor: Editor) -> None:
    """The titles at the left, the chosen page at the right."""
    with popup(editor, t("Tutorial and how-to"), *SIZE):
        chosen = editor.view.help_page
        imgui.begin_child("##titles", ImVec2(theme.pt(LIST), 0), imgui.ChildFlags_.nav_flattened)
        for page in pages():
            is_chosen = page.name == chosen
            if imgui.selectable(f"{page.title}##{page.name}", is_chosen)[0]:
                editor.view.help_page = page.name
            mark(page.title)
        imgui.end_child()
        imgui.same_line(0, theme.pt(16))
        imgui.begin_child(f"##{chosen}", ImVec2(0, 0), imgui.ChildFlags_.nav_flattened)
        for page in pages():
            if page.name == chosen:
                with bold_text(18.0):
                    imgui.text_unformatted(page.title)
                for block in page.blocks:
                    _draw_block(block)
        imgui.end_child()


def _draw_block(block: Block) -> None:
    if block.kind is Kind.HEADING:
        gap(20)
        widgets.heading(block.text)
    elif block.kind is Kind.CODE:
        imgui.push_style_color(imgui.Col_.child_bg, theme.vec("raised"))
        flags = imgui.ChildFlags_.auto_resize_y | imgui.ChildFlags_.always_use_window_padding
        imgui.begin_child(f"##{block.text}", ImVec2(0, 0), flags)
        widgets.wrapped_text(block.text)
        imgui.end_child()
        imgui.pop_style_color()
    elif block.kind is Kind.ITEM:
        imgui.bullet()
        imgui.same_line()
        note(block.text)
    else:
        note(block.text)
