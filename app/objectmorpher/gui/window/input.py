"""Input: mouse, keys and the keyboard's crosshair become pointers, strokes and commands."""

from __future__ import annotations

import logging
import math
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from ...commands import next_step, run, take_next_step
from ...editor.editor import Editor
from ...editor.intents.landing import OF_THE_PHOTO
from ...editor.shortcuts import Shortcuts
from ...editor.view import Hover, ToolName
from ...system.texts import t
from ...tools import navigate
from ...tools.pointer import Button, Pointer, PointerShape
from ...tools.pose_tool import DEPTH_STEP
from ...tools.registry import TOOLS, Tool
from ..overlay.canvas import DARK, WHITE, CanvasPainter
from ..widgets.panes import INSPECTOR, START, STATUS, TABS, Rect
from ..widgets.panes import TOOLS as TOOL_STRIP
from ..widgets.theme import theme
from .landmarks import mark_on_canvas

# Buttons and fields by keyboard: which part of the window has the keys, the photo or a panel.

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
        return ("", TOOL_STRIP, INSPECTOR, *last, MENU, *tabs)

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


def _is_in_step() -> bool:
    """Whether the button that is held now is the one that is held in ImGui's frame.

    While a frame was slow it may have gone up, and down again elsewhere: for another stroke.
    """
    queue = imgui.get_current_context().input_events_queue
    kind = imgui.internal.InputEventType.mouse_button
    return any(imgui.get_io().mouse_down) and all(event.type != kind for event in queue)


def is_for_controls(keys: str) -> bool:
    """Whether a panel that has the keys needs this chord for itself."""
    return keys.rpartition("+")[2] in (
        "Left", "Right", "Up", "Down", "Enter", "Space", "Home", "End", "PageUp", "PageDown",
    )  # fmt: skip


def part_frames() -> None:
    """What comes next is for ImGui's next frame.

    Called before a modifier is let go: of a key pressed with it and its release, which a slow frame
    may bring together, a field would see the key alone. ImGui takes two events of one key, which
    no keyboard here has, in two frames.
    """
    io = imgui.get_io()
    io.add_key_event(imgui.Key.f24, True)
    io.add_key_event(imgui.Key.f24, False)


# A pointer on the canvas for those who have no mouse: arrows move it, keys press at it.

STRIDE, FAR = 8.0, 64.0  # points that an arrow moves it, and with Shift
EDGE = 24.0  # points to the canvas's edge; nearer to it the photo moves instead
ARM, HOLE = 14.0, 4.0  # points from the middle to the end and to the start of each line


