"""Bodies made in code, and the handles that bend them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from objectmorpher_core.arrays import F64
from objectmorpher_core.camera import Camera
from objectmorpher_core.deform.control_points import sample_control_points
from objectmorpher_core.document import Handle, LiftedObject, PhotoTexture
from objectmorpher_core.gaussians import Gaussians
from objectmorpher_core.rotations import quats_along, turn_matrix

LIMBS = 5
LENGTH, RADIUS = 0.5, 0.07  # of a limb


def five_limbs(count: int, nodes: int) -> LiftedObject:
    """Round limbs, open at their ends, in a plane around a ball: about `count` Gaussians."""
    rng = np.random.default_rng(0)
    each = count // (LIMBS + 1)
    points, normals = [], []
    for limb in range(LIMBS):
        angle = 2 * np.pi * limb / LIMBS
        axis = np.array([np.cos(angle), np.sin(angle), 0.0])
        side = np.array([-axis[1], axis[0], 0.0])
        around = rng.uniform(0, 2 * np.pi, each)
        along = rng.uniform(0.3 * LENGTH, LENGTH, each)
        normal = np.cos(around)[:, None] * side + np.sin(around)[:, None] * [0.0, 0.0, 1.0]
        points.append(along[:, None] * axis + RADIUS * normal)
        normals.append(normal)
    ball = rng.normal(size=(each, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    means, outward = np.concatenate([*points, 0.18 * ball]), np.concatenate([*normals, ball])
    spacing = 0.01
    scales = np.tile(spacing * np.array([1, 1, 0.2], np.float32), (len(means), 1))
    grey = np.full((len(means), 3), 0.5, np.float32)
    solid = np.ones(len(means), np.float32)
    gaussians = Gaussians(
        means.astype(np.float32), quats_along(outward).astype(np.float32), scales, solid, grey
    )
    control_points = sample_control_points(gaussians.means, gaussians.opacities, nodes)
    world_from_object = np.eye(4)
    world_from_object[2, 3] = 3.0
    camera = Camera.from_fov(1024, 1024)
    u0 = camera.project(means + world_from_object[:3, 3]).astype(np.float32)
    seen = np.ones(len(means), np.float32)
    texture = PhotoTexture(u0, seen, seen)
    return LiftedObject(gaussians, texture, control_points, world_from_object, spacing, "bench")


def limb_handles(lifted: LiftedObject, degrees: float) -> tuple[Handle, ...]:
    """Two handles at the end of each limb; the first limb's are turned about its root."""
    points = lifted.control_points.astype(np.float64)
    chosen: list[Handle] = []
    turn = turn_matrix(0.0, 0.0, degrees)
    for limb in range(LIMBS):
        angle = 2 * np.pi * limb / LIMBS
        axis = np.array([np.cos(angle), np.sin(angle), 0.0])
        for up in (RADIUS, -RADIUS):
            tip = LENGTH * axis + [0.0, 0.0, up]
            node = int(((points - tip) ** 2).sum(1).argmin())
            root = 0.25 * axis
            target = points[node] if limb else root + turn @ (points[node] - root)
            if all(h.control_point != node for h in chosen):
                chosen.append(Handle(node, points[node], target, is_pin=limb > 0))
    return tuple(chosen)


def even_sphere(count: int) -> tuple[F64, np.ndarray]:
    """Vertices (count, 3) spread evenly over the unit sphere, and triangles between them."""
    k = np.arange(count) + 0.5
    height, angle = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    radius = np.sqrt(1 - height**2)
    vertices = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
    faces = ConvexHull(vertices).simplices.astype(np.int64)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * corners[:, 0]).sum(1) < 0
    faces[inward] = faces[inward, ::-1]
    return vertices, faces
