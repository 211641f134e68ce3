"""Values over the pipe between the window and its worker: large arrays travel once.

A message is a pickle (protocol 5). Arrays and bytes above `LARGE` are sent once, under a key, and
stay the *same object* on the other side, so that a backend can remember what it computed for a
photo by the photo's identity. All other array buffers are sent beside the pickle and arrive
read-only, as documents need them. The largest are memory that both processes share
where the system can. Both ends are our own processes: nothing foreign is
unpickled.
"""

from __future__ import annotations

import io
import mmap
import os
import pickle
import socket
import sys
from collections import OrderedDict
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from multiprocessing.connection import Connection as Pipe


# Memory that two processes share: what is large is there once, however often it is sent.
#
# A block is an anonymous file in memory (memfd, Linux) that goes through a Unix socket as an open
# file and is mapped, read-only, on the other side. Nobody else can name it, and it is gone with the
# last process that has it, however that ends. An array that came in a block goes back in it.

LEAST = 1 << 25  # bytes: smaller ones would use up the open files that a process may have
PIECE = 1 << 30  # bytes that one write takes


class SharedBlock(mmap.mmap):
    """Read-only memory that another process can have, too."""

    descriptor = -1

    def __del__(self) -> None:
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1


def pipe_of(connection: object) -> Pipe | None:
    """The connection where blocks go through it."""
    if sys.platform != "linux":
        return None
    from multiprocessing.connection import Connection

    return connection if isinstance(connection, Connection) else None


def block_of(buffer: memoryview) -> SharedBlock | None:
    """The block whose very bytes an array's `buffer` shows, all of them."""
    owner = buffer.obj
    while isinstance(owner, np.ndarray | memoryview):
        owner = owner.base if isinstance(owner, np.ndarray) else owner.obj
    if not isinstance(owner, SharedBlock) or len(owner) != buffer.nbytes:
        return None
    return owner  # as long as the block, so it begins where the block does


def shared(buffer: memoryview) -> SharedBlock | None:
    """A block with the bytes of `buffer`, a copy unless they came in one.

    None where the system has no memory for it.
    """
    if (block := block_of(buffer)) is not None:
        return block
    if sys.platform != "linux":
        return None
    try:
        descriptor = os.memfd_create("objectmorpher", os.MFD_CLOEXEC)
    except OSError:
        return None
    try:
        rest = buffer.cast("B")
        while rest:  # written, not mapped: where memory ends, that is an error and no signal
            rest = rest[os.write(descriptor, rest[:PIECE]) :]
    except OSError:
        os.close(descriptor)
        return None
    return _mapped(descriptor, buffer.nbytes)


def send(pipe: Pipe, block: SharedBlock) -> None:
    """Send it to the caller of `receive` on the other side."""
    assert sys.platform == "linux"
    with _socket(pipe) as line:
        socket.send_fds(line, [b"\0"], [block.descriptor])


def receive(pipe: Pipe, size: int) -> SharedBlock:
    """The block of `size` bytes that was sent. Raises EOFError, OSError."""
    assert sys.platform == "linux"
    with _socket(pipe) as line:
        _, found, _, _ = socket.recv_fds(line, 1, 1, socket.MSG_CMSG_CLOEXEC)
    if not found:
        raise EOFError
    return _mapped(found[0], size)


def _mapped(descriptor: int, size: int) -> SharedBlock:
    try:
        block = SharedBlock(descriptor, size, access=mmap.ACCESS_READ)
    except BaseException:
        os.close(descriptor)
        raise
    block.descriptor = descriptor
    return block


def _socket(pipe: Pipe) -> socket.socket:
    """The pipe, which is a pair of Unix sockets; to be closed."""
    return socket.socket(fileno=os.dup(pipe.fileno()))


LARGE = 1 << 20  # bytes
KEPT = 12  # large values remembered on both sides; least recently used first out
KEPT_BYTES = 1 << 30  # that they may have in all


Buffer: TypeAlias = bytes | SharedBlock


class Connection(Protocol):
    """multiprocessing's; Windows has another class of the same methods."""

    def send(self, obj: Any, /) -> None: ...
    def recv(self) -> Any: ...
    def send_bytes(self, buf: Any, /) -> None: ...
    def recv_bytes(self) -> bytes: ...
    def fileno(self) -> int: ...


class _Pickler(pickle.Pickler):
    def __init__(self, file: io.BytesIO, writer: PipeWriter, buffers: list[pickle.PickleBuffer]):
        super().__init__(file, protocol=5, buffer_callback=buffers.append)
        self._writer = writer

    def persistent_id(self, obj: Any) -> int | None:
        return self._writer.key(obj)

    def reducer_override(self, obj: Any) -> Any:
        """What the window's thread computes of a value while it is sent is left out.

        A cached property is kept among the value's fields, which must not grow under the pickler.
        """
        is_plain = type(obj).__module__ == "builtins" or isinstance(obj, type)
        if is_plain or not hasattr(obj, "__dict__"):
            return NotImplemented
        reduced = obj.__reduce_ex__(pickle.HIGHEST_PROTOCOL)
        if isinstance(reduced, str) or len(reduced) < 3 or type(reduced[2]) is not dict:
            return NotImplemented
        return (*reduced[:2], dict(reduced[2]), *reduced[3:])


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
        self._pipe = pipe_of(connection)
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
        blocks = [shared(raw) if pipe and raw.nbytes >= LEAST else None
                  for raw in raws]  # fmt: skip
        self._connection.send((what, key, [len(block) if block else 0 for block in blocks]))
        self._connection.send_bytes(data)
        for raw, block in zip(raws, blocks, strict=True):
            if pipe is not None and block is not None:
                send(pipe, block)
            else:
                self._connection.send_bytes(raw)


class PipeReader:
    """The receiving end."""

    def __init__(self, connection: Connection) -> None:
        self._connection, self._pipe = connection, pipe_of(connection)
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
            return receive(self._pipe, size)
        return self._connection.recv_bytes()
