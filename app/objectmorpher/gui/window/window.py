"""The window: creation, the loop, and one frame as a recipe."""

from __future__ import annotations

import ctypes
import logging
import math
import sys
import time
from pathlib import Path
from typing import Any

from imgui_bundle import ImVec2, imgui  # before glfw: both must use one libglfw

# isort: split
import glfw

from objectmorpher_core.document.model import Document

from ...canvas.derived import import_core
from ...canvas.shares import count_changed
from ...cli.options import WindowOptions
from ...commands import run
from ...editor.editor import Editor
from ...editor.settings import read_settings, settings_path, write_settings
from ...editor.shortcuts import Shortcuts
from ...render.renderer import Renderer
from ...system.desktop import motion
from ...system.freed_memory import set_aside
from ...system.texts import ENGLISH, t, use_language
from ...tools.pointer import PointerShape
from ..dialogs.dialogs import Dialogs
from ..dialogs.popups import Popups
from ..dialogs.start import StartScreen
from ..panels.inspector import draw_inspector
from ..widgets import theme as looks
from ..widgets.panes import Layout, Rect, fades, has_panel, lay_out
from ..widgets.theme import theme
from ..widgets.widgets import pictures
from . import landmarks
from .input import HELP, Input, part_frames
from .landmarks import FrameLog
from .menu import draw_menu, draw_toolbar
from .overlays import draw_overlays
from .scenes import build_scene
from .status import draw_status
from .tab_bar import draw_tabs

log = logging.getLogger(__name__)

SETTLE = 3  # frames drawn after the last event: ImGui lays out in two
IDLE = 0.5  # s between two looks at the clock when nothing happens
BUSY = 0.1  # s, while a job runs, whose progress is shown; frames take cores from it
SOON = 0.05  # s, while a dialog is open or an exact picture is due
DOUBLE_CLICK = 0.45  # s between two presses, about as desktops have it; ImGui allows 0.5
CONTROL = glfw.MOD_SUPER if sys.platform == "darwin" else glfw.MOD_CONTROL
MODIFIERS = (("Ctrl", CONTROL), ("Shift", glfw.MOD_SHIFT), ("Alt", glfw.MOD_ALT))
KEY_NAMES = {
    glfw.KEY_ESCAPE: "Escape",
    glfw.KEY_ENTER: "Enter",
    glfw.KEY_KP_ENTER: "Enter",
    glfw.KEY_DELETE: "Delete",
    glfw.KEY_BACKSPACE: "Backspace",
    glfw.KEY_LEFT: "Left",
    glfw.KEY_RIGHT: "Right",
    glfw.KEY_UP: "Up",
    glfw.KEY_DOWN: "Down",
    glfw.KEY_TAB: "Tab",
    glfw.KEY_SPACE: "Space",
    glfw.KEY_HOME: "Home",
    glfw.KEY_END: "End",
    glfw.KEY_PAGE_UP: "PageUp",
    glfw.KEY_PAGE_DOWN: "PageDown",
    glfw.KEY_INSERT: "Insert",
    **{glfw.KEY_F1 + n: f"F{n + 1}" for n in range(12)},
}
ONCE = (glfw.KEY_ENTER, glfw.KEY_KP_ENTER, glfw.KEY_SPACE)  # held down, they do it once
CURSORS = {
    PointerShape.ARROW: glfw.ARROW_CURSOR,
    PointerShape.CROSS: glfw.CROSSHAIR_CURSOR,
    PointerShape.HAND: glfw.POINTING_HAND_CURSOR,
    PointerShape.MOVE: glfw.RESIZE_ALL_CURSOR,
    PointerShape.TURN: glfw.POINTING_HAND_CURSOR,
    PointerShape.SIZE: glfw.RESIZE_NWSE_CURSOR,
    PointerShape.SPLIT: glfw.RESIZE_EW_CURSOR,
}


def run_window(options: WindowOptions, handle: Any) -> int:
    """Runs the editor in a window (`glfw_window`) until it is closed; the exit code."""
    window = Window(options, handle)
    try:
        window.run()
    finally:
        window.close()
    return 0