class Crosshair:
    """Unseen until an arrow is pressed, and again when the mouse moves."""

    def __init__(self) -> None:
        self._xy: tuple[float, float] | None = None  # canvas px
        self.is_down = False  # a button is held at it
        self._mouse = (0.0, 0.0)

    @property
    def is_shown(self) -> bool:
        return self._xy is not None

    def hide(self) -> None:
        self._xy, self.is_down = None, False

    def follow_mouse(self, xy: tuple[float, float], has_acted: bool) -> None:
        """The mouse, where it is used, is the pointer again. A stroke in progress goes on."""
        is_used = has_acted or xy != self._mouse
        self._mouse = xy
        if is_used and not self.is_down:
            self.hide()

    def move(self, editor: Editor, dx: float, dy: float) -> None:
        """Move by so many canvas px; at the edge of the canvas the photo scrolls."""
        view, photo = editor.view, editor.photo_size
        if photo is None:
            return
        if self._xy is None:
            self._xy = self._start(editor)
        edge = min(EDGE * view.scale, view.width / 2, view.height / 2)
        x, y = self._xy[0] + dx, self._xy[1] + dy
        inside = (
            min(max(x, edge), max(view.width - edge, edge)),
            min(max(y, edge), max(view.height - edge, edge)),
        )
        if inside != (x, y) and not view.is_fitted:
            view.pan(inside[0] - x, inside[1] - y, photo)
        self._xy = inside

    def _start(self, editor: Editor) -> tuple[float, float]:
        """Where the mouse is on the photo, else in the middle of what is seen."""
        pointer = editor.pointer
        if pointer is not None and editor.is_on_photo(pointer.xy):
            return pointer.x, pointer.y
        return editor.view.width / 2, editor.view.height / 2

    def pointer(self, button: Button | None = None) -> Pointer:
        """Return a pressed pointer as the tools see it."""
        assert self._xy is not None
        return Pointer(*self._xy, button=button, is_down=True)

    def draw(self, editor: Editor, rect: Rect, pixel_ratio: float) -> None:
        """Four lines around the place, and a square while it holds something."""
        if self._xy is None or editor.document is None:
            return
        canvas = CanvasPainter(editor, rect, pixel_ratio)
        at = canvas.on_canvas(self.pointer().xy)[0]
        near, far = theme.pt(HOLE), theme.pt(ARM)
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            start = ImVec2(at.x + dx * near, at.y + dy * near)
            end = ImVec2(at.x + dx * far, at.y + dy * far)
            canvas.draw.add_line(start, end, theme.u32(DARK), theme.pt(5))
            canvas.draw.add_line(start, end, theme.u32(WHITE), theme.pt(2))
        if self.is_down:
            low, high = ImVec2(at.x - far, at.y - far), ImVec2(at.x + far, at.y + far)
            canvas.draw.add_rect(low, high, theme.u32(DARK), 0.0, thickness=theme.pt(5))
            canvas.draw.add_rect(low, high, theme.u32(WHITE), 0.0, thickness=theme.pt(2))
        mark_on_canvas("Crosshair", at, at)


log = logging.getLogger(__name__)

ARROWS = {"Left": (-1, 0), "Right": (1, 0), "Up": (0, -1), "Down": (0, 1)}
HELP = "?"
DEPTHS = {"PageUp": 1, "PageDown": -1}
PACES = {(): 1.0, ("Shift",): 10.0, ("Alt",): 0.1}  # px that an arrow nudges, by what is held
STRIDES = {(): STRIDE, ("Shift",): FAR, ("Alt",): 0.0}  # points of the crosshair; 0: one px


