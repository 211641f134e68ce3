"""Ten solids whose every view is known: textured meshes, and shapes made here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import trimesh

from objectmorpher_core.base.arrays import F64, I32, U8
from objectmorpher_core.base.rotations import turn_matrix
from objectmorpher_research.evaluation.truth.lookup import looked_up
from objectmorpher_research.evaluation.truth.materials import veins

LIGHT = np.array([-0.45, -0.7, -0.55]) / np.linalg.norm([0.45, 0.7, 0.55])  # towards it
AMBIENT = 0.55  # share of the light that comes from everywhere


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed textured surface in its own frame: x right, y down, z away; largest extent 1."""

    name: str
    vertices: F64  # (V, 3)
    faces: I32  # (F, 3)
    uv: F64  # (F, 3, 2) in texture px
    texture: U8 | None  # (h, w, 3); None: coloured through and through, see `colors`
    seed: int = 0

    def turned(self, yaw: float, pitch: float = 0.0, roll: float = 0.0) -> Solid:
        """The same solid seen from another side; centred anew."""
        points = self.vertices @ turn_matrix(yaw, pitch, roll).T
        return replace(self, vertices=_unit(points))

    def colors(self, points: F64, face: I32, corners: F64) -> F64:
        """sRGB (n, 3) in [0, 1] of places: rest points (n, 3), faces (n,), barycentric (n, 3).

        The light is painted on: it turns with the solid.
        """
        shade = AMBIENT + (1 - AMBIENT) * np.clip(self.normals(face, corners) @ LIGHT, 0, 1)
        return self.albedo(points, face, corners) * shade[:, None]

    def albedo(self, points: F64, face: I32, corners: F64) -> F64:
        """The same without light."""
        if self.texture is None:
            return _marble(points, self.seed)
        at = (self.uv[face] * corners[:, :, None]).sum(1)
        size = np.array(self.texture.shape[1::-1])
        at = np.clip(np.mod(at, size), 0, size - 1.001)
        return looked_up(self.texture, at) / 255

    def normals(self, face: I32, corners: F64) -> F64:
        """(n, 3) outward, unit, at rest."""
        mesh = trimesh.Trimesh(self.vertices, self.faces, process=False)
        normals = (mesh.vertex_normals[self.faces[face]] * corners[:, :, None]).sum(1)
        return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)


def _unit(points: F64) -> F64:
    middle = 0.5 * (points.min(0) + points.max(0))
    return (points - middle) / (points.max(0) - points.min(0)).max()


def _marble(points: F64, seed: int) -> F64:
    """A solid texture with detail of many sizes, (n, 3) in [0, 1]."""
    rng = np.random.default_rng(seed)
    base, other = rng.uniform(0.25, 0.9, (2, 3))
    mix = veins(points, rng)
    grain = np.sin(points @ (rng.normal(size=(8, 3)) * 55).T + rng.uniform(0, 6, 8)).sum(1)
    return np.clip(base + (other - base) * mix[:, None] + 0.03 * grain[:, None], 0.02, 0.98)


def read_mesh(path: Path, upright: F64, name: str, texture: Path | None, seed: int = 0) -> Solid:
    """A mesh file, turned by `upright` (3, 3) into our axes."""
    mesh = trimesh.load(path, force="mesh", process=False)
    assert isinstance(mesh, trimesh.Trimesh)
    vertices = _unit(np.asarray(mesh.vertices) @ upright.T)
    faces = np.asarray(mesh.faces, np.int32)
    image, uv = None, np.zeros((len(faces), 3, 2))
    if texture is not None:
        loaded = cv2.imread(str(texture))
        assert loaded is not None, texture
        image = np.ascontiguousarray(loaded[..., ::-1], np.uint8)
        per_vertex = np.asarray(mesh.visual.uv)[faces]  # type: ignore[union-attr]
        uv = np.stack([per_vertex[..., 0], 1 - per_vertex[..., 1]], -1)
        uv = uv * [image.shape[1], image.shape[0]] - 0.5
    else:  # its vertices joined, so that its normals are smooth
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        vertices = _unit(np.asarray(mesh.vertices) @ upright.T)
        faces = np.asarray(mesh.faces, np.int32)
        uv = np.zeros((len(faces), 3, 2))
    return Solid(name, vertices, faces, uv, image, seed)


def shape(name: str, parts: list[trimesh.Trimesh], seed: int) -> Solid:
    """A solid made of simple ones that overlap, coloured through and through."""
    mesh = trimesh.util.concatenate(parts)
    faces = np.asarray(mesh.faces, np.int32)
    return Solid(
        name, _unit(np.asarray(mesh.vertices)), faces, np.zeros((len(faces), 3, 2)), None, seed
    )


def capsule(start: tuple[float, ...], end: tuple[float, ...], radius: float) -> trimesh.Trimesh:
    a, b = np.array(start, float), np.array(end, float)
    mesh = trimesh.creation.capsule(float(np.linalg.norm(b - a)), radius, count=[24, 24])
    mesh.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], b - a))
    mesh.apply_translation(a)
    return mesh


def ball(centre: tuple[float, ...], radii: tuple[float, ...]) -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(4)
    mesh.apply_scale(radii)
    mesh.apply_translation(centre)
    return mesh


def figure() -> Solid:
    """A standing figure: head, body, arms and legs, one arm in front of the body."""
    return shape("figure", [
        ball((0, -0.62, 0), (0.17, 0.2, 0.18)),
        ball((0, -0.1, 0), (0.24, 0.36, 0.17)),
        capsule((-0.2, -0.32, 0), (-0.5, 0.05, 0.05), 0.075),
        capsule((0.2, -0.32, 0), (0.38, 0.0, -0.12), 0.075),
        capsule((0.38, 0.0, -0.12), (0.08, 0.08, -0.3), 0.07),
        capsule((-0.11, 0.15, 0), (-0.16, 0.85, 0.05), 0.1),
        capsule((0.11, 0.15, 0), (0.2, 0.85, -0.1), 0.1),
    ], 3)  # fmt: skip


