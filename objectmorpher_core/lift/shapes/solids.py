"""The explicit shapes as closed meshes in camera axes."""

from __future__ import annotations

from functools import cache

import numpy as np

from ...base.arrays import F64, I64
from .drawing import Mesh

AROUND = 28  # corners of a ring, while its numbers are looked for
FINE = 96  # of one that is shown
RINGS = 14  # of a ball; of one that is shown so many times more as it has corners


def box(centre: F64, axes: F64, half: F64) -> Mesh:
    """About `centre` (3,), `half` (3,) as long along the rows of `axes` (3, 3), unit."""
    return Mesh(centre + (_CORNERS * half) @ axes, _SIDES, axes)


def ellipsoid(centre: F64, columns: F64, around: int = AROUND) -> Mesh:
    """The unit ball about `centre` (3,) under a linear map (3, 3)."""
    vertices, faces = _ball(around)
    return Mesh(centre + vertices @ columns.T, faces)


def revolved(places: F64, radii: F64, axis: F64, around: int = AROUND) -> Mesh:
    """Rings of `radii` (n,) about `places` (n, 3) on an axis with the direction `axis` (3,)."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    across = np.cross(axis, helper)
    across /= np.linalg.norm(across)
    over = np.cross(axis, across)
    turn = 2 * np.pi * np.arange(around) / around
    ways = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * over
    rings = places[:, None] + radii[:, None, None] * ways
    vertices = np.concatenate([rings.reshape(-1, 3), places[[0, -1]]])
    return Mesh(np.asarray(vertices, np.float64), _rings(len(places), around), axis[None])


def tube(centre: F64, axis: F64, sizes: F64, around: int = AROUND) -> Mesh:
    """A ring about `centre` (3,) and `axis` (3,), unit.

    `sizes` (3,): its radius, and half of the tube's width, across the axis and along it.
    """
    across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    across /= np.linalg.norm(across)
    turn, own = (2 * np.pi * np.arange(n) / n for n in (around, around // 2))
    ways = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * np.cross(axis, across)
    away = sizes[0] + sizes[1] * np.cos(own)
    vertices = away[:, None] * ways[:, None] + (sizes[2] * np.sin(own))[:, None] * axis
    count = len(own)
    k, m = np.meshgrid(np.arange(around), np.arange(count), indexing="ij")
    after, beside = ((k + 1) % around) * count, (m + 1) % count
    a, b, c, d = k * count + m, after + m, after + beside, k * count + beside
    faces = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    return Mesh(centre + vertices.reshape(-1, 3), faces.astype(np.int64), axis[None])


def sheet(corner_rays: F64, inverse: F64, share: float) -> Mesh:
    """A plate: what rays (n, 3) with z = 1 around its outline meet; `share` thicker behind."""
    front = corner_rays / inverse[:, None]
    n = len(front)
    vertices = np.concatenate([front, front * (1 + share)])
    k = np.arange(1, n - 1)
    cap = np.column_stack([np.zeros_like(k), k, k + 1])
    return Mesh(vertices, np.concatenate([cap, cap[:, ::-1] + n]).astype(np.int64))


_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
_SIDES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]], np.int64,
)  # fmt: skip


@cache
def _rings(count: int, around: int) -> I64:
    """(F, 3) faces between `count` rings, and two caps about the last two vertices."""
    k = np.arange(around)
    after = (k + 1) % around
    faces = []
    for ring in range(count - 1):
        a, b = ring * around, (ring + 1) * around
        faces += [np.column_stack([a + k, b + k, b + after]),
                  np.column_stack([a + k, b + after, a + after])]  # fmt: skip
    last = (count - 1) * around
    first_middle, last_middle = count * around, count * around + 1
    faces.append(np.column_stack([np.full(around, first_middle), k, after]))
    faces.append(np.column_stack([np.full(around, last_middle), last + after, last + k]))
    return np.concatenate(faces).astype(np.int64)


@cache
def _ball(around: int) -> tuple[F64, I64]:
    rings = RINGS * around // AROUND
    angles = np.pi * (np.arange(rings) + 0.5) / rings
    places = np.column_stack([0 * angles, -np.cos(angles), 0 * angles])
    mesh = revolved(places, np.sin(angles), np.array([0.0, 1.0, 0.0]), around)
    return mesh.vertices, mesh.faces
