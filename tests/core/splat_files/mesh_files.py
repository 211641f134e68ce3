"""Mesh files made here: small, of known colours."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

WHITE = [1.0, 1.0, 1.0, 1.0]


def png(pixels: np.ndarray) -> bytes:
    """Of (H, W, 3) or (H, W, 4) u8."""
    out = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(out, "png")
    return out.getvalue()


def cube_arrays() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners (24, 3) of a unit cube, texture coordinates (24, 2), triangles (12, 3).

    Face k = +x -x +y -y +z -z shows the picture's column k of six, its bottom row down. Normals
    are outward. glTF's convention of texture coordinates: v down from the top row.
    """
    corners, uv, faces = [], [], []
    for k in range(6):
        axis, sign = k // 2, 1.0 if k % 2 == 0 else -1.0
        normal = np.zeros(3)
        normal[axis] = sign
        up = np.array([0.0, 1, 0]) if axis != 1 else np.array([0.0, 0, -sign])
        right = np.cross(up, normal)
        for s, t in ((0, 0), (1, 0), (1, 1), (0, 1)):
            corners.append(normal / 2 + (s - 0.5) * right + (t - 0.5) * up)
            uv.append(((k + 0.02 + 0.96 * s) / 6, 1 - (0.02 + 0.96 * t)))
        faces += [[4 * k, 4 * k + 1, 4 * k + 2], [4 * k, 4 * k + 2, 4 * k + 3]]
    return np.array(corners), np.array(uv), np.array(faces)


def gltf(
    arrays: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None,
    image: bytes | None = None,
    material: dict[str, Any] | None = None,
    colors: np.ndarray | None = None,
    node: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """The JSON of a .gltf file with all of its data inside."""
    corners, uv, faces = cube_arrays() if arrays is None else arrays
    parts = [
        (np.asarray(corners, "<f4"), 5126, "VEC3"), (np.asarray(uv, "<f4"), 5126, "VEC2"),
        (np.asarray(faces, "<u4").reshape(-1), 5125, "SCALAR"),
    ]  # fmt: skip
    attributes = {"POSITION": 0, "TEXCOORD_0": 1}
    if colors is not None:
        parts.append((np.asarray(colors, "<f4"), 5126, f"VEC{colors.shape[1]}"))
        attributes["COLOR_0"] = 3
    data, views, accessors = b"", [], []
    for k, (part, kind, shape) in enumerate(parts):
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": part.nbytes})
        accessors.append({"bufferView": k, "componentType": kind, "count": len(part),
                          "type": shape})  # fmt: skip
        data += part.tobytes()
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data), "uri": data_uri(data)}],
        "bufferViews": views, "accessors": accessors, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0} | (node or {})],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 2, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": WHITE}} | (material or {})],
    }  # fmt: skip
    if image is not None:
        tree["images"] = [{"uri": data_uri(image, "image/png"), "mimeType": "image/png"}]
        tree["textures"] = [{"source": 0}]
        tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    return tree


def data_uri(data: bytes, kind: str = "application/octet-stream") -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def written(tree: dict[str, Any], path: Path) -> Path:
    path.write_text(json.dumps(tree))
    return path


def as_glb(tree: dict[str, Any], path: Path) -> Path:
    """The same scene as one binary file, through trimesh."""
    scene = trimesh.load_scene(io.BytesIO(json.dumps(tree).encode()), file_type="gltf")
    path.write_bytes(scene.export(file_type="glb"))
    return path
