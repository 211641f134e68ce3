"""Meshes out: a glTF file (.glb) of an object, with the photo on what the photo shows of it.

The photo's light is in its colours already, so that the material is unlit (KHR_materials_unlit).
What the photo does not show has colours at its vertices.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from ...base.arrays import F64, I64
from ...deform.puppet import Puppet
from ...document.gaussians import Gaussians
from ...document.model import EditObject, Matte
from ...pictures.image import Picture, at_most, encode_picture, to_u8
from ..splats.objects import facing_outwards, thinnest_last
from ..splats.ply_table import HALF_TURN
from .meshing import surface_of
from .surface import linear_from_srgb

SEEN = 0.5  # visibility in the photo from which a triangle shows it
TEXTURE_SIDE = 4096  # px, which every viewer can hold
NEAREST = 6  # Gaussians of which a vertex has its colour
FLOAT, UINT = 5126, 5125  # of glTF's accessors
GENERATOR = "ObjectMorpher"


@dataclass(frozen=True, eq=False)
class MeshPart:
    """Triangles of one material: with texture coordinates, or with colours."""

    points: F64  # (V, 3) in our axes
    triangles: I64  # (T, 3)
    uv: F64 | None = None  # (V, 2) from the picture's upper left corner
    colors: F64 | None = None  # (V, 3) sRGB in [0, 1]


def plain_glb(gaussians: Gaussians) -> bytes:
    """Return the .glb file of the surface that Gaussians lie on, in their colours."""
    outward = facing_outwards(thinnest_last(gaussians))
    points, triangles = surface_of(outward)
    near = _Nearest(outward, points, triangles)
    return _glb([MeshPart(points, triangles, colors=near.blended(outward.colors))], None)


def textured_glb(thing: EditObject, puppet: Puppet) -> bytes:
    """Return the .glb file of a lifted object as it is posed, in the frame of the photo's camera.

    Raises SplatFileError where it has no surface.
    """
    lifted, matte = thing.lifted, thing.matte
    assert lifted is not None, "the caller checks"
    body = lifted.body
    points, triangles = surface_of(body)
    near = _Nearest(body, points, triangles)
    posed = points
    if thing.pose is not None:
        posed = puppet.deformer.skin_points(points, thing.pose, near.normals).points
    motion = thing.placement.matrix(lifted, puppet.camera)
    world = lifted.world_points(posed) @ motion[:3, :3].T + motion[:3, 3]
    seen = near.blended(lifted.texture.visibility[lifted.is_body, None])[:, 0]
    if matte is None:
        return _glb([MeshPart(world, triangles, colors=near.blended(body.colors))], None)
    is_front = seen[triangles].mean(1) > SEEN
    uv = _places_in(matte, puppet.camera.project(lifted.world_points(points)))
    parts = [
        _part(world, triangles[is_front], uv=uv),
        _part(world, triangles[~is_front], colors=near.blended(body.colors)),
    ]
    return _glb([part for part in parts if len(part.triangles)], _texture(matte))


def _part(points: F64, triangles: I64, **values: F64) -> MeshPart:
    """These triangles with the vertices that they have."""
    used, fresh = np.unique(triangles, return_inverse=True)
    own = {name: value[used] for name, value in values.items()}
    return MeshPart(points[used], fresh.reshape(-1, 3), **own)


class _Nearest:
    """The Gaussians next to each vertex, on its own side of a thin thing."""

    def __init__(self, gaussians: Gaussians, points: F64, triangles: I64) -> None:
        self.normals = vertex_normals(points, triangles)
        far, which = KDTree(gaussians.means).query(points, NEAREST)
        facing = np.einsum("vkc,vc->vk", gaussians.normals[which], self.normals)
        width = np.maximum(far.mean(1, keepdims=True), 1e-12)
        weights = np.exp(-((far / width) ** 2)) * np.maximum(facing, 1e-3)
        self._which, self._weights = which, weights / weights.sum(1, keepdims=True)

    def blended(self, values: np.ndarray) -> F64:
        """(V, C) of the Gaussians' (N, C)."""
        return np.einsum("vk,vkc->vc", self._weights, values[self._which].astype(np.float64))


