"""Every shortcut and gesture in one table; a click on the keys of a command gives it others."""

from __future__ import annotations

import math
from collections.abc import Iterator

from imgui_bundle import ImVec2, imgui

from ....commands import COMMANDS, GROUPS, keys_of
from ....editor.editor import Editor
from ....editor.shortcuts import GESTURES, Shortcuts
from ....system.texts import t
from ...widgets.modal import popup
from ...widgets.theme import SMALL_SIZE, Icon, theme
from ...widgets.widgets import Emphasis, bold_text, button, small_text, tooltip, wrapped_text

SIZE = (880.0, 720.0)  # points
COLUMNS = 2
KEYS = 132.0  # points, width of the keys' column
RESET = 24.0
GESTURE = 0.44  # of a column, where the gestures' meanings begin


class ShortcutsPopup:
    """Remembers what is searched for."""

    def __init__(self, shortcuts: Shortcuts) -> None:
        self._shortcuts = shortcuts
        self._filter = ""

    def draw(self, editor: Editor) -> None:
        with popup(editor, t("Keyboard and pointer"), *SIZE):
            self._draw_head()
            imgui.begin_child("##keys", ImVec2(0, 0), imgui.ChildFlags_.nav_flattened)
            imgui.push_style_var(imgui.StyleVar_.item_spacing, theme.size(8, 2))
            if imgui.begin_table("##table", COLUMNS):
                self._draw_columns(editor)
                imgui.end_table()
            imgui.pop_style_var()
            imgui.end_child()

    def _draw_head(self) -> None:
        imgui.set_next_item_width(imgui.get_content_region_avail().x - theme.pt(168))
        hint = t("Search")
        self._filter = imgui.input_text_with_hint("##search", hint, self._filter)[1]
        imgui.same_line()
        changed = bool(self._shortcuts.changed)
        why_not = None if changed else t("All keys are the usual ones")
        if button(t("Reset all"), why_not=why_not, width=160):
            self._shortcuts.reset_all()
        imgui.dummy(theme.size(0, 4))

    def _draw_columns(self, editor: Editor) -> None:
        """Groups one after the other, about as many rows in each column."""
        groups = [(title, rows) for title, rows in self._groups(editor) if rows]
        sizes = [len(rows) + 2 for _, rows in groups]
        half, used, column = math.ceil(sum(sizes) / COLUMNS), 0, -1
        for i, (title, rows) in enumerate(groups):
            if column < 0 or (used + sizes[i] / 2 > half and column < COLUMNS - 1):
                imgui.table_next_column()
                column, used = column + 1, 0
            used += sizes[i]
            with bold_text():
                imgui.text_unformatted(t(title))
            for row in rows:
                if isinstance(row, str):
                    self._draw_command(editor, row)
                else:
                    _draw_gesture(*row)
            imgui.dummy(theme.size(0, 8))

    def _groups(self, editor: Editor) -> Iterator[tuple[str, list[str] | list[tuple[str, str]]]]:
        """Commands by their names, then gestures with their meanings, as far as they are meant."""
        for title, commands in GROUPS.items():
            yield (
                title,
                [n for n, c in commands.items() if self._is_meant(c.label, keys_of(editor, n))],
            )
        for title, rows in GESTURES.items():
            meant = [(keys, does) for keys, does in rows if self._is_meant(does, keys)]
            yield t("Pointer: {tool}", tool=t(title)), meant

    def _is_meant(self, label: str, keys: str) -> bool:
        wanted = self._filter.casefold()
        return wanted in t(label).casefold() or wanted in keys.casefold()

    def _draw_command(self, editor: Editor, name: str) -> None:
        shortcuts, keys = self._shortcuts, keys_of(editor, name)
        right = _draw_label(t(COMMANDS[name].label))
        is_awaited = shortcuts.recording == name
        imgui.same_line()
        imgui.set_cursor_pos_x(right)
        imgui.push_id(name)
        imgui.push_font(None, SMALL_SIZE)
        text = t("Press keys…") if is_awaited else keys or "–"
        kind = Emphasis.PRIMARY_SMALL if is_awaited else Emphasis.PLAIN if keys else Emphasis.QUIET
        if button(text, kind, width=KEYS - RESET - 4):
            shortcuts.recording = None if is_awaited else name
        imgui.pop_font()
        tooltip(t("Click, then press other keys. Esc leaves them as they are."))
        if name in shortcuts.changed:
            imgui.same_line(0, theme.pt(4))
            if button(Icon.RESET, Emphasis.QUIET, width=RESET):
                shortcuts.reset(name)
            tooltip(t("Back to {keys}", keys=COMMANDS[name].keys or "–"))
        imgui.pop_id()


def _draw_label(text: str) -> float:
    """The row's text; where its keys begin, from the window's left."""
    left = imgui.get_cursor_pos_x()
    width = imgui.get_content_region_avail().x
    imgui.align_text_to_frame_padding()
    imgui.text_colored(theme.vec("secondary"), text)
    return left + width - theme.pt(KEYS + 12)


def _draw_gesture(gesture: str, meaning: str) -> None:
    imgui.align_text_to_frame_padding()
    start = imgui.get_cursor_pos_x()
    width = imgui.get_content_region_avail().x
    with small_text():
        imgui.text_unformatted(t(gesture))
    imgui.same_line()
    imgui.set_cursor_pos_x(start + GESTURE * width)
    wrapped_text(t(meaning), "secondary", start + width - theme.pt(12))
