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
import zlib
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import all_finite
from ..base.files import UNFINISHED, make_folder, sync_folder, write_all, write_new
from ..base.limits import SESSION_UNPACKED as MAX_BYTES
from ..document.model import Document, Photo
from ..pictures.image import MAX_PIXELS, Picture, encode_picture
from .file import build_document
from .tree import ArrayError, SessionError, TreeWriter, encode_tree, read_npy

FORMAT = "objectmorpher recovery"
VERSION = 1
DOCUMENT = "document.json"
ARRAY, PACKED, PHOTO = ".npy", ".npy.z", ".photo"  # endings
OWN = (ARRAY, PACKED, PHOTO, UNFINISHED)
LEVEL = 1  # of zlib: masks are deflated, floating-point numbers hardly would be
MAX_MASK = MAX_PIXELS + 128  # bytes: a mask and its header
DIGEST = 64  # characters of a SHA-256


@dataclass
class _Collector(TreeWriter):
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
        make_folder(self.folder)
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
        text = encode_tree(head)
        sync_folder(self.folder)  # the arrays' names first: a power cut may turn their order round
        write_all({self.folder / DOCUMENT: text})
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
            write_new(target, parts)
        return target.name

    def _remove_others(self, names: set[str]) -> None:
        """Earlier steps' arrays, and what was cut off."""
        with suppress(OSError):  # they are in nobody's way, and go with the folder
            for path in self.folder.iterdir():
                if path.name not in names and path.name.endswith(OWN):
                    path.unlink(missing_ok=True)


def read_about(folder: Path) -> dict[str, Any]:
    """Read the journal's summary of its document. Raises SessionError."""
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
        return read_npy(data)
    except ArrayError as error:
        raise SessionError(f"what was kept of the edit is damaged: a file is {error}") from error


def _checked(folder: Path, name: object) -> bytes:
    """A file's content, which is what its name says."""
    if not isinstance(name, str) or Path(name).name != name:
        raise SessionError("what was kept of the edit is damaged: a file's name is none")
    try:
        at = folder / name
        if at.is_symlink() or not at.is_file() or at.stat().st_size > MAX_BYTES:
            raise SessionError("what was kept of the edit is incomplete")
        data = at.read_bytes()
        data = _unpacked(data) if name.endswith(PACKED) else data
    except (OSError, ValueError, zlib.error) as error:  # ValueError: a name with a zero in it
        if isinstance(error, SessionError):
            raise
        raise SessionError("what was kept of the edit is incomplete") from error
    if hashlib.sha256(data).hexdigest() != name[:DIGEST]:
        raise SessionError("what was kept of the edit is damaged")
    return data


def _unpacked(data: bytes) -> bytes:
    """A packed mask; a bomb is unpacked no further than a mask can be long. Raises zlib.error."""
    packer = zlib.decompressobj()
    plain = packer.decompress(data, MAX_MASK)
    if not packer.eof:
        raise zlib.error("it ends early, or goes on for too long")
    return plain


def _is_numbers(array: np.ndarray) -> bool:
    if array.dtype.kind == "f":
        return all_finite(array)
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
