"""Grain where an edit has lost it: a moved object is as noisy as the photo around it.

Where the photo is carried along by whole pixels its noise comes along. By a part of a pixel, or
enlarged, it is smoothed; made smaller, it is averaged; what is invented has none. How much is left
is measured: noise like the photo's (`noise`) is looked up along the map by which the object shows
the photo, in small patches, and compared with itself, band by band of its spectrum. What is missing
of each band is added.

What is added is fixed to the photo's pixels, not to the object: noise is the sensor's. Fixed to the
surface it would be looked up along the same map, and lose what it is to give back. During a drag
the object so slides under grain that stands still, as in a film.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import cv2
import numpy as np

from ...base.arrays import F32, F64, U8, frozen
from ...base.camera import Camera
from ...base.kernel_files import numba
from ...base.threads import EXACT, in_threads
from ...raster import tiles
from ...raster.posed import PosedSplats
from ...raster.reference import Picture3D
from ...raster.rules import HALF, RULES, ZERO
from ...raster.sampling import sample
from ...raster.texture import TextureLevels, build_levels
from ..silhouette import SilhouetteGrid, cell_places, fine_grid, sketched
from .defocus import attenuation
from .noise import BANDS, LEVELS, TILE, Noise, band_masks

NODES = 16  # patches along the longer side
SAMPLES = 3  # patches of a sketch
FEWEST = 20  # Gaussians that say how an object has moved
PATCH = 32  # px
SPREAD = 3  # nodes over which the power is averaged, a box
KEPT = 0.97  # of a band's variance: then nothing is missing
SOLID = 0.5  # alpha, and share of it, from which a cell of the map counts
STEEPEST = 2.5  # px of the photo per px that the map changes by: beyond is a step to other parts
RANGE = 8.0  # deviations of noise in a texture's range from 0 to 1
WANDER = 53, 97, 96  # where in the tile a patch lies, by its number: two factors, and their range
FILLED = 3.0  # px of the grid, over which amounts are continued beyond the object
FAINT = 1e-3
LEAST = 0.02  # of an amount: less is none
COARSEST = 6  # how often the tile is halved for what is shown smaller
LEAST_ROWS = 64  # of a picture, for which a second thread is woken


class PlacedNoise(NamedTuple):
    """The noise that a kernel adds to a picture (h, w), how much of it, and where they lie."""

    tile: F32  # (bands, n, n, 3)
    ys: np.ndarray  # (h,) row of the tile of each row of the picture
    xs: np.ndarray  # (w,) likewise its column
    amount: F32  # as `Grain.padded`
    rows: np.ndarray  # (h,) row of the amount before it, and
    down: F32  # how much it takes of the next
    columns: np.ndarray  # (w,) and the same of columns
    across: F32


@dataclass(frozen=True, eq=False)
class Grain:
    """Noise to be added to the picture of an object."""

    noise: Noise
    amount: F32  # (h, w, BANDS) of each band, a small picture over the photo, as `Relit.factor`
    left: float  # photo px, its corner
    top: float
    pitch: float  # photo px per px of it

    def grained(self, colour: F32, alpha: F32, left: int, top: int) -> F32:
        """Premultiplied colours (h, w, 3), their corner at photo px, with grain.

        `alpha` (h, w). None is brighter than white, or darker than black.
        """
        out = np.empty(colour.shape, np.float32)
        table, places = self.noise.deviation, self._places(alpha.shape, left, top, 1.0)
        pixels = np.ascontiguousarray(colour), np.ascontiguousarray(alpha)
        inputs: tuple[Any, ...] = *pixels, table, places, out
        in_threads(lambda a, b: _add(a, b, *inputs), len(out), 2, LEAST_ROWS)
        return out

    def grained_rgba(self, rgba: U8, left: float, top: float, zoom: float) -> U8:
        """Add the grain to a picture (h, w, 4) u8 that has `zoom` px per px of the photo."""
        packed = np.ascontiguousarray(rgba).view("<u4")[..., 0]
        out = np.empty_like(packed)
        table, places = self.noise.deviation, self._places(packed.shape, left, top, zoom)
        inputs: tuple[Any, ...] = packed, table, places, out
        in_threads(lambda a, b: _add_bytes(a, b, *inputs), len(out), 2, LEAST_ROWS)
        return out.view(np.uint8).reshape(rgba.shape)

    @cached_property
    def padded(self) -> F32:
        """(h + 2, w + 2, BANDS) the amounts, with their own border around them."""
        return frozen(np.pad(self.amount, ((1, 1), (1, 1), (0, 0)), mode="edge"))

    def _places(self, shape: tuple[int, ...], left: float, top: float, zoom: float) -> PlacedNoise:
        """Noise for a picture (h, w) that begins at photo px `left`, `top`."""
        level = tile_level(zoom)
        tile, amount = self.noise.levels[level], self.padded
        if self.amount.shape[:2] == (1, 1):  # the same everywhere: the bands are put together
            tile = np.tensordot(self.amount[0, 0], tile, 1)[None]
            amount = np.ones((3, 3, 1), np.float32)
        texels = [
            np.floor((start + (np.arange(count) + 0.5) / zoom) / 2**level).astype(np.int64)
            % tile.shape[1]
            for start, count in ((top, shape[0]), (left, shape[1]))
        ]
        pitch, (rows, columns) = zoom * self.pitch, self.amount.shape[:2]
        x, y = (self.left - left) * zoom, (self.top - top) * zoom
        above, down = cell_places(0, shape[0], y, pitch, rows)
        before, across = cell_places(0, shape[1], x, pitch, columns)
        ys, xs = texels
        return PlacedNoise(frozen(tile), ys, xs, frozen(amount), above, down, before, across)


def tile_level(zoom: float) -> int:
    """Return how often the tile is halved where the photo is shown `zoom` times as large."""
    return int(np.clip(np.rint(-np.log2(zoom)), 0, COARSEST))


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=EXACT)
def _add(first, last, colour, alpha, table, places, out):
    """The rows first..last of `out`: `colour` and noise."""
    noise = np.empty((len(places.columns), 3), np.float32)
    for y in range(first, last):
        _mix(places, y, noise)
        for x in range(len(noise)):
            a = alpha[y, x]
            brighter = np.float32(LEVELS - 1) / max(a, np.float32(1e-6))
            for c in range(3):
                value = colour[y, x, c]
                level = min(np.uint32(max(value, ZERO) * brighter + HALF), np.uint32(LEVELS - 1))
                value += a * table[level, c] * noise[x, c]
                out[y, x, c] = min(max(value, ZERO), a)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=EXACT)
def _add_bytes(first, last, packed, table, places, out):
    """The same of pixels of four bytes, of which the last is alpha."""
    noise = np.empty((len(places.columns), 3), np.float32)
    byte, eight = np.uint32(255), np.uint32(8)
    for y in range(first, last):
        _mix(places, y, noise)
        for x in range(len(noise)):
            pixel = packed[y, x]
            alpha = pixel >> np.uint32(24)
            if alpha == 0:
                out[y, x] = pixel
                continue
            whole = np.float32(np.int32(alpha))
            brighter = np.float32(LEVELS - 1) / whole
            grained = alpha
            for c in range(3):
                own = pixel >> np.uint32(16 - 8 * c) & byte  # blue, green, red
                value = np.float32(np.int32(own))
                level = min(np.uint32(value * brighter + HALF), byte)
                value += whole * table[level, 2 - c] * noise[x, 2 - c]
                grained = grained << eight | np.uint32(min(max(value, ZERO), whole) + HALF)
            out[y, x] = grained


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def _mix(places, y, noise):
    """Fills `noise` (w, 3) of row y: so much of each band of the tile."""
    noise[:] = ZERO
    tile, xs, share = places.tile[:, places.ys[y]], places.xs, places.down[y]
    above, below = places.amount[places.rows[y]], places.amount[places.rows[y] + 1]
    columns, across = places.columns, places.across
    line = np.empty(len(above), np.float32)
    for b in range(len(tile)):
        for j in range(len(line)):
            line[j] = above[j, b] + share * (below[j, b] - above[j, b])
        for x in range(len(columns)):
            j, i = columns[x], xs[x]
            amount = line[j] + across[x] * (line[j + 1] - line[j])
            noise[x, 0] += amount * tile[b, i, 0]
            noise[x, 1] += amount * tile[b, i, 1]
            noise[x, 2] += amount * tile[b, i, 2]


def find_grain(
    splats: PosedSplats, texture: TextureLevels, noise: Noise, strength: float, camera: Camera,
    blur: float = 0.0,
) -> Grain | None:  # fmt: skip
    """Find the grain that a moved object lacks, as the photo's `camera` sees it.

    None where it lacks nothing. `strength` in [0, 1] of it is given. `blur`: px of the photo by
    which the object is put out of focus.
    """
    grid = fine_grid(splats, camera)
    if grid is None:
        return None
    own = grid.camera(camera)
    picture, invented = tiles.draw_with_share(tiles.prepare(splats, own, camera), texture)
    # Where the photo would be stretched too far, or has shown nothing, it is not shown.
    shown = (picture.alpha - invented) / np.maximum(picture.alpha, FAINT)
    share = np.asarray(np.clip(shown, 0, 1), np.float32)
    amount = _missing(share[..., None] ** 2 * _kept(picture, share, grid, noise) * _sharp(blur))
    amount = _continued(amount, np.minimum(picture.alpha, 1))
    if amount.max() < LEAST:
        return None
    return Grain(noise, frozen(strength * amount, np.float32), grid.left, grid.top, grid.pitch)


def sketch_grain(
    splats: PosedSplats, noise: Noise, strength: float, camera: Camera, blur: float = 0.0
) -> Grain | None:
    """Estimate the grain in a millisecond or two, as if all of it had moved by one affine map."""
    few = sketched(splats)
    few = few[splats.rest.lifted.texture.visibility[few] > SOLID]
    few = few[splats.means[few, 2] > 0]
    kept = np.zeros(BANDS)
    if len(few) > FEWEST:
        now, was = camera.project(splats.means[few]), splats.rest.lifted.texture.u0[few]
        middle = now.mean(0)
        table = np.column_stack([now - middle, np.ones(len(few))])
        fitted = np.linalg.lstsq(table, was - now, rcond=None)[0]  # (3, 2)
        maps = np.tile(np.concatenate([middle, fitted[2], fitted[0], fitted[1]]), (SAMPLES, 1))
        after, before = _powers(maps, noise).sum(1)
        kept = after / np.maximum(before, 1e-12) * _sharp(blur)
    amount = _missing(kept)
    if amount.max() < LEAST:
        return None
    return Grain(noise, frozen(strength * amount[None, None], np.float32), 0.0, 0.0, 1.0)


def _sharp(blur: float) -> np.ndarray:
    """(BANDS,) what a blur, px, leaves of the power in each band."""
    along = np.fft.fftfreq(PATCH)
    frequency = np.hypot(along[:, None], along)
    left = attenuation(blur, frequency)
    return np.array([left[mask].mean() for mask in band_masks(frequency)], np.float32)


def _missing(kept: np.ndarray) -> F32:
    """Amounts where so much of a band's variance is left."""
    return np.sqrt(np.where(kept > KEPT, 0, 1 - np.clip(kept, 0, 1))).astype(np.float32)