def mug() -> Solid:
    body = trimesh.creation.cylinder(0.36, 0.9, sections=96)
    body.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    handle = trimesh.creation.torus(0.26, 0.055, 48, 24)
    handle.apply_translation([0.38, 0, 0])
    return shape("mug", [body, handle], 5)


def box() -> Solid:
    return shape("box", [trimesh.creation.box([0.62, 0.9, 0.28])], 8)


Maker = Callable[[Path], Solid]
View = tuple[float, float, float]  # degrees, yaw, pitch, roll
Y_UP = np.diag([1.0, -1.0, -1.0])
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def _mesh(file: str, name: str, upright: F64 = Y_UP, texture: str = "", seed: int = 0) -> Maker:
    return lambda folder: read_mesh(
        folder / file, upright, name, folder / texture if texture else None, seed
    )


# name -> its maker from the folder of meshes, and the side that the photo sees: from a little
# above, as photos of things are taken
SOLIDS: dict[str, tuple[Maker, View]] = {
    "duck": (_mesh("duck.obj", "duck", texture="duckCM.png"), (35, 12, 0)),
    "bunny": (_mesh("bunny.obj", "bunny", seed=1), (-20, 15, 0)),
    "teddy": (_mesh("teddy2_VHACD_CHs.obj", "teddy", seed=2), (15, 10, 0)),
    "ball": (_mesh("soccerball.obj", "ball", seed=11), (20, 12, 0)),
    "ring": (_mesh("torus/torus_textured.obj", "ring", texture="cube.png"), (30, 50, 0)),
    "brick": (_mesh("lego/lego.obj", "brick", Z_UP, seed=7), (35, 18, 0)),
    "robot": (
        _mesh("a1/meshes/trunk.obj", "robot", Z_UP, "a1/meshes/trunk_A1.png"), (30, 14, 0),
    ),
    "figure": (lambda _: figure(), (20, 6, 0)),
    "mug": (lambda _: mug(), (25, 16, 0)),
    "box": (lambda _: box(), (30, 14, 0)),
}  # fmt: skip


def _lathed(radii: list[float], height: float, low: float = 0.0) -> trimesh.Trimesh:
    """A surface of revolution about the upright axis, from its foot at `low` up."""
    rise = np.linspace(0, height, len(radii))
    profile = np.column_stack([[0.0, *radii, 0.0], [0.0, *rise, height]])
    mesh = trimesh.creation.revolve(profile, sections=96)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    mesh.apply_translation([0, -low, 0])
    return mesh


def _plank(sizes: tuple[float, ...], centre: tuple[float, ...]) -> trimesh.Trimesh:
    mesh = trimesh.creation.box(sizes)
    mesh.apply_translation(centre)
    return mesh


def _made(name: str, seed: int, *parts: trimesh.Trimesh) -> Maker:
    return lambda _: shape(name, list(parts), seed)


VASE = [0.2, 0.3, 0.36, 0.37, 0.33, 0.25, 0.17, 0.13, 0.13, 0.17]
# Ten further ones, on which nothing was chosen: two sheets, two surfaces of revolution, two of
# several parts, and what else pybullet has. Views and sizes are as they first came to mind.
HELD_OUT: dict[str, tuple[Maker, View]] = {
    "leaf": (_made("leaf", 21, ball((0, 0, 0), (0.3, 0.5, 0.008))), (-25, 10, 20)),
    "card": (_made("card", 22, _plank((0.7, 0.95, 0.012), (0, 0, 0))), (30, 12, 0)),
    "vase": (_made("vase", 23, _lathed(VASE, 1.0)), (0, 15, 0)),
    "plate": (_made("plate", 24, _lathed([0.3, 0.42, 0.5], 0.1)), (10, 35, 0)),
    "cup": (
        _made("cup", 25, _lathed([0.2, 0.26, 0.29, 0.3], 0.42, 0.06),
              _lathed([0.3, 0.45, 0.52], 0.06)), (20, 28, 0),
    ),
    "lamp": (
        _made("lamp", 26, _lathed([0.3, 0.28], 0.08), _lathed([0.04, 0.04], 0.7),
              _lathed([0.36, 0.2], 0.4, 0.6)), (0, 12, 0),
    ),
    "domino": (_mesh("domino/domino.obj", "domino", Z_UP, "domino/domino.jpg"), (40, 20, 0)),
    "cone": (_mesh("racecar/meshes/cone.obj", "cone", Z_UP, seed=28), (30, 15, 0)),
    "hand": (_mesh("franka_panda/meshes/collision/hand.obj", "hand", Z_UP, seed=29), (35, 15, 0)),
    "beaker": (_mesh("objects/mug.obj", "beaker", Z_UP, seed=30), (25, 15, 0)),
}  # fmt: skip
MADE = ("figure", "mug", "box")  # here: nothing is fetched for them


def upright(name: str) -> F64:
    """(3,) camera axes: what is down of the solid called `name` as the photo sees it."""
    _, side = (SOLIDS | HELD_OUT)[name]
    return turn_matrix(*side)[:, 1]


def load(name: str, meshes: Path) -> Solid:
    """The solid called `name` as the photo sees it; `meshes` is not read for one that is MADE."""
    make, side = (SOLIDS | HELD_OUT)[name]
    return make(meshes).turned(*side)
