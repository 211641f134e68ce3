"""A check of a .gltf or .glb file before a loader allocates what it declares."""

from __future__ import annotations

import base64
import binascii
import io
import json
import struct
import warnings
from collections.abc import Iterator
from pathlib import Path, PureWindowsPath
from typing import Any
from urllib.parse import unquote

from ...base.limits import MESH_ASSET as MAX_ASSET
from ...base.limits import MESH_DEPTH as MAX_DEPTH
from ...base.limits import MESH_JSON as MAX_JSON
from ...base.limits import MESH_NODES as MAX_NODES
from ...base.limits import MESH_TRIANGLES as MAX_TRIANGLES
from ...base.limits import MESH_VERTICES as MAX_VERTICES
from ...base.limits import TEXTURE_SIDE as MAX_SIDE
from ...base.quoting import counted, named, shown
from ..limits import SplatFileError

# The files beside a mesh: its textures and buffers, never one of another folder or the net.


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


ITEM_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}  # by componentType
ITEMS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
TRIANGLES, STRIP = 4, 5  # modes
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
UNDERSTOOD = {  # extensions without which the shape and its colours are still right
    "KHR_materials_unlit", "KHR_materials_ior", "KHR_materials_specular", "KHR_lights_punctual",
    "KHR_materials_clearcoat", "KHR_materials_emissive_strength", "KHR_materials_sheen",
    "KHR_materials_pbrSpecularGlossiness", "EXT_texture_webp", "KHR_materials_variants",
}  # fmt: skip

Json = dict[str, Any]


def check_gltf(data: bytes, folder: MeshFolder) -> None:
    """Raises SplatFileError, one sentence, for what is damaged, unsupported or out of bounds."""
    try:
        text, binary = _split(data)
        tree = json.loads(text)
        if not isinstance(tree, dict):
            raise ValueError("no object")
        _check_extensions(tree)
        views = _view_lengths(tree, binary, folder)
        counts = _accessor_counts(tree, views)
        triangles = _mesh_triangles(tree, counts)
        _check_scene(tree, triangles)
        _check_pictures(tree, memoryview(data)[28 + len(text) :], folder)
    except SplatFileError:
        raise
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError) as error:
        raise SplatFileError("the glTF file is damaged") from error


def _split(data: bytes) -> tuple[bytes, int]:
    """The JSON, and how many bytes follow it as the first buffer."""
    if not data.startswith(b"glTF"):
        if len(data) > MAX_JSON:
            raise SplatFileError(f"the glTF file's text is larger than {MAX_JSON >> 20} MiB")
        return data, 0
    if len(data) < 20:
        raise SplatFileError("the glTF file ends early")
    version, length, size, kind = struct.unpack_from("<4I", data, 4)
    if version != 2:
        raise SplatFileError(f"the glTF file is of version {version}, not 2")
    if kind != JSON_CHUNK or length > len(data) or 20 + size > length or size > MAX_JSON:
        raise SplatFileError("the glTF file is damaged or ends early")
    binary = 0
    if 28 + size <= length:
        binary, kind = struct.unpack_from("<2I", data, 20 + size)
        if kind != BINARY_CHUNK or 28 + size + binary > length:
            raise SplatFileError("the glTF file is damaged or ends early")
    return data[20 : 20 + size], binary


def _check_extensions(tree: Json) -> None:
    version = str(tree["asset"]["version"])
    if not version.startswith("2."):
        raise SplatFileError(f"the glTF file is of version {shown(version)}, not 2")
    for name in tree.get("extensionsRequired", []):
        if name not in UNDERSTOOD:
            raise SplatFileError(f"the glTF file needs {str(name)[:60]}, which is not supported")


def _view_lengths(tree: Json, binary: int, folder: MeshFolder) -> list[int]:
    """Bytes of each bufferView, each inside its buffer."""
    sizes = []
    for k, buffer in enumerate(tree.get("buffers", [])):
        uri = buffer.get("uri")
        if uri is None and (k or not binary):
            raise SplatFileError("the glTF file is incomplete: a buffer is missing")
        size = binary if uri is None else _uri_bytes(uri, folder)
        if size < _whole(buffer["byteLength"]):
            raise SplatFileError("the glTF file is incomplete: a buffer ends early")
        sizes.append(size)
    lengths = []
    for view in tree.get("bufferViews", []):
        start, length = _whole(view.get("byteOffset", 0)), _whole(view["byteLength"])
        if start + length > sizes[_whole(view["buffer"])]:
            raise SplatFileError("the glTF file is damaged: a view leaves its buffer")
        _whole(view.get("byteStride", 0))
        lengths.append(length)
    return lengths


def _uri_bytes(uri: str, folder: MeshFolder) -> int:
    if not uri.startswith("data:"):
        return folder.find(uri).stat().st_size
    return len(_decoded(uri))


def _decoded(uri: str) -> bytes:
    """The bytes in a data: URI."""
    try:
        return base64.b64decode(uri.partition("base64,")[2], validate=True)
    except binascii.Error as error:
        raise SplatFileError("the glTF file is damaged: a buffer cannot be decoded") from error


