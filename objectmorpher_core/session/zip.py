"""A session's zip file, written and read in pieces: of gigabytes only a little is in the memory."""

from __future__ import annotations

import hashlib
import io
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TypeAlias

import numpy as np

from ..base.limits import SESSION_DIRECTORY, SESSION_EXCESS, SESSION_FILE_SHARE, SESSION_RATIO
from ..base.limits import SESSION_UNPACKED as MAX_BYTES
from ..base.quoting import named, shown
from .tree import SessionError

LONG_AGO = (1980, 1, 1, 0, 0, 0)  # the zip format's first day: no clock in the bytes
PACKED_ENDINGS = (".png", ".npz", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".avif")
LEVEL = 1  # of zlib
PIECE = 1 << 24  # bytes that are read at a time
IN_MEMORY = 1 << 26  # bytes up to which a file that is needed for a moment is not on the disk
LOCAL_HEADER, NAME_LENGTHS = 30, 26  # bytes of a member's own header; where its lengths are
DIRECTORY_SIZE = 5  # which number of the zip file's last record that is


class Npy:
    """An array as a .npy file."""

    def __init__(self, array: np.ndarray) -> None:
        self._array = np.ascontiguousarray(array).reshape(array.shape)
        head = io.BytesIO()
        facts = np.lib.format.header_data_from_array_1_0(self._array)
        np.lib.format.write_array_header_1_0(head, facts)
        self._head = head.getvalue()

    def __len__(self) -> int:
        return len(self._head) + self._array.nbytes

    def __iter__(self) -> Iterator[bytes | memoryview]:
        yield self._head
        plain = self._array.reshape(-1).view(np.uint8).data
        for start in range(0, len(plain), PIECE):
            yield plain[start : start + PIECE]


