"""A fill of a picture's hole, from coarse to fine, by the patches around it.

Each level of a pyramid alternates between looking for the nearest patches and letting them vote
(`patch_search`). Beside colours the patches carry how rough the picture is, measured at full size
and only then made coarse: without that the coarse levels cannot tell gravel from a grey wall
(Newson et al. 2014, "Video Inpainting of Complex Scenes"). Beside the finest steps two coarser
bands are measured, which tell gravel from finer or blurred gravel farther off, and which way a
grain slants: a mirror image slants the other way, and would lie across it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ...base.arrays import F32, I32, Mask, Pixels, frozen
from ...base.progress import Progress
from ...base.threads import in_threads
from . import patch_search
from .sources import Guide, guidance

PATCH_RADIUS = 3  # px
HALF_KNOWN = 0.5  # share of a coarse pixel that must be known, or it is of the hole
COARSEST = 8.0  # px, how deep the hole of the coarsest level is at most
EXPECTATIONS = (8, 3)  # searches and votes, at the coarsest level and at the finest
ROUNDS = 2  # of each search
LAST_ROUNDS = 4
LOOKS = 4  # searches where nothing coarser was searched before
ROUGHNESS_WINDOW = 5  # px
ROUGHNESS_BANDS = (2.0, 4.0)  # px, the finer standard deviation of each band
BAND_WINDOW = 3.0  # x the band's, standard deviation of what its roughness is a mean of
BAND_GAIN = 2.0  # x, of a band's contrast, to count about as much as the finest steps
SLANT_SIGMAS = (0.0, 1.5)  # px, blur before steps are taken that slant
SLANT_GAIN = 2.0  # x a slant's mean, which is signed and partly cancels
SLANT_WINDOW = 6.0  # px or x sigma, of that mean: over less, grass seems to have a direction
SLANTS = slice(-len(SLANT_SIGMAS), None)  # of the channels: they change sign in a mirror image
# A patch that matches nothing well costs least where it is smooth: by the variance of the texture.
# Roughness must cost as much, and is less than a third of a texture's deviation in levels.
ROUGHNESS_WEIGHT = 8.0  # x a colour channel's
TONE_WEIGHT = 0.4  # x a colour channel's, of each of a tone's
HOLE_WEIGHT = 0.4  # x a known pixel's, of one that is only guessed, when patches are compared
TRUST = 1.3  # x less a patch's vote counts for each px that it lies deeper in the hole
VOTED_PARTS, VOTED_ROWS = 4, 16  # of the rows that vote: how many a core, and what one is worth
LEAST_TRUST = np.float32(1e-30)  # deep in a hole; less would be no whole float32 any more
USUAL_COST = 75  # percentile of the patches' costs, at which a vote loses
LEAST_SHARE = 1e-12
SIGMAS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # px, of the first guess; each weighs a hundredth


@dataclass(frozen=True, eq=False)
class Completion:
    """A filled picture, and from where."""

    colors: F32  # (h, w, 3)
    hole: Mask  # (h, w)
    sources: I32  # (h, w, 3) whether mirrored, row and column there; see `patch_search`


@dataclass(frozen=True, eq=False)
class _Level:
    """The picture at one size."""

    values: F32  # (h, w, C) colours and roughness, means of what is known
    known: F32  # (h, w) in [0, 1]

    @cached_property
    def hole(self) -> Mask:
        return self.known < min(HALF_KNOWN, float(self.known.max()))

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) px."""
        return self.known.shape[1], self.known.shape[0]


def shrunk(
    values: F32 | Pixels, known: F32, size: tuple[int, int], unit: float = 1.0
) -> tuple[F32, F32]:
    """Values (h, w, C) and how much is known of them (h, w), both at another size (w, h) px.

    What is stored as `unit` is a value of 1.
    """
    share = np.asarray(cv2.resize(known, size, interpolation=cv2.INTER_AREA), np.float32)

    def weighted_channel(c: int) -> F32:  # one at a time: all of a photo's as floats are 12 bytes
        channel = values[..., c]
        if unit != 1:
            channel = channel.astype(np.float32) / np.float32(unit)
        small = cv2.resize(channel * known, size, interpolation=cv2.INTER_AREA)
        return np.asarray(small, np.float32)

    weighted = [weighted_channel(c) for c in range(values.shape[2])]
    mean = np.dstack(weighted) / np.maximum(share, 1e-6)[..., None]
    return np.asarray(mean, np.float32), share


