"""Meshes with their textures (.glb .gltf .obj .stl .off .ply) as Gaussians on their surface.

trimesh reads the files; this is the only place that knows it. What is taken from a material is
its base colour: picture, factor, colours of vertices or faces, and alpha. Shine, relief and
emission are not. Axes become ours by the format's own rule or, where it has none, by custom: see
AXES and docs/formats.md.
"""

from __future__ import annotations

import io
import logging
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import F64, U8
from ...base.limits import MESH_BYTES as MAX_MESH
from ...document.gaussians import Gaussians
from ..limits import GREATEST, SplatFileError
from ..splats.ply import HALF_TURN, QUARTER_TURN, read_header, turned
from .gltf_check import MAX_SIDE, MAX_TRIANGLES, MeshFolder, check_gltf
from .sampling import sample_surface
from .surface import WORKING, Look, Texture, TriangleMesh, linear_from_srgb

log = logging.getLogger(__name__)

AXES = {
    ".glb": HALF_TURN, ".gltf": HALF_TURN,  # y up, by specification
    ".obj": HALF_TURN, ".off": HALF_TURN, ".ply": HALF_TURN,  # y up, by custom
    ".stl": QUARTER_TURN,  # z up: what stands on a printer's bed
}  # fmt: skip
ENDINGS = tuple(AXES)
GREY = 0.6  # sRGB of a surface that nobody coloured


def read_mesh(path: Path, count: int, seed: int = 0) -> Gaussians:
    """About `count` Gaussians on the surface of a mesh file, in our axes. Raises SplatFileError."""
    ending = path.suffix.lower()
    if path.stat().st_size > MAX_MESH:
        raise SplatFileError(f"the mesh file is larger than {MAX_MESH >> 30} GiB")
    gaussians = sample_surface(load_surface(path.read_bytes(), path), count, seed)
    return turned(gaussians, AXES[ending])


def load_surface(data: bytes, path: Path) -> TriangleMesh:
    """The triangles of a mesh file and what they look like, in the file's axes."""
    ending, folder = path.suffix.lower(), MeshFolder(path)
    is_gltf = ending in (".glb", ".gltf")
    if not data:
        raise SplatFileError("the mesh file is empty")
    if is_gltf:
        check_gltf(data, folder)
    if ending == ".ply":
        _check_ply(data)
    if ending == ".stl":
        _check_stl(data)
    if ending == ".obj" or (ending == ".stl" and not _is_binary_stl(data)):
        _check_text(data)
    scene = _scene(data, ending, folder)
    if folder.refused:
        name = folder.refused[0]
        raise SplatFileError(f"the mesh names a file outside its folder: {name[:80]!r}")
    for name in folder.missing:
        log.warning("The mesh's texture or material %s is missing", name)
    try:
        surface = _surface(scene, is_gltf)
    except (ValueError, IndexError, TypeError, OSError) as error:
        if isinstance(error, SplatFileError):
            raise
        raise SplatFileError("the mesh file is damaged") from error
    if not len(surface.corners):
        raise SplatFileError("the mesh file holds no triangles")
    return surface


def _scene(data: bytes, ending: str, folder: MeshFolder) -> Any:
    """trimesh's Scene of the file."""
    import trimesh

    resolver: Any = folder  # trimesh asks by name alone, whatever its type hints say
    # Its loaders raise whatever a damaged file leads them to, RecursionError and zlib's errors
    # among them: the user reads one sentence.
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            return trimesh.load_scene(
                io.BytesIO(data), file_type=ending[1:], resolver=resolver, process=False
            )
    except MemoryError:
        raise
    except Exception as error:
        if folder.refused:
            name = folder.refused[0]
            raise SplatFileError(
                f"the mesh names a file outside its folder: {name[:80]!r}"
            ) from error
        raise SplatFileError("the mesh file is damaged or not what its ending says") from error


def _check_ply(data: bytes) -> None:
    """The rows that the header declares fit into the file: a list's row takes a byte at least."""
    header = read_header(io.BytesIO(data))
    least = 0
    for element in header.elements:
        sizes = [1 if form == "list" else int(form[1:]) for form, _ in element.properties]
        least += element.count * (2 * len(sizes) if header.kind == "ascii" else sum(sizes))
    if least > len(data) - header.start + 2:
        raise SplatFileError("the .ply file ends early")


def _check_stl(data: bytes) -> None:
    """A binary file has as many triangles as it says: trimesh would take it for text."""
    if not _is_binary_stl(data) and not data.lstrip()[:5].lower() == b"solid":
        raise SplatFileError("the .stl file is damaged or ends early")


def _is_binary_stl(data: bytes) -> bool:
    """By its length: the first word of binary files may be "solid", too."""
    return len(data) == 84 + 50 * int.from_bytes(data[80:84], "little")


def _check_text(data: bytes) -> None:
    """trimesh would guess an encoding, and what comes out depends on what else is installed."""
    try:
        is_text = "\0" not in data.decode("utf-8")
    except UnicodeDecodeError:
        is_text = False
    if not is_text:
        raise SplatFileError("the mesh file is damaged: it is no text in UTF-8")


