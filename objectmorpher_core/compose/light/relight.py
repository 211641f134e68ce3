"""Light that stays where it is while the object turns in it.

A surface that turns towards the light grows brighter, and the photo's pixels, carried along, do not
know that. So each place is multiplied by what light it gets now over what it got in the photo, see
`light_estimate`. What did not turn has the factor 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from ...base.arrays import F32, F64, U8
from ...base.camera import Camera
from ...base.kernel_files import numba
from ...base.threads import EXACT, FAST, in_threads
from ...raster import tiles
from ...raster.posed import PosedSplats
from ...raster.texture import build_levels
from ..shadow.fall import Caster
from ..silhouette import SKETCHED, SilhouetteGrid, cell_places, fine_grid, sketch_grid, sketched

LEAST, MOST = 0.6, 1.6  # factor of encoded values
SEEN = 0.05  # cosine with the direction to the viewer, from which a surface counts
NOTHING = 1e-3  # of a factor: less is no difference
SMOOTH = 1.5  # px of a sketch
BITS = 16  # of a factor's fraction, where pixels are bytes
FAINT = 1e-3  # of the weight of what is continued
LEAST_ROWS = 128  # of a picture, for which a second thread is woken
EVERY = slice(None)
SHADED = 1500  # Gaussians in a sketch of what others shade
FILLED = 3.0  # px of the picture of factors, over which they are continued beyond the object

# What painted Gaussians ask nothing of.
NO_PHOTO = build_levels(np.zeros((1, 1, 3), np.float32), np.zeros((1, 1), np.float32), 0, 0)


@dataclass(frozen=True, eq=False)
class Relit:
    """Factors for the picture of an object, as a small picture over the photo."""

    factor: F32  # (h, w) less 1: 0 changes nothing
    left: float  # photo px, its corner
    top: float
    pitch: float  # photo px per px of it

    def lit(self, colour: F32, alpha: F32, left: float, top: float) -> F32:
        """Premultiplied colours (h, w, 3), their corner at photo px; none is brighter than white.

        `alpha` (h, w).
        """
        out, whole = np.array(colour, order="C"), np.ascontiguousarray(alpha)
        inputs = whole, *self._places(alpha.shape, left, top, 1.0), out
        in_threads(lambda a, b: _multiply(a, b, *inputs), len(out), 2, LEAST_ROWS)
        return out

    def lit_rgba(self, rgba: U8, left: float, top: float, zoom: float) -> U8:
        """Relight a picture (h, w, 4) u8 that has `zoom` px per px of the photo."""
        packed = np.ascontiguousarray(rgba).view(np.uint32)[..., 0]
        out = np.empty_like(packed)
        inputs = packed, *self._places(packed.shape, left, top, zoom), out
        in_threads(lambda a, b: _multiply_packed(a, b, *inputs), len(out), 2, LEAST_ROWS)
        return out.view(np.uint8).reshape(rgba.shape)

    def _places(
        self, shape: tuple[int, ...], left: float, top: float, zoom: float
    ) -> tuple[Any, Any, Any, Any, Any]:
        """The factors, and where among them the pixels of a picture (h, w) lie."""
        pitch, (rows, columns) = zoom * self.pitch, self.factor.shape
        x, y = (self.left - left) * zoom, (self.top - top) * zoom
        down = cell_places(0, shape[0], y, pitch, rows)
        return np.pad(self.factor, 1), *down, *cell_places(0, shape[1], x, pitch, columns)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=EXACT)
def _multiply(first, last, alpha, factor, rows, down, columns, across, out):
    """Multiplies the rows first..last of `out` by one more than `factor`."""
    gains, line = np.empty(len(columns), np.float32), np.empty(factor.shape[1], np.float32)
    for y in range(first, last):
        _find_gains(factor[rows[y]], factor[rows[y] + 1], down[y], columns, across, line, gains)
        for x in range(len(columns)):
            for c in range(3):
                out[y, x, c] = min(out[y, x, c] * gains[x], alpha[y, x])


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=EXACT)
def _multiply_packed(first, last, packed, factor, rows, down, columns, across, out):
    """The same of pixels of four bytes, of which the last is alpha."""
    gains, line = np.empty(len(columns), np.float32), np.empty(factor.shape[1], np.float32)
    byte, half = np.uint32(255), np.uint32(1 << (BITS - 1))
    for y in range(first, last):
        _find_gains(factor[rows[y]], factor[rows[y] + 1], down[y], columns, across, line, gains)
        for x in range(len(columns)):
            pixel, gain = packed[y, x], np.uint32(gains[x] * np.float32(1 << BITS))
            alpha = pixel >> np.uint32(24)
            red = ((pixel & byte) * gain + half) >> np.uint32(BITS)
            green = ((pixel >> np.uint32(8) & byte) * gain + half) >> np.uint32(BITS)
            blue = ((pixel >> np.uint32(16) & byte) * gain + half) >> np.uint32(BITS)
            red, green, blue = min(red, alpha), min(green, alpha), min(blue, alpha)
            high = blue << np.uint32(16) | alpha << np.uint32(24)
            out[y, x] = red | green << np.uint32(8) | high


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def _find_gains(above, below, share, columns, across, line, gains):
    """Fills `gains` (w,) of a row that lies so far between two rows of factors."""
    for j in range(len(line)):
        line[j] = np.float32(1) + above[j] + share * (below[j] - above[j])
    for x in range(len(columns)):
        j = columns[x]
        gains[x] = line[j] + across[x] * (line[j + 1] - line[j])


def relight(
    splats: PosedSplats,
    light: F64,
    strength: float,
    camera: Camera,
    is_sketch: bool = False,
    casters: Sequence[Caster] = (),
) -> Relit | None:
    """The factors of an object, as the photo's `camera` sees it; None where there are none.

    `light` (3,): of `estimate_light`. `is_sketch`: coarser, in the time that a frame of a drag has.
    `casters`: other objects, whose shadows fall on it.
    """
    few = sketched(splats, SHADED if strength == 0 else SKETCHED) if is_sketch else None
    grid = fine_grid(splats, camera) if few is None else sketch_grid(splats, few, camera)
    if grid is None:
        return None
    asked = EVERY if few is None else few
    means, normals = splats.means[asked], turned_normals(splats, asked)
    factors = _factors(splats.rest.shown_normals[asked], normals, strength * light)
    body = splats.means[sketched(splats, SHADED)] if casters else means
    for caster in casters:
        ink = float(np.mean(caster.shadow.colour))
        factors *= 1 - (1 - ink) * caster.on(means, normals, body)
    if np.abs(factors - 1).max() < NOTHING:
        return None
    if few is None:
        picture = _drawn(splats, factors, grid, camera)
    else:
        picture = _sketched(means, normals, factors, grid, camera)
    return Relit(picture - 1, grid.left, grid.top, grid.pitch)


def turned_normals(splats: PosedSplats, asked: np.ndarray | slice = EVERY) -> F64:
    """(N, 3) outward, world, unit: where the normals at rest are now, by the cofactors of F.

    Of the Gaussians `asked` for.
    """
    axes = splats.rest.world_from_object[:3, :3]
    normals = splats.rest.normals[asked] @ axes  # along the object's axes
    linear = np.ascontiguousarray(splats.skinned.linear[asked], np.float64)
    turned = _by_cofactors(linear, normals)
    turned = turned @ splats.world_from_object[:3, :3].T  # a similarity
    return turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-12)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _by_cofactors(linear, vectors):
    """(N, 3) vectors times the cofactors of matrices (N, 3, 3)."""
    out = np.empty_like(vectors)
    for i in range(len(vectors)):
        m, x, y, z = linear[i], vectors[i, 0], vectors[i, 1], vectors[i, 2]
        for r in range(3):
            p, q = (r + 1) % 3, (r + 2) % 3
            out[i, r] = (
                x * (m[p, 1] * m[q, 2] - m[p, 2] * m[q, 1])
                + y * (m[p, 2] * m[q, 0] - m[p, 0] * m[q, 2])
                + z * (m[p, 0] * m[q, 1] - m[p, 1] * m[q, 0])
            )
    return out


def _factors(shown: F64, normals: F64, light: F64) -> F64:
    """(N,) what Gaussians are multiplied by whose `normals` (N, 3) were `shown` in the photo."""
    turned = normals - shown
    return np.clip(np.exp(turned @ light), LEAST, MOST)


def _drawn(splats: PosedSplats, factors: F64, grid: SilhouetteGrid, camera: Camera) -> F32:
    """(h, w) the factors as a picture of the object, continued beyond it."""
    least = min(LEAST, float(factors.min()))
    share = (factors - least) / (MOST - least)
    painted = splats.painted(np.repeat(share[:, None], 3, axis=1), has_edge=False)
    picture = tiles.draw(tiles.prepare(painted, grid.camera(camera), camera), NO_PHOTO)
    values = _continued(picture.color[..., 0], picture.alpha)
    return (least + (MOST - least) * values).astype(np.float32)


def _sketched(means: F64, normals: F64, factors: F64, grid: SilhouetteGrid, camera: Camera) -> F32:
    """Likewise, the mean in each cell of Gaussians (n, 3) that face the viewer."""
    front = -(normals * means).sum(1) > SEEN * np.linalg.norm(means, axis=1)
    index, is_there = grid.cells(means[front], camera)
    size, shape = grid.width * grid.height, (grid.height, grid.width)
    count = np.bincount(index, minlength=size).reshape(shape)
    summed = np.bincount(index, factors[front][is_there], size).reshape(shape)
    return _continued(_smooth(summed), _smooth(count))


def _smooth(values: np.ndarray) -> F32:
    return np.asarray(cv2.GaussianBlur(values.astype(np.float32), (0, 0), SMOOTH), np.float32)


def _continued(values: F32, weight: F32) -> F32:
    """Weighted `values` (h, w) over their weights, and around them what is nearest, blurred."""
    mean = float(values.sum()) / max(float(weight.sum()), 1e-6)
    result = np.full_like(values, mean)
    for reach in (FILLED**2, FILLED):
        summed = cv2.GaussianBlur(values, (0, 0), reach)
        spread = cv2.GaussianBlur(weight, (0, 0), reach)
        result = np.where(spread > FAINT, summed / np.maximum(spread, FAINT), result)
    found = values / np.maximum(weight, FAINT)
    return np.asarray(np.where(weight > 0.5, found, result), np.float32)
