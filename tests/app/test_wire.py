"""Values between the window and its worker: what arrives, and what stays the same object."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from multiprocessing import Pipe
from typing import Any

import numpy as np
import pytest

from app.wire import KEPT, LARGE, Reader, Writer


class Line:
    """Both ends, in one process."""

    def __init__(self) -> None:
        self._ends = Pipe()
        self._writer, self._reader = Writer(self._ends[0]), Reader(self._ends[1])

    def sent(self, message: Any) -> Any:
        """What arrives; it is written beside the reading, for a pipe holds little."""
        thread = threading.Thread(target=self._writer.write, args=(message,))
        thread.start()
        arrived = self._reader.read()
        thread.join()
        return arrived

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
