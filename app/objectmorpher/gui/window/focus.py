"""Buttons and fields by keyboard: which part of the window has the keys, the photo or a panel."""

from __future__ import annotations

from imgui_bundle import imgui

from ...editor.editor import Editor
from ..widgets.panes import INSPECTOR, START, STATUS, TABS, TOOLS

MENU = "##MainMenuBar"  # ImGui's name of it
ANY_POPUP = imgui.PopupFlags_.any_popup_id | imgui.PopupFlags_.any_popup_level


class KeyboardFocus:
    """Tab and F6 leave the photo for the panels, Esc and the mouse come back to it."""

    def __init__(self) -> None:
        self.is_on = False  # a panel has the keys; the ring shows which part of it
        self._pane = ""
        self._age = 0  # frames since it came there

    def begin(self, editor: Editor, is_recording: bool) -> None:
        """Before ImGui's frame: whether keys go to its controls. Not while they are recorded."""
        io = imgui.get_io()
        if self.is_on and any(io.mouse_down):
            self._stop()
        has_popup = imgui.is_popup_open("", ANY_POPUP) or editor.view.popup is not None
        flag = int(imgui.ConfigFlags_.nav_enable_keyboard)
        is_wanted = (self.is_on or has_popup) and not is_recording
        io.config_flags = (io.config_flags | flag) if is_wanted else (io.config_flags & ~flag)
        io.config_nav_cursor_visible_always = self.is_on and not has_popup

    def check(self, editor: Editor) -> None:
        """Return the keys to the photo where their panel is gone; once a frame."""
        self._age += 1
        if self.is_on and self._age > 2 and self._pane not in self._panes(editor):
            self.leave()

    def take(self, editor: Editor, keys: str) -> bool:
        """A chord that goes to the panels, or to the next one; whether it was one."""
        if editor.view.popup is not None:
            return keys in ("Tab", "Shift+Tab") or is_for_controls(keys)
        if keys in ("Tab", "Shift+Tab"):
            if not self.is_on:
                self._enter(START if editor.document is None else INSPECTOR)
            return True
        if keys == "F10":
            self._enter(MENU)
            return True
        if keys in ("F6", "Shift+F6"):
            self._go_on(editor, -1 if keys == "Shift+F6" else 1)
            return True
        if self.is_on and keys == "Escape":
            self.leave()
            return True
        return self.is_on and is_for_controls(keys)

    def leave(self) -> None:
        """The photo has the keys."""
        self._stop()
        imgui.set_window_focus(None)  # pyright: ignore[reportArgumentType, reportCallIssue]

    def _stop(self) -> None:
        self.is_on, self._pane = False, ""
        imgui.set_nav_cursor_visible(False)

    def _panes(self, editor: Editor) -> tuple[str, ...]:
        """In the order of F6; "" is the photo, which is not there before one is open."""
        is_telling = editor.message is not None or not editor.jobs.is_idle
        last = (STATUS,) if is_telling or self._pane == STATUS else ()
        tabs = (TABS,) if len(editor.tabs.all) > 1 else ()
        if editor.document is None:
            return (START, *last, MENU, *tabs)
        return ("", TOOLS, INSPECTOR, *last, MENU, *tabs)

    def _go_on(self, editor: Editor, step: int) -> None:
        panes = self._panes(editor)
        at = panes.index(self._pane) if self._pane in panes else -1 if step > 0 else 0
        following = panes[(at + step) % len(panes)]
        if following:
            self._enter(following)
        else:
            self.leave()

    def _enter(self, pane: str) -> None:
        """ImGui's ring is on the first of its controls."""
        window = imgui.internal.find_window_by_name(pane)
        if window is None:
            return
        self.is_on, self._pane, self._age = True, pane, 0
        io = imgui.get_io()
        io.config_flags |= int(imgui.ConfigFlags_.nav_enable_keyboard)
        imgui.internal.focus_window(window)
        context = imgui.get_current_context()
        layer = imgui.internal.NavLayer
        context.nav_layer = layer.menu if pane == MENU else layer.main
        imgui.internal.nav_init_window(window, True)
        imgui.set_nav_cursor_visible(True)


def is_for_controls(keys: str) -> bool:
    """Whether a panel that has the keys needs this chord for itself."""
    return keys.rpartition("+")[2] in (
        "Left", "Right", "Up", "Down", "Enter", "Space", "Home", "End", "PageUp", "PageDown",
    )  # fmt: skip
