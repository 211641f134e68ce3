"""Options of the command line that concern the window."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

RENDERERS = ("auto", "gl", "tiles")


@dataclass(frozen=True)
class WindowOptions:
    """How to open the window; for tests also its lifetime and the file of its picture."""

    files: tuple[Path, ...] = ()  # photos and sessions to open at once
    renderer: str = "auto"  # one of RENDERERS
    theme: str | None = None  # "dark" or "light"; None: the user's setting
    scale: float | None = None  # canvas px per point; None: the monitor's
    size: tuple[int, int] = (1440, 900)  # points
    fov: float | None = None  # degrees, horizontal; None: EXIF or the default
    seed: int = 0
    frames: int | None = None  # close after so many frames; None: stay
    screenshot: Path | None = None  # PNG of the last frame
    frame_log: Path | None = None  # JSON, when which frame was shown
    returns: Path | None = None  # where another program, which waits, wants the edit
