"""Runs the program's sources in the environment that holds PyTorch, beside an installer's copy.

What runs there is a command of the command line, or the worker process of the window; the core's
`base/torch_environment.py` says when. Multiprocessing cannot start that process: it would start the
copy itself.
"""

from __future__ import annotations

import mmap
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from objectmorpher_core.base import torch_environment

if TYPE_CHECKING:
    from .wire import Connection

HERE = ("models setup", "plugin", "completion", "warm-up")  # commands of the copy itself


def run_command(arguments: Sequence[str]) -> int | None:
    """Run a command in the environment; its exit code. None where the program runs it itself."""
    if any(" ".join(arguments).startswith(command) for command in HERE):
        return None
    command = torch_environment.apart(*arguments)
    if command is None:
        return None
    return subprocess.run(command, env=torch_environment.apart_variables(), check=False).returncode


class Flag:
    """A number from 0 to 255 in memory that two processes share, by a file."""

    def __init__(self, path: Path | None = None) -> None:
        """Make one; or take the one that another process has made in `path`."""
        self.is_ours = path is None
        if path is None:
            descriptor, name = tempfile.mkstemp("-stop", "objectmorpher-")
            os.write(descriptor, b"\0")
            self.path = Path(name)
        else:
            descriptor, self.path = os.open(path, os.O_RDWR), path
        self._memory = mmap.mmap(descriptor, 1)
        os.close(descriptor)

    @property
    def value(self) -> int:
        """The number."""
        return self._memory[0]

    @value.setter
    def value(self, number: int) -> None:
        self._memory[0] = number

    def close(self) -> None:
        """Give the memory back, and remove the file where it was made here."""
        self._memory.close()
        if self.is_ours:
            self.path.unlink(missing_ok=True)


class ApartProcess:
    """A worker process in the environment, with the methods of multiprocessing's."""

    def __init__(
        self, command: list[str], theirs: Connection, stop: Flag, warm: Sequence[str]
    ) -> None:
        self._stop = stop
        number = theirs.fileno()
        told = [torch_environment.WORKER, str(number), str(stop.path), ",".join(warm)]
        if sys.platform == "win32":
            os.set_handle_inheritable(number, True)
            start = subprocess.STARTUPINFO(lpAttributeList={"handle_list": [number]})
            self._process = subprocess.Popen(
                [*command, *told], env=torch_environment.apart_variables(), startupinfo=start,
                creationflags=subprocess.CREATE_NO_WINDOW,
            )  # fmt: skip
        else:
            self._process = subprocess.Popen(
                [*command, *told], env=torch_environment.apart_variables(), pass_fds=[number]
            )
        self.pid = self._process.pid

    def kill(self) -> None:
        """End it, whatever it does."""
        self._process.kill()

    def join(self) -> None:
        """Wait until it has ended."""
        self._process.wait()
        self._stop.close()


def work_apart(arguments: Sequence[str]) -> int:
    """The other side of an `ApartProcess`: works until its pipe ends."""
    from .jobs import work

    _, number, stop, warm = arguments
    if sys.platform == "win32":
        from multiprocessing.connection import PipeConnection

        connection = PipeConnection(int(number))
    else:
        from multiprocessing.connection import Connection

        connection = Connection(int(number))
    work(connection, Flag(Path(stop)), tuple(filter(None, warm.split(","))), None)
    return 0
