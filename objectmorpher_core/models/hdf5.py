"""Reads the float32 arrays of an HDF5 file as Keras writes weights, without h5py.

Of the HDF5 file format (version 0 of the superblock, The HDF Group's specification 3.0) this is
what h5py writes unless it is told otherwise: groups as B-trees of symbol tables, object headers of
version 1, arrays in one piece. Chunks, filters and links are refused. Nothing is executed.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..arrays import F32
from .registry import ModelError

SIGNATURE = b"\x89HDF\r\n\x1a\n"
ROOT = 24 + 4 * 8  # bytes before the root's entry: the fixed fields and four addresses
END = 24 + 2 * 8  # where the third of these is, that of the file's end
ENTRY, HEADER, MESSAGE = 40, 16, 8  # bytes of a symbol table's entry, of two kinds of headers
DATASPACE, DATATYPE, LAYOUT, MORE, TABLE = 0x1, 0x3, 0x8, 0x10, 0x11  # kinds of messages
LITTLE_FLOAT32 = b"\x11\x20\x1f\x00\x04\x00\x00\x00\x00\x00\x20\x00\x17\x08\x00\x17\x7f\x00\x00\x00"
DEEPEST = 32  # groups in groups
Messages = dict[int, bytes]  # by kind


def read_arrays(path: Path) -> dict[str, F32]:
    """Every array by its path, as "block1/vars/0". Raises ModelError: one sentence."""
    try:
        return dict(_File(path.read_bytes()).arrays())
    except OSError as error:
        raise ModelError(f"{path.name} cannot be read: {error.strerror or error}") from error
    except (ValueError, struct.error, RecursionError) as error:
        raise ModelError(f"{path.name} is damaged, or no HDF5 file that we can read") from error


class _File:
    """Raises ValueError and struct.error where the bytes make no sense."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._seen: set[int] = set()  # addresses: a damaged tree may run in circles

    def arrays(self) -> Iterator[tuple[str, F32]]:
        # After the signature: versions, then the sizes of addresses and of lengths.
        if self._bytes(0, 9) != SIGNATURE + b"\0" or self._bytes(13, 2) != b"\x08\x08":
            raise ValueError("another version")
        if self._numbers("<Q", END)[0] > len(self._data):
            raise ValueError("cut off")
        yield from self._object(self._numbers("<8xQ", ROOT)[0], "", 0)

    def _object(self, at: int, name: str, depth: int) -> Iterator[tuple[str, F32]]:
        self._enter(at, depth)
        messages = self._messages(at)
        if TABLE not in messages:
            yield name, self._array(messages)
            return
        tree, heap = struct.unpack_from("<QQ", messages[TABLE])
        names = self._heap(heap)
        for start, child in self._entries(tree, 0):
            inner = names[start : names.index(b"\0", start)].decode()
            yield from self._object(child, f"{name}/{inner}" if name else inner, depth + 1)

    def _enter(self, at: int, depth: int) -> None:
        if at in self._seen or depth > DEEPEST:
            raise ValueError("a tree that runs in circles")
        self._seen.add(at)

    def _messages(self, at: int) -> Messages:
        version, count, size = self._numbers("<BxHxxxxI", at)
        if version != 1:
            raise ValueError("another header")
        found: Messages = {}
        blocks = [(at + HEADER, size)]
        for start, length in blocks:  # which grows: a header may go on elsewhere
            end = start + length
            while start + MESSAGE <= end and count > 0:
                kind, size = self._numbers("<HH", start)
                body = self._bytes(start + MESSAGE, size)
                if kind == MORE:
                    blocks.append(struct.unpack_from("<QQ", body))
                found[kind] = body
                start, count = start + MESSAGE + size, count - 1
        return found

    def _heap(self, at: int) -> bytes:
        """The names of a group, each ended by a zero."""
        signature, size, start = self._numbers("<4s4xQ8xQ", at)
        if signature != b"HEAP":
            raise ValueError("no heap")
        return self._bytes(start, size)

    def _entries(self, at: int, depth: int) -> Iterator[tuple[int, int]]:
        """(where its name starts, where its header is) of each object in a group."""
        self._enter(at, depth)
        signature, kind, level, count = self._numbers("<4sBBH", at)
        if signature != b"TREE" or kind != 0:
            raise ValueError("no tree of names")
        for k in range(count):
            child = self._numbers("<8xQ", at + 24 + 16 * k)[0]
            if level > 0:
                yield from self._entries(child, depth + 1)
                continue
            signature, held = self._numbers("<4sxxH", child)
            if signature != b"SNOD":
                raise ValueError("no table of names")
            for entry in range(held):
                yield self._numbers("<QQ", child + 8 + ENTRY * entry)

    def _array(self, messages: Messages) -> F32:
        shape = self._shape(messages.get(DATASPACE, b""))
        if messages.get(DATATYPE, b"")[: len(LITTLE_FLOAT32)] != LITTLE_FLOAT32:
            raise ValueError("no float32")
        version, how, start, size = struct.unpack_from("<BBQQ", messages.get(LAYOUT, b""))
        if (version, how) != (3, 1) or size != 4 * math.prod(shape):
            raise ValueError("not in one piece")
        return np.frombuffer(self._bytes(start, size), "<f4").reshape(shape)

    def _shape(self, message: bytes) -> tuple[int, ...]:
        version, rank = struct.unpack_from("<BB", message)
        if version != 1:
            raise ValueError("another dataspace")
        return struct.unpack_from(f"<{rank}Q", message, 8)

    def _numbers(self, form: str, at: int) -> tuple:
        return struct.unpack(form, self._bytes(at, struct.calcsize(form)))

    def _bytes(self, at: int, count: int) -> bytes:
        if at + count > len(self._data):
            raise ValueError("cut off")
        return self._data[at : at + count]
