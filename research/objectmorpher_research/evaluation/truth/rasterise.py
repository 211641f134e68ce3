"""Triangles as a camera sees them: a depth buffer with many samples in a pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objectmorpher_core.base.arrays import F64, I32
from objectmorpher_core.base.kernel_files import numba

SAMPLES = 3  # by as many in a pixel: odd, so that one is in its middle


@dataclass(frozen=True, eq=False)
class Hits:
    """The hits of every sample; SAMPLES to a pixel each way."""

    face: I32  # (h, w), -1: nothing
    corners: F64  # (h, w, 3) weights of the face's corners, right in perspective
    nearest: F64  # (h, w) depth; inf where nothing is

    @property
    def coverage(self) -> F64:
        """(H, W) share of each pixel's samples that meet something."""
        return pixel_means((self.face >= 0)[..., None].astype(np.float64))[..., 0]

    def middles(self) -> Hits:
        """The samples in the middle of the pixels."""
        n, k = SAMPLES, SAMPLES // 2
        return Hits(self.face[k::n, k::n], self.corners[k::n, k::n], self.nearest[k::n, k::n])


def rasterise(pixels: F64, depth: F64, faces: I32, size: tuple[int, int]) -> Hits:
    """Triangles `faces` (F, 3) of corners at px (V, 2) and `depth` (V,); `size`: width, height."""
    width, height = size
    scaled = np.ascontiguousarray(pixels, np.float64) * SAMPLES
    nearest, _, face, corners = rasterised(
        scaled, np.ascontiguousarray(depth, np.float64), np.ascontiguousarray(faces, np.int32),
        height * SAMPLES, width * SAMPLES,
    )  # fmt: skip
    return Hits(face, corners, nearest)


def pixel_means(samples: F64) -> F64:
    """(H, W, n) means over the samples (h, w, n) of each pixel."""
    n = SAMPLES
    height, width = samples.shape[0] // n, samples.shape[1] // n
    return samples.reshape(height, n, width, n, -1).mean((1, 3))


def interpolated(values: F64, faces: I32, hits: Hits) -> F64:
    """(m, n) of values (V, n) at the corners, for the samples that meet something, in rows."""
    hit = hits.face >= 0
    return np.einsum("mkn,mk->mn", values[faces[hits.face[hit]]], hits.corners[hit])


@numba.njit(cache=True)
def rasterised(pixels, depth, faces, height, width):
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
