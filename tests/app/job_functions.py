"""Job functions for the tests; they must be importable by the spawned worker."""

from __future__ import annotations

import errno
import os
import sys
import time
from pathlib import Path

import numpy as np

from objectmorpher.editor.export_plan import ExportPlan
from objectmorpher_core.base.files import OutputError
from objectmorpher_core.base.progress import Progress
from objectmorpher_core.document.edits import EditError
from objectmorpher_core.document.model import Document

_seen: list[np.ndarray] = []


def double(value: np.ndarray, progress: Progress) -> np.ndarray:
    progress(0.5, "halfway")
    return value * 2


def is_same_as_last_time(value: np.ndarray, progress: Progress) -> bool:
    is_same = bool(_seen) and _seen[-1] is value
    _seen.append(value)
    return is_same


def wait(seconds: float, progress: Progress) -> str:
    """Stops when asked, within 20 ms."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        progress(1 - left / seconds, "waiting")
        time.sleep(0.02)
    return "waited"


def prefix(progress: Progress) -> str:
    """The environment that the worker runs in, and whether it has PyTorch."""
    import torch

    return f"{sys.prefix} {torch.__version__}"


def hang(seconds: float, progress: Progress) -> str:
    """Never asks whether it should stop."""
    time.sleep(seconds)
    return "slept"


def fail(progress: Progress) -> None:
    raise ValueError("the mask is empty")


def write_when_there_is_room(path: Path, progress: Progress) -> None:
    """The disk is full while there is a file FULL beside the path; the first try removes that."""
    full = path.with_name("FULL")
    if full.exists():
        full.unlink()
        try:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            raise OutputError(f"{path} cannot be written: {error.strerror}") from error
    path.write_text("written")


def save_when_there_is_room(document: Document, path: Path, progress: Progress) -> None:
    write_when_there_is_room(path, progress)


def export_when_there_is_room(document: Document, plan: ExportPlan, progress: Progress) -> None:
    write_when_there_is_room(plan.path, progress)


def inpaint_badly(*arguments: object, progress: Progress) -> None:
    raise ArithmeticError("the fill did not converge")


def divide(progress: Progress) -> None:
    """Fails with an error of numpy's."""
    np.linalg.inv(np.zeros((2, 2)))


def refuse(progress: Progress) -> None:
    raise EditError("nothing is selected")


def crash(progress: Progress) -> None:
    os._exit(11)
