"""The bare window: created while everything that draws in it is still being imported."""

from __future__ import annotations

import os
from typing import Any

from imgui_bundle import imgui  # before glfw: both must use one libglfw

# isort: split
import glfw

from ...cli.options import WindowOptions
from ...system.resources import resource

assert imgui  # imported for its library


class WindowError(RuntimeError):
    """No window can be opened; one sentence."""


def open_window(options: WindowOptions) -> Any:
    """A window with an OpenGL 3.3 core context, current in this thread. Raises WindowError."""
    errors: list[str] = []
    glfw.set_error_callback(lambda _code, text: errors.append(os.fsdecode(text)))
    if not glfw.init():
        raise WindowError(f"no window can be opened: {'; '.join(errors) or 'no display'}")
    hints: tuple[tuple[int, int], ...] = (
        (glfw.CONTEXT_VERSION_MAJOR, 3),
        (glfw.CONTEXT_VERSION_MINOR, 3),
        (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE),
        (glfw.OPENGL_FORWARD_COMPAT, glfw.TRUE),
        (glfw.SCALE_TO_MONITOR, glfw.TRUE),
        (glfw.DEPTH_BITS, 0),  # nothing here needs them
        (glfw.STENCIL_BITS, 0),
        (glfw.ALPHA_BITS, 0),
    )
    for hint, value in hints:
        glfw.window_hint(hint, value)
    scale = options.scale or 1.0
    size = (int(options.size[0] * scale), int(options.size[1] * scale))
    handle = glfw.create_window(*size, "ObjectMorpher", None, None)
    if not handle:
        glfw.terminate()
        raise WindowError(f"OpenGL 3.3 is not available: {'; '.join(errors)}")
    if options.frames is None:
        _keep_on_screen(handle)
    _set_icon(handle)
    glfw.make_context_current(handle)
    glfw.swap_interval(0 if options.frames is not None else 1)
    return handle


def _keep_on_screen(handle: Any) -> None:
    """Makes a window that is larger than the screen as large as that, with its frame."""
    monitor = glfw.get_primary_monitor()
    if not monitor:
        return
    x, y, *room = glfw.get_monitor_workarea(monitor)
    left, top, right, bottom = glfw.get_window_frame_size(handle)
    room = (room[0] - left - right, room[1] - top - bottom)
    size = glfw.get_window_size(handle)
    if min(room) <= 0 or (size[0] <= room[0] and size[1] <= room[1]):
        return
    glfw.set_window_size(handle, min(size[0], room[0]), min(size[1], room[1]))
    glfw.set_window_pos(handle, x + left, y + top)


def _set_icon(handle: Any) -> None:
    from PIL import Image

    icon: Any = Image.open(str(resource("assets/icon.png"))).convert("RGBA")
    glfw.set_window_icon(handle, 1, [icon])
