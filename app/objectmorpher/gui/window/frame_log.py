"""When each frame was on the screen, and which pointer it shows: for measuring, see docs/tour."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from ...editor.editor import Editor


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
