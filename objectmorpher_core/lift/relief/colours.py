"""The colours of what the photo did not show: the back, the walls, and what was hidden.

Seen from the side, most things look the same from behind: their back is the mirror image of their
front. Of what looks the same left and right, a face, the mirror image is not what is behind it:
there the rim goes on, with its texture.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask
from .bilinear import bilinear
from .canvas import Canvas
from .growing import grown
from .mirror import MirrorAxis
from .silhouette import Silhouette

FINENESS = 3.0  # px to a mean spacing: more of the photo plain colours need not see
BLUR = 1.2  # x mean spacing: plain colours, so that neighbours agree
RIM_BLUR = 0.5  # x mean spacing, of the rim's texture
RIM = (0.08, 0.28)  # x local radius from the outline: where the rim's own texture ends
BACK_SIDE = 200  # px, longer side of the picture in which the rim's texture is grown
HIDDEN_SIDE = 400  # px, likewise for what was hidden
SURE = 0.95  # alpha from which a pixel is the object's


@dataclass(frozen=True, eq=False)
class Colouring:
    """Colour fields over the canvas, on pixels of their own."""

    corner: F64  # (2,) px in the photo
    step: F64  # (2,) px of the photo per px of the fields
    front: F32  # (h, w, 3) what the photo shows, continued where it shows nothing
    back: F32  # (h, w, 3)

    def sample(self, xy: F64, is_back: Mask) -> F32:
        """(N, 3) at photo px (N, 2), of the back where `is_back` (N,)."""
        at = (xy - self.corner) / self.step - 0.5
        colours = np.where(is_back[:, None], bilinear(self.back, at), bilinear(self.front, at))
        return np.clip(colours, 0, 1).astype(np.float32)


def colouring(
    canvas: Canvas, silhouette: Silhouette, spacing: float, is_mirrored: bool,
    axis: MirrorAxis | None,
) -> Colouring:  # fmt: skip
    """`spacing`: of the Gaussians, px. `axis`: of an object that looks the same left and right."""
    height, width = canvas.alpha.shape
    scale = min(1.0, FINENESS * canvas.step / spacing)
    size = max(1, round(scale * width)), max(1, round(scale * height))
    step = canvas.step * np.array([width, height]) / size
    corner = canvas.corner
    shown = (_resized(canvas.alpha, size) > SURE).astype(np.float32)
    cells = np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), -1)
    xy = (cells + 0.5) * step + corner
    depth = _depth(silhouette, xy)
    front = _continued(_resized(canvas.foreground, size), shown, depth, xy, axis)
    spacing = spacing / float(step.mean())
    blurred = _blurred(front, BLUR * spacing)
    if is_mirrored:
        return Colouring(corner, step, blurred, blurred)
    rim = _grown(front, (depth > 0) & (depth < RIM[1]), depth >= RIM[1], BACK_SIDE)
    rim = _blurred(rim, RIM_BLUR * spacing)
    t = np.clip((depth - RIM[0]) / (RIM[1] - RIM[0]), 0, 1)[..., None]
    back = blurred + (t * t * (3 - 2 * t)) * (rim - blurred)
    return Colouring(corner, step, blurred, back.astype(np.float32))


def _resized(image: F32, size: tuple[int, int], how: int = cv2.INTER_AREA) -> F32:
    return np.asarray(cv2.resize(image, size, interpolation=how), np.float32)


def _blurred(image: F32, sigma: float) -> F32:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), max(sigma, 0.5)), np.float32)


def _depth(silhouette: Silhouette, xy: F64) -> F64:
    """(h, w) how deep photo px (h, w, 2) are inside: 0 at the outline, 1 amid a limb or body."""
    fields = np.stack([silhouette.depth, silhouette.radius], -1)
    depth, radius = bilinear(fields, silhouette.grid_xy(xy.reshape(-1, 2))).T
    return (depth / np.maximum(radius, silhouette.cell)).reshape(xy.shape[:2])


def _grown(colours: F32, source: Mask, hole: Mask, side: int) -> F32:
    """`colours` (h, w, 3) with texture from `source` (h, w) in `hole` (h, w).

    It is grown in a picture of `side` px.
    """
    height, width = hole.shape
    scale = min(1.0, side / max(height, width))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    known = _resized(source.astype(np.float32), size) > 0.5
    unknown = (_resized(hole.astype(np.float32), size) > 0) & ~known
    whole = grown(fill_in(_resized(colours, size), known), known, unknown)
    larger = _resized(whole, (width, height), cv2.INTER_LINEAR)
    return np.where(hole[..., None], larger, colours)


def _continued(foreground: F32, shown: F32, depth: F64, xy: F64, axis: MirrorAxis | None) -> F32:
    """The object's colours (h, w, 3), also where it was hidden: mirrored, else from beside."""
    hidden = (shown < 0.5) & (depth > 0)
    if not hidden.any():
        return foreground
    known = cv2.erode(shown, np.ones((3, 3), np.uint8)) > 0.5
    result = _grown(foreground, known, hidden, HIDDEN_SIDE)
    if axis is not None:
        height, width = shown.shape
        step = (xy[-1, -1] - xy[0, 0]) / np.maximum([width - 1, height - 1], 1)
        image = (axis.mirrored(xy[hidden]) - xy[0, 0]) / np.maximum(step, 1e-9)
        inside = (image >= 0).all(1) & (image <= [width - 1, height - 1]).all(1)
        is_shown = inside & (bilinear(known.astype(np.float32), image) > 0.99)
        colours = result[hidden]
        colours[is_shown] = bilinear(foreground, image[is_shown])
        result[hidden] = colours
    return result.astype(np.float32)


def fill_in(colours: F32, known: Mask) -> F32:
    """`colours` (h, w, 3) where `known` (h, w), and everywhere else a smooth continuation.

    Push and pull over halved copies (Gortler et al. 1996): near a known place its colour decides,
    far away the mean of all.
    """
    weight = known.astype(np.float32)
    if not known.any():
        return colours
    if min(weight.shape) <= 2:
        mean = (colours * weight[..., None]).sum((0, 1)) / weight.sum()
        return np.where(known[..., None], colours, mean).astype(np.float32)
    size = ((weight.shape[1] + 1) // 2, (weight.shape[0] + 1) // 2)
    fewer = _resized(weight, size)
    summed = _resized(colours * weight[..., None], size)
    mean = (summed / np.maximum(fewer, 1e-6)[..., None]).astype(np.float32)
    coarse = fill_in(mean, fewer > 1e-6)
    smooth = _resized(coarse, (weight.shape[1], weight.shape[0]), cv2.INTER_LINEAR)
    return np.where(known[..., None], colours, smooth).astype(np.float32)