class Window:
    """The GLFW window, ImGui's context, and what is drawn in them."""

    def __init__(self, options: WindowOptions, handle: Any) -> None:
        """`handle`: GLFW's, its context current in this thread."""
        self._options = options
        self._handle, self._size = handle, WindowSize(handle)
        self._renderer = Renderer(options.renderer)
        settings = read_settings(settings_path())
        self.editor = Editor(settings, wake=glfw.post_empty_event)
        self.editor.filing.fov, self.editor.filing.seed = options.fov, options.seed
        self.editor.exporting.returns = options.returns
        self._saved_settings = settings
        self._language = ENGLISH
        self._look: tuple[str, float] = ("", 0.0)
        self._shortcuts = Shortcuts(self.editor)
        self._input = Input(self._shortcuts)
        self._start_imgui()
        self._start = StartScreen(self._renderer)
        pictures.use(self._renderer)
        self._dialogs = Dialogs()
        self._popups = Popups(self._shortcuts)
        self._cursors: dict[int, Any] = {}
        self._cursor: Any = None
        self._title = Title()
        self._is_quiet = False  # nothing has happened for a moment
        self._frame_log = FrameLog(options.frame_log) if options.frame_log else None
        if options.frames is not None:
            self.editor.cache.frame_time = math.inf
        take_drop: Any = self._take_drop
        glfw.set_drop_callback(self._handle, take_drop)

    def run(self) -> None:
        """Frames, as few as possible: after an event, and while something moves."""
        drawn, lively = 0, SETTLE
        while True:
            if self._options.frames is None and lively <= 0:
                lively = self._wait()
            else:
                glfw.poll_events()
            has_news = self.editor.poll() or self.editor.posing.is_restless
            lively = SETTLE if has_news else lively - 1
            if self._frame_log is not None:
                self._frame_log.begin()
            if self._frame():
                if fades.is_moving:
                    lively = max(lively, 1)
                if len(imgui.get_current_context().input_events_queue):
                    lively = SETTLE  # ImGui takes one key or button of a kind a frame
            drawn += 1
            if self._is_over(drawn):
                break
            glfw.swap_buffers(self._handle)
            if self._frame_log is not None:
                self._frame_log.end(self.editor, self._input.mouse)
            if drawn == 1:
                self._open_first()
        if self._frame_log is not None:
            self._frame_log.write()
        if self._options.screenshot is not None:
            self._write_screenshot(self._options.screenshot)

    def _is_over(self, drawn: int) -> bool:
        """Whether this frame is the last; asks about unsaved changes first."""
        if self._options.frames is not None:
            return drawn >= self._options.frames
        if glfw.window_should_close(self._handle):
            glfw.set_window_should_close(self._handle, False)
            run(self.editor, "quit")
        return self.editor.is_over

    def _open_first(self) -> None:
        """What takes a second to import waits until the window has been drawn, and not for it."""
        if self._options.files:
            self.editor.filing.open_all(self._options.files)
        if self._options.frames is None:
            self.editor.recovery.look(is_shown=not self._options.files)
            self.editor.models.look()
            self.editor.chores.start(
                "Getting ready", lambda progress: self._warm_up(), kind="warm up",
                done=lambda _: None, failed=self.editor.complain_of, is_quiet=True,
            )  # fmt: skip
        while self._options.frames is not None and not self.editor.chores.is_idle:
            self.editor.poll()
            time.sleep(SOON)

    def _warm_up(self) -> None:
        """In a thread."""
        motion.ask_system()
        import_core()
        set_aside()
        self._renderer.rehearse()

    def _wait(self) -> int:
        """Sleeps until an event; how many frames to draw for it."""
        editor = self.editor
        is_busy = editor.jobs.current is not None or not editor.chores.is_idle
        patience = BUSY if is_busy else IDLE
        is_due = editor.cache.is_waiting or editor.candidates.is_due
        if self._dialogs.is_open or is_due:
            patience = SOON
        before = time.monotonic()
        glfw.wait_events_timeout(patience)
        is_event = time.monotonic() - before < 0.95 * patience
        self._is_quiet = not is_event and patience == IDLE
        return SETTLE if is_event else 1

    # One frame

    def _frame(self) -> bool:
        """Draws everything; whether there was anything to draw on."""
        size, ratio = self._size.pixels, self._size.ratio
        if 0 in size:  # minimised
            return False
        self._adopt_look()
        is_still = self._options.frames is not None
        is_still = is_still or motion.is_reduced(self.editor.settings.motion)
        imgui.get_io().config_input_text_cursor_blink = not is_still
        fades.begin(time.monotonic(), is_on=not is_still and not self.editor.hand.is_busy)
        imgui.backends.opengl3_new_frame()
        self._input.focus.begin(self.editor, self._shortcuts.recording is not None)
        self._size.begin_frame()
        imgui.new_frame()
        layout = self._lay_out()
        self._resize_canvas(layout.canvas, ratio)
        is_held = self.editor.hand.is_busy  # the panels wait for the hand: they are drawn first
        if not is_held:
            self._input.update(self.editor, layout.canvas, ratio)
        layout = self._lay_out()
        draw_menu(self.editor, layout.menu)
        if layout.tabs.height:
            draw_tabs(self.editor, layout.tabs)
        if self.editor.document is None:
            self._start.draw(self.editor, layout.canvas)
        else:
            draw_toolbar(self.editor, layout.strip)
            draw_inspector(self.editor, layout.inspector)
        if is_held:  # with the newest place of the pointer
            glfw.poll_events()
            self._input.update(self.editor, layout.canvas, ratio, self._size.held_pointer())
        if self.editor.document is not None:
            draw_overlays(self.editor, layout.canvas, ratio)
            self._input.crosshair.draw(self.editor, layout.canvas, ratio)
        draw_status(self.editor, layout.status, self._input.hint(self.editor))
        self._popups.draw(self.editor)
        self._dialogs.draw(self.editor)
        self._set_cursor()
        if (title := self._title.changed(self.editor, self._is_quiet)) is not None:
            glfw.set_window_title(self._handle, title)
        imgui.render()
        self._draw(layout.canvas, ratio, size)
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())
        landmarks.write()
        self._save_settings()
        return True

    def _lay_out(self) -> Layout:
        view, size = self.editor.view, self._size.size
        view.has_panel = has_panel(size[0], view.wants_panel)
        has_photo, has_tabs = self.editor.document is not None, len(self.editor.tabs.all) > 1
        return lay_out(*size, has_photo, view.has_panel, has_tabs)

    def _draw(self, canvas: Rect, ratio: float, size: tuple[int, int]) -> None:
        """The picture below ImGui's."""
        self._renderer.begin(theme.rgb("panel"), size)
        scene = build_scene(self.editor, self._renderer.kind)
        if scene is None:
            self._renderer.clear()
            return
        self._renderer.table = self.editor.looking.screen_table()
        view = self.editor.view
        left, bottom = round(canvas.x * ratio), round(canvas.y * ratio) + view.height
        viewport = (left, size[1] - bottom, view.width, view.height)
        self._renderer.draw(scene, view, viewport)
        self._read_color(viewport)

    def _read_color(self, viewport: tuple[int, int, int, int]) -> None:
        """What the picture shows under the pointer, where single pixels are looked at."""
        view, pointer = self.editor.view, self.editor.pointer
        view.color = None
        if pointer is not None and view.is_at_pixels and self.editor.is_on_photo(pointer.xy):
            left, bottom = viewport[0] + int(pointer.x), viewport[1] + view.height - 1
            view.color = self._renderer.read_pixel(left, bottom - int(pointer.y))

    def _resize_canvas(self, canvas: Rect, ratio: float) -> None:
        size = (max(round(canvas.width * ratio), 1), max(round(canvas.height * ratio), 1))
        self.editor.view.resize(size, theme.scale * ratio, self.editor.photo_size)

    # What the window looks like

    def _start_imgui(self) -> None:
        imgui.create_context()
        io = imgui.get_io()
        io.set_ini_filename("")
        io.config_drag_click_to_input_text = True
        io.mouse_double_click_time = DOUBLE_CLICK
        io.config_flags |= imgui.ConfigFlags_.no_mouse_cursor_change
        context = imgui.get_current_context()  # Ctrl+Tab is between photos, not ImGui's windows
        context.config_nav_windowing_key_next = context.config_nav_windowing_key_prev = 0
        looks.load_fonts()
        take_key: Any = self._take_key
        take_character: Any = self._take_character
        glfw.set_key_callback(self._handle, take_key)  # before ImGui's, which calls it too
        glfw.set_char_callback(self._handle, take_character)
        address = ctypes.cast(self._handle, ctypes.c_void_p).value
        assert address is not None
        imgui.backends.glfw_init_for_opengl(address, True)
        imgui.backends.opengl3_init("#version 330")

    def _adopt_look(self) -> None:
        """Theme and scale, when the user or the monitor changed them."""
        settings = self.editor.settings
        name = settings.theme
        if self._options.theme is not None and settings.theme == self._saved_settings.theme:
            name = self._options.theme
        scale = self._options.scale or settings.scale or self._monitor_scale()
        if settings.language != self._language:
            self._language = settings.language
            use_language(settings.language)
        if (name, scale) != self._look:
            self._look = (name, scale)
            looks.apply(name if name in looks.PALETTES else "dark", scale)
            self._size.forbid_less(*(round(theme.pt(side)) for side in looks.LEAST_SIZE))

    def _monitor_scale(self) -> float:
        """Window units per point. Where the framebuffer is finer than the window, 1."""
        content = glfw.get_window_content_scale(self._handle)[0]
        return max(round(content / max(self._size.ratio, 1e-3) * 4) / 4, 1.0)

    def _set_cursor(self) -> None:
        """On the canvas the tool's cursor, elsewhere what ImGui asks for."""
        io = imgui.get_io()
        if io.want_capture_mouse and not self.editor.hand.is_busy:
            wanted = _IMGUI_CURSORS.get(int(imgui.get_mouse_cursor()), glfw.ARROW_CURSOR)
        else:
            wanted = CURSORS[self._input.shape]
        if wanted not in self._cursors:
            self._cursors[wanted] = glfw.create_standard_cursor(wanted)
        if self._cursors[wanted] is not self._cursor:
            glfw.set_cursor(self._handle, self._cursors[wanted])
            self._cursor = self._cursors[wanted]

    # The rest

    def _take_key(self, _window: object, key: int, scancode: int, action: int, mods: int) -> None:
        """Names the chord while the modifiers are what they were when the key went down."""
        if action == glfw.RELEASE and glfw.KEY_LEFT_SHIFT <= key <= glfw.KEY_RIGHT_SUPER:
            part_frames()
        if action not in (glfw.PRESS, glfw.REPEAT):
            return
        if action == glfw.REPEAT and key in ONCE:
            return  # one press is one step
        name = KEY_NAMES.get(key) or glfw.get_key_name(key, scancode)
        if name:
            held = [word for word, bit in MODIFIERS if mods & bit]
            self._input.take_key("+".join([*held, name[:1].upper() + name[1:]]))

    def _take_character(self, _window: object, code: int) -> None:
        """The one shortcut that is a character, wherever the keyboard has it."""
        if chr(code) == HELP:
            self._input.take_key(HELP)

    def _take_drop(self, _window: object, paths: Any) -> None:
        self.editor.filing.drop([Path(path) for path in paths])

    def _save_settings(self) -> None:
        if self.editor.settings is not self._saved_settings:
            self._saved_settings = self.editor.settings
            write_settings(settings_path(), self._saved_settings)

    def _write_screenshot(self, path: Path) -> None:
        from PIL import Image

        Image.fromarray(self._renderer.read(self._size.pixels)).save(path)

    def close(self) -> None:
        self.editor.shut_down()
        imgui.backends.opengl3_shutdown()
        imgui.backends.glfw_shutdown()
        imgui.destroy_context()
        glfw.terminate()


