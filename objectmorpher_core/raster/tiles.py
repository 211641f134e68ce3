"""The fast twin of `reference`: compiled, tile by tile, all cores.

Gaussians are projected once, each tile of the picture gets the list of those that touch it, and
is then drawn by itself with its sums in the processor's cache: in layers where the photo is shown
(`surface`), one by one where there are plain colours only (`cloud`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.arrays import F32, F64, frozen
from ..base.camera import Camera
from ..base.threads import in_threads
from .binning import TILE, TiledSplats, bin_tiles, depth_order
from .cloud import TALL, WIDE, draw_one_by_one
from .compositing import PhotoLookup
from .posed import PosedSplats
from .projection import project
from .reference import Picture3D
from .rules import AYX, AYY, BLUE, CX, CY, EX, EY, RED, RULES, SY, WEIGHT
from .surface import draw_layers
from .texture import TextureLevels

AROUND = 4.0  # px of the view, by which Gaussians are looked at beside what they colour
PARTS = 8  # pieces of the picture for each thread: they are not equally full


@dataclass(frozen=True, eq=False)
class Drawable:
    """Gaussians on the screen of one view, ready to be drawn on any part of it."""

    splats: PosedSplats
    projected: F32  # (N, SPAN), see `projection`
    order: np.ndarray | None  # (M,) u32 rows from near to far; None where nothing has to be sorted
    camera: Camera  # of the whole view
    photo_camera: Camera

    def box(self) -> tuple[int, int, int, int] | None:
        """x0, y0, x1, y1 px of the view: all that they touch; None where that is nothing."""
        drawn = self.projected[self.projected[:, WEIGHT] > 0]
        if not len(drawn):
            return None
        size = np.array([self.camera.width, self.camera.height])
        centre, extent = drawn[:, [CX, CY]], drawn[:, [EX, EY]]
        low = np.floor((centre - extent).min(0)).clip(0, size)
        high = np.ceil((centre + extent).max(0)).clip(0, size)
        if (high <= low).any():
            return None
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])

    def rows_looked_at(self, box: tuple[int, int, int, int]) -> tuple[F64, F64]:
        """(M,) between which rows of the photo each Gaussian looks in a `box` of the view.

        And the rows of invented pictures, where it shows one. A pixel looks at a mean of these.
        """
        drawn = self.projected[self.projected[:, WEIGHT] > 0].astype(np.float64)
        if not self.splats.is_layered or not len(drawn):
            return np.empty(0), np.empty(0)
        centre, extent = drawn[:, [CX, CY]], drawn[:, [EX, EY]] + AROUND
        low = np.maximum(centre - extent, box[:2]) - centre
        high = np.minimum(centre + extent, box[2:]) - centre
        there = (low <= high).all(1)
        low, high, drawn = low[there], high[there], drawn[there]
        ratio = self.photo_camera.focal / self.camera.focal
        own = (drawn[:, CY] - self.camera.cy) * ratio + self.photo_camera.cy + drawn[:, SY]
        slope = drawn[:, [AYX, AYY]] + [0.0, ratio]
        ends = np.stack([slope * low, slope * high])
        return own + ends.min(0).sum(1), own + ends.max(0).sum(1)


def prepare(splats: PosedSplats, camera: Camera, photo_camera: Camera) -> Drawable:
    """Projects the Gaussians, and sorts them where their order matters."""
    photo_camera = splats.rest.carried(photo_camera)
    depths = None if splats.is_layered else np.empty(len(splats), np.float32)
    projected = frozen(project(splats, camera, photo_camera, depths))
    order = None if depths is None else depth_order(depths)
    return Drawable(splats, projected, order, camera, photo_camera)


def draw(
    drawable: Drawable, texture: TextureLevels, box: tuple[int, int, int, int] | None = None
) -> Picture3D:
    """The part `box` (x0, y0, x1, y1 px) of the view, or all of it."""
    left, top, right, bottom = box or (0, 0, drawable.camera.width, drawable.camera.height)
    out = np.empty((bottom - top, right - left, 8), np.float32)
    _draw(drawable, texture, (left, top), out, _NO_RGBA)
    return Picture3D(out[..., :3], out[..., 3], out[..., 4], out[..., 5], out[..., 6:8])


def draw_with_share(drawable: Drawable, texture: TextureLevels) -> tuple[Picture3D, F32]:
    """The whole view, and (h, w) how much of each pixel shows the Gaussians' own colours.

    The rest shows the photo. Colours brighter by 1 make a picture that is as much brighter.
    """
    picture = draw(drawable, texture)
    projected = drawable.projected.copy()
    projected[:, RED : BLUE + 1] += 1
    brighter = draw(replace(drawable, projected=frozen(projected)), texture)
    change = brighter.color - picture.color
    share = (change[..., 0] + change[..., 1] + change[..., 2]) / np.float32(3)
    return picture, np.asarray(share, np.float32)


def draw_rgba(
    drawable: Drawable, texture: TextureLevels, box: tuple[int, int, int, int] | None = None
) -> np.ndarray:
    """Draw (h, w, 4) u8, premultiplied, as a window shows it: an eighth of the memory."""
    left, top, right, bottom = box or (0, 0, drawable.camera.width, drawable.camera.height)
    rgba = np.empty((bottom - top, right - left), "<u4")
    _draw(drawable, texture, (left, top), _NO_OUT, rgba)
    return rgba.view(np.uint8).reshape(*rgba.shape, 4)


def tile_size(splats: PosedSplats) -> tuple[int, int]:
    """Width and height px of the tiles that the picture is drawn in."""
    return (TILE, TILE) if splats.is_layered else (WIDE, TALL)


_NO_OUT, _NO_RGBA = np.empty((0, 0, 8), np.float32), np.empty((0, 0), "<u4")


def _draw(
    drawable: Drawable, texture: TextureLevels, corner: tuple[int, int],
    out: np.ndarray, rgba: np.ndarray,
) -> None:  # fmt: skip
    """Draws the part of the view that begins at `corner` into the array that is not empty."""
    splats, kind = drawable.splats, drawable.splats.rest.splatting
    height, width = max(out.shape[0], rgba.shape[0]), max(out.shape[1], rgba.shape[1])
    window = (*corner, width, height)
    bins = bin_tiles(drawable.projected, window, tile_size(splats), drawable.order)
    tiled = TiledSplats(
        drawable.projected, frozen(bins.starts), frozen(bins.members), bins.across, *window
    )
    inputs: tuple[Any, ...] = RULES, kind, out, rgba
    kernel = draw_one_by_one
    if splats.is_layered:
        lookup = PhotoLookup(
            _intrinsics(drawable.camera), _intrinsics(drawable.photo_camera), texture.texels,
            texture.shapes, float(texture.left), float(texture.top),
        )  # fmt: skip
        inputs = lookup, float(splats.gap), float(splats.texture_gap), *inputs
        kernel = draw_layers
    in_threads(
        lambda first, last: kernel(first, last, tiled, *inputs), bins.across * bins.down, PARTS
    )


def render(
    splats: PosedSplats, texture: TextureLevels, camera: Camera, photo_camera: Camera
) -> Picture3D:
    """The object as `camera` sees it; see `reference.render`, with which it agrees."""
    return draw(prepare(splats, camera, photo_camera), texture)


def _intrinsics(camera: Camera) -> F64:
    return frozen(
        np.array([camera.focal, camera.cx, camera.cy, camera.width, camera.height], np.float64)
    )