def vertex_normals(points: F64, triangles: I64) -> F64:
    """(V, 3) unit normals, the mean of the triangles around each vertex by their areas."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, triangles[:, k], across)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)


def _places_in(matte: Matte, px: F64) -> F64:
    """(V, 2) where in the matte's crop photo px (V, 2) are; the crop is 1 x 1."""
    height, width = matte.alpha.shape
    return (px - np.array([matte.left, matte.top])) / np.array([width, height])


def _texture(matte: Matte) -> bytes:
    pixels = at_most(np.rint(np.clip(matte.foreground, 0, 1) * 255).astype(np.uint8), TEXTURE_SIDE)
    return encode_picture(Picture(to_u8(pixels)), ".jpg")


def _glb(parts: list[MeshPart], texture: bytes | None) -> bytes:
    """The file of these parts; those with texture coordinates show `texture`, a JPEG file."""
    buffer = _Buffer()
    primitives = [_primitive(part, buffer) for part in parts]
    unlit = {"extensions": {"KHR_materials_unlit": {}}, "doubleSided": True}
    shine = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    about: dict[str, object] = {
        "asset": {"version": "2.0", "generator": GENERATOR},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "name": "object"}],
        "meshes": [{"primitives": primitives}],
        "materials": [
            {"name": "colours", "pbrMetallicRoughness": shine, **unlit},
            {"name": "photo", **unlit,
             "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, **shine}},
        ] if texture else [{"name": "colours", "pbrMetallicRoughness": shine, **unlit}],
    }  # fmt: skip
    if texture:
        about["images"] = [{"bufferView": buffer.add(texture), "mimeType": "image/jpeg"}]
        about["textures"] = [{"source": 0, "sampler": 0}]
        about["samplers"] = [{"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}]
    about |= {"bufferViews": buffer.views, "accessors": buffer.accessors}
    about["buffers"] = [{"byteLength": len(buffer.data)}]
    text = json.dumps(about, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(buffer.data), b"BIN\0") + bytes(buffer.data)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _primitive(part: MeshPart, buffer: _Buffer) -> dict[str, object]:
    points = part.points @ HALF_TURN.T
    normals = vertex_normals(points, part.triangles)
    attributes = {"POSITION": buffer.accessor(points, has_bounds=True),
                  "NORMAL": buffer.accessor(normals)}  # fmt: skip
    if part.uv is not None:
        attributes["TEXCOORD_0"] = buffer.accessor(part.uv)
    if part.colors is not None:
        attributes["COLOR_0"] = buffer.accessor(linear_from_srgb(np.clip(part.colors, 0, 1)))
    indices = buffer.accessor(part.triangles.reshape(-1, 1), kind=UINT)
    return {"attributes": attributes, "indices": indices, "material": int(part.uv is not None)}


class _Buffer:
    """The binary part of a file, and the tables that say what is where in it."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, object]] = []

    def add(self, data: bytes) -> int:
        """Append bytes; the number of their view."""
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data + bytes(-len(data) % 4)
        return len(self.views) - 1

    def accessor(self, values: np.ndarray, kind: int = FLOAT, has_bounds: bool = False) -> int:
        """Append (V, 1..3) numbers; the number of their accessor."""
        stored = values.astype("<f4" if kind == FLOAT else "<u4")
        shape = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}[values.shape[1]]
        about: dict[str, object] = {
            "bufferView": self.add(stored.tobytes()), "componentType": kind,
            "count": len(values), "type": shape,
        }  # fmt: skip
        if has_bounds:
            about |= {"min": stored.min(0).tolist(), "max": stored.max(0).tolist()}
        self.accessors.append(about)
        return len(self.accessors) - 1