class Input:
    """One frame's input to the editor; it remembers only the shape of the pointer."""

    def __init__(self, shortcuts: Shortcuts) -> None:
        self._shortcuts = shortcuts
        self.shape = PointerShape.ARROW
        self.crosshair, self.focus = Crosshair(), KeyboardFocus()
        self._waiting: list[tuple[int, str]] = []  # ImGui's number of the event, and the chord
        self._pressed: list[str] = []  # chords since the last frame, in their order
        self.mouse = 0.0, 0.0  # where it was last, window units
        self._last: tuple[float, float] | None = None
        self._has_popup = False  # in the last frame
        self._hovered: tuple[object, ...] | None = None  # where `hover` was last asked

    def update(
        self, editor: Editor, rect: Rect, ratio: float, at: tuple[float, float] | None = None
    ) -> None:
        """`rect`: the canvas, window units; `ratio`: canvas px per window unit.

        `at`: where the mouse is by now, if not where ImGui's frame began, window units.
        """
        io = imgui.get_io()
        has_mouse = imgui.is_mouse_pos_valid()  # else it has left, and is at minus 3e38
        if at is not None and _is_in_step():
            self.mouse = at
        elif has_mouse:
            self.mouse = io.mouse_pos.x, io.mouse_pos.y
        x, y = self.mouse
        is_mouse_used = any(io.mouse_down) or io.mouse_wheel != 0
        self.crosshair.follow_mouse((x, y), is_mouse_used)
        if editor.document is None:
            self.crosshair.hide()
        self.crosshair.is_down &= editor.hand.is_busy
        self.focus.check(editor)
        self._run_keys(editor)
        pointer = Pointer(
            (x - rect.x) * ratio,
            (y - rect.y) * ratio,
            is_down=True,
            shift=io.key_shift,
            alt=io.key_alt,
            ctrl=io.key_ctrl,
            space=imgui.is_key_down(imgui.Key.space),
            wheel=io.mouse_wheel,
        )
        is_over = has_mouse and rect.contains(x, y) and not io.want_capture_mouse
        if self.crosshair.is_shown:
            pointer, is_over = self.crosshair.pointer(), not imgui.is_popup_open("", ANY_POPUP)
        with _guarded(editor):
            self._point(editor, pointer, is_over)

    def _point(self, editor: Editor, pointer: Pointer, is_over: bool) -> None:
        """Hovering, beginning, going on: whichever it is."""
        editor.pointer = pointer if is_over or editor.hand.is_busy else None
        if editor.hand.is_busy:
            self._go_on(editor, pointer)
        elif editor.document is not None and is_over:
            self._begin(editor, pointer)
        else:
            self.shape = PointerShape.ARROW
            editor.hover, self._hovered = Hover(), None

    def hint(self, editor: Editor) -> str:
        if editor.document is None:
            return t("Open a photo, drop one here, or try a sample")
        if _is_held(editor) and editor.hover.other is None:
            return editor.why_held or ""
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
        had_popup, self._has_popup = self._has_popup, imgui.is_popup_open("", ANY_POPUP)
        if imgui.get_io().want_text_input or self._has_popup:
            editor.view.is_before = False
            return
        if had_popup:  # ImGui has folded up a list for it already
            pressed = [keys for keys in pressed if keys != "Escape"]
        editor.view.is_before = editor.document is not None and imgui.is_key_down(imgui.Key.x)
        for keys in pressed:
            if not self.focus.take(editor, keys):
                self._run_key(editor, keys)

    def _run_key(self, editor: Editor, keys: str) -> None:
        *held, key = keys.split("+")
        is_step = (key in ARROWS or key in DEPTHS) and tuple(held) in PACES
        is_free = editor.view.popup is None and not editor.filing.is_asking
        if keys == "Escape" and editor.view.popup is not None:
            editor.view.popup = None
        elif keys == "Escape":
            editor.escape()
        elif keys in ("Enter", "Space", "Shift+Space", "Shift+Enter") and is_free:
            self._press_key(editor, keys)
        elif keys == HELP:
            run(editor, "shortcuts")
        elif is_step and is_free:
            self._step(editor, key, tuple(held))
        elif (name := self._shortcuts.command_of(keys)) is not None:
            run(editor, name)

    def _step(self, editor: Editor, key: str, held: tuple[str, ...]) -> None:
        """An arrow moves what is chosen, else the crosshair."""
        (dx, dy), depth = ARROWS.get(key, (0, 0)), DEPTHS.get(key, 0)
        tool, pace = editor.view.tool, PACES[held]
        is_placing = tool is ToolName.PLACE and editor.is_lifted
        is_posing = tool is ToolName.POSE and bool(editor.posing.selected)
        if (is_placing or is_posing) and not self.crosshair.is_down:
            if not editor.chosen.is_visible:
                editor.objects.say_hidden(editor.current)
                return
            nudge = editor.placing.nudge if is_placing else editor.posing.nudge
            nudge(dx * pace, dy * pace, depth * pace * DEPTH_STEP)
        elif depth == 0:
            stride = STRIDES[held] * editor.view.scale or max(editor.view.zoom, 1.0)
            self.crosshair.move(editor, dx * stride, dy * stride)

    def _press_key(self, editor: Editor, keys: str) -> None:
        """At the crosshair Space clicks, and Shift+Enter takes hold or lets go.

        Enter is the next step; where that is the user's own, in the photo, it clicks too.
        """
        is_pose = editor.view.tool is ToolName.POSE and editor.is_lifted
        is_awaited = next_step(editor)[1] is None and (is_pose or editor.tasks.is_click_awaited)
        with _guarded(editor):
            if self.crosshair.is_down:
                self._let_go(editor)
            elif keys == "Enter" and not (self.crosshair.is_shown and is_awaited):
                take_next_step(editor)
            elif self.crosshair.is_shown and not editor.hand.is_busy:
                self._press(editor, Button.RIGHT if keys == "Shift+Space" else Button.LEFT)
                if keys != "Shift+Enter":
                    self._let_go(editor)

    def _press(self, editor: Editor, button: Button) -> None:
        """A button goes down at the crosshair."""
        pointer, tool = self.crosshair.pointer(button), TOOLS[editor.view.tool]
        if not _is_answered(editor) or _is_locked(editor, pointer):
            return
        self.shape = tool.hover(editor, pointer)
        editor.message = None
        is_split = navigate.is_on_split(editor, pointer)
        stroke = (navigate.drag_split if is_split else tool.press)(editor, pointer)
        self.crosshair.is_down = True
        editor.hand.press(stroke, button)
        self._last = (pointer.x, pointer.y)

    def _let_go(self, editor: Editor) -> None:
        """It goes up where the crosshair is now."""
        self.crosshair.is_down = False
        pointer = self.crosshair.pointer()
        if self._last != (pointer.x, pointer.y):
            editor.hand.move(pointer)
        editor.hand.move(replace(pointer, is_down=False))

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
                elif (
                    button is Button.MIDDLE
                    or not _is_answered(editor)
                    or _is_locked(editor, pressed)
                ):
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
            self.shape = PointerShape.HAND
        elif navigate.is_on_split(editor, pointer):
            self.shape = PointerShape.SPLIT
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
            self.shape = _hover(tool, editor, pointer)
            self._hovered = key

    def _go_on(self, editor: Editor, pointer: Pointer) -> None:
        """A stroke goes on or ends."""
        button = editor.hand.button
        is_down = self.crosshair.is_down
        is_down = is_down or (button is not None and imgui.is_mouse_down(button.value))
        if imgui.get_io().app_focus_lost:
            editor.hand.abort(editor)
            return
        if self._last != (pointer.x, pointer.y) or pointer.wheel != 0:
            self._last = (pointer.x, pointer.y)
            editor.hand.move(pointer)  # before the release: both may come in one slow frame
        else:
            editor.posing.relax()
        if is_down:
            return
        if (tab := editor.tabs.aimed) is not None and not self.crosshair.is_shown:
            editor.hand.abort(editor)
            editor.pasting.carry(tab)
        else:
            editor.hand.move(replace(pointer, is_down=False))


