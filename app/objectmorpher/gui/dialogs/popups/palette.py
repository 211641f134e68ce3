"""The command palette: every command, setting, gesture and help page, found by typing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from imgui_bundle import ImVec2, imgui

from ....commands import (
    COMMANDS,
    GROUPS,
    OTHER_WORDS,
    SETTINGS,
    keys_of,
    meaning_of,
    run,
    why_not,
)
from ....editor.editor import Editor
from ....editor.shortcuts import GESTURES
from ....editor.view import Popup
from ....system.help_pages import pages
from ....system.texts import languages, t
from ...widgets.modal import popup
from ...widgets.theme import theme
from ...widgets.widgets import fitted, sought, tooltip
from ...window.landmarks import mark

SIZE = (600.0, 480.0)  # points
ROW = 28.0
SELF = Popup.PALETTE.name.lower()
BETWEEN = 24.0  # points, at least, between a title and what is right of it
STEPS = {imgui.Key.down_arrow: 1, imgui.Key.up_arrow: -1, imgui.Key.page_down: 10,
         imgui.Key.page_up: -10}  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """One line: what it is, where it belongs, and what choosing it does."""

    title: str
    group: str
    keys: str
    choose: Callable[[Editor], None]
    command: str = ""  # of COMMANDS, where it is one
    words: str = ""  # by which it is found, too


class CommandPalette:
    """Remembers what is typed, and which line is chosen."""

    def __init__(self) -> None:
        self._typed, self._chosen, self._recent = "", 0, list[str]()

    def draw(self, editor: Editor) -> None:
        with popup(editor, t("Find a command"), *SIZE):
            is_new = imgui.is_window_appearing()
            if is_new:
                self._typed, self._chosen = "", 0
                imgui.set_keyboard_focus_here()
            imgui.set_next_item_width(-1)
            hint = t("Type what you want to do")
            is_other, self._typed = imgui.input_text_with_hint("##typed", hint, self._typed)
            mark(hint)
            found = self._found(editor)
            self._chosen = 0 if is_other else min(self._chosen, max(len(found) - 1, 0))
            step = sum(n for key, n in STEPS.items() if imgui.is_key_pressed(key))
            self._chosen = min(max(self._chosen + step, 0), max(len(found) - 1, 0))
            imgui.dummy(theme.size(0, 4))
            self._draw_lines(editor, found, is_moved=bool(step))
            if imgui.is_key_pressed(imgui.Key.escape):
                editor.view.popup = None
            elif found and not is_new and imgui.is_key_pressed(imgui.Key.enter, False):
                self._choose(editor, found[self._chosen])

    def _draw_lines(self, editor: Editor, found: list[Entry], is_moved: bool) -> None:
        imgui.begin_child("##found", ImVec2(0, 0))
        if not found:
            imgui.text_colored(theme.vec("secondary"), t("No command has such a name"))
        for n, entry in enumerate(found):
            self._draw_line(editor, entry, n)
            if is_moved and n == self._chosen:
                imgui.set_scroll_here_y()
        imgui.end_child()

    def _draw_line(self, editor: Editor, entry: Entry, n: int) -> None:
        """Title left; the keys, or the group, right. What cannot run now is dimmed."""
        reason = why_not(editor, entry.command) if entry.command else None
        low, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
        if imgui.selectable(f"##{n}", n == self._chosen, 0, ImVec2(0, theme.pt(ROW)))[0]:
            self._choose(editor, entry)
        mark(entry.title)
        if told := reason or meaning_of(editor, entry.command):
            tooltip(told)
        draw, pad = imgui.get_window_draw_list(), theme.pt(8)
        top = low.y + (theme.pt(ROW) - imgui.get_font_size()) / 2
        right = entry.keys or entry.group
        across = imgui.calc_text_size(right).x
        room = width - across - 2 * pad - theme.pt(BETWEEN)
        ink = theme.u32("text", 1.0 if reason is None else 0.45)
        draw.add_text(ImVec2(low.x + pad, top), ink, fitted(entry.title, room))
        draw.add_text(ImVec2(low.x + width - pad - across, top), theme.u32("secondary"), right)

    def _choose(self, editor: Editor, entry: Entry) -> None:
        self._recent = [entry.title, *(r for r in self._recent if r != entry.title)]
        editor.view.popup = None
        entry.choose(editor)

    def _found(self, editor: Editor) -> list[Entry]:
        """What fits what is typed, the best first; with nothing typed, what was chosen last."""
        words = self._typed.casefold().split()
        ranked = []
        for place, entry in enumerate(_entries(editor)):
            title = t(entry.title).casefold()
            whole = f"{title} {entry.group} {entry.keys} {entry.words}".casefold()
            if not all(word in whole for word in words):
                continue
            is_known = entry.title in self._recent
            recent = self._recent.index(entry.title) if is_known else len(self._recent)
            starts = not words or title.startswith(words[0])
            inside = all(word in title for word in words)
            is_meant = all(word in f"{title} {entry.words}" for word in words)
            order = (recent,) if not words else (not starts, not inside, not is_meant, recent)
            ranked.append((*order, place, entry))
        return [row[-1] for row in sorted(ranked, key=lambda row: row[:-1])]


def _entries(editor: Editor) -> list[Entry]:
    """All there is: commands, settings, pages, gestures."""

    def read(name: str, editor: Editor) -> None:
        editor.view.help_page, editor.view.popup = name, Popup.HELP

    def show_gestures(editor: Editor) -> None:
        editor.view.popup = Popup.SHORTCUTS

    def go(name: str, editor: Editor) -> None:
        run(editor, name)

    def find(name: str, label: str, editor: Editor) -> None:
        """The row of a setting, in the panel that has it."""
        reason = why_not(editor, name)
        run(editor, name)
        if reason is None:
            if name != "preferences" and not editor.view.has_panel:
                editor.view.wants_panel = True
            sought.begin(t(label))

    found = [
        Entry(
            t(command.label), t(title), keys_of(editor, name), partial(go, name), name,
            OTHER_WORDS.get(command.label, ""),
        )
        for title, commands in GROUPS.items()
        for name, command in commands.items()
        if name != SELF
    ]  # fmt: skip
    for name, labels in SETTINGS.items():
        where = t(COMMANDS[name].label)
        group = t("Setting: {where}", where=where)
        found += [
            Entry(t(label), group, "", partial(find, name, label), name, OTHER_WORDS.get(label, ""))
            for label in labels
            if label != "Language" or len(languages()) > 1
        ]
    found += [Entry(page.title, t("Help"), "", partial(read, page.name)) for page in pages()]
    for tool, rows in GESTURES.items():
        label = t("Pointer: {tool}", tool=t(tool))
        found += [Entry(t(meaning), label, t(keys), show_gestures) for keys, meaning in rows]
    return found