_IMGUI_CURSORS = {
    int(imgui.MouseCursor_.text_input): glfw.IBEAM_CURSOR,
    int(imgui.MouseCursor_.hand): glfw.POINTING_HAND_CURSOR,
    int(imgui.MouseCursor_.resize_ew): glfw.RESIZE_EW_CURSOR,
    int(imgui.MouseCursor_.resize_ns): glfw.RESIZE_NS_CURSOR,
    int(imgui.MouseCursor_.resize_all): glfw.RESIZE_ALL_CURSOR,
}


# The window's title: the file, and what the edit has changed of it.


class Title:
    """The window's title as it was last set."""

    def __init__(self) -> None:
        self._text = ""
        self._changed: tuple[Document | None, int] = (None, 0)  # px that a document changes

    def changed(self, editor: Editor, is_quiet: bool) -> str | None:
        """Return another title, or None, once a frame; `is_quiet`: nothing has happened lately."""
        if is_quiet and editor.preview is None and editor.committed is not self._changed[0]:
            document = editor.committed
            count = 0 if document is None else count_changed(document, editor.cache)
            self._changed = (document, count)
        before, self._text = self._text, self._text_for(editor)
        return self._text if self._text != before else None

    def _text_for(self, editor: Editor) -> str:
        document = editor.committed
        if document is None:
            return "ObjectMorpher"
        name = editor.path.name if editor.path else document.photo.name
        state = "" if editor.is_saved else f" — {self._edited(document)}"
        return f"{name}{state} · ObjectMorpher"

    def _edited(self, document: Document) -> str:
        counted, count = self._changed
        if counted is not document or count == 0:
            return t("edited")
        width, height = document.photo.size
        share = 100 * count / (width * height)
        if share < 1:
            return t("edited, less than 1 % of the photo")
        return t("edited, {share} % of the photo", share=round(share))


