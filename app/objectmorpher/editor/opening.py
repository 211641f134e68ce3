"""Reads what the user opens: a photo or a session; everything else is a sentence."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

from objectmorpher_core.base.arrays import RGB
from objectmorpher_core.base.limits import FILE_BYTES as MAX_BYTES
from objectmorpher_core.base.progress import Progress
from objectmorpher_core.document.model import Document
from objectmorpher_core.pictures.formats import READABLE

SESSION_ENDING = ".omorph"
PHOTO_ENDINGS = READABLE
OBJECT_ENDINGS = (".ply", ".splat", ".spz", ".obj", ".glb", ".gltf", ".stl", ".off")
ZIP_MAGIC = b"PK\x03\x04"
BLOCK = 1 << 24  # bytes read at a time


class OpeningError(ValueError):
    """The file cannot be opened; one sentence."""


@dataclass(frozen=True, eq=False)
class OpenedFile:
    """The contents of an opened file."""

    document: Document
    is_session: bool


def is_object(path: Path) -> bool:
    """Whether the file's name is that of a 3D object."""
    return path.suffix.lower() in OBJECT_ENDINGS


def read_document(path: Path, fov: float | None, seed: int, progress: Progress) -> OpenedFile:
    """The document in a file; `fov` (degrees) and `seed` are for photos. Raises OpeningError."""
    if path.is_dir():
        raise OpeningError(f"{path.name} is a folder; choose a photo in it")
    if is_object(path):
        raise OpeningError(
            f"{path.name} is a 3D object: open a photo, select what it stands for, then drop it"
        )
    try:
        _check(path)
        with path.open("rb") as file:
            if file.read(len(ZIP_MAGIC)) == ZIP_MAGIC:
                from objectmorpher_core.session.file import read_session

                progress(0.1, "")
                return OpenedFile(read_session(file), is_session=True)
        data = _read(path, progress)
        progress(0.35, "")
        return read_photo(data, path.name, fov, seed)
    except OpeningError:
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise OpeningError(f"{path.name} cannot be opened: {reason}") from error
    except MemoryError as error:
        raise OpeningError(f"{path.name} does not fit into the memory") from error
    except ValueError as error:
        raise OpeningError(f"{path.name} cannot be opened: {error}") from error


def read_photo(data: bytes, name: str, fov: float | None, seed: int) -> OpenedFile:
    """A new document of a photo, the bytes of its file. Raises OpeningError."""
    from objectmorpher_core.pipeline import open_photo

    try:
        return OpenedFile(open_photo(data, name, fov=fov, seed=seed), is_session=False)
    except MemoryError as error:
        raise OpeningError(f"{name} does not fit into the memory") from error
    except ValueError as error:
        raise OpeningError(f"{name} cannot be opened: {error}") from error


def _check(path: Path) -> None:
    """It is a file that ends, and not too large. Raises OpeningError, OSError."""
    size = path.stat().st_size
    if not path.is_file():
        raise OpeningError(f"{path.name} is no file")
    if size > MAX_BYTES:
        raise OpeningError(
            f"{path.name} is {size / (1 << 30):.1f} GiB, more than the {MAX_BYTES >> 30} GiB "
            "that can be opened"
        )


def _read(path: Path, progress: Progress) -> bytes:
    """The file's bytes."""
    size, parts = path.stat().st_size, []
    with path.open("rb") as file:
        while block := file.read(BLOCK):
            parts.append(block)
            progress(0.3 * min(len(parts) * BLOCK / max(size, 1), 1.0), "")
    return b"".join(parts)


# Small pictures of files, for the list in which one is chosen.

THUMB = 128  # px, longer side
MOST_BYTES = 1 << 28  # of a file that is read for it
JPEG = b"\xff\xd8\xff"


def read_thumbnail(path: Path) -> RGB | None:
    """Return the photo of a file or session, at most `THUMB` px; None of what is no picture."""
    from objectmorpher_core.session.zip import Zip

    try:
        if path.stat().st_size > MOST_BYTES:
            return None
        if path.suffix.lower() != SESSION_ENDING:
            return _shrunk(path.read_bytes())
        with path.open("rb") as file, Zip(file, "session") as archive:
            name = next((name for name in archive.names if name.startswith("photo/")), None)
            return None if name is None else _shrunk(archive.read(name, MOST_BYTES))
    except Exception:  # Pillow raises whatever a broken file makes it stumble over
        return None


def _shrunk(data: bytes) -> RGB:
    """A picture file's pixels; a JPEG is decoded at a fraction of its size."""
    import numpy as np
    from PIL import Image, ImageOps

    from objectmorpher_core.pictures.image import at_most, read_picture, to_u8

    if data.startswith(JPEG):
        with Image.open(io.BytesIO(data), formats=["JPEG"]) as image:
            image.draft("RGB", (2 * THUMB, 2 * THUMB))
            return at_most(np.array(ImageOps.exif_transpose(image).convert("RGB")), THUMB)
    return to_u8(at_most(read_picture(data).pixels, THUMB))