def complete(rgb: F32, known: F32, guide: Guide, seed: int, progress: Progress) -> Completion:
    """Fills what of `rgb` (h, w, 3), levels up to 255, is not `known` (h, w) in [0, 1].

    Something must be known.
    """
    levels = _pyramid(_Level(np.dstack([rgb, _roughness(rgb, known)]), known))
    random = np.random.default_rng(seed)
    found: _Filling | None = None
    for n, level in enumerate(levels):
        progress(n / len(levels), "Filling in the background")
        filling = _Filling(level, guide, random)
        if found is None:
            filling.guess()
        else:
            filling.continue_from(found)
        share = n / max(len(levels) - 1, 1)
        for _ in range(round(EXPECTATIONS[0] + share * (EXPECTATIONS[1] - EXPECTATIONS[0]))):
            filling.search(ROUNDS)
            filling.vote()
        found = filling
    assert found is not None
    found.search(LAST_ROUNDS)
    return Completion(found.values[..., :3], found.hole, found.sources)


def sources_like(filled: F32, hole: Mask, seed: int, progress: Progress) -> I32:
    """(h, w, 3) for each pixel of a hole where what is known looks like what it was filled with.

    `filled` (h, w, 3), levels up to 255. Sources are as in `Completion`, -1 where there is none.
    """
    everywhere = np.ones(hole.shape, np.float32)
    values = np.dstack([filled, _roughness(filled, everywhere)])
    filling = _Filling(
        _Level(values, 1 - hole.astype(np.float32)),
        Guide(np.zeros(hole.shape, np.float32)),
        np.random.default_rng(seed),
    )
    filling.values = values
    for k in range(LOOKS):
        progress(k / LOOKS, "Copying the details")
        filling.search(ROUNDS)
    return filling.sources


def _roughness(rgb: F32, known: F32) -> F32:
    """(h, w, 6) around each pixel: steps to the side and down, two coarser bands, two slants."""
    grey = rgb.mean(-1)
    whole = np.asarray(known >= 1, np.float32)
    inner = np.asarray(cv2.erode(whole, np.ones((3, 3)), borderValue=1), np.float32)
    window = (ROUGHNESS_WINDOW, ROUGHNESS_WINDOW)
    count = np.maximum(cv2.blur(inner, window), 1e-6)
    steps = [np.abs(cv2.Sobel(grey, cv2.CV_32F, *d, ksize=1)) for d in ((1, 0), (0, 1))]
    found = [cv2.blur(s * inner, window) / count for s in steps]
    found += [_band(grey, known, sigma) for sigma in ROUGHNESS_BANDS]
    return np.dstack(found + [_slant(grey, known, inner, sigma) for sigma in SLANT_SIGMAS])


def _band(grey: F32, known: F32, sigma: float) -> F32:
    """(h, w) mean contrast of `grey` (h, w) in the octave above `sigma` px, of what is known."""
    contrast = np.abs(_blurred(grey, known, sigma) - _blurred(grey, known, 2 * sigma))
    share = np.where(known > 0, cv2.GaussianBlur(known, (0, 0), 2 * sigma), np.float32(0))
    return BAND_GAIN * _blurred(contrast, share, BAND_WINDOW * sigma)


def _slant(grey: F32, known: F32, inner: F32, sigma: float) -> F32:
    """(h, w) mean steps of `grey` (h, w) on a diagonal: > 0 where both go up, < 0 where one does.

    `inner` (h, w) is 1 where the px around are known, too. The structure tensor's mixed term, in
    levels: 2 x y / (|x| + |y|) of the steps x and y.
    """
    if sigma > 0:
        grey = _blurred(grey, known, sigma)
    x, y = (cv2.Sobel(grey, cv2.CV_32F, *d, ksize=1) for d in ((1, 0), (0, 1)))
    mixed = np.asarray(2 * x * y / np.maximum(np.abs(x) + np.abs(y), 1e-6), np.float32)
    return SLANT_GAIN * _blurred(mixed, inner, SLANT_WINDOW * max(sigma, 1.0))


def _blurred(values: F32, weights: F32, sigma: float) -> F32:
    """(h, w) weighted means of what is around."""
    share = cv2.GaussianBlur(weights, (0, 0), sigma)
    mean = cv2.GaussianBlur(values * weights, (0, 0), sigma) / np.maximum(share, 1e-6)
    return np.asarray(mean, np.float32)


