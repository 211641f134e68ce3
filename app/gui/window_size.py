"""How large the window is, and what the time is, for ImGui."""

from __future__ import annotations

import time
from typing import Any

from imgui_bundle import ImVec2, imgui  # before glfw: both must use one libglfw

# isort: split
import glfw

BUTTONS = (glfw.MOUSE_BUTTON_LEFT, glfw.MOUSE_BUTTON_RIGHT, glfw.MOUSE_BUTTON_MIDDLE)
LEAST_STEP = 1e-4  # s between two frames; ImGui asks for more than none


class WindowSize:
    """As GLFW told of it last.

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
        if not self._is_pointer_inside and any(
            glfw.get_mouse_button(self._handle, button) for button in BUTTONS
        ):  # to ImGui it is nowhere, but a stroke goes on there
            io.add_mouse_pos_event(*glfw.get_cursor_pos(self._handle))

    def _take_pointer(self, _window: object, is_inside: int) -> None:
        self._is_pointer_inside = bool(is_inside)

    def _take_size(self, _window: object, width: int, height: int) -> None:
        self.size = (width, height)

    def _take_pixels(self, _window: object, width: int, height: int) -> None:
        self.pixels = (width, height)
