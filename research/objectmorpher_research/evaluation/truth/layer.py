"""A thing drawn as textured triangles: how the methods that have no Gaussians draw."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F64, I32, RGB, crop
from objectmorpher_core.document.model import Matte

from .lookup import looked_up
from .rasterise import Hits, interpolated, pixel_means, rasterise

SHRUNK = 0.85  # of its area, below which colours are means over a pixel and no longer sharp


@dataclass(frozen=True, eq=False)
class CutOut:
    """Straight colours and coverage of a thing; both of the whole picture."""

    color: F64  # (H, W, 3) in [0, 1]
    alpha: F64  # (H, W)

    def over(self, plate: RGB, photo: RGB, matte: Matte) -> RGB:
        """The photo, but for where the thing was and is now: there it lies over the plate."""
        height, width = plate.shape[:2]
        was = crop(matte.alpha, matte.box, (0, 0, width, height)) > 0
        alpha = self.alpha[..., None]
        mixed = np.clip(alpha * self.color * 255 + (1 - alpha) * plate + 0.5, 0, 255)
        is_touched = (was | (self.alpha > 0) | (plate != photo).any(-1))[..., None]
        return np.where(is_touched, mixed.astype(np.uint8), photo)


@dataclass(frozen=True, eq=False)
class TexturedMesh:
    """Triangles that carry the photo."""

    uv: F64  # (V, 2) px of the photo
    faces: I32  # (F, 3)
    is_solid: bool = False  # covers all that it is drawn over; else as the matte says there
    plain: F64 | None = None  # (V, 3) colours of faces from `painted` on
    painted: int = 0  # faces that carry the photo, when others are plain


def draw_sheet(
    sheet: TexturedMesh, at: F64, depth: F64, matte: Matte, size: tuple[int, int]
) -> CutOut:
    """The triangles with their corners at px (V, 2) and depths (V,); `size`: width, height."""
    hits = rasterise(at, depth, sheet.faces, size)
    if _is_shrunk(sheet, at):
        color, alpha = _samples(sheet, hits, matte)
        alpha_mean = pixel_means(alpha[..., None])
        color = pixel_means(color * alpha[..., None]) / np.maximum(alpha_mean, 1e-9)
        return CutOut(color, alpha_mean[..., 0])
    middle = hits.middles()
    color, _ = _samples(sheet, middle, matte)
    whole, alpha = _samples(sheet, hits, matte)
    mean = pixel_means(alpha[..., None])
    rim = (middle.face < 0)[..., None]
    blurred = pixel_means(whole * alpha[..., None]) / np.maximum(mean, 1e-9)
    return CutOut(np.where(rim, blurred, color), mean[..., 0])


def _is_shrunk(sheet: TexturedMesh, at: F64) -> bool:
    def area(corners: F64) -> float:
        a, b, c = (corners[sheet.faces[:, k]] for k in range(3))
        u, v = b - a, c - a
        return float(np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum())

    return area(at) < SHRUNK * area(sheet.uv)


def _samples(sheet: TexturedMesh, hits: Hits, matte: Matte) -> tuple[F64, F64]:
    """Colours (h, w, 3) and coverage (h, w) of every sample."""
    hit = hits.face >= 0
    uv = interpolated(sheet.uv, sheet.faces, hits) - [matte.left + 0.5, matte.top + 0.5]
    found = looked_up(matte.foreground, uv, cv2.INTER_CUBIC, cv2.BORDER_REPLICATE)
    if sheet.plain is not None:
        is_plain = hits.face[hit] >= sheet.painted
        found[is_plain] = interpolated(sheet.plain, sheet.faces, hits)[is_plain]
    color, alpha = np.zeros((*hit.shape, 3)), hit.astype(np.float64)
    color[hit] = np.clip(found, 0, 1)
    if not sheet.is_solid:
        alpha[hit] = np.clip(looked_up(matte.alpha, uv, cv2.INTER_CUBIC)[:, 0], 0, 1)
    return color, alpha
