"""The line at the bottom: message and hint left; job, zoom and size right."""

from __future__ import annotations

import time

from imgui_bundle import ImVec2, imgui

from ...editor.editor import Editor
from ...editor.intents.models import DOWNLOAD
from ...editor.view import StatusMessage
from ...system.report import without_names
from ...system.texts import t
from ...worker.requests import Executor, Request
from ..widgets.panes import STATUS, Rect, edge, fades, pane
from ..widgets.theme import Icon, theme
from ..widgets.widgets import icon_button, small_text, tooltip
from .landmarks import mark

JOB_DELAY = 0.15  # s; a job that is faster shows no bar
LEAST_AREA = 0.05  # megapixels that are told
BAR = 120.0  # points
BAR_HEIGHT = 6.0
BESIDE = 24.0  # points between a message and the hint
GLANCE = 4.0  # s, in which the line is looked at
PER_CHARACTER = 0.06  # s, in which one of them is read

Places = tuple[float, ...]  # of the pointer, in whatever units


class StatusReading:
    """Whether the message that is shown has been read, so that the hint has the line again.

    The time runs from when the pointer first moves: before that, somebody may have gone for a
    coffee while a film was written.
    """

    def __init__(self) -> None:
        self._message: StatusMessage | None = None
        self._places: Places = ()  # of the pointer, when the message came
        self._began: float | None = None  # s, when the pointer moved

    def is_over(self, message: StatusMessage | None, places: Places, now: float) -> bool:
        """Whether `message` was there for long enough at `now` s, with the pointer at `places`."""
        if message is not self._message:
            self._message, self._places, self._began = message, places, None
        if message is None:
            return False
        if self._began is None and places != self._places:
            self._began = now
        needed = GLANCE + PER_CHARACTER * len(message.text)
        return self._began is not None and now - self._began >= needed


_reading = StatusReading()


def draw_status(editor: Editor, rect: Rect, hint: str) -> None:
    with pane(STATUS, rect, padding=(12, 0)), small_text():
        imgui.set_cursor_pos_y((rect.height - imgui.get_font_size()) / 2)
        right = rect.width - theme.pt(12) - _facts_width(editor)
        _draw_facts(editor, rect, right)
        right = _draw_job(editor, rect, right)
        _draw_text(editor, rect, hint, right)
        edge((rect.x, rect.y + 0.5), (rect.x + rect.width, rect.y + 0.5))


def _line_y(rect: Rect) -> float:
    return (rect.height - imgui.get_font_size()) / 2


def _facts(editor: Editor) -> str:
    size = editor.photo_size
    if size is None:
        return ""
    zoom = editor.view.zoom * 100
    megapixels = size[0] * size[1] / 1e6
    area = f"   ·   {megapixels:.1f} MP" if megapixels >= LEAST_AREA else " px"
    return f"{_pixel(editor)}{zoom:.0f} %   ·   {size[0]} × {size[1]}{area}"


def _pixel(editor: Editor) -> str:
    """Place and colour of the pixel under the pointer, where single pixels are looked at."""
    color, pointer = editor.view.color, editor.pointer
    if color is None or pointer is None:
        return ""
    x, y = editor.view.image_from_canvas(pointer.xy)
    code = "".join(f"{value:02X}" for value in color)
    return f"{int(x)}, {int(y)}   #{code}   ·   "


def _facts_width(editor: Editor) -> float:
    return imgui.calc_text_size(_facts(editor)).x


def _draw_facts(editor: Editor, rect: Rect, x: float) -> None:
    imgui.set_cursor_pos(ImVec2(x, _line_y(rect)))
    imgui.text_colored(theme.vec("secondary"), _facts(editor))


def _shown_job(editor: Editor) -> tuple[Executor, Request] | None:
    """What the user waits for most: what opens, before what is computed; and who does it."""
    chore, job = editor.chores.shown, editor.jobs.shown
    if chore is not None and (chore.kind != DOWNLOAD or job is None):
        return editor.chores, chore
    return None if job is None else (editor.jobs, job)


def job_text(job: Request, held_up: tuple[Request, ...]) -> str:
    """What a job does, and which of the user's wait for it to end."""
    text = job.title if job.note in ("", job.title) else f"{job.title}: {job.note}"
    if not held_up:
        return text
    first, count = held_up[0].title, len(held_up) - 1
    if count:
        return t("{job} · waiting: {first} and {count} more", job=text, first=first, count=count)
    return t("{job} · waiting: {first}", job=text, first=first)


