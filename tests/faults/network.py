"""Runs a program to which the network is refused: `python -m tests.faults.network OUT -- COMMAND`.

The kernel stops the program, its threads and whatever it starts, in whatever language, before a
socket is made or connected (ptrace, seccomp). A socket of another family than Unix's is refused and
written down, and so is each connection to a Unix socket but X's: a name server's may be behind it.
A look-up of a name needs one or the other; glibc's first place to ask, which knows users, too, is
refused in silence: the next one for a host's name is the network. OUT gets what was tried, a line
of JSON each, at once.
"""

from __future__ import annotations

import errno
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from . import ptrace

SOCKET, CONNECT, IO_URING = 41, 42, 425  # numbers of x86-64; the last makes calls unseen
DISPLAYS = ("/tmp/.X11-unix/", "@/tmp/.X11-unix/")
NAMES_OF_USERS = "/var/run/nscd/socket"
LONGEST = 128  # bytes of an address
FAMILIES = {int(f): f.name for f in socket.AddressFamily}


@dataclass(frozen=True)
class Attempt:
    """A call that was refused."""

    call: str
    target: str  # the family of a socket, the address of a connection
    program: str  # its command line


def watcher(out: Path) -> tuple[str, ...]:
    """What is put before a command."""
    return (sys.executable, "-m", "tests.faults.network", str(out), "--")


def tried(out: Path) -> list[Attempt]:
    """What a watched command has tried until now."""
    lines = out.read_text(encoding="utf-8").splitlines()
    return [Attempt(**json.loads(line)) for line in lines]


def run(command: list[str], cwd: Path, env: dict[str, str]) -> tuple[int, str, list[Attempt]]:
    """Until the last of its processes ended: exit status, what it said, what it tried."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "tried.jsonl"
        done = subprocess.run(
            [*watcher(out), *command], cwd=cwd, env=env, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        return done.returncode, done.stdout, tried(out)


def main() -> int:
    out, _, *command = sys.argv[1:]
    child = os.fork()
    if child == 0:
        _become(command)
    with open(out, "w", encoding="utf-8", buffering=1) as file:
        return _watch(child, lambda attempt: file.write(json.dumps(asdict(attempt)) + "\n"))


def _become(command: list[str]) -> None:
    ptrace.libc().ptrace(ptrace.TRACEME, 0, None, None)
    os.kill(os.getpid(), signal.SIGSTOP)
    ptrace.stop_at([SOCKET, CONNECT, IO_URING])
    os.execvp(command[0], command)


def _watch(child: int, tell: Callable[[Attempt], object]) -> int:
    """Until the last process has ended; how the first ended."""
    status = 0
    os.waitpid(child, 0)
    ptrace.request(ptrace.SETOPTIONS, child, ptrace.OPTIONS)
    ptrace.request(ptrace.CONT, child, 0)
    while True:
        try:
            who, ended = os.waitpid(-1, ptrace.ALL_CHILDREN)
        except ChildProcessError:
            return status
        if not os.WIFSTOPPED(ended):
            status = os.waitstatus_to_exitcode(ended) if who == child else status
            continue
        event, deliver = ended >> 16, 0
        if event == ptrace.SECCOMP_STOP:
            _answer(who, tell)
        elif event == 0 and os.WSTOPSIG(ended) != signal.SIGSTOP:  # a new thread's first stop
            deliver = os.WSTOPSIG(ended)
        ptrace.request(ptrace.CONT, who, deliver)


def _answer(who: int, tell: Callable[[Attempt], object]) -> None:
    """Refuses the call that this thread is about to make, or lets it be made."""
    registers = ptrace.registers_of(who)
    call, target = _looked_at(who, registers)
    if call:
        ptrace.answer_with(who, registers, errno.EACCES)
    if call and target != NAMES_OF_USERS:
        program = Path(f"/proc/{who}/cmdline").read_bytes().replace(b"\0", b" ")
        tell(Attempt(call, target, program.decode("utf-8", "replace")[:200]))


def _looked_at(who: int, registers: ptrace.Registers) -> tuple[str, str]:
    """Name and target of a call that is to be refused."""
    if registers.orig_rax == IO_URING:
        return "io_uring_setup", ""
    if registers.orig_rax == SOCKET:
        family = registers.rdi & 0xFFFFFFFF
        is_local = family == socket.AF_UNIX
        return ("", "") if is_local else ("socket", FAMILIES.get(family, str(family)))
    address = ptrace.memory(who, registers.rsi, min(registers.rdx, LONGEST))
    family = int.from_bytes(address[:2], sys.byteorder)
    if family != socket.AF_UNIX:  # of a socket that was handed to the program
        return "connect", f"{FAMILIES.get(family, family)} {address[2:].hex()}"
    path = address[2:]
    shown = "@" + path[1:].decode("utf-8", "replace") if path[:1] == b"\0" else _until_zero(path)
    return ("", "") if shown.startswith(DISPLAYS) else ("connect", shown)


def _until_zero(path: bytes) -> str:
    return path.partition(b"\0")[0].decode("utf-8", "replace")


if __name__ == "__main__":
    sys.exit(main())
