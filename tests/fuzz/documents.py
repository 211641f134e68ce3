"""Readers of documents: sessions, and the folders of the autosave journal."""

from __future__ import annotations

import hashlib
import io
import json
import random
import zipfile
import zlib
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from objectmorpher.canvas.shape import build_ready
from objectmorpher.editor.recovery import _left_in
from objectmorpher_core.document.model import Document, EditObject, LiftSettings, Placement
from objectmorpher_core.pictures.image import Picture, encode_picture
from objectmorpher_core.pipeline import export, lift_mask, open_photo
from objectmorpher_core.session.file import SessionError, decode_session, encode_session
from objectmorpher_core.session.journal import Journal, read_about, read_journal
from tests.core.test_session_file import full_document

from .checks import Reader, check_finite, check_picture, check_same, refusing
from .zips import BROKEN_ZIP, zipped

WIDTH, HEIGHT = 100, 96


def mere_photo() -> Document:
    pixels = np.random.default_rng(5).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    pixels[20:70, 30:80] //= 4
    return open_photo(encode_picture(Picture(pixels), "png"), "ünï.png")


@cache
def undrawn() -> list[Document]:
    """One with something in every field, and a mere photo: quickly made."""
    photo = mere_photo()
    return [full_document(photo.photo.picture, photo.photo.source), photo]


@cache
def documents() -> list[Document]:
    """One that can be drawn."""
    photo = mere_photo()
    pixels = photo.photo.pixels
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[20:70, 30:80] = True
    matte, lifted = lift_mask(pixels, photo.photo.camera, mask, settings=LiftSettings(count=300))
    thing = EditObject("a", mask=mask, matte=matte, lifted=lifted,
                       placement=Placement(move=(5.0, 2.0)))  # fmt: skip
    return [replace(photo, objects=(thing,))]


def session_seeds() -> list[bytes]:
    return [encode_session(document) for document in undrawn()]


def drawn_seeds() -> list[bytes]:
    draw(documents()[0])  # compiles what it needs, before there are limits
    return [encode_session(documents()[0])]


def mend_session(data: bytes) -> bytes:
    """With the members' hashes made right, most of the time."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            infos = archive.infolist()
            if sum(info.file_size for info in infos) > 1 << 23:
                return data
            members = [(info.filename, archive.read(info)) for info in infos]
        head = json.loads(dict(members)["document.json"])
        digests = {n: hashlib.sha256(d).hexdigest() for n, d in members if n != "document.json"}
        if not isinstance(head, dict) or random.Random(len(data)).random() < 0.05:
            return data
        head["sha256"] = digests
        text = json.dumps(head).encode()
    except BROKEN_ZIP:
        return data
    return zipped([(n, text if n == "document.json" else d) for n, d in members])


def read_session(data: bytes, folder: Path) -> None:
    """It opens, and can be saved again."""
    with refusing(SessionError):
        document = decode_session(data)
    check_document(document)
    check_same(decode_session(encode_session(document)), document)


def read_and_draw(data: bytes, folder: Path) -> None:
    """It opens, and is drawn."""
    with refusing(SessionError):
        document = decode_session(data)
    draw(document)


def check_document(document: Document) -> None:
    check_picture(document.photo.picture)
    check_finite(replace(document, photo=None))  # type: ignore[arg-type]


def draw(document: Document) -> None:
    """What opening and exporting do with it; what cannot be drawn is one sentence."""
    with refusing(ValueError), np.errstate(all="ignore"):
        build_ready(document)
        found = export(document)
    check_picture(found)


@cache
def journal_seeds() -> tuple[bytes, ...]:
    import tempfile

    found = []
    for document in undrawn():
        with tempfile.TemporaryDirectory() as at:
            about = {"name": "a", "edited": "2026-01-02T03:04:05", "objects": 1, "path": None,
                     "source": "/x/a.png"}  # fmt: skip
            Journal(Path(at)).write(document, about)
            files = sorted(Path(at).iterdir())
            found.append(zipped([(f.name, f.read_bytes()) for f in files]))
    return tuple(found)


def mend_journal(data: bytes) -> bytes:
    """Files renamed after what they hold, and so in document.json."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(info.file_size for info in archive.infolist()) > 1 << 23:
                return data
            members = [(info.filename, archive.read(info)) for info in archive.infolist()]
    except BROKEN_ZIP:
        return data
    renamed, files = {}, []
    for name, content in members:
        stem, dot, ending = name.partition(".")
        if name != "document.json" and len(stem) == 64:
            plain = content
            if name.endswith(".z"):
                with suppress(zlib.error):
                    plain = zlib.decompressobj().decompress(content, 1 << 23)
            new = hashlib.sha256(plain).hexdigest() + dot + ending
            renamed[name] = new
            name = new
        files.append((name, content))
    out = []
    for name, content in files:
        if name == "document.json":
            for old, new in renamed.items():
                content = content.replace(old.encode(), new.encode())
        out.append((name, content))
    return zipped(out)


def read_folder(data: bytes, folder: Path) -> None:
    """The folder of an editor that crashed."""
    with suppress(*BROKEN_ZIP), zipfile.ZipFile(io.BytesIO(data)) as archive:
        for info in archive.infolist():
            name = Path(info.filename).name
            if info.file_size <= 1 << 22 and name not in ("", "..") and "\0" not in name:
                with suppress(*BROKEN_ZIP):
                    (folder / name).write_bytes(archive.read(info))
    left = _left_in(folder)
    assert left is None or left.problem or left.name is not None
    with refusing(SessionError):
        read_about(folder)
        document = read_journal(folder)
    check_document(document)


def bombs() -> list[bytes]:
    """Packed arrays that unpack to much more."""
    big = zlib.compress(bytes(300 << 20), 9)
    name = hashlib.sha256(bytes(300 << 20)).hexdigest() + ".npy.z"
    with zipfile.ZipFile(io.BytesIO(journal_seeds()[0])) as archive:
        members = [(n, archive.read(n)) for n in archive.namelist()]
    old = next(n for n, _ in members if n.endswith(".z"))
    text = dict(members)["document.json"].replace(old.encode(), name.encode())
    return [zipped([("document.json", text), (name, big),
                    *[m for m in members if m[0] not in ("document.json", old)]])]  # fmt: skip


READERS = [
    Reader("session", session_seeds, read_session, mend_session, share=4),
    Reader("drawn-session", drawn_seeds, read_and_draw, mend_session, share=2),
    Reader("journal", lambda: [*journal_seeds(), *bombs()], read_folder, mend_journal, share=2),
]
