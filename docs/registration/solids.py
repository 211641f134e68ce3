"""The twenty objects: what they are, how they are sampled, and the turns that leave them alike.

Fourteen are meshes of the package pybullet (zlib licence), fetched into the user's cache and never
kept with the project; six are made here.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from objectmorpher_core.base.arrays import F32, F64
from objectmorpher_core.base.poisson_disk import thin_to_spacing
from objectmorpher_core.base.rotations import matrix_from_vector, quats_along
from objectmorpher_core.document.gaussians import Gaussians

sys.path.append(str(Path(__file__).resolve().parents[1]))
from meshes import fetched  # beside this folder: other pages have them, too

GAUSSIANS = 20_000
GREY = 0.6


@dataclass(frozen=True, eq=False)
class Solid:
    """A mesh, centred, its largest extent 1, and its colours."""

    name: str
    points: F64  # (V, 3)
    faces: np.ndarray  # (F, 3)
    colors: Callable[[np.ndarray, F64], F64]  # of faces (n,) at weights (n, 3): sRGB (n, 3)
    symmetry: str  # in words; "" for none
    turns: F64  # (k, 3, 3) rotations that leave it alike, the first one is none


def solids() -> list[Solid]:
    """All of them, in the order of the table."""
    root = fetched()
    files = [
        ("duck", "duck.obj", ""), ("rabbit", "bunny.obj", ""), ("bear", "teddy2_VHACD_CHs.obj", ""),
        ("mug", "objects/mug.obj", ""), ("robot's body", "laikago/chassis.obj", ""),
        ("robot's trunk", "a1/meshes/trunk.obj", ""),
        ("robot's hand", "franka_panda/meshes/collision/hand.obj", ""),
        ("wood piece", "random_urdfs/782/782.obj", ""), ("tray", "tray/tray_textured.obj", ""),
        ("domino", "domino/domino.obj", ""), ("wooden block", "jenga/jenga.obj", ""),
        ("traffic cone", "racecar/meshes/cone.obj", "fourfold z"),
        ("building block", "lego/lego.obj", "fourfold y"),
        ("torus", "torus/torus_textured.obj", "round y, flipped"),
    ]  # fmt: skip
    found = [_from_file(name, root / file, symmetry) for name, file, symmetry in files]
    ball, tube = trimesh.creation.icosphere(5), trimesh.creation.cylinder(0.3, 1.0, sections=96)
    made = [
        ("plain ball", ball, "any turn", False),
        ("plain cylinder", tube, "round z, flipped", False),
        ("plain cube", trimesh.creation.box((1, 1, 1)), "cube", False),
        ("patterned ball", ball, "", True), ("patterned knot", _knot(), "", True),
        ("patterned bracket", _bracket(), "", True),
    ]  # fmt: skip
    return found + [_made(*parts) for parts in made]


def _from_file(name: str, path: Path, symmetry: str) -> Solid:
    loaded: Any = trimesh.load(path, process=False)
    mesh = loaded.to_geometry() if hasattr(loaded, "to_geometry") else loaded
    visual, faces = mesh.visual, np.asarray(mesh.faces)
    image = getattr(getattr(visual, "material", None), "image", None)
    uv = getattr(visual, "uv", None)
    if image is not None and uv is not None:
        texels = np.asarray(image.convert("RGB"), np.float64) / 255

        def colors(of: np.ndarray, weights: F64) -> F64:
            at = (uv[faces[of]] * weights[:, :, None]).sum(1) % 1.0
            rows = ((1 - at[:, 1]) * texels.shape[0]).astype(int) % texels.shape[0]
            columns = (at[:, 0] * texels.shape[1]).astype(int) % texels.shape[1]
            return texels[rows, columns]
    else:
        plain = np.array([GREY] * 3)

        def colors(of: np.ndarray, weights: F64) -> F64:
            return np.tile(plain, (len(of), 1))

    return _solid(name, np.asarray(mesh.vertices, np.float64), faces, colors, symmetry)


def _made(name: str, mesh: trimesh.Trimesh, symmetry: str, is_patterned: bool) -> Solid:
    faces, points = np.asarray(mesh.faces), _centred(np.asarray(mesh.vertices, np.float64))

    def colors(of: np.ndarray, weights: F64) -> F64:
        if not is_patterned:
            return np.full((len(of), 3), GREY)
        return pattern((points[faces[of]] * weights[:, :, None]).sum(1))

    return _solid(name, points, faces, colors, symmetry)


def pattern(points: F64) -> F64:
    """sRGB (n, 3): waves through space, of all colours."""
    rng = np.random.default_rng(3)
    ways = rng.normal(size=(24, 3)) * rng.uniform(4, 18, (24, 1))
    phases, hues = rng.uniform(0, 2 * np.pi, 24), rng.normal(size=(24, 3))
    waves = np.sin(points @ ways.T + phases) @ hues
    return 0.5 + 0.4 * np.tanh(0.4 * waves)


def _solid(
    name: str, points: F64, faces: np.ndarray, colors: Callable[..., F64], symmetry: str
) -> Solid:
    return Solid(name, _centred(points), faces, colors, symmetry, _turns(symmetry))


def _centred(points: F64) -> F64:
    low, high = points.min(0), points.max(0)
    return (points - 0.5 * (low + high)) / (high - low).max()


def _turns(symmetry: str) -> F64:
    """The rotations of a symmetry; of a round one every half degree."""
    kind, _, rest = symmetry.partition(" ")
    axis = np.eye(3)["xyz".find(rest[:1]) if rest[:1] in ("x", "y", "z") else 2]
    count = {"fourfold": 4, "round": 720}.get(kind, 1)
    turns = [matrix_from_vector(axis * 2 * np.pi * k / count) for k in range(count)]
    if "flipped" in symmetry:
        across = np.roll(axis, 1)
        turns += [turn @ matrix_from_vector(across * np.pi) for turn in turns]
    if kind == "cube":
        grid = [np.array(m).reshape(3, 3) for m in _signed_permutations()]
        turns = [m for m in grid if np.linalg.det(m) > 0]
        turns.sort(key=lambda m: -np.trace(m))
    return np.array(turns)


def _signed_permutations() -> list[F64]:
    from itertools import permutations, product

    eye = np.eye(3)
    return [
        eye[list(order)] * np.array(signs)[:, None]
        for order in permutations(range(3))
        for signs in product((1, -1), repeat=3)
    ]


def _knot() -> trimesh.Trimesh:
    """A trefoil's tube, thicker on one side, and inside out, as not a few meshes are."""
    around, along = 28, 360
    t = 2 * np.pi * np.arange(along) / along
    path = np.column_stack(
        [np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)]
    )
    tangent = np.roll(path, -1, 0) - np.roll(path, 1, 0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, [0.3, 0.2, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(tangent, side)
    angle = 2 * np.pi * np.arange(around) / around
    radius = (0.55 + 0.2 * np.cos(t))[:, None, None]
    rings = side[:, None] * np.cos(angle)[:, None] + up[:, None] * np.sin(angle)[:, None]
    points = (path[:, None] + radius * rings).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    a, b = (i * around + j).ravel(), (i * around + (j + 1) % around).ravel()
    c, d = (
        (((i + 1) % along) * around + (j + 1) % around).ravel(),
        (((i + 1) % along) * around + j).ravel(),
    )
    return trimesh.Trimesh(points, np.concatenate([np.c_[a, d, c], np.c_[a, c, b]]), process=False)


def _bracket() -> trimesh.Trimesh:
    """Three boxes of different lengths that meet in a corner."""
    boxes = []
    for extent in ((1.0, 0.25, 0.3), (0.25, 0.7, 0.3), (0.25, 0.25, 0.55)):
        box = trimesh.creation.box(extent)
        box.apply_translation(np.array(extent) / 2)
        boxes.append(box)
    return trimesh.util.concatenate(boxes)


def gaussians(solid: Solid, is_cloud: bool = False, seed: int = 0) -> Gaussians:
    """About GAUSSIANS surfels, evenly spread; or a cloud of round, translucent ones, unevenly."""
    rng = np.random.default_rng(seed)
    corners = solid.points[solid.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(2 * areas, 1e-12)[:, None]
    wanted = GAUSSIANS if is_cloud else 10 * GAUSSIANS
    chosen = rng.choice(len(areas), wanted, p=areas / areas.sum())
    root, share = np.sqrt(rng.random(wanted)), rng.random(wanted)
    weights = np.column_stack([1 - root, root * (1 - share), root * share])
    points = (corners[chosen] * weights[:, :, None]).sum(1)
    spacing = float(np.sqrt(areas.sum() / GAUSSIANS))
    if not is_cloud:
        kept = thin_to_spacing(points, spacing * np.sqrt(0.68), rng.permutation(wanted))
        points, chosen, weights = points[kept], chosen[kept], weights[kept]
    else:
        inward = 0.5 * spacing  # as training leaves them: what is drawn has the right size
        points = points - inward * normals[chosen] + rng.normal(0, 0.2 * spacing, points.shape)
    sizes = [0.66, 0.66, 0.66 if is_cloud else 0.12]
    arrays = (
        points, quats_along(normals[chosen]), np.tile(np.array(sizes) * spacing, (len(points), 1)),
        np.full(len(points), 0.7 if is_cloud else 1.0), solid.colors(chosen, weights).clip(0, 1),
    )  # fmt: skip
    packed: list[F32] = [np.asarray(array, np.float32) for array in arrays]
    return Gaussians(*packed)
