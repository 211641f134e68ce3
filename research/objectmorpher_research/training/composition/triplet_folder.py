"""The triplets of a folder of shards, as the training reads them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from objectmorpher_core.base.arrays import RGB
from objectmorpher_core.pictures.image import ImageError, read_picture, to_u8

from . import TrainingError
from .shards import PICTURES, PLAN, SHARD, read_json


@dataclass(frozen=True)
class Stored:
    """A triplet on the disk."""

    name: str
    folder: Path

    def file(self, picture: str) -> Path:
        """Return the file of one of PICTURES."""
        return self.folder / f"{self.name}.{picture}.png"

    def read(self) -> tuple[RGB, RGB, RGB]:
        """B (H', W', 3), coarse A and A (H, W, 3). Raises TrainingError."""
        try:
            b, coarse, a = (to_u8(read_picture(self._bytes(p)).pixels) for p in PICTURES)
        except ImageError as error:
            raise TrainingError(f"{self.folder / self.name}: {error}") from error
        if coarse.shape != a.shape:
            raise TrainingError(f"{self.folder / self.name}: coarse edit and A differ in size")
        return b, coarse, a

    @cached_property
    def content(self) -> str:
        """SHA-256 of its pictures' files."""
        return hashlib.sha256(b"".join(self._hashes)).hexdigest()

    @property
    def photographed(self) -> frozenset[bytes]:
        """SHA-256 of the files of B and A, which other triplets may show as well."""
        b, _, a = self._hashes
        return frozenset((b, a))

    @cached_property
    def _hashes(self) -> tuple[bytes, ...]:
        return tuple(hashlib.sha256(self._bytes(picture)).digest() for picture in PICTURES)

    def _bytes(self, picture: str) -> bytes:
        at = self.file(picture)
        try:
            return at.read_bytes()
        except OSError as error:
            raise TrainingError(f"{at} cannot be read: {error.strerror or error}") from error


def triplets_in(folder: Path) -> tuple[Stored, ...]:
    """Return all triplets in the order of shards and pairs. Raises TrainingError."""
    if not (folder / PLAN).is_file():
        raise TrainingError(f"{folder} holds no triplets: make some by `objectmorpher train pairs`")
    found = [
        Stored(str(name), at.parent)
        for at in sorted(folder.glob(f"shard-*/{SHARD}"))
        for name in _made(at)
    ]
    if not found:
        raise TrainingError(f"no triplet of {folder} was good enough: see its {SHARD} files")
    return tuple(found)


def _made(at: Path) -> list[object]:
    """Names of a shard's triplets. Raises TrainingError."""
    made = read_json(at).get("made")
    if not isinstance(made, list):
        raise TrainingError(f"{at} does not say which triplets were made")
    return made