def _surface(scene: Any, is_gltf: bool) -> TriangleMesh:
    """Every triangle of the scene where its node puts it."""
    parts, looks, total = [], {}, 0
    placed_meshes = [scene.graph[node] for node in scene.graph.nodes_geometry]
    # Not by the nodes' names, which trimesh draws by lot where the file gives none.
    placed_meshes.sort(key=lambda found: (found[1], found[0].tolist()))
    for matrix, name in placed_meshes:
        mesh = scene.geometry[name]
        faces = np.asarray(getattr(mesh, "faces", ()))
        if faces.ndim != 2 or not len(faces):
            continue
        total += len(faces)
        if total > MAX_TRIANGLES:
            raise SplatFileError(f"the mesh has more than {MAX_TRIANGLES:,} triangles")
        vertices = np.asarray(mesh.vertices, np.float64)
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise SplatFileError("the mesh file is damaged: a triangle names a missing vertex")
        if np.linalg.det(matrix[:3, :3]) < 0:  # a mirror image is seen from the other side
            faces = faces[:, ::-1]
        placed = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        look = looks.setdefault(name, (len(looks), _look(mesh)))[0]
        uv = _uv(mesh)
        parts.append((
            placed[faces],
            np.zeros((len(faces), 3, 2)) if uv is None else uv[faces],
            _corner_tints(mesh, faces, is_gltf),
            np.full(len(faces), look),
        ))  # fmt: skip
    if not parts:
        raise SplatFileError("the mesh file holds no triangles")
    corners, uv, tint, which = (np.concatenate(column) for column in zip(*parts, strict=True))
    kept = (np.abs(corners) <= GREATEST).all((1, 2))  # NaN compares false
    return TriangleMesh(
        corners[kept], np.nan_to_num(uv[kept]), tint[kept].astype(np.float32), which[kept],
        tuple(look for _, look in sorted(looks.values(), key=lambda item: item[0])),
    )  # fmt: skip


def _look(mesh: Any) -> Look:
    """The picture of a mesh's material, and what its alpha means."""
    material = getattr(mesh.visual, "material", None)
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    mode = getattr(material, "alphaMode", "BLEND" if material is not None else None)
    cutoff = None
    if mode == "MASK":
        given = getattr(material, "alphaCutoff", None)
        cutoff = 0.5 if given is None else float(given)
    is_opaque = mode not in ("MASK", "BLEND")
    if image is None or getattr(mesh.visual, "uv", None) is None:
        return Look(None, cutoff, is_opaque)
    return Look(Texture(_rgba(image, is_opaque)), cutoff, is_opaque)


def _rgba(image: Any, is_opaque: bool) -> U8:
    """Straight sRGB pixels (H, W, 4) of a picture that was opened and not yet decoded.

    The alpha of what `is_opaque` means nothing: it may be something else.
    """
    if max(image.size) > MAX_SIDE:
        raise SplatFileError(f"a texture of the mesh is larger than {MAX_SIDE} px")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image = (image.convert("RGB") if is_opaque else image).convert("RGBA")
    except (OSError, ValueError, SyntaxError) as error:
        raise SplatFileError("a texture of the mesh cannot be read") from error
    factor = -(-max(image.size) // WORKING)
    return np.asarray(image.reduce(factor) if factor > 1 else image)


def _uv(mesh: Any) -> F64 | None:
    uv = getattr(mesh.visual, "uv", None)
    return np.asarray(uv, np.float64) if uv is not None and len(uv) == len(mesh.vertices) else None


def _corner_tints(mesh: Any, faces: np.ndarray, is_gltf: bool) -> np.ndarray:
    """Linear straight RGBA (F, 3, 4) at the corners of the faces."""
    tint = _tint(mesh, is_gltf)
    if mesh.visual.kind == "face" and len(tint) == len(faces):
        return np.broadcast_to(tint[:, None], (len(faces), 3, 4))
    if len(tint) == len(mesh.vertices):
        return tint[faces]
    return np.broadcast_to(tint[0], (len(faces), 3, 4))


def _tint(mesh: Any, is_gltf: bool) -> np.ndarray:
    """Linear straight RGBA (V, 4) of vertices, (F, 4) of faces, or (1, 4) of all."""
    visual = mesh.visual
    material = getattr(visual, "material", None)
    if material is None:
        if visual.kind == "vertex":
            return _linear(visual.vertex_colors, is_gltf)
        if visual.kind == "face":
            return _linear(visual.face_colors, False)
        return _linear(np.array([[GREY, GREY, GREY, 1.0]]), False)
    if hasattr(material, "baseColorTexture"):
        factor = material.baseColorFactor
        tint = np.ones((1, 4)) if factor is None else _linear(np.reshape(factor, (1, 4)), True)
        colors = visual.vertex_attributes.get("color")
        if colors is not None and len(colors) == len(mesh.vertices):
            tint = tint * _linear(_with_alpha(colors), True)
        return tint
    # A picture's Kd is left out: some programs write 0.8 there, and some 0.
    if material.image is not None and getattr(visual, "uv", None) is not None:
        return np.ones((1, 4))
    return _linear(np.reshape(material.diffuse, (1, 4)), False)


def _with_alpha(colors: np.ndarray) -> np.ndarray:
    colors = np.asarray(colors)
    if colors.shape[1] == 4:
        return colors
    most = np.iinfo(colors.dtype).max if colors.dtype.kind in "iu" else 1
    return np.column_stack([colors, np.full(len(colors), most, colors.dtype)])


def _linear(colors: np.ndarray, is_linear: bool) -> np.ndarray:
    """Floats (N, 4) of stored colours (N, 4), whole numbers of their type's range or floats."""
    colors = np.asarray(colors)
    if colors.dtype.kind in "iu":
        colors = colors / np.iinfo(colors.dtype).max
    colors = np.clip(np.nan_to_num(colors.astype(np.float64)), 0, 1)
    if not is_linear:
        colors = np.column_stack([linear_from_srgb(colors[:, :3]), colors[:, 3]])
    return colors