# How large the window is, and what the time is, for ImGui.

BUTTONS = (glfw.MOUSE_BUTTON_LEFT, glfw.MOUSE_BUTTON_RIGHT, glfw.MOUSE_BUTTON_MIDDLE)
LEAST_STEP = 1e-4  # s between two frames; ImGui asks for more than none


class WindowSize:
    """The window's size as GLFW last reported it.

    ImGui's own backend asks for it in every frame, and X answers when it has shown the last one:
    what could be computed meanwhile is not.
    """

    def __init__(self, handle: Any) -> None:
        """`handle`: GLFW's window."""
        self.size: tuple[int, int] = glfw.get_window_size(handle)  # window units
        self.pixels: tuple[int, int] = glfw.get_framebuffer_size(handle)
        self._handle = handle
        self._time = time.perf_counter()
        self._is_pointer_inside = True
        take_pointer: Any = self._take_pointer
        glfw.set_cursor_enter_callback(handle, take_pointer)  # before ImGui's, which calls it too
        take_size: Any = self._take_size
        take_pixels: Any = self._take_pixels
        glfw.set_window_size_callback(handle, take_size)
        glfw.set_framebuffer_size_callback(handle, take_pixels)

    @property
    def ratio(self) -> float:
        """Framebuffer px per window unit."""
        return self.pixels[0] / max(self.size[0], 1)

    def forbid_less(self, width: int, height: int) -> None:
        """Neither side gets shorter than that, window units."""
        any_size = glfw.DONT_CARE
        glfw.set_window_size_limits(self._handle, width, height, any_size, any_size)

    def begin_frame(self) -> None:
        """Tells ImGui, in place of its backend's own beginning of a frame."""
        io, now = imgui.get_io(), time.perf_counter()
        io.display_size = ImVec2(*self.size)
        io.display_framebuffer_scale = ImVec2(self.ratio, self.pixels[1] / max(self.size[1], 1))
        io.delta_time = max(now - self._time, LEAST_STEP)
        self._time = now
        if not self._is_pointer_inside and (held := self.held_pointer()) is not None:
            io.add_mouse_pos_event(*held)  # to ImGui it is nowhere, but a stroke goes on there

    def held_pointer(self) -> tuple[float, float] | None:
        """Where the pointer is now, window units; None where no button holds it any more.

        The place at which a button went up is ImGui's to report.
        """
        if any(glfw.get_mouse_button(self._handle, button) for button in BUTTONS):
            return glfw.get_cursor_pos(self._handle)
        return None

    def _take_pointer(self, _window: object, is_inside: int) -> None:
        self._is_pointer_inside = bool(is_inside)

    def _take_size(self, _window: object, width: int, height: int) -> None:
        self.size = (width, height)

    def _take_pixels(self, _window: object, width: int, height: int) -> None:
        self.pixels = (width, height)
