"""Weights that the user brings as a file: no package that we know carries them.

A file is tried before it is kept, and copied beside the fetched ones, with a note of what it was
called and its hash.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ..base.files import make_folder, place_file
from ..base.limits import FILE_BYTES as BYTES
from .fetch import UNFINISHED, folder, sha256_of
from .registry import ModelError

NOTE = ".json"  # ending of the note beside a file


@dataclass(frozen=True)
class AddedKind:
    """A kind of file that a user can add."""

    id: str
    file: str  # name in the cache folder
    purpose: str
    example: str  # a network that fits


KINDS = (
    AddedKind(
        "depth", "depth.onnx", "the depth of a lifted object's front, where the outline tells none",
        "an ONNX export of Depth-Anything-V2-Small (Apache-2.0)",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Added:
    """The cache's state of a kind."""

    kind: AddedKind
    path: Path  # where it is, or would be
    state: Literal["ok", "missing", "damaged"]
    name: str = ""  # of the user's file
    size: int = 0  # bytes
    sha256: str = ""  # hexadecimal


_looked: dict[tuple[str, int, int, str], bool] = {}  # path, bytes, mtime ns, hash -> it is right


def kind(id: str) -> AddedKind:
    """The kind called `id`; raises ModelError with the known names."""
    for known in KINDS:
        if known.id == id:
            return known
    names = ", ".join(known.id for known in KINDS)
    raise ModelError(f"a file cannot be added as {id!r}; it can be as {names}")


def added(id: str) -> Added:
    """Return the state of kind `id`; the file is hashed once in a process."""
    own = kind(id)
    at = folder() / own.file
    try:
        found = at.stat()
        notes = _notes(at.with_suffix(NOTE))
    except FileNotFoundError:
        return Added(own, at, "damaged" if at.exists() else "missing")
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return Added(own, at, "damaged")
    for name, sha256 in notes:
        key = (str(at), found.st_size, found.st_mtime_ns, sha256)
        try:
            if key not in _looked:
                _looked[key] = sha256_of(at) == sha256
        except OSError:
            return Added(own, at, "damaged", name, found.st_size, sha256)
        if _looked[key]:
            return Added(own, at, "ok", name, found.st_size, sha256)
    return Added(own, at, "damaged", notes[0][0], found.st_size, notes[0][1])


def _notes(at: Path) -> list[tuple[str, str]]:
    """Name and hash of the file, and of the one that was there before it."""
    said = json.loads(at.read_text(encoding="utf-8"))
    both = [said, *([said["before"]] if "before" in said else [])]
    return [(str(one["name"]), str(one["sha256"])) for one in both]


def add(id: str, source: Path) -> Added:
    """Keeps a copy of the user's file. Raises ModelError: one sentence, and nothing has changed."""
    own = kind(id)
    try:
        if source.stat().st_size > BYTES:
            raise ModelError(f"{source.name} is larger than {BYTES >> 30} GB")
        where, before = folder(), added(id)
        make_folder(where)
        with tempfile.TemporaryDirectory(  # what it cannot clean up is removed later
            dir=where, prefix=UNFINISHED, ignore_cleanup_errors=True
        ) as scratch:
            (Path(scratch) / "copy").mkdir()
            copy, note = Path(scratch) / "copy" / source.name, Path(scratch) / "note"
            shutil.copyfile(source, copy)
            CHECKS[id](copy)  # not the source: its weights may lie in a second file beside it
            said: dict[str, object] = {"name": source.name, "sha256": sha256_of(copy)}
            if before.state == "ok":  # which is still there until the copy takes its place
                said["before"] = {"name": before.name, "sha256": before.sha256}
            note.write_text(json.dumps(said), encoding="utf-8")
            place_file(note, (where / own.file).with_suffix(NOTE))
            place_file(copy, where / own.file)
    except OSError as error:
        raise ModelError(f"{source.name} cannot be added: {error.strerror or error}") from error
    return added(id)


def remove(id: str) -> None:
    """Remove the file as if it had never been added. Raises ModelError."""
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
