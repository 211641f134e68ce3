"""The files beside a mesh: its textures and buffers, never one of another folder or the net."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PureWindowsPath
from urllib.parse import unquote

from ...base.limits import MESH_ASSET as MAX_ASSET
from ...base.quoting import named
from ..limits import SplatFileError


class MeshFolder:
    """Resolves the names in a mesh file, as trimesh asks for them.

    A name that leads out of the folder is refused, unless a file of that name lies in the folder:
    material files often carry whole paths of the machine that they were made on. What was
    refused or missing is remembered, since a loader may go on without.
    """

    def __init__(self, mesh: Path) -> None:
        self._folder = mesh.resolve().parent
        self.refused: list[str] = []
        self.missing: list[str] = []

    def get(self, name: str) -> bytes:
        """The bytes of the file. Raises SplatFileError."""
        path = self.find(name)
        if path.stat().st_size > MAX_ASSET:
            raise SplatFileError(f"{named(path.name)} is larger than {MAX_ASSET >> 20} MiB")
        return path.read_bytes()

    def find(self, name: str) -> Path:
        """Return the path of the file. Raises SplatFileError."""
        name = str(name).strip()
        is_outside = "://" in name
        for candidate in () if is_outside else (name, unquote(name), PureWindowsPath(name).name):
            try:
                path = (self._folder / candidate).resolve()
                if not path.is_relative_to(self._folder):
                    is_outside = True
                elif path.is_file():
                    return path
            except (OSError, ValueError):  # a name that no file system takes
                continue
        if is_outside:
            self.refused.append(name)
            raise SplatFileError(f"the mesh names a file outside its folder: {name[:80]!r}")
        self.missing.append(name)
        raise SplatFileError(f"a file that the mesh names is missing: {name[:80]!r}")

    def __getitem__(self, name: str) -> bytes:
        return self.get(name)

    def __contains__(self, name: str) -> bool:
        try:
            return self.find(name).is_file()
        except SplatFileError:
            return False

    def keys(self) -> Iterator[str]:
        return (path.name for path in self._folder.iterdir() if path.is_file())

    def namespaced(self, namespace: str) -> MeshFolder:
        return self