def _accessor_counts(tree: Json, views: list[int]) -> list[int]:
    """Elements of each accessor, each inside its view."""
    counts = []
    for accessor in tree.get("accessors", []):
        count = _whole(accessor["count"])
        size = ITEM_BYTES[accessor["componentType"]] * ITEMS[accessor["type"]]
        if count > MAX_VERTICES:
            raise SplatFileError(
                f"the glTF file declares {counted(count)} vertices, more than the "
                f"{MAX_VERTICES:,} that can be read"
            )
        if "bufferView" in accessor:
            index = _whole(accessor["bufferView"])
            stride = tree["bufferViews"][index].get("byteStride") or size
            needed = _whole(accessor.get("byteOffset", 0)) + max(count - 1, 0) * stride + size
            if count and needed > views[index]:
                raise SplatFileError("the glTF file is damaged: an accessor leaves its view")
        elif "sparse" not in accessor and count > MAX_NODES:
            raise SplatFileError("the glTF file is incomplete: an accessor has no data")
        counts.append(count)
    return counts


def _mesh_triangles(tree: Json, counts: list[int]) -> list[int]:
    """Triangles of each mesh."""
    triangles = []
    for mesh in tree.get("meshes", []):
        total = 0
        for primitive in mesh["primitives"]:
            attributes = primitive["attributes"]
            sizes = [counts[_whole(index)] for index in attributes.values()]
            if len(set(sizes)) > 1:
                raise SplatFileError("the glTF file is damaged: attributes differ in length")
            corners = counts[_whole(primitive.get("indices", attributes["POSITION"]))]
            mode = primitive.get("mode", TRIANGLES)
            total += corners // 3 if mode == TRIANGLES else corners if mode == STRIP else 0
        triangles.append(total)
    return triangles


def _check_scene(tree: Json, triangles: list[int]) -> None:
    """The nodes are a forest, not too deep, and what they show is not too much."""
    nodes = tree.get("nodes", [])
    if len(nodes) > MAX_NODES:
        raise SplatFileError(f"the glTF file has more than {MAX_NODES:,} nodes")
    has_parent = [False] * len(nodes)
    for node in nodes:
        for child in node.get("children", []):
            if has_parent[_whole(child)]:
                raise SplatFileError("the glTF file is damaged: a node has two parents")
            has_parent[child] = True
    scenes = tree.get("scenes", [])
    scene = scenes[_whole(tree.get("scene", 0))] if scenes else {}
    level, shown, depth = [_whole(root) for root in scene.get("nodes", [])], 0, 0
    if len(set(level)) < len(level) or any(has_parent[root] for root in level):
        raise SplatFileError("the glTF file is damaged: its nodes form a cycle")
    while level:  # each node has one parent and no root has one: this ends
        depth += 1
        shown += sum(triangles[_whole(nodes[k]["mesh"])] for k in level if "mesh" in nodes[k])
        level = [child for k in level for child in nodes[k].get("children", [])]
        if depth > MAX_DEPTH:
            raise SplatFileError(f"the glTF file has nodes more than {MAX_DEPTH} deep")
        if shown > MAX_TRIANGLES:
            raise SplatFileError(f"the mesh has more than {MAX_TRIANGLES:,} triangles")
    if not shown:
        raise SplatFileError("the glTF file shows no triangles")


def _check_pictures(tree: Json, binary: memoryview, folder: MeshFolder) -> None:
    """Each base colour's picture is one, and not too large. A missing file is only remembered."""
    from PIL import Image

    for material in tree.get("materials", []):
        used = material.get("pbrMetallicRoughness", {}).get("baseColorTexture")
        source = tree["textures"][_whole(used["index"])].get("source") if used else None
        if source is None:
            continue
        try:
            data = _picture_bytes(tree, tree["images"][_whole(source)], binary, folder)
        except SplatFileError:
            if folder.refused:
                raise
            continue
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                width, height = Image.open(io.BytesIO(data)).size
        except Image.DecompressionBombError:
            width = height = MAX_SIDE + 1
        except (OSError, ValueError, SyntaxError, struct.error) as error:
            raise SplatFileError("a texture of the mesh cannot be read") from error
        if max(width, height) > MAX_SIDE:
            raise SplatFileError(f"a texture of the mesh is larger than {MAX_SIDE} px")


def _picture_bytes(
    tree: Json, image: Json, binary: memoryview, folder: MeshFolder
) -> bytes | memoryview:
    view = tree["bufferViews"][_whole(image["bufferView"])] if "bufferView" in image else None
    uri = tree["buffers"][view["buffer"]].get("uri") if view else image["uri"]
    data = binary if uri is None else _decoded(uri) if uri.startswith("data:") else folder.get(uri)
    if view is None:
        return data
    start = view.get("byteOffset", 0)
    return data[start : start + view["byteLength"]]


def _whole(value: Any) -> int:
    """A whole number, not negative: Python takes -1 for the last."""
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise ValueError(value)
    return value
