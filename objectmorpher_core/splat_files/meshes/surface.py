"""The triangles of a mesh, all in one frame, and what they look like; where they are sampled."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64, I32, U8, Mask


@dataclass(frozen=True, eq=False)
class Look:
    """The look of one material's triangles, before their tint."""

    texture: Texture | None
    cutoff: float | None  # alpha from which a spot is there at all; None: alpha is opacity
    is_opaque: bool  # alpha means nothing


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles, counter-clockwise from outside."""

    corners: F64  # (T, 3, 3)
    uv: F64  # (T, 3, 2) v up from the picture's bottom row
    tint: F32  # (T, 3, 4) linear straight RGBA, times the texture
    which: np.ndarray  # (T,) index into looks
    looks: tuple[Look, ...]

    def areas(self) -> F64:
        """(T,)"""
        return 0.5 * np.linalg.norm(self._cross(), axis=1)

    def normals(self) -> F64:
        """(T, 3) unit, by the corners' order; of a triangle without area anything."""
        cross = self._cross()
        return cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-300)

    def select(self, kept: Mask) -> TriangleMesh:
        """The triangles at `kept` (T,)."""
        return TriangleMesh(
            self.corners[kept], self.uv[kept], self.tint[kept], self.which[kept], self.looks
        )  # fmt: skip

    def _cross(self) -> F64:
        a, b, c = (self.corners[:, k] for k in range(3))
        return np.cross(b - a, c - a)


@dataclass(frozen=True, eq=False)
class Spots:
    """Places spread evenly over a surface."""

    points: F64  # (M, 3)
    triangle: I32  # (M,)
    weights: F64  # (M, 3) barycentric

    @staticmethod
    def spread(surface: TriangleMesh, count: int, rng: np.random.Generator) -> Spots:
        """`count` places, as many a unit of area everywhere."""
        cumulative = np.cumsum(surface.areas())
        # one in each count-th part of the area: evener than independent draws
        marks = (np.arange(count) + rng.random(count)) / count * cumulative[-1]
        triangle = np.minimum(np.searchsorted(cumulative, marks), len(cumulative) - 1)
        root, along = np.sqrt(rng.random(count)), rng.random(count)
        weights = np.stack([1 - root, root * (1 - along), root * along], axis=1)
        points = np.einsum("mk,mka->ma", weights, surface.corners[triangle])
        return Spots(points, triangle.astype(np.int32), weights)

    def colors(self, surface: TriangleMesh, width: float) -> F32:
        """Premultiplied linear RGBA (M, 4) of spots `width` wide, in the surface's units."""
        tint = np.einsum("mk,mka->ma", self.weights, surface.tint[self.triangle])
        uv = np.einsum("mk,mka->ma", self.weights, surface.uv[self.triangle])
        stretch = _stretch(surface)[self.triangle]
        which = surface.which[self.triangle]
        colors = np.ones((len(uv), 4), np.float32)
        for k, look in enumerate(surface.looks):
            rows = which == k
            if look.texture is not None:
                size = np.sqrt(look.texture.width * look.texture.height)
                colors[rows] = look.texture.sample(uv[rows], stretch[rows] * size * width)
            if look.is_opaque:
                colors[rows, :3] /= np.maximum(colors[rows, 3:], 1e-6)
                tint[rows, 3] = colors[rows, 3] = 1
            straight = tint[rows]
            colors[rows] *= np.column_stack([straight[:, :3] * straight[:, 3:], straight[:, 3]])
            if look.cutoff is not None:
                alpha = colors[rows, 3]
                kept = alpha >= look.cutoff
                colors[rows] *= np.where(kept, 1 / np.maximum(alpha, 1e-6), 0)[:, None]
        return colors


def _stretch(surface: TriangleMesh) -> F64:
    """(T,) share of the picture's side a unit of length on the surface."""
    a, b, c = (surface.uv[:, k] for k in range(3))
    ab, ac = b - a, c - a
    in_picture = 0.5 * np.abs(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    return np.sqrt(in_picture / np.maximum(surface.areas(), 1e-300))


# A surface's picture, filtered: what a spot of a given size on it looks like.

WORKING = 2048  # px, longer side: finer than any sampling of a surface here


class Texture:
    """Premultiplied linear RGBA at any place and level."""

    def __init__(self, rgba: U8) -> None:
        """Of straight sRGB pixels (H, W, 4), top row first."""
        self.height, self.width = rgba.shape[:2]
        whole: np.ndarray = np.empty(rgba.shape, np.float32)
        whole[..., 3] = rgba[..., 3] / np.float32(255)
        whole[..., :3] = LINEAR_OF_BYTE[rgba[..., :3]] * whole[..., 3:]
        self._levels: list[np.ndarray] = [whole]
        while max(whole.shape[:2]) > 1:
            half = (max(1, whole.shape[1] // 2), max(1, whole.shape[0] // 2))
            whole = cv2.resize(whole, half, interpolation=cv2.INTER_AREA)
            self._levels.append(whole)

    def sample(self, uv: F64, footprint: F64) -> F32:
        """Colours (N, 4) around `uv` (N, 2), v up from the bottom row, repeated beyond [0, 1].

        `footprint` (N,) px is the width of what each colour stands for.
        """
        level = np.log2(np.maximum(footprint, 1.0)).clip(0, len(self._levels) - 1)
        lower = np.minimum(level.astype(int), max(len(self._levels) - 2, 0))
        share = (level - lower)[:, None].astype(np.float32)
        colors = np.empty((len(uv), 4), np.float32)
        for k in np.unique(lower):
            rows = lower == k
            fine = _bilinear(self._levels[k], uv[rows])
            coarse = _bilinear(self._levels[min(k + 1, len(self._levels) - 1)], uv[rows])
            colors[rows] = fine + share[rows] * (coarse - fine)
        return colors


def _bilinear(pixels: F32, uv: F64) -> F32:
    height, width = pixels.shape[:2]
    x = (uv[:, 0] % 1.0) * width - 0.5
    y = ((1.0 - uv[:, 1]) % 1.0) * height - 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = ((a - b)[:, None].astype(np.float32) for a, b in ((x, left), (y, top)))
    columns, rows = (left % width, (left + 1) % width), (top % height, (top + 1) % height)
    upper = pixels[rows[0], columns[0]] * (1 - fx) + pixels[rows[0], columns[1]] * fx
    lower = pixels[rows[1], columns[0]] * (1 - fx) + pixels[rows[1], columns[1]] * fx
    return upper * (1 - fy) + lower * fy


def linear_from_srgb(encoded: np.ndarray) -> np.ndarray:
    """Linear light of sRGB values in [0, 1] (IEC 61966-2-1)."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(light: np.ndarray) -> np.ndarray:
    """sRGB values of linear light in [0, 1]."""
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)


LINEAR_OF_BYTE = linear_from_srgb(np.arange(256) / 255.0).astype(np.float32)
