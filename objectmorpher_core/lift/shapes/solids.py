"""The explicit shapes as closed meshes in camera axes, and the depths of meshes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from ...base.arrays import F64, I64
from ...base.kernel_files import numba

AROUND = 28  # corners of a ring, while its numbers are looked for
FINE = 96  # of one that is shown
RINGS = 14  # of a ball; of one that is shown so many times more as it has corners


def cross(one: F64, other: F64) -> F64:
    """The cross products of (..., 3) and (..., 3): of few, in less than half of numpy's time."""
    a, b, c = one[..., 0], one[..., 1], one[..., 2]
    x, y, z = other[..., 0], other[..., 1], other[..., 2]
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


# Closed meshes drawn into depth buffers: the nearest and the farthest surface on every ray.


class Mesh(NamedTuple):
    """A closed surface in camera axes: x right, y down, z forward."""

    vertices: F64  # (V, 3)
    faces: I64  # (F, 3), outward by the right-hand rule seen from outside with y down
    axes: F64 = np.zeros((0, 3))  # (k, 3) unit, about which it is alike: it may stand along one


@dataclass(frozen=True)
class RayGrid:
    """Rays through a grid of pixels: the tangents of pixel (j, i) are start + step (j, i)."""

    start: tuple[float, float]
    step: float
    shape: tuple[int, int]  # (h, w)

    @property
    def tangents(self) -> F64:
        """(h, w, 2) x / z and y / z of the rays."""
        i, j = np.indices(self.shape)
        found = np.stack([self.start[0] + self.step * j, self.start[1] + self.step * i], -1)
        return np.asarray(found, np.float64)


class Drawn(NamedTuple):
    """The hits of a grid's rays; 0 and -1 where they meet nothing."""

    near: F64  # (h, w) inverse depth along the axis, of the nearest surface
    far: F64  # (h, w) of the farthest
    face: I64  # (h, w) the nearest face


def drawn(mesh: Mesh, grid: RayGrid) -> Drawn:
    """`mesh`, all of it in front of the camera, as the rays of `grid` meet it."""
    x, y, z = mesh.vertices.T
    places = np.column_stack(
        [(x / z - grid.start[0]) / grid.step, (y / z - grid.start[1]) / grid.step, 1 / z]
    )
    return Drawn(*_rasterised(places, mesh.faces, *grid.shape))


def face_normals(mesh: Mesh) -> F64:
    """(F, 3) unit."""
    return _face_normals(mesh.vertices, mesh.faces)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _face_normals(vertices, faces):
    normals = np.zeros((len(faces), 3))
    for f in range(len(faces)):
        a, b, c = faces[f]
        ux, uy, uz = _between(vertices, a, b)
        vx, vy, vz = _between(vertices, a, c)
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        size = max(np.sqrt(x * x + y * y + z * z), 1e-12)
        normals[f, 0], normals[f, 1], normals[f, 2] = x / size, y / size, z / size
    return normals


@numba.njit(cache=True, nogil=True)
def _between(vertices, a, b):
    x, y, z = vertices[a]
    u, v, w = vertices[b]
    return u - x, v - y, w - z


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _rasterised(places, faces, height, width):
    """Over pixel centres; 1 / depth is linear over a face's picture."""
    near, far = np.zeros((height, width)), np.zeros((height, width))
    face = np.full((height, width), -1, np.int64)
    for f in range(len(faces)):
        a, b, c = places[faces[f, 0]], places[faces[f, 1]], places[faces[f, 2]]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(area) < 1e-12:
            continue
        left = max(int(np.ceil(min(a[0], min(b[0], c[0])) - 1e-9)), 0)
        right = min(int(np.floor(max(a[0], max(b[0], c[0])) + 1e-9)), width - 1)
        top = max(int(np.ceil(min(a[1], min(b[1], c[1])) - 1e-9)), 0)
        bottom = min(int(np.floor(max(a[1], max(b[1], c[1])) + 1e-9)), height - 1)
        for i in range(top, bottom + 1):
            for j in range(left, right + 1):
                u = ((b[0] - j) * (c[1] - i) - (b[1] - i) * (c[0] - j)) / area
                v = ((c[0] - j) * (a[1] - i) - (c[1] - i) * (a[0] - j)) / area
                w = 1.0 - u - v
                if u < -1e-9 or v < -1e-9 or w < -1e-9:
                    continue
                inverse = u * a[2] + v * b[2] + w * c[2]
                if inverse > near[i, j]:
                    near[i, j] = inverse
                    face[i, j] = f
                if far[i, j] == 0.0 or inverse < far[i, j]:
                    far[i, j] = inverse
    return near, far, face


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
    across = cross(axis, helper)
    across /= np.linalg.norm(across)
    over = cross(axis, across)
    turn = 2 * np.pi * np.arange(around) / around
    ways = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * over
    rings = places[:, None] + radii[:, None, None] * ways
    vertices = np.concatenate([rings.reshape(-1, 3), places[[0, -1]]])
    return Mesh(np.asarray(vertices, np.float64), _rings(len(places), around), axis[None])


def tube(centre: F64, axis: F64, sizes: F64, around: int = AROUND) -> Mesh:
    """A ring about `centre` (3,) and `axis` (3,), unit.

    `sizes` (3,): its radius, and half of the tube's width, across the axis and along it.
    """
    across = cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    across /= np.linalg.norm(across)
    turn, own = (2 * np.pi * np.arange(n) / n for n in (around, around // 2))
    ways = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * cross(axis, across)
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
