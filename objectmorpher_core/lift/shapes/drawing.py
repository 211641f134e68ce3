"""Closed meshes drawn into depth buffers: the nearest and the farthest surface on every ray."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...base.arrays import F64, I64
from ...base.kernel_files import numba


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
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        u, v = b - a, c - a
        x, y, z = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
        size = max(np.sqrt(x * x + y * y + z * z), 1e-12)
        normals[f, 0], normals[f, 1], normals[f, 2] = x / size, y / size, z / size
    return normals


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