def _is_locked(editor: Editor, pointer: Pointer) -> bool:
    """Whether a press would change the current object, which is locked or hidden; that is said."""
    if not _is_held(editor) or editor.objects.other_at(pointer.xy) is not None:
        return False
    if editor.chosen.is_locked:
        editor.say_locked(editor.current)
    else:
        editor.objects.say_hidden(editor.current)
    return True


def _is_held(editor: Editor) -> bool:
    """Whether the tool would change the current object, which is locked, or not seen to move."""
    return editor.view.tool is not ToolName.SELECT and editor.why_held is not None


def _hover(tool: Tool, editor: Editor, pointer: Pointer) -> PointerShape:
    """What a press would take is marked: of a locked object nothing, of the others all."""
    if _is_held(editor) and editor.objects.other_at(pointer.xy) is None:
        editor.hover = Hover()
        return PointerShape.ARROW
    return tool.hover(editor, pointer)


def _is_answered(editor: Editor) -> bool:
    """Whether a press does anything: on the photo as it was only what selects in it."""
    return not editor.view.is_before or editor.view.tool in OF_THE_PHOTO


@contextmanager
def _guarded(editor: Editor) -> Iterator[None]:
    """A stroke that fails is taken back, and a message says so."""
    try:
        yield
    except Exception as error:
        log.exception("The stroke failed")
        editor.hand.abort(editor)
        editor.complain(str(error) or type(error).__name__, traceback.format_exc())
