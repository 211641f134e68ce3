"""A document in a folder that is written again and again, to get it back after a crash.

    document.json       every choice, and which file holds each array
    SHA256.npy          an array, exactly; masks deflated as SHA256.npy.z
    SHA256.photo        the opened file's own bytes

Files are named by what they hold, so a step writes only what is new in it, and document.json,
which is replaced last and whole: wherever the writing is cut off, the step before is still there.
Hashing, packing and writing leave Python's lock to others, and so may run beside a window.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .document import Document, Photo
from .files import OutputError, write_all
from .image import Picture, encode_picture
from .session_file import build_document
from .session_tree import SessionError, Writer

FORMAT = "objectmorpher recovery"
VERSION = 1
DOCUMENT = "document.json"
ARRAY, PACKED, PHOTO = ".npy", ".npy.z", ".photo"  # endings
UNFINISHED = ".tmp"
LEVEL = 1  # of zlib: masks are deflated, floating-point numbers hardly would be
DIGEST = 64  # characters of a SHA-256


@dataclass
class _Collector(Writer):
    """Leaves every array as it is."""

    def _array(self, array: np.ndarray, path: str) -> dict[str, str]:
        self.arrays[path] = array
        return {"array": path}


@dataclass
class Journal:
    """The folder, and which of its files hold what was written last."""

    folder: Path
    _names: dict[int, tuple[object, str]] = field(default_factory=dict)  # id -> (it, its file)

    def write(self, document: Document, about: dict[str, Any]) -> None:
        """Replaces what the folder holds; `about` are plain values for who looks for it.

        Raises OSError where it cannot be written, SessionError for values beyond numbers.
        """
        collector = _Collector(skipped=(Photo,))
        tree = collector.tree(document, "")
        photo = document.photo
        self.folder.mkdir(parents=True, exist_ok=True)
        kept: dict[int, tuple[object, str]] = {}
        source = self._file(photo.source or photo.picture.pixels, "photo", kept)
        tree["photo"] = {
            "name": photo.name,
            "source": source,
            "camera": collector.tree(photo.camera, "camera"),
        }
        head = {
            "format": FORMAT,
            "version": VERSION,
            "about": about,
            "arrays": {p: self._file(a, p, kept) for p, a in collector.arrays.items()},
            "document": tree,
        }
        text = json.dumps(head, ensure_ascii=False, allow_nan=False)
        write_all({self.folder / DOCUMENT: text.encode()})
        self._names = kept
        self._remove_others({DOCUMENT} | {name for _, name in kept.values()})

    def _file(self, value: object, path: str, kept: dict[int, tuple[object, str]]) -> str:
        """The name of the file that holds an array or the photo; written unless it is there."""
        found = self._names.get(id(value)) or kept.get(id(value))
        if found is None:
            found = (value, self._written(value, path))
        kept[id(value)] = found  # held, so that no other object can get its id
        return found[1]

    def _written(self, value: object, path: str) -> str:
        parts, ending = _parts(value, path)
        digest = hashlib.sha256()
        for piece in parts:
            digest.update(piece)
        target = self.folder / f"{digest.hexdigest()}{ending}"
        if not target.exists():
            if ending == PACKED:
                packer = zlib.compressobj(LEVEL)
                parts = [*[packer.compress(piece) for piece in parts], packer.flush()]
            _write(target, parts)
        return target.name

    def _remove_others(self, names: set[str]) -> None:
        """Earlier steps' arrays, and what was cut off."""
        for path in self.folder.iterdir():
            if path.name not in names and path.name.endswith((ARRAY, PACKED, PHOTO, UNFINISHED)):
                path.unlink(missing_ok=True)


def read_about(folder: Path) -> dict[str, Any]:
    """What the journal says about its document. Raises SessionError."""
    about = _head(folder).get("about")
    return about if isinstance(about, dict) else {}


def read_journal(folder: Path) -> Document:
    """The document, equal to the written one array by array. Raises SessionError."""
    head = _head(folder)
    arrays, tree = head.get("arrays"), head.get("document")
    if not isinstance(arrays, dict) or not isinstance(tree, dict):
        raise SessionError("what was kept of the edit is damaged")
    photo = tree.get("photo")
    source = photo.get("source") if isinstance(photo, dict) else None
    members = {source: _checked(folder, source)} if isinstance(source, str) else {}
    return build_document(tree, members, {p: _array(folder, name) for p, name in arrays.items()})


def _head(folder: Path) -> dict[str, Any]:
    try:
        head = json.loads((folder / DOCUMENT).read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise SessionError("what was kept of the edit is damaged") from error
    if not isinstance(head, dict) or head.get("format") != FORMAT:
        raise SessionError("what was kept of the edit is damaged")
    if head.get("version") != VERSION:
        raise SessionError("what was kept of the edit was written by another version")
    return head


def _array(folder: Path, name: object) -> np.ndarray:
    data = _checked(folder, name)
    try:
        array = np.load(io.BytesIO(data), allow_pickle=False)
    except (ValueError, EOFError, OSError, SyntaxError) as error:
        raise SessionError("what was kept of the edit is damaged: an array is none") from error
    if not isinstance(array, np.ndarray) or not _is_numbers(array):
        raise SessionError("what was kept of the edit is damaged: an array holds no numbers")
    return array


def _checked(folder: Path, name: object) -> bytes:
    """A file's content, which is what its name says."""
    if not isinstance(name, str) or Path(name).name != name:
        raise SessionError("what was kept of the edit is damaged: a file's name is none")
    try:
        data = (folder / name).read_bytes()
        data = zlib.decompress(data) if name.endswith(PACKED) else data
    except (OSError, zlib.error) as error:
        raise SessionError("what was kept of the edit is incomplete") from error
    if hashlib.sha256(data).hexdigest() != name[:DIGEST]:
        raise SessionError("what was kept of the edit is damaged")
    return data


def _is_numbers(array: np.ndarray) -> bool:
    if array.dtype.kind == "f":
        return bool(np.isfinite(array).all())
    return array.dtype.kind in "iub"


def _parts(value: object, path: str) -> tuple[list[bytes | memoryview], str]:
    """What a file holds, in pieces that need no copy, and its ending."""
    if isinstance(value, bytes):
        return [value], PHOTO
    assert isinstance(value, np.ndarray)
    if path == "photo":  # a document that was made from no file
        return [encode_picture(Picture(value), "png")], PHOTO
    if not _is_numbers(value):
        raise SessionError(f"{path} holds values that are not finite and cannot be kept")
    array = np.ascontiguousarray(value).reshape(value.shape)
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, np.lib.format.header_data_from_array_1_0(array))
    plain = array.reshape(-1).view(np.uint8).data
    return [head.getvalue(), plain], PACKED if array.dtype == np.bool_ else ARRAY


def _write(target: Path, parts: Sequence[bytes | memoryview]) -> None:
    """Down to the disk, and under its name only when it is whole."""
    descriptor, name = tempfile.mkstemp(suffix=UNFINISHED, dir=target.parent)
    try:
        with os.fdopen(descriptor, "wb", buffering=0) as file:
            for piece in _pieces(parts):
                if file.write(piece) != len(piece):
                    raise OutputError(f"{target.name} cannot be written: the disk is full")
            os.fsync(file.fileno())
        os.replace(name, target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _pieces(parts: Sequence[bytes | memoryview]) -> Iterator[memoryview]:
    """No longer than what one write takes."""
    step = 1 << 24
    for part in map(memoryview, parts):
        for start in range(0, len(part), step):
            yield part[start : start + step]
