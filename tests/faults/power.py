"""Cuts the power after each operation, and lets the disk forget whatever it may.

What a file system promises is little: data that was synced is there, and so is a name in a folder
that was synced since. All else may be there or not, in any order: names of one folder, and blocks
of one file, of which missing ones are zeros. We record what the product asks of the system,
make the folders that may be found afterwards, and read them.
"""

from __future__ import annotations

import itertools
import os
import random
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from .faults import Result
from .scenarios import NEW, OLD, Scenario
from .tracer import Operation, watch

BLOCK = 512  # bytes that are written whole
MOST_EXACT = 4  # pending names of which all subsets are always tried; of more some


@dataclass
class _Inode:
    """A file's data."""

    data: bytes = b""  # as the program sees it
    synced: bytes = b""  # that the disk holds for sure


@dataclass
class _Naming:
    """A change of names that the disk may still forget."""

    folder: str  # whose sync makes it last
    gone: str = ""  # a name that is no more
    name: str = ""  # a name that is there now
    inode: int = -1  # of it; FOLDER for a folder


FOLDER = 0


@dataclass
class _Disk:
    inodes: dict[int, _Inode] = field(default_factory=dict)
    live: dict[str, int] = field(default_factory=dict)  # path -> inode, as the program sees it
    safe: dict[str, int] = field(default_factory=dict)  # that the disk holds for sure
    pending: list[_Naming] = field(default_factory=list)

    def add(self, path: str, data: bytes) -> int:
        number = len(self.inodes) + 1
        self.inodes[number] = _Inode(data, data)
        self.live[path] = number
        return number

    def do(self, op: Operation) -> None:
        """An operation as the program sees it."""
        folder = os.path.dirname(op.path)
        if op.name == "openat" and op.flags & os.O_CREAT and op.path not in self.live:
            number = self.add(op.path, b"")
            self._name(_Naming(folder, name=op.path, inode=number))
        elif op.name == "openat" and op.flags & os.O_TRUNC and op.path in self.live:
            self.inodes[self.live[op.path]].data = b""
        elif op.name in ("write", "sendfile"):
            inode = self.inodes[self.live[op.path]]
            inode.data = inode.data.ljust(op.at, b"\0")
            inode.data = inode.data[: op.at] + op.data + inode.data[op.at + len(op.data) :]
        elif op.name in ("fsync", "fdatasync"):
            self._sync(op.path)
        elif op.name in ("rename", "renameat", "renameat2"):
            number = self.live.pop(op.path)
            self.live[op.second] = number
            self._name(_Naming(os.path.dirname(op.second), op.path, op.second, number))
        elif op.name in ("link", "linkat"):
            self.live[op.second] = self.live[op.path]
            self._name(_Naming(os.path.dirname(op.second), name=op.second,
                               inode=self.live[op.path]))  # fmt: skip
        elif op.name in ("mkdir", "mkdirat"):
            self.live[op.path] = FOLDER
            self._name(_Naming(folder, name=op.path, inode=FOLDER))
        elif op.name in ("unlink", "unlinkat", "rmdir") and op.path in self.live:
            del self.live[op.path]
            self._name(_Naming(folder, gone=op.path))
        elif op.name not in ("openat", "chmod", "fchmod", "fchmodat", "unlink", "unlinkat", "rmdir",
                             "mkdir", "mkdirat"):  # fmt: skip
            raise NotImplementedError(f"{op.name} is not modelled")

    def _name(self, change: _Naming) -> None:
        self.pending.append(change)

    def _sync(self, path: str) -> None:
        if self.live.get(path, FOLDER) != FOLDER:
            inode = self.inodes[self.live[path]]
            inode.synced = inode.data
            return
        for change in self.pending:
            if change.folder == path:
                _apply(self.safe, change)
        self.pending = [change for change in self.pending if change.folder != path]

    def after_cut(self, chosen: random.Random, most: int) -> Iterator[dict[str, bytes | None]]:
        """What may be found: path -> data, None for a folder."""
        subsets = self._subsets(chosen, most)
        for kept in subsets:
            names = dict(self.safe)
            for change, is_kept in zip(self.pending, kept, strict=True):
                if is_kept:
                    _apply(names, change)
            for way in ("lost", "whole", "torn", "torn"):
                yield {
                    path: None if number == FOLDER else _found(self.inodes[number], way, chosen)
                    for path, number in sorted(names.items())
                }
                if all(self.inodes[n].data == self.inodes[n].synced for n in names.values() if n):
                    break  # nothing else can be found

    def _subsets(self, chosen: random.Random, most: int) -> list[tuple[bool, ...]]:
        count = len(self.pending)
        if 2**count <= max(most // 4, 2**MOST_EXACT):
            return list(itertools.product((False, True), repeat=count))
        some = {(False,) * count, (True,) * count}
        some |= {tuple(k == j for j in range(count)) for k in range(count)}  # one alone
        some |= {tuple(k != j for j in range(count)) for k in range(count)}  # all but one
        some |= {tuple(j < k for j in range(count)) for k in range(count)}  # in their order
        while len(some) < most // 4:
            some.add(tuple(chosen.random() < 0.5 for _ in range(count)))
        return sorted(some)


def _apply(names: dict[str, int], change: _Naming) -> None:
    if change.gone:
        names.pop(change.gone, None)
    if change.name:
        names[change.name] = change.inode


def _found(inode: _Inode, way: str, chosen: random.Random) -> bytes:
    """A file's data: what was not synced is lost, whole, or there in blocks."""
    if inode.data == inode.synced or way == "lost":
        return inode.synced
    if way == "whole":
        return inode.data
    size = chosen.choice((len(inode.data), chosen.randrange(len(inode.data) + 1)))
    blocks = []
    for start in range(0, size, BLOCK):
        old = inode.synced[start : start + BLOCK].ljust(BLOCK, b"\0")
        new = inode.data[start : start + BLOCK].ljust(BLOCK, b"\0")
        blocks.append(new if chosen.random() < 0.7 else old)
    return b"".join(blocks)[:size]


def cut_power(scenario: Scenario, most: int) -> Result:
    """Reads what is left after a cut behind each operation of a scenario."""
    result, chosen = Result(scenario.name), random.Random(7)
    with tempfile.TemporaryDirectory() as scratch:
        work = Path(os.path.realpath(scratch)) / "work"
        work.mkdir()
        scenario.prepare(work)
        disk = _Disk()
        for path in sorted(work.rglob("*")):
            if path.is_dir():
                disk.live[str(path)] = FOLDER
            else:
                disk.add(str(path), path.read_bytes())
        disk.safe = dict(disk.live)
        outcome = watch(lambda: scenario.act(work), work)
        result.operations = len(outcome.operations)
        for n, op in enumerate(outcome.operations, 1):
            disk.do(op)
            is_last = n == len(outcome.operations)
            seen: set[int] = set()
            for found in disk.after_cut(chosen, most):
                key = hash(tuple(found.items()))
                if key in seen:
                    continue
                seen.add(key)
                _lay_out(work, found)
                problem, state = _read(scenario, work)
                if is_last and state != NEW and not problem:
                    problem = "it was done, and is not there"
                result.runs["power cut"] = result.runs.get("power cut", 0) + 1
                result.ends[state] = result.ends.get(state, 0) + 1
                if problem:
                    result.wrong.append(f"after {n} ({op.name} {Path(op.path).name}): {problem}")
    return result


def _lay_out(work: Path, found: dict[str, bytes | None]) -> None:
    """Makes the folder as it is found; what lies in a folder that is lost is lost."""
    shutil.rmtree(work)
    work.mkdir()
    for path, data in found.items():
        if not Path(path).parent.is_dir():
            continue
        if data is None:
            Path(path).mkdir()
        else:
            Path(path).write_bytes(data)
            Path(path).chmod(0o600)  # as new files of ours are; rights are looked at by `faults`


def _read(scenario: Scenario, work: Path) -> tuple[str, str]:
    try:
        state = scenario.state(work)
    except Exception as error:
        return f"{type(error).__name__}: {error}", "lost"
    is_whole = state in {OLD, NEW, *scenario.between}
    return ("" if is_whole else f"it is {state}"), state
