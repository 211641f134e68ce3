"""From ImGui's mouse and keys to pointers, strokes and commands."""

from __future__ import annotations

import logging
import math
import traceback
from dataclasses import replace

from imgui_bundle import imgui

from ..commands import run, take_next_step
from ..editor import Editor
from ..feedback import Hover
from ..shortcuts import Shortcuts
from ..texts import t
from ..tools import navigate
from ..tools.pointer import Button, Pointer, Shape, Tool
from ..tools.registry import TOOLS
from ..view import ToolName
from .layout import Rect

log = logging.getLogger(__name__)

ARROWS = {"Left": (-1, 0), "Right": (1, 0), "Up": (0, -1), "Down": (0, 1)}
HELP = "?"
FAR = 10  # px that an arrow with Shift moves


class Input:
    """One frame's input to the editor; remembers only what the pointer looks like."""

    def __init__(self, shortcuts: Shortcuts) -> None:
        self._shortcuts = shortcuts
        self.shape = Shape.ARROW
        self._waiting: list[tuple[int, str]] = []  # ImGui's number of the event, and the chord
        self._pressed: list[str] = []  # chords since the last frame, in their order
        self._last: tuple[float, float] | None = None
        self._hovered: tuple[object, ...] | None = None  # where `hover` was last asked

    def update(self, editor: Editor, rect: Rect, ratio: float) -> None:
        """`rect`: the canvas, window units; `ratio`: canvas px per window unit."""
        io = imgui.get_io()
        self._run_keys(editor)
        mouse = io.mouse_pos
        pointer = Pointer(
            (mouse.x - rect.x) * ratio,
            (mouse.y - rect.y) * ratio,
            is_down=True,
            shift=io.key_shift,
            alt=io.key_alt,
            ctrl=io.key_ctrl,
            space=imgui.is_key_down(imgui.Key.space),
            wheel=io.mouse_wheel,
        )
        try:
            self._point(editor, rect, pointer)
        except Exception as error:  # a stroke that fails is taken back, and the user is told
            log.exception("The stroke failed")
            editor.hand.abort(editor)
            editor.complain(str(error) or type(error).__name__, traceback.format_exc())

    def _point(self, editor: Editor, rect: Rect, pointer: Pointer) -> None:
        """Hovering, beginning, going on: whichever it is."""
        io = imgui.get_io()
        is_over = rect.contains(io.mouse_pos.x, io.mouse_pos.y) and not io.want_capture_mouse
        editor.pointer = pointer if is_over or editor.hand.is_busy else None
        if editor.hand.is_busy:
            self._go_on(editor, pointer)
        elif editor.document is not None and is_over:
            self._begin(editor, pointer)
        else:
            self.shape = Shape.ARROW
            editor.hover, self._hovered = Hover(), None

    def hint(self, editor: Editor) -> str:
        if editor.document is None:
            return t("Open a photo, drop one here, or try a sample")
        return TOOLS[editor.view.tool].hint(editor)

    def take_key(self, keys: str) -> None:
        """A key went down, or repeats: "Ctrl+Shift+S"."""
        self._waiting.append((imgui.get_current_context().input_events_next_event_id, keys))

    def _take_waiting(self) -> None:
        """Chords go after the pointer's events that came before them and that ImGui still holds."""
        queue = imgui.get_current_context().input_events_queue
        first = queue[0].event_id if len(queue) else math.inf
        while self._waiting and self._waiting[0][0] <= first:
            self._pressed.append(self._waiting.pop(0)[1])

    def _run_keys(self, editor: Editor) -> None:
        """What was pressed since the last frame; nothing while a field or a dialog has the keys."""
        self._take_waiting()
        pressed, self._pressed = self._pressed, []
        if pressed and self._shortcuts.take(pressed[-1]):
            return
        any_popup = imgui.PopupFlags_.any_popup_id | imgui.PopupFlags_.any_popup_level
        if imgui.get_io().want_text_input or imgui.is_popup_open("", any_popup):
            editor.view.is_before = False
            return
        editor.view.is_before = editor.document is not None and imgui.is_key_down(imgui.Key.x)
        for keys in pressed:
            self._run_key(editor, keys)

    def _run_key(self, editor: Editor, keys: str) -> None:
        far, direction = keys.startswith("Shift+"), ARROWS.get(keys.removeprefix("Shift+"))
        if keys == "Escape" and editor.view.popup is not None:
            editor.view.popup = None
        elif keys == "Escape":
            editor.escape()
        elif keys == "Enter" and editor.view.popup is None:
            take_next_step(editor)
        elif keys == HELP:
            run(editor, "shortcuts")
        elif direction is not None:
            step = FAR if far else 1
            is_placing = editor.view.tool is ToolName.PLACE
            nudge = editor.placing.nudge if is_placing else editor.posing.nudge
            nudge(direction[0] * step, direction[1] * step)
        elif (name := self._shortcuts.command_of(keys)) is not None:
            run(editor, name)

    def _begin(self, editor: Editor, pointer: Pointer) -> None:
        """The pointer hovers, zooms, or starts a stroke."""
        if pointer.wheel:
            navigate.zoom(editor, pointer)
        tool = TOOLS[editor.view.tool]
        for button in Button:
            if imgui.is_mouse_clicked(button.value):
                clicks = imgui.get_mouse_clicked_count(button.value)
                pressed = replace(pointer, button=button, clicks=clicks)
                if navigate.wants_pan(pressed):
                    stroke = navigate.pan(editor, pressed)
                elif navigate.is_on_split(editor, pressed):
                    stroke = navigate.drag_split(editor, pressed)
                elif button is Button.MIDDLE or editor.view.is_before:
                    continue
                else:
                    editor.message = None
                    stroke = tool.press(editor, pressed)
                editor.hand.press(stroke, button)
                self._last = (pointer.x, pointer.y)
                if not imgui.is_mouse_down(button.value):  # pressed and released in one frame
                    editor.hand.move(replace(pointer, is_down=False))
                return
        if pointer.space:
            self.shape = Shape.HAND
        elif navigate.is_on_split(editor, pointer):
            self.shape = Shape.SPLIT
        else:
            self._hover(tool, editor, pointer)

    def _hover(self, tool: Tool, editor: Editor, pointer: Pointer) -> None:
        """Looks under the pointer anew only where it, the view or the document changed."""
        view = editor.view
        place = (view.left, view.top, view.zoom)
        key = (tool, pointer, editor.document, editor.current, view.tool, *place)
        if self._hovered is None or any(
            a is not b and a != b for a, b in zip(key, self._hovered, strict=True)
        ):
            self.shape = tool.hover(editor, pointer)
            self._hovered = key

    def _go_on(self, editor: Editor, pointer: Pointer) -> None:
        """A stroke goes on or ends."""
        button = editor.hand.button
        is_down = button is not None and imgui.is_mouse_down(button.value)
        if imgui.get_io().app_focus_lost:
            editor.hand.abort(editor)
            return
        if self._last != (pointer.x, pointer.y) or pointer.wheel != 0:
            self._last = (pointer.x, pointer.y)
            editor.hand.move(pointer)  # before the release: both may come in one slow frame
        else:
            editor.posing.relax()
        if not is_down:
            editor.hand.move(replace(pointer, is_down=False))
