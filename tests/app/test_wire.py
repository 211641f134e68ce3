"""Values between the window and its worker: what arrives, and what stays the same object."""

from __future__ import annotations

import errno
import gc
import os
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from multiprocessing import Pipe
from typing import Any

import numpy as np
import pytest

from objectmorpher.worker import wire
from objectmorpher.worker.wire import KEPT, LARGE, PipeReader, PipeWriter
from objectmorpher_core.base.arrays import frozen


class Line:
    """Both ends, in one process."""

    def __init__(self) -> None:
        self._ends = Pipe()
        self._writer, self._reader = PipeWriter(self._ends[0]), PipeReader(self._ends[1])

    def sent(self, message: Any) -> Any:
        """What arrives; it is written beside the reading, for a pipe holds little."""
        thread = threading.Thread(target=self._writer.write, args=(message,))
        thread.start()
        arrived = self._reader.read()
        thread.join()
        return arrived

    def little(self, message: Any) -> Any:
        """What arrives of a message that the pipe holds."""
        self._writer.write(message)
        return self._reader.read()

    def close(self) -> None:
        for end in self._ends:
            end.close()


@pytest.fixture
def line() -> Iterator[Line]:
    line = Line()
    yield line
    line.close()


def large(value: int, is_writeable: bool = False) -> np.ndarray:
    array = np.full(LARGE, value, np.uint8)
    array.setflags(write=is_writeable)
    return array


def test_arrays_arrive_as_they_were_and_read_only(line: Line) -> None:
    small = np.arange(6.0).reshape(2, 3)
    arrived = line.sent({"small": small, "large": large(3), "text": "é"})
    np.testing.assert_array_equal(arrived["small"], small)
    np.testing.assert_array_equal(arrived["large"], large(3))
    assert arrived["text"] == "é"
    assert not arrived["small"].flags.writeable and not arrived["large"].flags.writeable


@pytest.mark.parametrize("value", [large(1), bytes(LARGE)], ids=["array", "bytes"])
def test_a_large_value_is_the_same_object_each_time(line: Line, value: Any) -> None:
    first, twice = line.sent(value), line.sent([value, value])
    assert twice[0] is twice[1] is first


def test_what_may_change_is_sent_anew(line: Line) -> None:
    array = large(1, is_writeable=True)
    assert (line.sent(array) == 1).all()
    array[:] = 2
    assert (line.sent(array) == 2).all()


@dataclass(frozen=True, eq=False)
class Square:
    """A value that computes something of itself when it is first asked for."""

    side: Side
    name: str

    @cached_property
    def area(self) -> float:
        return self.side.length**2


class PlainSquare:
    """The same, and no dataclass."""

    def __init__(self, side: Side, name: str) -> None:
        self.side, self.name = side, name

    @cached_property
    def area(self) -> float:
        return self.side.length**2


class Side:
    """Asks for the area of its squares while it is sent, as another thread does."""

    def __init__(self, length: float) -> None:
        self.length, self.squares = length, list[Square | PlainSquare]()

    def __reduce__(self) -> tuple[Any, ...]:
        for square in self.squares:
            assert square.area == self.length**2
        return Side, (self.length,)


def test_a_value_may_grow_while_it_is_sent(line: Line) -> None:
    for kind in (Square, PlainSquare):
        side = Side(3.0)
        square = kind(side, "first")
        side.squares.append(square)
        got = line.little(square)
        assert (got.side.length, got.name, got.area) == (3.0, "first", 9.0)


def test_what_was_forgotten_is_sent_again(line: Line) -> None:
    values = [large(k) for k in range(KEPT + 2)]
    arrived = [line.sent(value) for value in values]
    assert line.sent(values[-1]) is arrived[-1]
    again = line.sent(values[0])
    assert again is not arrived[0]
    np.testing.assert_array_equal(again, values[0])


def test_one_message_may_hold_more_than_is_remembered(line: Line) -> None:
    values = [large(k) for k in range(KEPT + 3)]
    for _ in range(2):
        arrived = line.sent(values)
        assert [int(a[0]) for a in arrived] == list(range(KEPT + 3))


def huge(value: int) -> np.ndarray:
    array = np.full((2, wire.LEAST // 8), float(value))
    array.setflags(write=False)
    return array


needs_blocks = pytest.mark.skipif(sys.platform != "linux", reason="shared memory of Linux")


@needs_blocks
def test_what_is_shared_goes_back_as_the_same_memory(line: Line) -> None:
    first = line.sent([huge(1), "small"])
    there = frozen(first[0])  # as the document holds it
    assert wire.block_of(there.data) is not None
    back = Line()
    again = back.sent({"image": there})["image"]
    np.testing.assert_array_equal(again, huge(1))
    one, other = (wire.block_of(a.data) for a in (there, again))
    assert one is not None and other is not None
    assert os.fstat(one.descriptor).st_ino == os.fstat(other.descriptor).st_ino
    assert not again.flags.writeable
    back.close()


@needs_blocks
def test_a_part_of_shared_memory_is_sent_as_the_part_that_it_is(line: Line) -> None:
    whole = line.sent(np.arange(wire.LEAST / 4).reshape(2, -1))
    for part in (whole[1], whole[:, :-1], np.asfortranarray(whole), whole.T):
        np.testing.assert_array_equal(line.sent(part), part)


@pytest.mark.slow
@needs_blocks
def test_no_open_files_are_left(line: Line) -> None:
    before = len(os.listdir("/proc/self/fd"))
    for k in range(20):
        assert line.sent(huge(k))[0, 0] == k
    assert len(os.listdir("/proc/self/fd")) <= before + 3 * KEPT  # what both sides remember
    line.close()
    line._writer._kept.clear()
    line._reader._kept.clear()
    gc.collect()
    assert len(os.listdir("/proc/self/fd")) <= before


@needs_blocks
def test_without_shared_memory_it_goes_through_the_pipe(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_memory(name: str, flags: int) -> int:
        raise OSError(errno.ENOMEM, "no memory")

    monkeypatch.setattr(os, "memfd_create", no_memory)
    np.testing.assert_array_equal(line.sent(huge(4)), huge(4))


def test_what_is_remembered_has_a_limit_in_bytes(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wire, "KEPT_BYTES", 2 * LARGE)
    values = [large(k) for k in range(3)]
    arrived = [line.sent(value) for value in values]
    assert line.sent(values[2]) is arrived[2]
    assert line.sent(values[0]) is not arrived[0]


def test_who_remembers_nothing_is_heard_all_the_same() -> None:
    ends = Pipe()
    writer, reader = PipeWriter(ends[0], kept=0), PipeReader(ends[1])
    for k in range(3):
        thread = threading.Thread(target=writer.write, args=([large(k), large(k)],))
        thread.start()
        assert [int(a[0]) for a in reader.read()] == [k, k]
        thread.join()
    assert not writer._kept
