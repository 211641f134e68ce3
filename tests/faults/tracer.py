"""Watches what a function does to a folder, at the system's border, and lets it go wrong there.

The function runs in a forked child. A filter in the kernel (seccomp) stops the child before each
system call that opens, writes, syncs, renames or removes; we (ptrace) look which file it is about
and let it pass, answer it with an error, shorten it, or end the child there and then. Nothing of
Python's or of ours is replaced: what the product does is what it does on a real disk.
"""

from __future__ import annotations

import os
import pickle
import platform
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import ptrace

NEW_THREAD_STOP = signal.SIGSTOP
CALLS = {  # numbers of x86-64
    1: "write", 18: "pwrite", 20: "writev", 40: "sendfile", 74: "fsync", 75: "fdatasync",
    77: "ftruncate", 82: "rename", 83: "mkdir", 84: "rmdir", 86: "link", 87: "unlink",
    90: "chmod", 91: "fchmod", 257: "openat", 258: "mkdirat", 263: "unlinkat", 264: "renameat",
    265: "linkat", 268: "fchmodat", 285: "fallocate", 316: "renameat2", 326: "copy_file_range",
}  # fmt: skip
BY_NUMBER = {"write", "pwrite", "writev", "fsync", "fdatasync", "ftruncate", "fchmod", "fallocate"}
TWO_NAMES = {"rename", "link"}
AT_NAMES = {"openat", "mkdirat", "unlinkat", "fchmodat"}
TWO_AT_NAMES = {"renameat", "linkat", "renameat2"}
AT_FDCWD = -100 & 0xFFFFFFFF


@dataclass(frozen=True)
class Operation:
    """One system call about a file below the folder that is watched."""

    name: str  # of CALLS
    path: str
    second: str = ""  # of two names
    data: bytes = b""  # that is written
    at: int = 0  # bytes from the file's start, where it is written
    flags: int = 0  # of openat


@dataclass(frozen=True)
class Answer:
    """What becomes of an operation: it passes, unless one of these says otherwise."""

    error: int = 0  # errno
    length: int | None = None  # of a write, bytes that are taken
    is_killed: bool = False


PASS = Answer()
Decide = Callable[[int, Operation], Answer]  # the operation's number, from 1


@dataclass(frozen=True)
class Outcome:
    """How the child ended."""

    operations: tuple[Operation, ...]
    is_killed: bool
    error: str = ""  # the type and sentence of what was raised
    trace: str = ""


def missing() -> str:
    """Why it cannot be done here, or nothing."""
    if not sys.platform.startswith("linux") or platform.machine() != "x86_64":
        return "system calls are watched on Linux on x86-64 only"
    child = os.fork()
    if child == 0:
        os._exit(int(ptrace.libc().ptrace(ptrace.TRACEME, 0, None, None) != 0))
    if os.waitpid(child, 0)[1] != 0:
        return "this system forbids ptrace"
    with tempfile.TemporaryDirectory() as folder:
        probe = Path(folder) / "probe"
        try:
            seen = watch(lambda: bool(probe.write_bytes(b"1")) and None, Path(folder))
        except OSError as error:
            return f"this system does not let system calls be watched: {error}"
    return "" if seen.operations and not seen.error else "system calls go by unseen here"


def watch(act: Callable[[], None], folder: Path, decide: Decide = lambda n, op: PASS) -> Outcome:
    """Runs `act` in a child; `decide` answers each operation below `folder`."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _be_watched(act, writer)
    os.close(writer)
    watcher = _Watcher(child, os.path.realpath(folder), decide)
    try:
        is_killed = watcher.run()
    finally:
        with os.fdopen(reader, "rb") as told:
            said = told.read().decode("utf-8", "replace")
    error, _, trace = said.partition("\n")
    return Outcome(tuple(watcher.operations), is_killed, error, trace)


def apart(function: Callable[[], Any]) -> Any:
    """What `function` returns, in a forked child: threads that it starts do not stay with us.

    A fork takes no threads with it, and would wait for them.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        try:
            answer = True, function()
        except BaseException as error:
            answer = False, f"{type(error).__name__}: {error}"
        with os.fdopen(writer, "wb") as file:
            pickle.dump(answer, file)
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as file:
        data = file.read()
    os.waitpid(child, 0)
    is_done, value = pickle.loads(data)
    if not is_done:
        raise AssertionError(value)
    return value


