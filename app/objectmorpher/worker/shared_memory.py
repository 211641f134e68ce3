"""Memory that two processes share: what is large is there once, however often it is sent.

A block is an anonymous file in memory (memfd, Linux) that goes through a Unix socket as an open
file and is mapped, read-only, on the other side. Nobody else can name it, and it is gone with the
last process that has it, however that ends. An array that came in a block goes back in it.
"""

from __future__ import annotations

import mmap
import os
import socket
import sys
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from multiprocessing.connection import Connection as Pipe

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
