"""3D objects in and out of files, a format a file; here they are chosen by the ending.

Gaussians are in our axes on this side (x right, y down, z away from the viewer): what a format's
own are is in docs/formats.md and in the format's module, nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..base.limits import FILE_BYTES as MAX_BYTES
from ..base.quoting import named
from ..document.gaussians import Gaussians
from .limits import SplatFileError
from .splats.compressed_ply import (
    decode_compressed,
    encode_compressed,
    is_compressed,
    read_compressed,
)
from .splats.ply import (
    decode_ply,
    encode_ply,
    half_turned,
    is_mere_points,
    read_header,
    read_ply,
    read_points,
)
from .splats.splat import decode_splat, encode_splat
from .splats.spz import decode_spz, encode_spz

__all__ = [
    "COUNT",
    "FORMATS",
    "MESH_ENDINGS",
    "SPLAT_ENDINGS",
    "SplatFileError",
    "SplatFormat",
    "encode",
    "ending_of",
    "is_mesh",
    "read",
    "read_object",
]  # fmt: skip

COUNT = 20_000  # Gaussians that a mesh is sampled to


@dataclass(frozen=True)
class SplatFormat:
    """A format of Gaussians: its bytes to Gaussians in our axes and back."""

    name: str
    decode: Callable[[bytes], Gaussians]
    encode: Callable[[Gaussians], bytes]


FORMATS = {  # the longer ending first
    ".compressed.ply": SplatFormat("compressed 3DGS .ply", decode_compressed, encode_compressed),
    ".ply": SplatFormat("3DGS .ply", decode_ply, encode_ply),
    ".splat": SplatFormat(".splat", decode_splat, encode_splat),
    ".spz": SplatFormat(".spz", decode_spz, encode_spz),
}
SPLAT_ENDINGS = tuple(FORMATS)
MESH_ENDINGS = (".glb", ".gltf", ".obj", ".stl", ".off")  # read only; a .ply may be one, too


def ending_of(path: Path) -> str:
    """Return the ending that names the format, lower case. Raises SplatFileError."""
    name = path.name.lower()
    for ending in (*FORMATS, *MESH_ENDINGS):
        if name.endswith(ending):
            return ending
    known = " ".join((*FORMATS, *MESH_ENDINGS))
    raise SplatFileError(f"{named(path.name)} has none of the endings {known}")


def encode(gaussians: Gaussians, path: Path) -> bytes:
    """The bytes of a file of that name. Raises SplatFileError for what its format cannot hold."""
    ending = ending_of(path)
    if ending not in FORMATS:
        raise SplatFileError(
            f"{named(path.name)}: Gaussians cannot be written as {ending}; {' '.join(FORMATS)} can"
        )
    return FORMATS[ending].encode(gaussians)


def read(path: Path, count: int = COUNT, is_flipped: bool = False) -> Gaussians:
    """Read all Gaussians of the file in our axes; a mesh is sampled to about `count` of them.

    With `is_flipped` turned by 180 degrees about x: for a file that does not keep to its format's
    axes. Raises SplatFileError, one sentence that names the file.
    """
    ending = ending_of(path)
    try:
        _check_file(path)
        if is_mesh(path):
            from .meshes.reader import read_mesh

            gaussians = read_mesh(path, count)
        elif ending.endswith(".ply"):
            gaussians = _read_ply(path)
        else:
            gaussians = FORMATS[ending].decode(path.read_bytes())
    except SplatFileError as error:
        raise SplatFileError(f"{named(path.name)}: {error}") from error
    return half_turned(gaussians) if is_flipped else gaussians


def read_object(path: Path, count: int = COUNT, is_flipped: bool = False) -> Gaussians:
    """The file's object in the object frame: centred, largest extent 1, the right way up.

    Local +z is the thinnest axis and points outwards, as the document's Gaussians have it. What a
    training left floating around it is left out; of a mesh everything belongs to it.
    Raises SplatFileError.
    """
    from .splats.objects import as_object, centred

    gaussians = read(path, count, is_flipped)
    try:
        return centred(gaussians) if is_mesh(path) else as_object(gaussians)
    except SplatFileError as error:
        raise SplatFileError(f"{named(path.name)}: {error}") from error


def _check_file(path: Path) -> None:
    size = path.stat().st_size
    if not path.is_file() and not path.is_dir():  # a pipe might never end
        raise SplatFileError("it is no file")
    if size > MAX_BYTES:
        raise SplatFileError(f"the file is larger than {MAX_BYTES >> 30} GiB")


def is_mesh(path: Path) -> bool:
    """True where the file's surface is sampled; what a .ply is, its header says.

    Raises OSError and SplatFileError where that cannot be read.
    """
    ending = ending_of(path)
    if not ending.endswith(".ply"):
        return ending in MESH_ENDINGS
    with path.open("rb") as file:
        header = read_header(file)
    vertex, faces = header.element("vertex"), header.element("face")
    is_solid = faces is not None and faces.count > 0 and not is_compressed(header)
    return is_solid and vertex is not None and is_mere_points(vertex)


def _read_ply(path: Path) -> Gaussians:
    """A .ply file of Gaussians or points, whatever its name says."""
    size = path.stat().st_size
    with path.open("rb") as file:
        header = read_header(file)
        vertex = header.element("vertex")
        if is_compressed(header):
            return read_compressed(file, header, size)
        if vertex is None or not is_mere_points(vertex):
            return read_ply(file, header, size)
        return read_points(file, header, size)