class FilePieces:
    """All members of a file."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    def __len__(self) -> int:
        return self._file.seek(0, io.SEEK_END)

    def __iter__(self) -> Iterator[bytes]:
        self._file.seek(0)
        while piece := self._file.read(PIECE):
            yield piece


Member: TypeAlias = bytes | Npy | FilePieces


@contextmanager
def scratch_file(folder: Path | None = None) -> Iterator[IO[bytes]]:
    """A file without a name for a moment; a large one is in `folder`. Raises OSError."""
    with tempfile.SpooledTemporaryFile(IN_MEMORY, dir=folder and str(folder)) as file:
        yield file  # type: ignore[misc]


def digest(member: bytes | Iterable[bytes | memoryview]) -> str:
    """The SHA-256 of a member."""
    found = hashlib.sha256()
    for piece in _parts(member):
        found.update(piece)
    return found.hexdigest()


def write_zip(file: IO[bytes], members: Mapping[str, Member]) -> None:
    """Zip file whose bytes depend on nothing but the members; packed ones are not packed again."""
    with zipfile.ZipFile(file, "w") as archive:
        for name, member in members.items():
            info = zipfile.ZipInfo(name, LONG_AGO)
            info.create_system, info.external_attr = 3, 0o644 << 16  # as on Linux, everywhere
            is_packed = name.endswith(PACKED_ENDINGS)
            info.compress_type = zipfile.ZIP_STORED if is_packed else zipfile.ZIP_DEFLATED
            info.file_size = len(member)
            setattr(info, "_compresslevel", LEVEL)  # noqa: B010  as `writestr` does
            with archive.open(info, "w") as target:
                for piece in _parts(member):
                    target.write(piece)


def _parts(member: bytes | Iterable[bytes | memoryview]) -> Iterable[bytes | memoryview]:
    return [member] if isinstance(member, bytes) else member


class Zip:
    """A zip file that is read: members have sound names, and only those that are asked for unpack.

    Everything raises SessionError, in which the file is called `what`. A zip file inside another
    one shares the `budget` of the outer one.
    """

    def __init__(self, file: IO[bytes], what: str, budget: Budget | None = None) -> None:
        self._file, self._what = file, what
        with self._told():
            size = file.seek(0, io.SEEK_END)
            self._check_directory()
            self._archive = zipfile.ZipFile(file)
            infos = self._archive.infolist()
            self.names = [info.filename for info in infos]
            self._check_names()
            if sum(info.compress_size for info in infos) > size:
                raise zipfile.BadZipFile("members overlap")
        self._budget = budget or Budget(size)

    def __enter__(self) -> Zip:
        return self

    def __exit__(self, *_: object) -> None:
        self._archive.close()

    def read(self, name: str, most: int = MAX_BYTES) -> bytes:
        """A member, all of it; one of more than `most` bytes is refused."""
        with self._told():
            info = self._archive.getinfo(name)
        if info.file_size > most:
            raise SessionError(
                f"the {self._what} is damaged: {named(name)} has {info.file_size:,} bytes, "
                f"more than {most:,}"
            )
        self._budget.take(name, info.file_size, info.compress_size)
        data = io.BytesIO()
        for piece in self.pieces(name):
            data.write(piece)
        return data.getvalue()

    def pieces(self, name: str) -> Iterator[bytes]:
        """A member, piece by piece, of which none stays in the memory."""
        with self._told(), self._archive.open(name) as member:
            while piece := member.read(PIECE):
                yield piece

    def inner(self, name: str) -> Zip:
        """A member that is a zip file itself; not in the memory where it is stored as it is."""
        with self._told():
            info = self._archive.getinfo(name)
            if info.compress_type != zipfile.ZIP_STORED:
                return Zip(io.BytesIO(self.read(name)), name, self._budget)
            self._file.seek(info.header_offset + NAME_LENGTHS)
            lengths = struct.unpack("<HH", self._file.read(4))
            start = info.header_offset + LOCAL_HEADER + sum(lengths)
            window = _Window(self._file, start, info.compress_size)
            return Zip(io.BufferedReader(window), name, self._budget)

    def _check_directory(self) -> None:
        """Python reads the directory at once, and each entry takes ten times its bytes."""
        end = getattr(zipfile, "_EndRecData")(self._file)  # noqa: B009  None where there is none
        if end is not None and end[DIRECTORY_SIZE] > SESSION_DIRECTORY:
            raise SessionError(f"the {self._what} holds too many members")

    def _check_names(self) -> None:
        for name in self.names:
            if name.startswith("/") or "\\" in name or ".." in name.split("/"):
                raise SessionError(
                    f"the {self._what} holds a member with a forbidden name: {shown(name)}"
                )
        if len(set(self.names)) < len(self.names):
            raise SessionError(f"the {self._what} holds two members of the same name")

    @contextmanager
    def _told(self) -> Iterator[None]:
        what = self._what
        try:
            yield
        except SessionError:
            raise
        except (NotImplementedError, zlib.error) as error:
            raise SessionError(f"the {what} is damaged") from error
        except (zipfile.BadZipFile, EOFError, OSError, ValueError, RuntimeError, KeyError,
                struct.error) as error:  # fmt: skip
            raise SessionError(f"the {what} is not a zip file, is damaged or ends early") from error


class Budget:
    """The budget of a session's unpacked bytes: real contents hardly shrink when they are packed.

    `file_size`: bytes of the session's file.
    """

    def __init__(self, file_size: int) -> None:
        self._excess = SESSION_EXCESS + SESSION_FILE_SHARE * file_size
        self._left = MAX_BYTES

    def take(self, name: str, size: int, packed: int) -> None:
        """Counts a member of `size` bytes before it is unpacked. Raises SessionError."""
        self._left -= size
        self._excess -= max(size - SESSION_RATIO * packed, 0)
        if self._left < 0:
            raise SessionError(f"the session would unpack to more than {MAX_BYTES >> 30} GiB")
        if self._excess < 0:
            raise SessionError(
                f"the session is damaged: {named(name)} would unpack from {packed:,} "
                f"to {size:,} bytes"
            )


class _Window(io.RawIOBase):
    """A part of a file, as a file."""

    def __init__(self, file: IO[bytes], start: int, size: int) -> None:
        self._file, self._start, self._size, self._at = file, start, size, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        origin = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        self._at = max(origin + offset, 0)
        return self._at

    def tell(self) -> int:
        return self._at

    def readinto(self, buffer: memoryview, /) -> int:  # type: ignore[override]
        self._file.seek(self._start + self._at)
        data = self._file.read(max(min(len(buffer), self._size - self._at), 0))
        buffer[: len(data)] = data
        self._at += len(data)
        return len(data)