def _pyramid(finest: _Level) -> list[_Level]:
    """From coarse to fine."""
    depth = cv2.distanceTransform(finest.hole.astype(np.uint8), cv2.DIST_L2, 5).max()
    levels = [finest]
    while depth > COARSEST:
        width, height = (round(n / 2 ** len(levels)) for n in finest.size)
        if min(width, height) < 2 * (2 * PATCH_RADIUS + 1):
            break
        smaller = _Level(*shrunk(finest.values, finest.known, (width, height)))
        if _usable(smaller.hole)[0] < PATCH_RADIUS:
            break
        levels.append(smaller)
        depth /= 2
    return levels[::-1]


def smooth(values: F32, known: F32) -> F32:
    """(h, w, C) with what is not `known` (h, w) as a smooth mean of what is around it."""
    total, mean = np.zeros(known.shape, np.float32), np.zeros_like(values)
    for n, sigma in enumerate(SIGMAS):
        share = np.float32(100.0**-n)
        total += share * cv2.GaussianBlur(known, (0, 0), sigma)
        for c in range(values.shape[2]):
            mean[..., c] += share * cv2.GaussianBlur(values[..., c] * known, (0, 0), sigma)
    everywhere = (values * known[..., None]).sum((0, 1)) / known.sum()
    # A thousandth of the widest kernel's share: what is less is float32's rounding.
    is_near = total > 1e-3 * 100.0 ** (1 - len(SIGMAS))
    mean = np.where(is_near[..., None], mean / np.where(is_near, total, 1)[..., None], everywhere)
    return np.where(known[..., None] > 0, values, mean.astype(np.float32))


