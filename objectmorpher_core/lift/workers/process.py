"""Runs a worker's command in a process group of its own, and leaves nothing of it behind.

What it prints on stdout in lines of JSON is its progress, {"progress": 0.5, "note": "Sampling"},
or why it fails, {"error": "one sentence"}. Every other line, a library's, is ignored.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import numpy as np

from ...base.arrays import F64
from ...base.limits import WORKER_FILE
from ...base.progress import Progress
from ...base.quoting import shown
from .. import LiftError
from .file import LiftWorker

# The small JSON files that workers leave, and the poses in them (docs/workers.md).

VERSION = 1  # of the protocol
TOLERANCE = 1e-3  # of a turn's rows, in its size
# What reading a file raises that says something else than it should.
WRONG = (OSError, ValueError, LookupError, TypeError, RecursionError, OverflowError)


def read_told(at: Path) -> Any:
    """Read a JSON file of our version. Raises one of WRONG."""
    if at.is_symlink() or at.stat().st_size > WORKER_FILE:
        raise ValueError("it is no small file")
    told = json.loads(at.read_text(encoding="utf-8"))
    if told["version"] != VERSION:
        raise ValueError(f"version {shown(told['version'])} is not known")
    return told


def check_similarity(matrix: F64, name: str, size: float | None = None) -> None:
    """Raises ValueError unless it is a (4, 4) of a turn, a `size` (None: any) and a place."""
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ValueError(f"{name} is no 4 x 4 of numbers")
    linear = matrix[:3, :3]
    volume = np.linalg.det(linear)
    squared = np.cbrt(volume) ** 2 if size is None else size**2
    is_turn = volume > 0 and np.allclose(linear @ linear.T / squared, np.eye(3), atol=TOLERANCE)
    if not is_turn or not np.allclose(matrix[3], [0, 0, 0, 1]):
        known = "size" if size is None else f"size of {size:g}"
        raise ValueError(f"{name} is no turn, {known} and place")


POLL = 0.05  # s between two looks at the process
LINE = 1 << 14  # characters of a line that are read
TOLD = 300  # characters of a sentence that is passed on


class _Heard:
    """What a worker has said so far; written by the threads that read its pipes."""

    def __init__(self) -> None:
        self.fraction, self.note, self.error, self.last = 0.0, "", "", ""

    def out(self, line: str) -> None:
        """A line of stdout."""
        try:
            told = json.loads(line)
        except (ValueError, RecursionError):
            return
        if not isinstance(told, dict):
            return
        fraction = told.get("progress")
        if isinstance(fraction, int | float) and 0 <= fraction <= 1:
            self.fraction = max(self.fraction, float(fraction))
            self.note = str(told.get("note", ""))[:TOLD]
        if "error" in told:
            self.error = " ".join(str(told["error"]).split())[:TOLD]

    def err(self, line: str) -> None:
        """Take a line of stderr; the last one says most."""
        self.last = " ".join(line.split())[:TOLD] or self.last


def run_worker(worker: LiftWorker, folder: Path, progress: Progress) -> None:
    """Runs `worker` on the job in `folder`, which is its working directory, too.

    Raises LiftError: one sentence; Cancelled passes. The whole group has ended in every case.
    """
    heard = _Heard()
    process = _started(worker, folder)
    readers = [
        threading.Thread(target=_read, args=pair, daemon=True)
        for pair in ((process.stdout, heard.out), (process.stderr, heard.err))
    ]
    for reader in readers:
        reader.start()
    end = time.monotonic() + worker.timeout
    try:
        while not _has_ended(process):
            progress(heard.fraction, heard.note or f"{worker.name} is at work")
            if time.monotonic() > end:
                raise LiftError(f"the worker {worker.name} took more than {worker.timeout:g} s")
            time.sleep(POLL)
    finally:
        _end_group(process)
        code = process.wait()
        for reader in readers:
            reader.join(1.0)
    if code != 0:
        reason = heard.error or heard.last or "it said nothing"
        how = f"was ended by signal {-code}" if code < 0 else f"failed ({code})"
        raise LiftError(f"the worker {worker.name} {how}: {reason}")


def _started(worker: LiftWorker, folder: Path) -> subprocess.Popen[str]:
    own: dict[str, Any] = (
        {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}  # type: ignore[attr-defined]
        if sys.platform == "win32"
        else {"start_new_session": True}
    )
    try:
        return subprocess.Popen(
            [*worker.command, str(folder)], cwd=folder, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8",
            errors="replace", env=os.environ | {"PYTHONUNBUFFERED": "1"}, **own,
        )  # fmt: skip
    except (OSError, ValueError) as error:
        raise LiftError(f"the worker {worker.name} cannot be started: {error}") from error


def _read(pipe: IO[str], take: Callable[[str], None]) -> None:
    with pipe:
        while line := pipe.readline(LINE):
            take(line)


def _has_ended(process: subprocess.Popen[str]) -> bool:
    """On POSIX without reaping it: its number, which is its group's, stays taken until then."""
    wait = getattr(os, "waitid", None)  # macOS has it since Python 3.13
    if sys.platform == "win32" or wait is None:
        return process.poll() is not None
    flags = os.WEXITED | os.WNOHANG | os.WNOWAIT
    return wait(os.P_PID, process.pid, flags) is not None


def _end_group(process: subprocess.Popen[str]) -> None:
    """Kills the process and all that it started; also what outlives it."""
    if sys.platform == "win32":
        subprocess.run(["taskkill", "/F", "/T", "/PID", str(process.pid)], capture_output=True)
        return
    # On macOS there is no right to kill a group of which only a zombie is left.
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
