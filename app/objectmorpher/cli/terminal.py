"""Output of the subcommands on the terminal: progress bars, and failures in one sentence."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from traceback import walk_tb

from objectmorpher_core.base.progress import Progress, silent

PROGRAM = "objectmorpher"
FAILURES = (ValueError, OSError, RuntimeError, MemoryError)  # that are one sentence for the user


OURS = "objectmorpher"  # the names of all our packages begin with it


class UsageError(ValueError):
    """The command line asks for something impossible; one sentence."""


def failure_sentence(error: BaseException) -> str:
    """Return one line for the user that says what failed, in the words of the code that noticed."""
    if isinstance(error, MemoryError):
        return "there is not enough memory"
    if isinstance(error, FileNotFoundError | PermissionError | IsADirectoryError):
        reason = {FileNotFoundError: "does not exist", PermissionError: "cannot be read"}
        if error.filename is not None:
            return f"{error.filename} {reason.get(type(error), 'is a folder, not a file')}"
    text = str(error) or type(error).__name__
    return json.dumps(text)[1:-1] if "\n" in text else text


def is_librarys(error: BaseException) -> bool:
    """Whether a library found fault with what we gave it: its words are not for the user."""
    if isinstance(error, OSError | MemoryError) or error.__traceback__ is None:
        return False
    *_, (frame, _) = walk_tb(error.__traceback__)
    return not frame.f_globals.get("__name__", "").startswith(OURS)


@contextmanager
def progress_bar(title: str) -> Iterator[Progress]:
    """A Progress that draws a bar on a terminal, and does nothing in a pipe."""
    if not sys.stderr.isatty():
        yield silent
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    columns = (TextColumn("{task.description:<28}"), BarColumn(), TimeElapsedColumn())
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task(title, total=1.0)
        yield lambda fraction, note: bars.update(task, completed=fraction, description=note)