def _kept(picture: Picture3D, share: F32, grid: SilhouetteGrid, noise: Noise) -> F32:
    """(h, w, BANDS) of the noise's variance where the photo is looked up as in `picture`."""
    height, width = share.shape
    step = max(-(-max(height, width) // NODES), 1)
    there = (picture.alpha > SOLID) & (share > SOLID)
    size = (-(-height // step), -(-width // step))
    found = np.zeros((2, *size, BANDS))  # power after, and before
    places, maps = [], []
    slopes = _slopes(picture.shift, there, grid.pitch)
    for i in range(size[0]):
        for j in range(size[1]):
            part = np.s_[i * step : (i + 1) * step, j * step : (j + 1) * step]
            rows, columns = np.nonzero(there[part])
            if len(rows) == 0:
                continue
            # The cell nearest to the middle of those that are there.
            away = (rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2
            y, x = i * step + rows[away.argmin()], j * step + columns[away.argmin()]
            places.append((i, j))
            at = (grid.left + (x + 0.5) * grid.pitch, grid.top + (y + 0.5) * grid.pitch)
            slope = slopes[part][there[part]].mean(0)
            maps.append([*at, *picture.shift[y, x], *slope])
    if not places:
        return np.ones((height, width, BANDS), np.float32)
    i, j = np.array(places).T
    found[:, i, j] = _powers(np.array(maps, np.float64), noise)
    after, before = (cv2.blur(p, (SPREAD, SPREAD), borderType=cv2.BORDER_CONSTANT) for p in found)
    kept = np.where(before > 0, after / np.maximum(before, 1e-12), 1).clip(0, 1)
    at = [(np.arange(n) + 0.5) / step - 0.5 for n in (width, height)]
    across, down = np.meshgrid(*at)
    kept = cv2.remap(
        kept.astype(np.float32), across.astype(np.float32), down.astype(np.float32),
        cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE,
    )  # fmt: skip
    return np.asarray(kept, np.float32)


def _slopes(shift: F32, there: np.ndarray, pitch: float) -> F32:
    """(h, w, 4) how a shift (h, w, 2) changes per px of the photo, to the right and downwards."""
    slopes = np.zeros((*there.shape, 4), np.float32)
    for axis, columns in ((1, slice(0, 2)), (0, slice(2, 4))):
        change = np.diff(shift, axis=axis) / np.float32(pitch)
        both = np.take(there, range(1, there.shape[axis]), axis) & np.take(
            there, range(there.shape[axis] - 1), axis
        )
        both &= (np.abs(change) < STEEPEST).all(2)
        change[~both] = 0
        target = slopes[:, :-1, columns] if axis == 1 else slopes[:-1, :, columns]
        target[:] = change
    return slopes


def _powers(maps: F64, noise: Noise) -> F64:
    """(2, n, BANDS) power of noise looked up along `maps` (n, 8), and of the same as it is.

    A map: photo px x and y, the shift there, and how it changes to the right and downwards.
    """
    level = _texture(noise)
    looked = np.empty((len(maps), PATCH, PATCH, 3), np.float32)
    plain = np.empty_like(looked)
    sharp = np.float32(RULES.sharp)
    in_threads(
        lambda a, b: _look(a, b, maps, level.texels, level.shapes, sharp, looked, plain), len(maps)
    )
    window = np.hanning(PATCH + 2)[1:-1].astype(np.float32)
    window = np.outer(window, window)[..., None]
    along = np.fft.fftfreq(PATCH)
    frequency = np.hypot(along[:, None], along)[:, : PATCH // 2 + 1]
    powers = []
    for patches in (looked, plain):
        level_out = (patches - patches.mean((1, 2), keepdims=True)) * window
        power = np.abs(np.fft.rfft2(level_out, axes=(1, 2))) ** 2
        total = power.sum(3)
        powers.append(np.stack([total[:, mask].sum(1) for mask in band_masks(frequency)], 1))
    return np.array(powers)


@lru_cache(maxsize=2)
def _texture(noise: Noise) -> TextureLevels:
    """The tile as Gaussians could carry it, in the range of colours."""
    whole = noise.tile.sum(0)
    return build_levels(0.5 + whole / RANGE, np.ones((TILE, TILE), np.float32), 0, 0)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=EXACT)
def _look(first, last, maps, texels, shapes, sharp, looked, plain):
    """Patches of the tile (n, PATCH, PATCH, 3) looked up along maps, and as they are."""
    half, middle = PATCH // 2, TILE // 2
    for n in range(first, last):
        x, y, dx, dy, xx, xy, yx, yy = maps[n]
        # The larger of how many px of the photo come to one: the map's first singular value.
        a, b, c, d = 1 + xx, yx, xy, 1 + yy
        square, area = a * a + b * b + c * c + d * d, a * d - b * c
        larger = np.sqrt((square + np.sqrt(max(square * square - 4 * area * area, 0.0))) / 2)
        magnified = max(np.float32(larger) / sharp, np.float32(1))
        left, top = np.floor(x), np.floor(y)  # whole px, the patch's middle
        out_x, out_y = np.rint(dx), np.rint(dy)  # whole px that it has moved by
        start_x = middle - WANDER[2] // 2 + n * WANDER[0] % WANDER[2]
        start_y = middle - WANDER[2] // 2 + n * WANDER[1] % WANDER[2]
        for i in range(PATCH):
            for j in range(PATCH):
                px, py = left + j - half + 0.5, top + i - half + 0.5
                u = px + dx + xx * (px - x) + yx * (py - y) - out_x
                v = py + dy + xy * (px - x) + yy * (py - y) - out_y
                place_x = np.float32(u - left + start_x)
                place_y = np.float32(v - top + start_y)
                value = sample(texels, shapes, place_x, place_y, magnified)
                k = 4 * ((start_y + i - half) * TILE + start_x + j - half)
                for c in range(3):
                    looked[n, i, j, c] = value[c]
                    plain[n, i, j, c] = texels[k + c]


def _continued(amount: F32, weight: F32) -> F32:
    """(h, w, BANDS) amounts, and around the object those that are nearest, blurred."""
    mean = (amount * weight[..., None]).sum((0, 1)) / max(float(weight.sum()), 1e-6)
    result = np.broadcast_to(mean, amount.shape).astype(np.float32)
    for reach in (FILLED**2, FILLED):
        summed = cv2.GaussianBlur(amount * weight[..., None], (0, 0), reach)
        spread = cv2.GaussianBlur(weight, (0, 0), reach)[..., None]
        result = np.where(spread > FAINT, summed / np.maximum(spread, FAINT), result)
    return np.where(weight[..., None] > SOLID, amount, result).astype(np.float32)
