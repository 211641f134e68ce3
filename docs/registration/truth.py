"""Photos whose truth is known: a mesh drawn by its triangles over a photo.

Nothing here is shared with the registration: triangles are drawn with a depth buffer, nine samples
in a pixel, lit by a lamp and the sky, exposed and balanced at random, with noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from solids import Solid

from objectmorpher_core.base.arrays import F64, Mask, Pixels
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.rotations import matrices_from_quats

WIDTH, HEIGHT = 640, 480  # px
FOVS = 20.0, 70.0  # degrees, horizontal
SIZES = 170.0, 300.0  # px of the object's extent
ASIDE = 0.2  # x the photo's sides: how far from the middle it may stand
SAMPLES = 3  # by as many in a pixel
SKY, LAMP = 0.6, 0.5
NOISE = 0.012  # sRGB


@dataclass(frozen=True, eq=False)
class Scene:
    """A photo of a solid, and where it stands."""

    solid: Solid
    pixels: Pixels  # (H, W, 3)
    mask: Mask  # (H, W)
    camera: Camera
    world_from_solid: F64  # (4, 4), scale 1


def scene(solid: Solid, ground: Pixels, seed: int) -> Scene:
    """`solid` in a random pose before a random camera, over the photo `ground`."""
    rng = np.random.default_rng(seed)
    camera = Camera.from_fov(WIDTH, HEIGHT, rng.uniform(*FOVS))
    matrix = np.eye(4)
    matrix[:3, :3] = matrices_from_quats(rng.normal(size=(1, 4)))[0]
    middle = np.array([WIDTH, HEIGHT]) * (0.5 + rng.uniform(-ASIDE, ASIDE, 2))
    matrix[:3, 3] = camera.unproject(middle, camera.focal / rng.uniform(*SIZES))
    lamp = rng.normal(size=3) - [0, 0, 1.2]
    alpha, color = draw(solid, matrix, camera, lamp / np.linalg.norm(lamp))
    color = color * rng.uniform(0.75, 1.15) * rng.uniform(0.92, 1.08, 3)
    photo = alpha[..., None] * color + (1 - alpha[..., None]) * ground / 255
    photo = np.clip(photo + rng.normal(0, NOISE, photo.shape), 0, 1)
    return Scene(solid, np.rint(255 * photo).astype(np.uint8), alpha > 0.5, camera, matrix)


def draw(solid: Solid, matrix: F64, camera: Camera, lamp: F64 | None = None) -> tuple[F64, F64]:
    """Coverage (H, W) and straight colour (H, W, 3); without a `lamp` the colours themselves."""
    fine = camera.windowed(0, 0, camera.width * SAMPLES, camera.height * SAMPLES, SAMPLES)
    corners = np.ascontiguousarray((solid.points @ matrix[:3, :3].T + matrix[:3, 3])[solid.faces])
    faces = np.full((fine.height, fine.width), -1, np.int64)
    weights = np.zeros((fine.height, fine.width, 3))
    _draw(corners, fine.focal, fine.cx, fine.cy, faces, weights)
    hit = faces >= 0
    own = solid.colors(faces[hit], weights[hit])
    if lamp is not None:
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        normals *= -np.sign((normals * corners.mean(1)).sum(1, keepdims=True))
        own = own * (SKY + LAMP * np.maximum(normals[faces[hit]] @ lamp, 0))[:, None]
    color = np.zeros((*faces.shape, 3))
    color[hit] = np.clip(own, 0, 1)
    blocks = (camera.height, SAMPLES, camera.width, SAMPLES)
    share = hit.reshape(blocks).mean((1, 3))
    total = color.reshape(*blocks, 3).mean((1, 3))
    return share, total / np.maximum(share, 1e-9)[..., None]


@numba.njit(cache=True)
def _draw(corners, focal, cx, cy, faces, weights):
    """Nearest triangle of each sample and the perspective-correct weights of its corners."""
    height, width = faces.shape
    nearest = np.zeros((height, width))  # 1 / z
    x, y, inverse = np.empty(3), np.empty(3), np.empty(3)
    for t in range(len(corners)):
        if min(corners[t, 0, 2], corners[t, 1, 2], corners[t, 2, 2]) < 1e-3:
            continue
        for k in range(3):
            inverse[k] = 1.0 / corners[t, k, 2]
            x[k] = focal * corners[t, k, 0] * inverse[k] + cx
            y[k] = focal * corners[t, k, 1] * inverse[k] + cy
        area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
        if area == 0.0:
            continue
        for row in range(max(int(y.min() - 0.5), 0), min(int(y.max() + 0.5) + 1, height)):
            for column in range(max(int(x.min() - 0.5), 0), min(int(x.max() + 0.5) + 1, width)):
                px, py = column + 0.5, row + 0.5
                a = ((x[1] - px) * (y[2] - py) - (x[2] - px) * (y[1] - py)) / area
                b = ((x[2] - px) * (y[0] - py) - (x[0] - px) * (y[2] - py)) / area
                c = 1.0 - a - b
                if a < 0.0 or b < 0.0 or c < 0.0:
                    continue
                depth = a * inverse[0] + b * inverse[1] + c * inverse[2]
                if depth > nearest[row, column]:
                    nearest[row, column], faces[row, column] = depth, t
                    weights[row, column, 0] = a * inverse[0] / depth
                    weights[row, column, 1] = b * inverse[1] / depth
                    weights[row, column, 2] = c * inverse[2] / depth
