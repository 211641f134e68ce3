"""Values over the pipe between the window and its worker: large arrays travel once.

A message is a pickle (protocol 5). Arrays and bytes above `LARGE` are sent once, under a key, and
stay the *same object* on the other side, so that a backend can remember what it computed for a
photo by the photo's identity. All other array buffers are sent beside the pickle and arrive
read-only, as documents need them. The largest are memory that both processes share
(`shared_memory.py`), where the system can. Both ends are our own processes: nothing foreign is
unpickled.
"""

from __future__ import annotations

import io
import pickle
from collections import OrderedDict
from typing import Any, Protocol, TypeAlias

import numpy as np

from . import shared_memory

LARGE = 1 << 20  # bytes
KEPT = 12  # large values remembered on both sides; least recently used first out
KEPT_BYTES = 1 << 30  # that they may have in all


Buffer: TypeAlias = bytes | shared_memory.SharedBlock


class Connection(Protocol):
    """multiprocessing's; Windows has another class of the same methods."""

    def send(self, obj: Any, /) -> None: ...
    def recv(self) -> Any: ...
    def send_bytes(self, buf: Any, /) -> None: ...
    def recv_bytes(self) -> bytes: ...


class _Pickler(pickle.Pickler):
    def __init__(self, file: io.BytesIO, writer: PipeWriter, buffers: list[pickle.PickleBuffer]):
        super().__init__(file, protocol=5, buffer_callback=buffers.append)
        self._writer = writer

    def persistent_id(self, obj: Any) -> int | None:
        return self._writer.key(obj)


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, kept: dict[int, Any], buffers: list[Buffer]):
        super().__init__(file, buffers=buffers)
        self._kept = kept

    def persistent_load(self, pid: Any) -> Any:
        return self._kept[pid]


def _size(value: Any) -> int:
    return len(value) if type(value) is bytes else value.nbytes


def _is_large(value: Any) -> bool:
    if type(value) is bytes:
        return len(value) >= LARGE
    # A writeable array may change after it was sent: it goes with each message.
    return type(value) is np.ndarray and value.nbytes >= LARGE and not value.flags.writeable


class PipeWriter:
    """The sending end."""

    def __init__(self, connection: Connection, kept: int = KEPT) -> None:
        """`kept`: large values that are remembered after a message; 0 where none comes again."""
        self._connection, self._limit = connection, kept
        self._pipe = shared_memory.pipe_of(connection)
        self._kept: OrderedDict[int, Any] = OrderedDict()  # id -> value, held so ids stay unique

    def key(self, value: Any) -> int | None:
        """The key of a large value, which is sent now if the other side lacks it."""
        if not _is_large(value):
            return None
        key = id(value)
        if key not in self._kept:
            self._kept[key] = value
            self._send("keep", key, value)
        self._kept.move_to_end(key)
        return key

    def write(self, message: Any) -> None:
        """Sends one message. Blocks until the other side has taken it in."""
        buffers: list[pickle.PickleBuffer] = []
        file = io.BytesIO()
        _Pickler(file, self, buffers).dump(message)
        self._send_parts("message", None, file.getvalue(), buffers)
        while len(self._kept) > self._limit or self._bytes > KEPT_BYTES:
            key, _ = self._kept.popitem(last=False)
            self._send("drop", key, None)

    @property
    def _bytes(self) -> int:
        return sum(_size(value) for value in self._kept.values())

    def _send(self, what: str, key: int, value: Any) -> None:
        buffers: list[pickle.PickleBuffer] = []
        data = pickle.dumps(value, protocol=5, buffer_callback=buffers.append)
        self._send_parts(what, key, data, buffers)

    def _send_parts(
        self, what: str, key: int | None, data: bytes, buffers: list[pickle.PickleBuffer]
    ) -> None:
        raws, pipe = [buffer.raw() for buffer in buffers], self._pipe
        shared = [shared_memory.shared(raw) if pipe and raw.nbytes >= shared_memory.LEAST else None
                  for raw in raws]  # fmt: skip
        self._connection.send((what, key, [len(block) if block else 0 for block in shared]))
        self._connection.send_bytes(data)
        for raw, block in zip(raws, shared, strict=True):
            if pipe is not None and block is not None:
                shared_memory.send(pipe, block)
            else:
                self._connection.send_bytes(raw)


class PipeReader:
    """The receiving end."""

    def __init__(self, connection: Connection) -> None:
        self._connection, self._pipe = connection, shared_memory.pipe_of(connection)
        self._kept: dict[int, Any] = {}

    def read(self) -> Any:
        """The next message; blocks. EOFError or OSError when the other side is gone."""
        while True:
            what, key, sizes = self._connection.recv()
            data = self._connection.recv_bytes()
            buffers = [self._buffer(size) for size in sizes]
            if what == "keep":
                self._kept[key] = pickle.loads(data, buffers=buffers)
            elif what == "drop":
                del self._kept[key]
            else:
                return _Unpickler(io.BytesIO(data), self._kept, buffers).load()

    def _buffer(self, size: int) -> Buffer:
        """The next buffer: a block of so many bytes, or, at 0, what is in the pipe."""
        if size and self._pipe is not None:
            return shared_memory.receive(self._pipe, size)
        return self._connection.recv_bytes()