class _Filling:
    """One level's hole while it is filled."""

    def __init__(self, level: _Level, guide: Guide, random: np.random.Generator) -> None:
        self.hole, self._random = level.hole, random
        self.values: F32 = np.where(self.hole[..., None], np.float32(0), level.values)
        self._radius, self._usable = _usable(self.hole)
        self._guidance = guidance(guide, self.hole)
        size = (2 * self._radius + 1,) * 2
        self._touched = cv2.dilate(self.hole.astype(np.uint8), np.ones(size, np.uint8)) > 0
        self._targets = np.argwhere(self._touched).astype(np.int32)
        mirrored = self.values[:, ::-1].copy()
        mirrored[..., SLANTS] *= -1
        tone = self._guidance.tone.values
        self._layers = np.stack(
            [self._rimmed(self.values, tone), self._rimmed(mirrored, tone[:, ::-1])]
        )
        self._barred = np.where(self._usable, self._guidance.unlikely, patch_search.NEVER)
        weights = np.full(level.values.shape[2], ROUGHNESS_WEIGHT, np.float32)
        weights[:3] = 1
        inside = np.where(self.hole, np.float32(HOLE_WEIGHT), 1)[..., None] * weights
        share = np.float32(TONE_WEIGHT) * self._guidance.tone.share
        rim = (self._radius, self._radius)
        self._weight = np.pad(np.dstack([inside, *tone.shape[2] * [share]]), (rim, rim, (0, 0)))
        depth = cv2.distanceTransform(self.hole.astype(np.uint8), cv2.DIST_L2, 5)
        trust = np.maximum(np.float32(TRUST) ** -depth, LEAST_TRUST)
        self._trust = np.asarray(trust, np.float32)
        self._costs = np.ones(self.hole.shape, np.float32)
        self._places = np.argwhere(self._usable).astype(np.int32)
        self.sources: I32 = np.full((*self.hole.shape, 3), -1, np.int32)
        chosen = random.integers(len(self._places), size=len(self._targets))
        self.sources[self._touched] = self._places[chosen]

    def guess(self) -> None:
        """Starts from a smooth guess."""
        self.values = smooth(self.values, 1 - self.hole.astype(np.float32))
        self._follow_guidance()

    def continue_from(self, coarser: _Filling) -> None:
        """Starts from the sources of the level before."""
        row, column = self._targets.T
        old, new = np.array(coarser.hole.shape), np.array(self.hole.shape)
        zoom = new / old
        before = np.minimum((self._targets / zoom).astype(int), old - 1)
        sources = coarser.sources[before[:, 0], before[:, 1]]
        moved = np.rint((sources[:, 1:] - before) * zoom).astype(int) + self._targets
        is_valid = (sources[:, 0] >= 0) & (moved >= 0).all(1) & (moved < new).all(1)
        moved, layer = np.where(is_valid[:, None], moved, 0), np.maximum(sources[:, 0], 0)
        is_valid &= self._usable[layer, moved[:, 0], moved[:, 1]]
        found = np.column_stack([layer, moved]).astype(np.int32)
        self.sources[row[is_valid], column[is_valid]] = found[is_valid]
        self._follow_guidance()
        self._let_vote(self._trust)

    def search(self, rounds: int) -> None:
        """Looks for better sources."""
        guidance = self._guidance
        target = self._rimmed(self.values, guidance.tone.values)
        pictures = _rows(target), _rows(self._weight), _rows(self._layers)
        wanted, offered = frozen(guidance.wanted), frozen(guidance.offered)
        barred, targets = frozen(self._barred, np.float32), frozen(self._targets)
        patch_search.search(
            pictures, wanted, offered, barred, targets, self.sources, self._costs, rounds,
            self._random,
        )  # fmt: skip

    def vote(self) -> None:
        """Makes the hole what its patches' sources are."""
        usual = max(float(np.percentile(self._costs[self._touched], USUAL_COST)), 1.0)
        self._let_vote(self._trust * np.exp(-self._costs / (2 * usual)) + LEAST_SHARE)

    def _let_vote(self, shares: F32) -> None:
        values, shares = self.values.copy(), frozen(shares, np.float32)
        layers, sources = frozen(self._layers[..., : values.shape[2]]), frozen(self.sources)
        hole = frozen(self.hole)

        def vote(first: int, last: int) -> None:
            patch_search.vote(layers, sources, shares, hole, values, first, last)

        in_threads(vote, len(hole), VOTED_PARTS, VOTED_ROWS)
        self.values = values

    def _follow_guidance(self) -> None:
        """Gives what lies beside a line, or under a hint, a source that is right for it."""
        wanted, offered = self._guidance.wanted, self._guidance.offered[self._usable]
        for number in np.unique(wanted[..., 0])[1:]:
            own = self._places[offered[:, 0] == number]
            self._start_beside(wanted[..., 0] == number, own)
        for bit in np.unique(wanted[..., 2])[1:]:
            own = self._places[(offered[:, 2].astype(int) & int(bit)) > 0]
            there = self._touched & (wanted[..., 2] == bit)
            is_right = (self._offered_to(there)[:, 2].astype(int) & int(bit)) > 0
            self._replace(there, ~is_right, own, self._random.integers(max(len(own), 1),
                          size=len(is_right)))  # fmt: skip

    def _start_beside(self, there: Mask, own: I32) -> None:
        """`own` (n, 3) are the sources along a line that pixels `there` (h, w) lie beside."""
        if not len(own):
            return
        gaps = self._guidance.offered[own[:, 0], own[:, 1], own[:, 2], 1]
        own, gaps = own[np.argsort(gaps)], np.sort(gaps)
        there = there & self._touched
        wanted = self._guidance.wanted[there]
        found = self._offered_to(there)
        is_right = (found[:, 0] == wanted[:, 0]) & (np.abs(found[:, 1] - wanted[:, 1]) < 1)
        near = np.searchsorted(gaps, wanted[:, 1]) + self._random.integers(-5, 6, len(wanted))
        self._replace(there, ~is_right, own, np.clip(near, 0, len(own) - 1))

    def _offered_to(self, there: Mask) -> F32:
        """(n, 3) what the sources of the pixels `there` (h, w) offer."""
        layer, row, column = self.sources[there].T
        return self._guidance.offered[layer, row, column]

    def _replace(self, there: Mask, which: Mask, own: I32, chosen: np.ndarray) -> None:
        """`which` (n,) of the pixels `there` take the `chosen` (n,) of their `own` sources."""
        if len(own):
            row, column = (part[which] for part in np.nonzero(there))
            self.sources[row, column] = own[chosen[which]]

    def _rimmed(self, values: F32, tone: F32) -> F32:
        """(h + 2 r, w + 2 r, C + K) of values (h, w, C) and their tone (h, w, K)."""
        rim = (self._radius, self._radius)
        return np.pad(np.dstack([values, tone]), (rim, rim, (0, 0)), mode="edge")


def _rows(values: F32) -> F32:
    """(..., h, w * C) of values (..., h, w, C), as `patch_search` compares them."""
    values = frozen(values)
    return values.reshape(*values.shape[:-2], -1)


def _usable(hole: Mask) -> tuple[int, Mask]:
    """The radius of patches, and (2, h, w) where a whole one is known, in either layer."""
    for radius in range(PATCH_RADIUS, 0, -1):
        kernel = np.ones((2 * radius + 1,) * 2, np.uint8)
        usable = cv2.erode((~hole).astype(np.uint8), kernel, borderValue=0) > 0
        if usable.any():
            return radius, np.stack([usable, usable[:, ::-1]])
    return 0, np.stack([~hole, ~hole[:, ::-1]])
