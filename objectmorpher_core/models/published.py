"""The official networks of measures: the user's files, and their verification.

No package that we may fetch from carries them. They are published under names that end in the first
digits of their SHA-256, so that a file can be told from another.
"""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ..base.files import make_folder, place_file
from .fetch import UNFINISHED, folder, sha256_of
from .registry import ModelError, Trunk, trunk
from .weight_folder import PLAIN

FOLDER = "evaluation"  # among the models in the cache

_hashes: dict[tuple[str, int, int], str] = {}  # (path, bytes, mtime ns) -> sha256


@dataclass(frozen=True)
class TrunkState:
    """The state of a network."""

    trunk: Trunk
    path: Path  # where it is, or would be
    state: Literal["ok", "missing", "damaged"]
    reason: str = ""  # why it is damaged


def trunk_folder() -> Path:
    """Return the folder of the files unless another one is given."""
    return folder() / FOLDER


def find_file(names: tuple[str, ...], where: Path) -> Path | None:
    """The first of the published names that is in a folder, or the same tensors as safetensors."""
    for name in names:
        for path in (where / name, (where / name).with_suffix(PLAIN)):
            if path.is_file():
                return path
    return None


def look_trunk(id: str) -> TrunkState:
    """Return the state of network `id`; a file is hashed once in a process."""
    known = trunk(id)
    found = find_file(known.files, trunk_folder())
    if found is None:
        return TrunkState(known, trunk_folder() / known.files[0], "missing")
    try:
        check_published(known, found)
    except ModelError as error:
        return TrunkState(known, found, "damaged", str(error))
    return TrunkState(known, found, "ok")


def check_published(known: Trunk, path: Path) -> None:
    """Raises ModelError where the file is not what its name says; safetensors are not known."""
    if path.suffix == PLAIN:
        return
    begins, sha256 = known.hash_of(path.name), hash_once(path)
    if not sha256.startswith(begins):
        told = f"its SHA-256 starts with {sha256[: len(begins)]}, not {begins}"
        raise ModelError(f"{path} is not {known.name} as published: {told}")


def add_trunk(id: str, source: Path) -> TrunkState:
    """Keeps a copy of the user's file under its published name, whatever it is called.

    Raises ModelError: one sentence, and nothing has changed.
    """
    known = trunk(id)
    try:
        sha256 = sha256_of(source)
        name = next((n for n in known.files if sha256.startswith(known.hash_of(n))), None)
        if name is None:
            begins = " or ".join(dict.fromkeys(known.hash_of(n) for n in known.files))
            told = f"its SHA-256 starts with {sha256[:8]}, not {begins}"
            raise ModelError(f"{source.name} is not {known.name} as published: {told}")
        where = trunk_folder()
        make_folder(where)
        with tempfile.TemporaryDirectory(  # what it cannot clean up is removed later
            dir=where, prefix=UNFINISHED, ignore_cleanup_errors=True
        ) as scratch:
            shutil.copyfile(source, Path(scratch) / name)
            place_file(Path(scratch) / name, where / name)
    except OSError as error:
        raise ModelError(f"{source.name} cannot be added: {error.strerror or error}") from error
    return look_trunk(id)


def remove_trunk(id: str) -> None:
    """Deletes what is there of it. Raises ModelError."""
    while (found := find_file(trunk(id).files, trunk_folder())) is not None:
        try:
            found.unlink()
        except OSError as error:
            raise ModelError(f"{found} cannot be removed: {error.strerror or error}") from error


def hash_once(path: Path) -> str:
    """The SHA-256 of a file, computed once in a process. Raises ModelError."""
    try:
        found = path.stat()
        key = (str(path), found.st_size, found.st_mtime_ns)
        if key not in _hashes:
            _hashes[key] = sha256_of(path)
    except OSError as error:
        raise ModelError(f"{path} cannot be read: {error.strerror or error}") from error
    return _hashes[key]
