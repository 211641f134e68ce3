"""The tutorial and the how-to pages, read in the window."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from ....editor.editor import Editor
from ....system.help_pages import Block, Kind, pages
from ....system.texts import t
from ...widgets import widgets
from ...widgets.theme import theme
from ...widgets.widgets import bold_text, gap, note
from ...window.landmarks import mark
from .frame import popup

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
        imgui.push_style_color(imgui.Col_.text, theme.vec("text"))
        imgui.push_style_color(imgui.Col_.child_bg, theme.vec("raised"))
        flags = imgui.ChildFlags_.auto_resize_y | imgui.ChildFlags_.always_use_window_padding
        imgui.begin_child(f"##{block.text}", ImVec2(0, 0), flags)
        imgui.push_text_wrap_pos(0.0)
        imgui.text_unformatted(block.text)
        imgui.pop_text_wrap_pos()
        imgui.end_child()
        imgui.pop_style_color(2)
    elif block.kind is Kind.ITEM:
        imgui.bullet()
        imgui.same_line()
        note(block.text)
    else:
        note(block.text)
