"""A solid as a camera sees it: a depth buffer with many samples in a pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from solids import Solid

from objectmorpher_core.arrays import F64
from objectmorpher_core.camera import Camera

SAMPLES = 3  # by as many in a pixel


@dataclass(frozen=True, eq=False)
class View:
    """What the camera sees; colours are straight."""

    color: F64  # (h, w, 3) the mean of what is hit
    alpha: F64  # (h, w) share that is hit
    depth: F64  # (h, w) world, of the nearest; inf where nothing is
    back: F64  # (h, w) world, of the farthest; -inf where nothing is


def draw(solid: Solid, world: F64, camera: Camera) -> View:
    """The solid with its vertices at `world` (V, 3)."""
    n = SAMPLES
    pixels = camera.project(world) * n
    height, width = camera.height * n, camera.width * n
    nearest, farthest, face, corners = _rasterise(
        pixels.astype(np.float64), world[:, 2].copy(), solid.faces, height, width
    )
    hit = face >= 0
    weights = corners[hit]
    points = (solid.vertices[solid.faces[face[hit]]] * weights[:, :, None]).sum(1)
    colors = np.zeros((height, width, 3))
    colors[hit] = solid.colors(points, face[hit], weights)

    def mean(image: F64) -> F64:
        return image.reshape(camera.height, n, camera.width, n, -1).mean((1, 3))

    alpha = mean(hit[..., None].astype(np.float64))[..., 0]
    color = mean(colors) / np.maximum(alpha, 1e-9)[..., None]
    depth = nearest.reshape(camera.height, n, camera.width, n).min((1, 3))
    back = farthest.reshape(camera.height, n, camera.width, n).max((1, 3))
    return View(color, alpha, depth, back)


@numba.njit(cache=True)
def _rasterise(pixels, depth, faces, height, width):
    """Depths (h, w) of nearest and farthest faces; the nearest's index, its corners' weights."""
    nearest = np.full((height, width), np.inf)
    farthest = np.full((height, width), -np.inf)
    found = np.full((height, width), -1, np.int32)
    corners = np.zeros((height, width, 3))
    for f in range(len(faces)):
        a, b, c = faces[f]
        ax, ay, bx, by, cx, cy = (
            pixels[a, 0], pixels[a, 1], pixels[b, 0], pixels[b, 1], pixels[c, 0], pixels[c, 1],
        )  # fmt: skip
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if abs(area) < 1e-12:
            continue
        left = max(int(np.floor(min(ax, bx, cx) - 0.5)), 0)
        right = min(int(np.ceil(max(ax, bx, cx))) + 1, width)
        top = max(int(np.floor(min(ay, by, cy) - 0.5)), 0)
        bottom = min(int(np.ceil(max(ay, by, cy))) + 1, height)
        for i in range(top, bottom):
            y = i + 0.5
            for j in range(left, right):
                x = j + 0.5
                u = ((bx - x) * (cy - y) - (cx - x) * (by - y)) / area
                v = ((cx - x) * (ay - y) - (ax - x) * (cy - y)) / area
                w = 1.0 - u - v
                if u < -1e-9 or v < -1e-9 or w < -1e-9:
                    continue
                inverse = u / depth[a] + v / depth[b] + w / depth[c]
                z = 1.0 / inverse
                farthest[i, j] = max(farthest[i, j], z)
                if z < nearest[i, j]:
                    nearest[i, j] = z
                    found[i, j] = f
                    corners[i, j, 0] = u / depth[a] * z
                    corners[i, j, 1] = v / depth[b] * z
                    corners[i, j, 2] = w / depth[c] * z
    return nearest, farthest, found, corners
