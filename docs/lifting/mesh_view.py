"""A solid as a camera sees it: a depth buffer with many samples in a pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from solids import Solid

from objectmorpher_core.arrays import F64
from objectmorpher_core.camera import Camera
from objectmorpher_research.evaluation.truth.rasterise import SAMPLES, pixel_means, rasterised


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
    nearest, farthest, face, corners = rasterised(
        pixels.astype(np.float64), world[:, 2].copy(), solid.faces, height, width
    )
    hit = face >= 0
    weights = corners[hit]
    points = (solid.vertices[solid.faces[face[hit]]] * weights[:, :, None]).sum(1)
    colors = np.zeros((height, width, 3))
    colors[hit] = solid.colors(points, face[hit], weights)

    alpha = pixel_means(hit[..., None].astype(np.float64))[..., 0]
    color = pixel_means(colors) / np.maximum(alpha, 1e-9)[..., None]
    depth = nearest.reshape(camera.height, n, camera.width, n).min((1, 3))
    back = farthest.reshape(camera.height, n, camera.width, n).max((1, 3))
    return View(color, alpha, depth, back)
