"""Meshes out: a glTF file (.glb) of an object, with the photo on what the photo shows of it.

The photo's light is in its colours already, so that the material is unlit (KHR_materials_unlit).
The invented sides lie in the same picture, beside the photo's part, and paint lies over both. What
neither shows has colours at its vertices.

Its triangles are the surface that the Gaussians lie on. The signed distance to their planes,
blended by nearness (implicit moving least squares, Kolluri 2008), is sampled on a grid near them;
between inside and outside each cell that the surface crosses gets one vertex (surface nets, Gibson
1998), which is then moved onto the surface.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from ...base.arrays import F64, I64, Mask
from ...compose.light.lighting import object_texture
from ...deform.puppet import Puppet
from ...document.gaussians import Gaussians
from ...document.model import EditObject, LiftedObject
from ...document.sides import Sides
from ...pictures.image import Picture, at_most, encode_picture, to_u8
from ..limits import SplatFileError
from ..splats.objects import facing_outwards, thinnest_last
from ..splats.ply import HALF_TURN
from .surface import linear_from_srgb

CELLS = 144  # along the longest side
LEAST_CELL = 0.9  # x the spacing of the Gaussians: finer cells show their planes
REACH = 2.5  # cells around the Gaussians in which there is a distance
BLENDED = 12  # Gaussians that it is blended of
STEPS = 3  # of a vertex towards the surface
MOST_PLACES = 4_000_000  # of the grid, near the Gaussians
CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], np.int64)
EDGES = np.array([(a, b) for a in range(8) for b in range(a + 1, 8)
                  if np.abs(CORNERS[a] - CORNERS[b]).sum() == 1])  # fmt: skip


def surface_of(gaussians: Gaussians) -> tuple[F64, I64]:
    """Vertices (V, 3) and triangles (T, 3), outward by the right-hand rule.

    The Gaussians are of one object, local +z outwards. Raises SplatFileError where they are no
    surface.
    """
    means, normals = gaussians.means.astype(np.float64), gaussians.normals.astype(np.float64)
    if len(means) < BLENDED:
        raise SplatFileError("there are too few Gaussians for a surface")
    tree = KDTree(means)
    spacing = float(np.median(tree.query(means, 2)[0][:, 1])) * np.sqrt(2)
    extent = float(np.ptp(means, axis=0).max())
    cell = max(extent / CELLS, LEAST_CELL * spacing)
    if not extent > 0 or not cell > 0:
        raise SplatFileError("the Gaussians all lie in one point")
    field = _Field(tree, means, normals, cell)
    places = _near(means, cell)
    low = means.min(0) - 4 * cell
    values = field.at(low + places * cell)
    vertices, quads = _net(places, values)
    if not len(quads):
        raise SplatFileError("the Gaussians lie on no surface")
    vertices = field.onto_surface(low + vertices * cell)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return _used(vertices, triangles)


class _Field:
    """The signed distance to the Gaussians' planes, blended by nearness."""

    def __init__(self, tree: KDTree, means: F64, normals: F64, cell: float) -> None:
        self._tree, self._means, self._normals, self._cell = tree, means, normals, cell

    def at(self, points: F64) -> F64:
        """(P,) positive outside."""
        return np.concatenate([self._block(p)[0] for p in _blocks(points)])

    def onto_surface(self, points: F64) -> F64:
        """(P, 3) moved along the blended normal to where the distance is zero."""
        for _ in range(STEPS):
            moved = []
            for block in _blocks(points):
                distance, normal = self._block(block)
                step = np.clip(distance, -self._cell, self._cell)
                moved.append(block - step[:, None] * normal)
            points = np.concatenate(moved)
        return points

    def _block(self, points: F64) -> tuple[F64, F64]:
        far, which = self._tree.query(points, BLENDED)
        width = np.maximum(far[:, BLENDED // 2], self._cell)[:, None]
        weights = np.exp(-((far / width) ** 2) * 2)
        weights /= weights.sum(1, keepdims=True)
        normals = self._normals[which]
        planes = np.einsum("pkc,pkc->pk", normals, points[:, None] - self._means[which])
        normal = np.einsum("pk,pkc->pc", weights, normals)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        return (weights * planes).sum(1), normal / np.maximum(length, 1e-9)


def _blocks(points: F64) -> list[F64]:
    return np.array_split(points, max(len(points) // 50_000, 1))


def _near(means: F64, cell: float) -> I64:
    """(P, 3) the places of the grid that are near a Gaussian, each once."""
    own = np.unique(np.floor((means - means.min(0)) / cell).astype(np.int64) + 4, axis=0)
    reach = int(np.ceil(REACH))
    steps = np.mgrid[-reach : reach + 2, -reach : reach + 2, -reach : reach + 2]
    steps = steps.reshape(3, -1).T
    steps = steps[np.linalg.norm(steps - 0.5, axis=1) <= REACH + 0.5]
    size = own.max(0) + 8
    if len(own) > MOST_PLACES // 8:
        raise SplatFileError("there are too many Gaussians for a mesh")
    flags = np.zeros(size, bool)
    for step in steps:
        flags[tuple((own + step).T)] = True
    return np.argwhere(flags)


def _net(places: I64, values: F64) -> tuple[F64, I64]:
    """Vertices (V, 3) in cells, and quadrilaterals (Q, 4) of them."""
    size = places.max(0) + 2
    grid = np.full(size, np.nan)
    grid[tuple(places.T)] = values
    corners = np.stack([_shifted(grid, c) for c in CORNERS])  # (8, x, y, z) of each cell
    low, high = corners.min(0), corners.max(0)  # NaN where a corner is missing
    with np.errstate(invalid="ignore"):
        crossed = np.argwhere((low < 0) & (high >= 0))
    number = np.full(low.shape, -1, np.int64)
    number[tuple(crossed.T)] = np.arange(len(crossed))
    own = corners[:, crossed[:, 0], crossed[:, 1], crossed[:, 2]].T  # (V, 8)
    a, b = own[:, EDGES[:, 0]], own[:, EDGES[:, 1]]
    cuts = (a < 0) != (b < 0)
    along = np.where(cuts, a / np.where(cuts, a - b, 1), 0)
    ends = CORNERS[EDGES[:, 0]], CORNERS[EDGES[:, 1]]
    spots = ends[0] + along[..., None] * (ends[1] - ends[0])
    vertices = crossed + (spots * cuts[..., None]).sum(1) / cuts.sum(1, keepdims=True)
    quads = [_quads(grid, number, axis) for axis in range(3)]
    return vertices, np.concatenate(quads)


def _shifted(grid: F64, corner: I64) -> F64:
    x, y, z = corner
    return grid[x : grid.shape[0] - 1 + x, y : grid.shape[1] - 1 + y, z : grid.shape[2] - 1 + z]


def _quads(grid: F64, number: I64, axis: int) -> I64:
    """The four cells around each edge along `axis` that the surface crosses, outwards."""
    one, two = [k for k in range(3) if k != axis] if axis != 1 else (2, 0)
    step = np.eye(3, dtype=np.int64)
    start = grid[tuple(slice(1, -1) if k != axis else slice(0, -1) for k in range(3))]
    end = grid[tuple(slice(1, -1) if k != axis else slice(1, None) for k in range(3))]
    with np.errstate(invalid="ignore"):
        found = np.argwhere(((start < 0) & (end >= 0)) | ((start >= 0) & (end < 0)))
    leaves = start[tuple(found.T)] < 0  # from inside to outside
    at = found + 1 - step[axis]
    around = [at - step[one] - step[two], at - step[two], at, at - step[one]]
    last = np.array(number.shape) - 1
    quads = np.stack([number[tuple(np.minimum(place, last).T)] for place in around], 1)
    quads[~leaves] = quads[~leaves][:, ::-1]
    return quads[(quads >= 0).all(1)]


def _used(vertices: F64, triangles: I64) -> tuple[F64, I64]:
    """Without the vertices that no triangle has."""
    used, fresh = np.unique(triangles, return_inverse=True)
    return vertices[used], fresh.reshape(-1, 3)


SEEN = 0.5  # visibility in the photo from which a triangle shows it
STRETCHED = 0.4  # cosine to the photo's line of sight: with less, a side's picture shows it better
APART = 2.0  # px of a side's picture: where neighbouring vertices see it alike, they agree by this
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
    lifted, matte = thing.shown, thing.matte
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
    texture = object_texture(matte, lifted)
    at_rest, camera = lifted.world_points(points), lifted.photo_camera(puppet.camera)
    is_front = seen[triangles].mean(1) > SEEN
    textured = [_part(world, triangles[is_front], uv=camera.project(at_rest))]
    is_plain = ~is_front
    if lifted.sides is not None and lifted.sides.pixels.size:
        sides = _SideMaps(lifted, near)
        is_side = sides.has_all(triangles) & (
            ~is_front | (_cosines(at_rest, triangles) < STRETCHED)
        )
        textured = [_part(world, triangles[is_front & ~is_side], uv=camera.project(at_rest))]
        textured += sides.parts(world, at_rest, triangles[is_side])
        is_plain &= ~is_side
    height, width = texture.levels[0].shape[:2]
    corner, size = np.array([texture.left, texture.top]), np.array([width, height])
    parts = [
        _joined(textured, corner, size),
        _part(world, triangles[is_plain], colors=near.blended(body.colors)),
    ]
    pixels = np.rint(np.clip(texture.levels[0][..., :3], 0, 1) * 255).astype(np.uint8)
    return _glb([part for part in parts if len(part.triangles)], _jpeg(pixels))


def _cosines(points: F64, triangles: I64) -> F64:
    """(T,) of triangles (T, 3) with the lines of sight of a camera at the origin."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normal, middle = np.cross(b - a, c - a), (a + b + c) / 3
    length = np.linalg.norm(normal, axis=1) * np.linalg.norm(middle, axis=1)
    return -(normal * middle).sum(1) / np.maximum(length, 1e-300)


class _SideMaps:
    """Where the invented pictures show the surface: px of the photo, as `Sides.at`."""

    def __init__(self, lifted: LiftedObject, near: _Nearest) -> None:
        assert lifted.sides is not None, "the caller checks"
        self._sides: Sides = lifted.sides.select(lifted.is_body)
        self._means = lifted.world_points(lifted.body.means.astype(np.float64))
        self._carriers = near.best(self._sides.zoom != 0)  # (V,) a Gaussian on a picture, or -1

    def has_all(self, triangles: I64) -> Mask:
        """(T,) whose three corners are near Gaussians that are on a picture."""
        return np.asarray((self._carriers[triangles] >= 0).all(axis=1))

    def parts(self, world: F64, at_rest: F64, triangles: I64) -> list[MeshPart]:
        """Triangles whose corners see one picture, and those on a seam, with corners of their own.

        `world` (V, 3) where the vertices are, `at_rest` where they were in the photo.
        """
        corners = self._carriers[triangles]
        first = np.repeat(corners[:, :1], 3, axis=1)
        own, alike = self._at(corners, at_rest[triangles]), self._at(first, at_rest[triangles])
        extent = np.ptp(alike, axis=1).max(-1)
        is_one = np.abs(own - alike).max(-1).max(-1) < APART + 0.25 * extent
        uv = self._at(np.maximum(self._carriers, 0), at_rest)
        seam = triangles[~is_one].ravel()
        alone = MeshPart(
            world[seam], np.arange(len(seam)).reshape(-1, 3), uv=alike[~is_one].reshape(-1, 2)
        )
        return [_part(world, triangles[is_one], uv=uv), alone]

    def _at(self, carriers: I64, points: F64) -> F64:
        """(..., 2) of `points` (..., 3) as the maps of the Gaussians `carriers` (...) say."""
        slopes = self._sides.slopes[carriers].astype(np.float64)
        offsets = points - self._means[carriers]
        return self._sides.at[carriers] + np.einsum("...ij,...j->...i", slopes, offsets)


def _joined(parts: list[MeshPart], corner: np.ndarray, size: np.ndarray) -> MeshPart:
    """Parts that show px of the photo as one that shows a picture with this corner and size."""
    first = np.cumsum([0, *(len(part.points) for part in parts)])
    triangles = [part.triangles + start for part, start in zip(parts, first, strict=False)]
    uv = [part.uv for part in parts if part.uv is not None]
    return MeshPart(
        np.concatenate([part.points for part in parts]), np.concatenate(triangles),
        uv=(np.concatenate(uv) - corner) / size,
    )  # fmt: skip


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

    def best(self, is_wanted: np.ndarray) -> I64:
        """(V,) of those near each vertex the one with most weight that `is_wanted` (N,), or -1."""
        weights = np.where(is_wanted[self._which], self._weights, -1.0)
        rows = np.arange(len(weights))
        column = np.argmax(weights, axis=1)
        found = np.asarray(self._which)[rows, column]
        return np.where(weights[rows, column] >= 0, found, -1)

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


def _jpeg(pixels: np.ndarray) -> bytes:
    return encode_picture(Picture(to_u8(at_most(pixels, TEXTURE_SIDE))), ".jpg")


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