def _draw_job(editor: Editor, rect: Rect, right: float) -> float:
    """Name, bar, share and Cancel; the left end of what it drew."""
    shown = _shown_job(editor)
    if shown is None or time.monotonic() - shown[1].asked < JOB_DELAY:
        return right
    executor, job = shown
    side = rect.height - theme.pt(4)
    now = time.monotonic()
    held_up = editor.jobs.held_up if executor is editor.jobs else ()
    text = job_text(job, tuple(each for each in held_up if now - each.asked >= JOB_DELAY))
    share = f"{100 * job.fraction:.0f} %"
    gap = theme.pt(8)
    x = right - theme.pt(16) - side
    imgui.set_cursor_pos(ImVec2(x, theme.pt(2)))
    if icon_button(Icon.CLOSE, "cancel", t("Cancel the job"), None, side / theme.scale):
        executor.cancel(job.kind)
    x -= imgui.calc_text_size("100 %").x + gap
    imgui.set_cursor_pos(ImVec2(x, _line_y(rect)))
    imgui.text_unformatted(share)
    x -= theme.pt(BAR) + gap
    middle = rect.y + rect.height / 2
    _draw_bar(rect.x + x, middle, job.fraction)
    x -= imgui.calc_text_size(text).x + gap
    imgui.set_cursor_pos(ImVec2(x, _line_y(rect)))
    imgui.text_unformatted(text)
    return x - 2 * gap


def _draw_bar(x: float, middle: float, fraction: float) -> None:
    draw = imgui.get_window_draw_list()
    half = theme.pt(BAR_HEIGHT) / 2
    width = theme.pt(BAR)
    top, bottom = middle - half, middle + half
    draw.add_rect_filled(ImVec2(x, top), ImVec2(x + width, bottom), theme.u32("pressed"), half)
    filled = max(width * min(max(fraction, 0.0), 1.0), 2 * half)
    draw.add_rect_filled(ImVec2(x, top), ImVec2(x + filled, bottom), theme.u32("accent"), half)


def _draw_text(editor: Editor, rect: Rect, hint: str, right: float) -> None:
    """The message until it was read or something else is done, and the hint where it has room."""
    if _reading.is_over(editor.message, _pointer(editor), time.monotonic()):
        editor.drop_hint()
    message, share = fades.shown("message", editor.message)
    imgui.push_clip_rect(ImVec2(rect.x, rect.y), ImVec2(rect.x + right, rect.y + rect.height), True)
    imgui.set_cursor_pos(ImVec2(theme.pt(12), _line_y(rect)))
    if message is None:
        room = right - theme.pt(12)
        _draw_hint(_whole_parts(hint, room) or _whole_words(hint, room))
    else:
        role = "error" if message.is_error else "text"
        icon = Icon.WARNING if message.is_error else Icon.INFO
        imgui.text_colored(theme.vec(role if message.is_error else "accent", share), icon)
        imgui.same_line(0, theme.pt(6))
        imgui.text_colored(theme.vec(role, share), message.text)
        mark(message.text)
        if message is editor.message and (message.is_error or message.action is not None):
            _draw_buttons(editor, message)
        imgui.same_line(0, theme.pt(BESIDE))
        if shown := _whole_parts(hint, right - imgui.get_cursor_pos_x()):
            imgui.set_cursor_pos_y(_line_y(rect))
            _draw_hint(shown)
    imgui.pop_clip_rect()


def _draw_hint(shown: str) -> None:
    imgui.text_colored(theme.vec("secondary"), shown)
    mark(shown)


def _pointer(editor: Editor) -> Places:
    """Where the mouse is, and the crosshair that the keyboard moves."""
    mouse, pointer = imgui.get_io().mouse_pos, editor.pointer
    return (mouse.x, mouse.y) if pointer is None else (mouse.x, mouse.y, pointer.x, pointer.y)


def _whole_parts(hint: str, room: float) -> str:
    """As many of a hint's parts as have room (window units); "" where the first has none."""
    while imgui.calc_text_size(hint).x > room:
        hint = hint.rpartition(" · ")[0]
        if not hint:
            return ""
    return hint


def _whole_words(hint: str, room: float) -> str:
    """As many words of a hint's first part as have room (window units)."""
    words = hint.partition(" · ")[0].split(" ")
    while words and imgui.calc_text_size(" ".join(words) + "…").x > room:
        words.pop()
    return " ".join(words) + "…" if words else ""


def _draw_buttons(editor: Editor, message: StatusMessage) -> None:
    """What can be done about the message: what mends it first."""
    imgui.push_style_var(imgui.StyleVar_.frame_padding, theme.size(8, 2))
    imgui.same_line(0, theme.pt(12))
    top = imgui.get_cursor_pos_y() - theme.pt(2)  # the buttons' texts stand on the line
    if message.action is not None:
        imgui.set_cursor_pos_y(top)
        if imgui.button(message.action.label):
            editor.message = None
            message.action.run()
        mark(message.action.label)
        imgui.same_line(0, theme.pt(8))
    if message.details:
        imgui.set_cursor_pos_y(top)
        if imgui.button(t("Details")):
            imgui.set_clipboard_text(without_names(message.details))
            editor.say(t("The details are in the clipboard"))
        tooltip(t("Copies this:") + "\n" + message.details[-600:])
        imgui.same_line(0, theme.pt(8))
    imgui.set_cursor_pos_y(top)
    if imgui.button(t("Dismiss")) and editor.message is message:
        editor.message = None
    imgui.pop_style_var()