def _be_watched(act: Callable[[], None], writer: int) -> None:
    """In the child; never returns."""
    code = 0
    try:
        ptrace.libc().ptrace(ptrace.TRACEME, 0, None, None)
        os.kill(os.getpid(), signal.SIGSTOP)
        ptrace.stop_at(list(CALLS))
        act()
    except BaseException as error:
        code = 1
        said = f"{type(error).__module__}.{type(error).__name__}: {error}".replace("\n", "\\n")
        os.write(writer, f"{said}\n{traceback.format_exc()}".encode())
    os._exit(code)


class _Watcher:
    def __init__(self, child: int, folder: str, decide: Decide) -> None:
        self.operations: list[Operation] = []
        self._child, self._folder, self._decide = child, folder, decide

    def run(self) -> bool:
        """Until the child has ended; whether it was killed."""
        os.waitpid(self._child, 0)
        ptrace.request(ptrace.SETOPTIONS, self._child, ptrace.OPTIONS)
        ptrace.request(ptrace.CONT, self._child, 0)
        while True:
            who, status = os.waitpid(-1, ptrace.ALL_CHILDREN)
            if os.WIFSTOPPED(status):
                self._stopped(who, status)
            elif who == self._child:
                return os.WIFSIGNALED(status)

    def _stopped(self, who: int, status: int) -> None:
        deliver = 0
        if status >> 16 == ptrace.SECCOMP_STOP:
            if self._answer(who):
                return
        elif status >> 16 == 0 and os.WSTOPSIG(status) != NEW_THREAD_STOP:
            deliver = os.WSTOPSIG(status)
        ptrace.request(ptrace.CONT, who, deliver)

    def _answer(self, who: int) -> bool:
        """Decides about the call that is about to be made; whether that killed the child."""
        registers = ptrace.registers_of(who)
        operation = self._operation(who, registers)
        if operation is None:
            return False
        self.operations.append(operation)
        answer = self._decide(len(self.operations), operation)
        if answer.is_killed and answer.length is None:
            os.kill(self._child, signal.SIGKILL)
            return True
        if answer.error:
            ptrace.answer_with(who, registers, answer.error)
        elif answer.length is not None:
            registers.rdx = answer.length
            ptrace.set_registers(who, registers)
            if answer.is_killed:
                self._decide = lambda n, op: Answer(is_killed=True)  # with the next operation
        return False

    def _operation(self, who: int, r: ptrace.Registers) -> Operation | None:
        """What the call is, if it concerns the folder."""
        name = CALLS.get(r.orig_rax)
        if name is None:
            return None
        first, second, data, at, flags = "", "", b"", 0, 0
        if name in BY_NUMBER:
            first = _opened(who, r.rdi)
            if name == "write" and self._is_ours(first):
                data, at = ptrace.memory(who, r.rsi, r.rdx), _position(who, r.rdi)
        elif name == "sendfile":
            first = _opened(who, r.rdi)
            if self._is_ours(first):
                start = _position(who, r.rsi)
                if r.rdx:  # where the offset is that counts instead
                    start = int.from_bytes(ptrace.memory(who, r.rdx, 8), "little")
                data = Path(_opened(who, r.rsi)).read_bytes()[start : start + r.r10]
                at = _position(who, r.rdi)
        elif name == "copy_file_range":
            first = _opened(who, r.rdx)
        elif name in AT_NAMES:
            first = _named(who, r.rsi, r.rdi)
            flags = r.rdx if name == "openat" else 0
        elif name in TWO_AT_NAMES:
            first, second = _named(who, r.rsi, r.rdi), _named(who, r.r10, r.rdx)
        elif name in TWO_NAMES:
            first, second = _named(who, r.rdi), _named(who, r.rsi)
        else:
            first = _named(who, r.rdi)
        if not (self._is_ours(first) or self._is_ours(second)):
            return None
        return Operation(name, first, second, data, at, flags)

    def _is_ours(self, path: str) -> bool:
        return path == self._folder or path.startswith(self._folder + "/")


def _opened(who: int, number: int) -> str:
    try:
        return os.readlink(f"/proc/{who}/fd/{number & 0xFFFFFFFF}")
    except OSError:
        return ""


def _position(who: int, number: int) -> int:
    told = Path(f"/proc/{who}/fdinfo/{number & 0xFFFFFFFF}").read_text()
    return int(told.split("pos:")[1].split()[0])


def _named(who: int, address: int, beside: int = AT_FDCWD) -> str:
    """The path at an address, made absolute."""
    name = os.fsdecode(ptrace.memory(who, address, 4096).partition(b"\0")[0])
    if name.startswith("/"):
        return name
    is_here = beside & 0xFFFFFFFF == AT_FDCWD
    start = os.readlink(f"/proc/{who}/cwd") if is_here else _opened(who, beside)
    return os.path.normpath(os.path.join(start, name))
