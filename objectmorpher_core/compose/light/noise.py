"""The grain of a photo: how strong it is at each brightness, how coarse, how its channels agree.

A photo's flat places show nothing but noise. So the photo is looked at in small blocks, less the
plane that fits each best, and of blocks of like brightness the least varied ones are taken for flat
(in the spirit of the noise level functions of Foi et al. 2008 and Liu et al. 2008). Noise of like
spectrum, correlation and strength is then made on a tile, in bands of its spectrum, so that what
an edit has lost of each band can be given back by itself, see `grain`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.arrays import F32, F64, Mask, Pixels, frozen

BLOCK = 16  # px
MOST_BLOCKS = 4000  # that are looked at, however large the photo
FLAT = 0.1  # share of the blocks of a brightness that counts as flat
CLEAN = 0.3  # share of those in which texture has no part
LOWEST_MEAN = 1.75  # deviations: how far the mean of a normal's lowest tenth is below its own
MOST_CHOSEN = 0.3  # of the variance: it is never thought to be less
FINE = 0.3  # cycles per px, from which on little is texture
BINS = 12  # of brightness
FEWEST = 8  # blocks in a bin that says something
STEEPEST = 2.5  # x the least deviation of a bin: a larger one is texture, not noise
ROUNDED = 1e-9  # variance below which a block is of one colour, and the rest is its arithmetic's
ALIKE = 0.25  # of a block's pixels, that are like their neighbours, if some program has filled it
DRAWN = 0.8  # of the blocks: where so many are filled, the picture is no photo
SATURATED = 1.5 / 255  # from black and from white, where nothing can be noisier
MOST = 12 / 255  # deviation: where everything is texture, not all of that is grain
LEAST = 0.4 / 255  # deviation below which there is no grain: about a byte's own rounding
TILE = 256  # px, a power of two
EDGES = (0.1, 0.2, 0.34)  # cycles per px, between the bands
BANDS = len(EDGES) + 1
SMALLEST = 4  # px, of the tile halved
SEED = 20080
LEVELS = 256


@dataclass(frozen=True, eq=False)
class Noise:
    """The character of a photo's grain."""

    deviation: F32  # (LEVELS, 3) of a channel, in [0, 1], by that channel's own value
    tile: F32  # (BANDS, TILE, TILE, 3) of deviation 1 in all, and periodic

    @cached_property
    def levels(self) -> tuple[F32, ...]:
        """The tile (BANDS, n, n, 3), and what it is halved again and again."""
        found = [self.tile]
        while (size := found[-1].shape[1] // 2) >= SMALLEST:
            square = found[-1].reshape(BANDS, size, 2, size, 2, 3)
            found.append(frozen(square.mean((2, 4))))
        return tuple(found)


def find_noise(pixels: Pixels) -> Noise | None:
    """Find the grain of a photo (H, W, 3); None where it has none or is too small."""
    if min(pixels.shape[:2]) < BLOCK or len(blocks := _blocks(pixels)) < FEWEST:
        return None
    rest, means = _residuals(blocks)
    is_grainy = _may_be_grainy(blocks, rest)
    if is_grainy.mean() < 1 - DRAWN:
        return None
    rest, means = rest[is_grainy], means[is_grainy]
    flat = _flat(rest.var((1, 2)), means.mean(1))
    if len(flat) == 0:
        return None
    rest, means = rest[flat], means[flat]
    powers, is_fine = _powers(rest), _frequency(BLOCK) > FINE
    # Noise has the same spectrum everywhere; where more is coarse, that is texture.
    coarse = powers.mean((1, 2, 3)) / np.maximum(powers[:, is_fine].mean((1, 2)), 1e-12)
    clean = np.argsort(coarse, kind="stable")[: max(int(CLEAN * len(flat)), FEWEST)]
    unit = rest[clean] / np.sqrt(np.maximum(rest[clean].var(1), 1e-12))[:, None]
    together = np.einsum("npc,npd->cd", unit, unit) / (len(unit) * BLOCK * BLOCK)
    spectrum = _powers(unit).mean((0, 3))
    # Of what is fine little is texture: so it says how strong the noise is.
    fine = powers[:, is_fine].mean(1) / spectrum[is_fine].mean()
    # The least varied were chosen: by so much they vary less than all that are flat.
    samples = _independent(spectrum) * 9 / (together**2).sum()
    fine /= max(1 - LOWEST_MEAN * np.sqrt(2 / samples), MOST_CHOSEN)
    step = 1 / np.iinfo(pixels.dtype).max
    deviation = _deviation(np.maximum(fine - step * step / 12, 0), means)
    if deviation.mean() < LEAST:
        return None
    shape = _around(spectrum, _frequency(TILE))
    return Noise(frozen(deviation), frozen(_tile(shape, together)))


def _blocks(pixels: Pixels) -> F32:
    """(n, BLOCK², 3) of the photo, in [0, 1], none of them clipped."""
    height, width = pixels.shape[:2]
    apart = max(BLOCK // 2, int(np.sqrt(height * width / MOST_BLOCKS)))
    views = np.lib.stride_tricks.sliding_window_view(pixels, (BLOCK, BLOCK), (0, 1))
    samples = views[::apart, ::apart].reshape(-1, 3, BLOCK * BLOCK)
    most = np.iinfo(pixels.dtype).max
    clipped = SATURATED * most
    low, high = samples.min((1, 2)), samples.max((1, 2))
    kept = samples[(low > clipped) & (high < most - clipped)]
    return np.ascontiguousarray(kept.transpose(0, 2, 1)) * np.float32(1 / most)


def _residuals(blocks: F32) -> tuple[F32, F32]:
    """Blocks (n, p, 3) less their planes, and their means (n, 3)."""
    across = (np.arange(BLOCK) - (BLOCK - 1) / 2) / BLOCK
    y, x = np.meshgrid(across, across, indexing="ij")
    plane = np.linalg.qr(np.column_stack([np.ones(x.size), x.ravel(), y.ravel()]))[0]
    own = np.asarray(plane, np.float32)
    return np.asarray(blocks - own @ (own.T @ blocks), np.float32), blocks.mean(1)


def _may_be_grainy(blocks: F32, rest: F32) -> Mask:
    """(n,) which blocks (n, p, 3) no program has filled; `rest` is what their planes leave.

    A bar at the side of a photo says nothing about the photo. Where there is any, what is drawn
    beside it in flat colours, edges and all, is no grain, either.
    """
    is_filled = rest.var((1, 2)) < ROUNDED
    if is_filled.any():
        square = blocks.reshape(-1, BLOCK, BLOCK, 3)
        is_alike = (square[:, :, 1:] == square[:, :, :-1]).all(-1)
        is_filled |= is_alike.mean((1, 2)) > ALIKE
    return ~is_filled


def _flat(variance: F32, mean: F32) -> np.ndarray:
    """Numbers of the flat ones of blocks (n,): of each brightness the least varied."""
    at = _bins(mean)
    found = [np.empty(0, np.int64)]
    for own in (np.flatnonzero(at == k) for k in range(BINS)):
        if len(own) >= FEWEST:
            order = own[np.argsort(variance[own], kind="stable")]
            found.append(order[: int(np.ceil(FLAT * len(own)))])
    return np.concatenate(found)


def _bins(mean: F32) -> np.ndarray:
    """(n,) in which of BINS a brightness in [0, 1] is."""
    return np.clip((mean * BINS).astype(int), 0, BINS - 1)


def _deviation(variance: F64, means: F32) -> F32:
    """(LEVELS, 3) from the variances of flat blocks (n, 3) and their means (n, 3)."""
    levels = np.arange(LEVELS) / (LEVELS - 1)
    table = np.empty((LEVELS, 3), np.float32)
    for c in range(3):
        at = _bins(means[:, c])
        there = [k for k in range(BINS) if (at == k).any()]
        place = [float(means[at == k, c].mean()) for k in there]
        value = np.sqrt([float(np.median(variance[at == k, c])) for k in there])
        table[:, c] = np.interp(levels, place, np.minimum(value, STEEPEST * value.min()))
    return np.minimum(table, MOST)


def _powers(blocks: F32) -> F64:
    """(n, BLOCK, BLOCK, 3) power of blocks (n, p, 3) at each frequency; 1 of white noise of 1."""
    window = np.outer(*[np.hanning(BLOCK + 2)[1:-1]] * 2)
    window /= np.sqrt((window**2).sum())
    square = blocks.reshape(-1, BLOCK, BLOCK, 3) * window[..., None]
    return np.abs(np.fft.fft2(square, axes=(1, 2))) ** 2


def _around(power: F64, wanted: F64) -> F64:
    """At the frequencies `wanted` (N, N) what a block's power is there, in all directions.

    Below two periods in a block, where the plane has taken part of it, it is as there.
    """
    ring = np.rint(_frequency(BLOCK) * BLOCK).astype(int).ravel()
    profile = np.bincount(ring, power.ravel()) / np.bincount(ring)
    profile[:2] = profile[2]
    return np.interp(wanted * BLOCK, np.arange(len(profile)), profile)


def _frequency(size: int) -> F64:
    """(size, size) cycles per px of a Fourier transform."""
    along = np.fft.fftfreq(size)
    return np.hypot(along[:, None], along)


def _independent(spectrum: F64) -> float:
    """How many independent samples a block of noise has."""
    return float(spectrum.sum() ** 2 / (spectrum**2).sum())


def _tile(power: F64, together: F64) -> F32:
    """Noise of that power (TILE, TILE), whose channels correlate by `together` (3, 3)."""
    rng = np.random.default_rng(SEED)
    share, along = np.linalg.eigh(together)
    mixing = along * np.sqrt(np.maximum(share, 0))
    white = rng.normal(size=(TILE, TILE, 3)) @ mixing.T
    frequency = _frequency(TILE)
    coloured = np.fft.fft2(white, axes=(0, 1)) * np.sqrt(power)[..., None]
    bands = [np.where(mask[..., None], coloured, 0) for mask in band_masks(frequency)]
    tile = np.stack([np.fft.ifft2(band, axes=(0, 1)).real for band in bands])
    tile /= tile.sum(0).std((0, 1))
    return tile.astype(np.float32)


def band_masks(frequency: F64) -> list[np.ndarray]:
    """Which of the frequencies (cycles per px) are in each of the BANDS, coarse to fine."""
    at = np.digitize(frequency, EDGES)
    return [(at == k) & (frequency > 0) for k in range(BANDS)]
