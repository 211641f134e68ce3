"""Motion in the window: the user's preference, or else the system's setting."""

from __future__ import annotations

import logging
import subprocess
import sys
from collections.abc import Sequence

from ..editor.settings import AUTO

log = logging.getLogger(__name__)

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
