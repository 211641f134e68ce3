"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path


class OutputError(OSError):
    """An output cannot be written; one sentence. Nothing was changed."""


def write_all(outputs: Mapping[Path, bytes]) -> None:
    """Writes every output, or none: existing files stay as they are where one cannot be written.

    Each goes to a temporary file in its own folder, down to the disk, and all are renamed at the
    end. An existing file's permissions are kept, and a link is followed rather than replaced.
    Raises OutputError.
    """
    written: list[tuple[Path, Path]] = []  # (temporary, target)
    try:
        for path, data in outputs.items():
            target = Path(os.path.realpath(path))
            _check_target(path, target)
            try:
                written.append((_write_beside(target, data), target))
            except OSError as error:
                raise OutputError(f"{path} cannot be written: {_reason(error)}") from error
        if written:
            _rename_all(written)
    finally:
        for temporary, _ in written:
            temporary.unlink(missing_ok=True)


def _check_target(path: Path, target: Path) -> None:
    if target.is_dir():
        raise OutputError(f"{path} is a folder, not a file")
    if not target.parent.is_dir():
        raise OutputError(f"{path} cannot be written: the folder {path.parent} does not exist")
    if target.exists() and not os.access(target, os.W_OK):
        raise OutputError(f"{path} cannot be written: it is write-protected")


def _write_beside(target: Path, data: bytes) -> Path:
    """A temporary file in the target's folder that holds `data`, safely on the disk."""
    descriptor, name = tempfile.mkstemp(prefix=f".{target.name[:50]}.", dir=target.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, target.stat().st_mode if target.exists() else 0o666 & ~_umask())
    except BaseException:
        os.unlink(name)
        raise
    return Path(name)


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
        for done in renamed:
            os.replace(olds[done], done) if done in olds else done.unlink()
        raise OutputError(f"{target} cannot be written: {_reason(error)}") from error
    finally:
        for old in olds.values():
            old.unlink(missing_ok=True)
    for folder in {target.parent for _, target in written}:
        _sync_folder(folder)


def _second_name(target: Path) -> Path:
    """The existing file under another name in its folder, to bring it back."""
    descriptor, name = tempfile.mkstemp(prefix=f".{target.name[:50]}.old.", dir=target.parent)
    os.close(descriptor)
    os.unlink(name)
    try:
        os.link(target, name)
    except OSError:  # a file system without hard links: a copy costs time but is as safe
        Path(name).write_bytes(target.read_bytes())
    return Path(name)


def _sync_folder(folder: Path) -> None:
    """Makes the new names survive a power cut, where the system can."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
