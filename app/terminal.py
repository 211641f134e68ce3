"""What the subcommands say on the terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from objectmorpher_core.progress import Progress, silent

PROGRAM = "objectmorpher"


class UsageError(ValueError):
    """The command line asks for something impossible; one sentence."""


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
