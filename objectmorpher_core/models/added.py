"""Weights that the user brings as a file: no package that we know carries them.

A file is tried before it is kept, and copied beside the fetched ones, with a note of what it was
called and its hash.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from .fetch import UNFINISHED, folder, sha256_of
from .registry import ModelError

BYTES = 4 << 30  # largest file that is taken
NOTE = ".json"  # ending of the note beside a file


@dataclass(frozen=True)
class Kind:
    """What a user's file can be."""

    id: str
    file: str  # name in the cache folder
    purpose: str
    example: str  # a network that fits


KINDS = (
    Kind(
        "depth", "depth.onnx", "the depth of a lifted object's front, where the outline tells none",
        "an ONNX export of Depth-Anything-V2-Small (Apache-2.0)",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Added:
    """What the cache holds of a kind."""

    kind: Kind
    path: Path  # where it is, or would be
    state: Literal["ok", "missing", "damaged"]
    name: str = ""  # of the user's file
    size: int = 0  # bytes
    sha256: str = ""  # hexadecimal


_looked: dict[tuple[str, int, int, str], bool] = {}  # path, bytes, mtime ns, hash -> it is right


def kind(id: str) -> Kind:
    """The kind called `id`; raises ModelError with the known names."""
    for known in KINDS:
        if known.id == id:
            return known
    names = ", ".join(known.id for known in KINDS)
    raise ModelError(f"a file cannot be added as {id!r}; it can be as {names}")


def added(id: str) -> Added:
    """What is there of kind `id`; the file is hashed once in a process."""
    own = kind(id)
    at = folder() / own.file
    try:
        found = at.stat()
        said = json.loads(at.with_suffix(NOTE).read_text(encoding="utf-8"))
        name, sha256 = str(said["name"]), str(said["sha256"])
    except FileNotFoundError:
        return Added(own, at, "damaged" if at.exists() else "missing")
    except (OSError, ValueError, KeyError, TypeError):
        return Added(own, at, "damaged")
    key = (str(at), found.st_size, found.st_mtime_ns, sha256)
    if key not in _looked:
        _looked[key] = sha256_of(at) == sha256
    return Added(own, at, "ok" if _looked[key] else "damaged", name, found.st_size, sha256)


def add(id: str, source: Path) -> Added:
    """Keeps a copy of the user's file. Raises ModelError: one sentence, and nothing has changed."""
    own = kind(id)
    try:
        if source.stat().st_size > BYTES:
            raise ModelError(f"{source.name} is larger than {BYTES >> 30} GB")
        where = folder()
        where.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=where, prefix=UNFINISHED) as scratch:
            (Path(scratch) / "copy").mkdir()
            copy, note = Path(scratch) / "copy" / source.name, Path(scratch) / "note"
            shutil.copyfile(source, copy)
            CHECKS[id](copy)  # not the source: its weights may lie in a second file beside it
            said = {"name": source.name, "sha256": sha256_of(copy)}
            note.write_text(json.dumps(said), encoding="utf-8")
            os.replace(copy, where / own.file)
            os.replace(note, (where / own.file).with_suffix(NOTE))
    except OSError as error:
        raise ModelError(f"{source.name} cannot be added: {error.strerror or error}") from error
    return added(id)


def remove(id: str) -> None:
    """As if it had never been added. Raises ModelError."""
    at = folder() / kind(id).file
    try:
        at.with_suffix(NOTE).unlink(missing_ok=True)
        at.unlink(missing_ok=True)
    except OSError as error:
        raise ModelError(f"{at} cannot be removed: {error.strerror or error}") from error


def _check_depth(path: Path) -> None:
    from .depth_net import DepthNet

    DepthNet(path).check()


CHECKS: dict[str, Callable[[Path], None]] = {"depth": _check_depth}  # raise ModelError
