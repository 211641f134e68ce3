"""What the system knows of the desktop: the screen's colours, and whether things are to move."""

from __future__ import annotations

import ctypes
import logging
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from ..editor.settings import AUTO

log = logging.getLogger(__name__)

# The screen's colour profile: X11's `_ICC_PROFILE`, Windows, macOS.
#
# Wayland has none for programs; there, and for a second screen, the user names a file in
# Preferences.

MOST = 16 << 20  # bytes of a profile; a screen's has a few thousand
ANY_TYPE = 0


def read_profile(path: Path) -> bytes | None:
    """Return a profile file's bytes; None where there are none to be read."""
    try:
        if path.stat().st_size <= MOST:
            return path.read_bytes()
    except OSError as error:
        log.warning("the screen's profile cannot be read: %s", error)
    return None


def system_profile() -> bytes | None:
    """Return the main screen's profile; None where the system names none."""
    try:
        if sys.platform == "win32":
            return _of_windows()
        return _of_macos() if sys.platform == "darwin" else _of_x11()
    except (OSError, AttributeError, ValueError, ctypes.ArgumentError) as error:
        log.info("the system does not tell the screen's profile: %s", error)
        return None


def _of_windows() -> bytes | None:
    from PIL import ImageCms

    found = ImageCms.get_display_profile()  # by GetICMProfile
    return None if found is None else found.tobytes()


def _of_macos() -> bytes | None:
    frameworks = "/System/Library/Frameworks"
    graphics = ctypes.CDLL(f"{frameworks}/CoreGraphics.framework/CoreGraphics")
    foundation = ctypes.CDLL(f"{frameworks}/CoreFoundation.framework/CoreFoundation")
    for function in (graphics.CGDisplayCopyColorSpace, graphics.CGColorSpaceCopyICCData):
        function.restype = ctypes.c_void_p
    graphics.CGDisplayCopyColorSpace.argtypes = [ctypes.c_uint32]
    graphics.CGColorSpaceCopyICCData.argtypes = [ctypes.c_void_p]
    foundation.CFDataGetBytePtr.restype = ctypes.c_void_p
    foundation.CFDataGetLength.restype = ctypes.c_long
    for function in (
        foundation.CFDataGetBytePtr, foundation.CFDataGetLength, foundation.CFRelease,
    ):  # fmt: skip
        function.argtypes = [ctypes.c_void_p]
    space = graphics.CGDisplayCopyColorSpace(graphics.CGMainDisplayID())
    if not space:
        return None
    data = graphics.CGColorSpaceCopyICCData(space)
    foundation.CFRelease(space)
    if not data:
        return None
    length = foundation.CFDataGetLength(data)
    profile = ctypes.string_at(foundation.CFDataGetBytePtr(data), length)
    foundation.CFRelease(data)
    return profile


def _of_x11() -> bytes | None:
    """By the ICC Profiles in X Specification."""
    if not os.environ.get("DISPLAY"):
        return None
    x11 = ctypes.CDLL("libX11.so.6")  # by its name: looking for it takes longer than all the rest
    pointer, long, unsigned = ctypes.c_void_p, ctypes.c_long, ctypes.c_ulong
    x11.XOpenDisplay.restype, x11.XOpenDisplay.argtypes = pointer, [ctypes.c_char_p]
    x11.XDefaultRootWindow.restype, x11.XDefaultRootWindow.argtypes = unsigned, [pointer]
    x11.XInternAtom.restype = unsigned
    x11.XInternAtom.argtypes = [pointer, ctypes.c_char_p, ctypes.c_int]
    x11.XGetWindowProperty.argtypes = [
        pointer, unsigned, unsigned, long, long, ctypes.c_int, unsigned, pointer, pointer, pointer,
        pointer, pointer,
    ]  # fmt: skip
    x11.XFree.argtypes = x11.XCloseDisplay.argtypes = [pointer]
    display = x11.XOpenDisplay(None)
    if not display:
        return None
    try:
        atom = x11.XInternAtom(display, b"_ICC_PROFILE", True)
        if not atom:
            return None
        kind, bits, data = unsigned(), ctypes.c_int(), pointer()
        count, left = unsigned(), unsigned()
        told = [ctypes.byref(value) for value in (kind, bits, count, left, data)]
        root = x11.XDefaultRootWindow(display)
        x11.XGetWindowProperty(display, root, atom, 0, MOST // 4, False, ANY_TYPE, *told)
        if not data.value:
            return None
        profile = ctypes.string_at(data.value, count.value) if bits.value == 8 else None
        x11.XFree(data)
        return profile or None
    finally:
        x11.XCloseDisplay(display)


# Motion in the window: the user's preference, or else the system's setting.

FULL, REDUCED = "full", "reduced"
SECONDS = 2.0  # that the system may take to answer
GNOME = ("gsettings", "get", "org.gnome.desktop.interface", "enable-animations")
MACOS = ("defaults", "read", "com.apple.universalaccess", "reduceMotion")
WINDOWS_ANIMATIONS = 0x1042  # SPI_GETCLIENTAREAANIMATION


class MotionPreference:
    """The program's motion preference. There is one instance, `motion`."""

    def __init__(self) -> None:
        self._system_is_reduced = False

    def ask_system(self) -> None:
        """May take a moment: in a thread."""
        self._system_is_reduced = is_reduced_by_system()

    def is_reduced(self, choice: str) -> bool:
        """`choice`: AUTO, FULL or REDUCED of the settings."""
        return self._system_is_reduced if choice == AUTO else choice == REDUCED


motion = MotionPreference()


def is_reduced_by_system() -> bool:
    """Whether the system asks programs to move less; False where it cannot be read."""
    if sys.platform == "win32":
        return _windows_is_still()
    if sys.platform == "darwin":
        return _answer(MACOS) == "1"
    return _answer(GNOME) == "false"


def _answer(command: Sequence[str]) -> str:
    """The one line that a command prints; "" where it is not there or fails."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS)
    except (OSError, subprocess.SubprocessError) as error:
        log.debug("%s does not tell: %s", command[0], error)
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def _windows_is_still() -> bool:
    import ctypes

    shown = ctypes.c_int(1)
    user32 = getattr(ctypes, "windll").user32  # noqa: B009
    is_told = user32.SystemParametersInfoW(WINDOWS_ANIMATIONS, 0, ctypes.byref(shown), 0)
    return bool(is_told) and not shown.value
