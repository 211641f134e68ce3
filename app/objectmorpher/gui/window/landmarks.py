"""The places of the window's buttons and fields by their texts, and a log of its frames.

For tests and tours. So are the photo, the handles on it and the rings: what is drawn there cannot
be found otherwise.

With OBJECTMORPHER_LANDMARKS=FILE in the environment the window writes them there whenever they
change. Without it nothing is collected.
"""

from __future__ import annotations

import json
import os
import time
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from ...editor.editor import Editor

# When each frame was on the screen, and which pointer it shows: for measuring, see docs/tour.


@dataclass(frozen=True)
class LoggedFrame:
    """One frame."""

    began: float  # s, monotonic, when its events had been taken
    shown: float  # s, monotonic, when its buffers had been swapped
    x: float  # window units, the pointer that it shows
    y: float
    is_stroke: bool  # a stroke was in progress
    job: str  # title of the job that ran beside it, or ""


class FrameLog:
    """Collects them, and writes them at the end."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._frames: list[LoggedFrame] = []
        self._began = 0.0

    def begin(self) -> None:
        """The events of a frame have been taken; it is drawn now."""
        self._began = time.monotonic()

    def end(self, editor: Editor, pointer: tuple[float, float]) -> None:
        """It is on the screen."""
        job = editor.jobs.current
        title = job.title if job is not None else ""
        now = time.monotonic()
        self._frames.append(LoggedFrame(self._began, now, *pointer, editor.hand.is_busy, title))

    def write(self) -> None:
        """JSON, a list of frames."""
        self._path.write_text(json.dumps([asdict(f) for f in self._frames]), encoding="utf-8")


VARIABLE = "OBJECTMORPHER_LANDMARKS"
POINTER = "Pointer"
FOCUS = "Focus"  # before the name of what the keyboard has reached

_file = os.environ.get(VARIABLE) or None
_places: dict[str, tuple[float, float, float, float]] = {}
_written = ""


def mark(label: str) -> None:
    """The last item is called `label`; what stands after ## or before an icon is left out."""
    if _file is None or not imgui.is_item_visible():
        return
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    _places[clean(label)] = (low.x, low.y, high.x, high.y)
    if imgui.is_item_focused() and imgui.get_io().nav_visible:
        _places[f"{FOCUS}: {clean(label)}"] = _places[clean(label)]


def mark_on_canvas(label: str, low: ImVec2, high: ImVec2) -> None:
    """Something that is drawn over the photo and can be taken hold of."""
    if _file is not None:
        _places[label] = (low.x, low.y, high.x, high.y)


@lru_cache(1000)  # the same ones in each frame
def clean(label: str) -> str:
    """Return a text as a user reads it: without icons (private use area) and ids."""
    text = label.partition("##")[0]
    return "".join(c for c in text if not "\ue000" <= c <= "\uf8ff").strip()


def write() -> None:
    """At the end of a frame: x0, y0, x1, y1 window units of each. The next frame begins anew."""
    global _written
    if _file is None:
        return
    mouse = imgui.get_io().mouse_pos
    _places[POINTER] = (mouse.x, mouse.y, mouse.x, mouse.y)  # what came before it was answered
    text = json.dumps(_places)
    _places.clear()
    if text != _written:
        _written = text
        temporary = Path(f"{_file}.tmp")
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(_file)
