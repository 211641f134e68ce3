"""Files that are written whole or not at all; everything that is written goes through here.

A file is written under a temporary name in its own folder, down to the disk, renamed, and the
folder is brought down to the disk, too. Whatever fails in between, and wherever the power is cut,
the file is the old one or the new one. (docs/reliability-tests.md tells how that is tested.)
"""

from __future__ import annotations

import contextlib
import os
import stat
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from .limits import FILE_BYTES

UNFINISHED = ".unfinished"  # ending of what is being written
STALE = 3600.0  # s; an unfinished file older than this belongs to a process that died
PIECE = 1 << 24  # bytes that one write takes
NAMED = 50  # characters of a file's name that the temporary one has, too

Parts = Iterable[bytes | memoryview]


class InputError(ValueError):
    """The file is none that can be read; one sentence."""


class OutputError(OSError):
    """An output cannot be written; one sentence. Nothing was changed."""


def write_all(outputs: Mapping[Path, bytes | Parts]) -> None:
    """Writes every output, or none: existing files stay as they are where one cannot be written.

    What is large may come in parts.

    Each goes to a temporary file in its own folder, down to the disk, and all are renamed at the
    end. An existing file's permissions are kept, and a link is followed rather than replaced.
    Raises OutputError.
    """
    written: list[tuple[Path, Path]] = []  # (temporary, target)
    try:
        for path, data in outputs.items():
            try:
                target = _checked_target(path)
                _remove_stale(target)
                parts = [data] if isinstance(data, bytes) else data
                written.append((_write_beside(target, parts), target))
            except OutputError:
                raise
            except (OSError, ValueError) as error:  # ValueError: a name with a zero in it
                raise OutputError(f"{path} cannot be written: {reason_of(error)}") from error
        if written:
            _rename_all(written)
    finally:
        for temporary, _ in written:
            _discard(temporary)


def read_input(path: Path) -> bytes:
    """A file that the user names, if it ends, and is no larger than FILE_BYTES.

    Raises InputError for what is none, or too large; OSError.
    """
    about = path.stat()
    if not (stat.S_ISREG(about.st_mode) or stat.S_ISFIFO(about.st_mode) or path.is_dir()):
        raise InputError(f"{path} is no file")
    if about.st_size > FILE_BYTES:
        raise InputError(
            f"{path} is {about.st_size / (1 << 30):.1f} GiB, more than the {FILE_BYTES >> 30} GiB "
            "that can be opened"
        )
    return path.read_bytes()


def write_new(target: Path, parts: Parts, mode: int | None = None) -> None:
    """Writes one file from pieces that are not joined; it may have permissions of its own.

    A link in its place is replaced. The folder is not synced: see `sync_folder`. Raises OSError.
    """
    temporary = _write_beside(target, parts, mode)
    try:
        os.replace(temporary, target)
    except BaseException:
        _discard(temporary)
        raise


def place_file(source: Path, target: Path) -> None:
    """Moves a file that is complete into its place on the same disk, for good. Raises OSError."""
    with source.open("rb+") as file:
        os.fsync(file.fileno())
    os.replace(source, target)
    sync_folder(target.parent)


def make_folder(folder: Path) -> None:
    """Makes a folder and those above it, so that they survive a power cut. Raises OSError."""
    missing = []
    while not folder.is_dir():
        missing.append(folder)
        folder = folder.parent
    for new in reversed(missing):
        new.mkdir(exist_ok=True)
        sync_folder(new.parent)


def sync_folder(folder: Path) -> None:
    """Makes the names in it survive a power cut, where the system can."""
    if sys.platform == "win32":
        return
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _checked_target(path: Path) -> Path:
    """The file that `path` means, links followed. Raises OutputError, OSError."""
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise OutputError(f"{path} is a folder, not a file")
    if not target.parent.is_dir():
        raise OutputError(f"{path} cannot be written: the folder {path.parent} does not exist")
    if target.exists() and not os.access(target, os.W_OK):
        raise OutputError(f"{path} cannot be written: it is write-protected")
    return target


def _write_beside(target: Path, parts: Parts, mode: int | None = None) -> Path:
    """A temporary file in the target's folder that holds the parts, safely on the disk."""
    descriptor, name = tempfile.mkstemp(UNFINISHED, _prefix(target), target.parent)
    try:
        with os.fdopen(descriptor, "wb", buffering=0) as file:
            for piece in _pieces(parts):
                rest = piece
                while rest:  # a disk may take less than it is given
                    rest = rest[file.write(rest) :]
            if mode is None:
                mode = target.stat().st_mode if target.exists() else 0o666 & ~_umask()
            os.chmod(name, mode & 0o7777)
            os.fsync(file.fileno())
    except BaseException:
        _discard(Path(name))
        raise
    return Path(name)


def _pieces(parts: Parts) -> Iterator[memoryview]:
    """No longer than what one write takes."""
    for part in map(memoryview, parts):
        for start in range(0, len(part), PIECE):
            yield part[start : start + PIECE]


def _prefix(target: Path) -> str:
    return f".{target.name[:NAMED]}."


def _remove_stale(target: Path) -> None:
    """What a process that was killed has left of this file."""
    with contextlib.suppress(OSError):
        for entry in os.scandir(target.parent):
            is_ours = entry.name.startswith(_prefix(target)) and entry.name.endswith(UNFINISHED)
            if is_ours and time.time() - entry.stat(follow_symlinks=False).st_mtime > STALE:
                _discard(Path(entry.path))


def _discard(path: Path) -> None:
    """What cannot be removed is hidden, and harms nobody."""
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)


def _rename_all(written: list[tuple[Path, Path]]) -> None:
    """Every temporary file becomes its target; where a rename fails, those before are undone."""
    olds: dict[Path, Path] = {}  # target -> second name of the file that was there
    renamed: list[Path] = []
    target = written[0][1]
    try:
        for _, target in written if len(written) > 1 else ():
            if target.exists():
                olds[target] = _second_name(target)
        for temporary, target in written:
            os.replace(temporary, target)
            renamed.append(target)
    except OSError as error:
        told = f"{target} cannot be written: {reason_of(error)}"
        for changed, old in _bring_back(renamed, olds):
            told += f"; {changed} has changed already"
            told += f", what it was is in {old.name}" if old is not None else ""
        raise OutputError(told) from error
    finally:
        for old in olds.values():
            _discard(old)
    for folder in {target.parent for _, target in written}:
        sync_folder(folder)


def _bring_back(renamed: list[Path], olds: dict[Path, Path]) -> Iterator[tuple[Path, Path | None]]:
    """Undoes renames; reports those that the disk keeps, whose old files stay then."""
    for done in renamed:
        old = olds.get(done)
        try:
            if old is not None:
                os.replace(old, done)
            else:
                done.unlink()
        except OSError:
            yield done, olds.pop(done, None)


def _second_name(target: Path) -> Path:
    """The existing file under another name in its folder, to bring it back. Raises OSError."""
    descriptor, name = tempfile.mkstemp(".old", _prefix(target), target.parent)
    os.close(descriptor)
    os.unlink(name)
    try:
        os.link(target, name)
    except OSError:  # a file system without hard links: a copy costs time but is as safe
        return _write_beside(target, [target.read_bytes()])
    return Path(name)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def reason_of(error: OSError | ValueError) -> str:
    """Why, as the end of a sentence."""
    return (getattr(error, "strerror", None) or str(error)).lower()
