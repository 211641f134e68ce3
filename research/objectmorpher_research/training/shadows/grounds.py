"""Grounds, walls and skins of any kind: photographed and drawn textures, at any scale and turn."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, F64, RGB
from objectmorpher_core.compose.shadow.shadow import GAMMA

from ...evaluation.error import EvaluationError
from ...photos import photo

SIDE = 512  # px of a texture
LEVELS = 6  # of its pyramid
LONGEST = 640  # px of a photograph
KEPT = 150  # textures to choose from
FRESH = 0.05  # how often one of them is replaced
SCALES = (25.0, 400.0)  # px of a texture per unit of the ground
DARKEST = 0.06  # mean linear light of a texture

# Photographs that come with scikit-image and scikit-learn, but for those that docs/compositing
# measures on: gravel, leaves, floor, cloth, moon, astronaut, rocket, flower, motorcycle.
PHOTOGRAPHS = (
    "chelsea", "coffee", "brick", "grass", "coins", "camera", "text", "page", "clock",
    "immunohistochemistry", "hubble_deep_field", "retina", "cell", "colorwheel",
)  # fmt: skip
SCENIC = 3  # the first of them are whole scenes


@cache
def photographs() -> tuple[F32, ...]:
    """(h, w, 3) linear, those that are here; scenes of the world come first."""
    shown = [photo("china")]
    for name in PHOTOGRAPHS:
        try:
            shown.append(photo(name))
        except EvaluationError:  # it would have to be fetched
            continue
    return tuple(_linear(image) for image in shown)


def _linear(image: RGB) -> F32:
    scale = min(LONGEST / max(image.shape[:2]), 1.0)
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return np.asarray((small / 255.0) ** GAMMA, np.float32)


def any_colour(rng: np.random.Generator) -> F64:
    """(3,) linear: greys, and colours more or less strong."""
    value, spread = rng.uniform(0.08, 0.85), rng.choice([0.02, 0.12, 0.3])
    encoded = value * (1 + rng.normal(0, spread, 3))
    return np.asarray(encoded.clip(0.02, 0.95) ** GAMMA)


def _noise(rng: np.random.Generator, sigma: float) -> F64:
    noise = cv2.GaussianBlur(rng.normal(size=(SIDE, SIDE)), (0, 0), max(sigma, 0.3))
    return np.asarray(noise / noise.std())


def _photographed(rng: np.random.Generator) -> F64:
    whole = photographs()[rng.integers(len(photographs()))]
    height, width = whole.shape[:2]
    side = int(rng.uniform(60, min(height, width)))
    y, x = rng.integers(height - side + 1), rng.integers(width - side + 1)
    way = cv2.INTER_AREA if side > SIDE else cv2.INTER_LINEAR
    part = cv2.resize(whole[y : y + side, x : x + side], (SIDE, SIDE), interpolation=way)
    found = np.asarray(part, np.float64)
    found = found[..., rng.permutation(3)] if rng.random() < 0.4 else found
    if rng.random() < 0.4:
        found = found.mean(-1, keepdims=True) * any_colour(rng) * 2
    if rng.random() < 0.5:  # less contrast
        mean = np.maximum(found.mean((0, 1)), 1e-3)
        found = mean * (np.maximum(found, 1e-3) / mean) ** rng.uniform(0.3, 1.0)
    return found


def _plain(rng: np.random.Generator) -> F64:
    grain = rng.uniform(0, 0.08) * _noise(rng, rng.uniform(0.3, 2))
    return any_colour(rng) * np.exp(grain)[..., None]


def _fractal(rng: np.random.Generator) -> F64:
    along = np.fft.fftfreq(SIDE)
    frequency = np.hypot(along[:, None], along[None])
    frequency[0, 0] = 1
    spectrum = np.fft.fft2(rng.normal(size=(SIDE, SIDE))) / frequency ** rng.uniform(0.3, 1.6)
    noise = np.real(np.fft.ifft2(spectrum))
    return any_colour(rng) * np.exp(rng.uniform(0.05, 0.6) * noise / noise.std())[..., None]


def _pebbles(rng: np.random.Generator) -> F64:
    plane = cv2.Subdiv2D((0, 0, SIDE, SIDE))
    for x, y in rng.uniform(0, SIDE, (int(rng.integers(20, 400)), 2)):
        plane.insert((float(x), float(y)))
    cells = [np.asarray(cell, np.int32) for cell in plane.getVoronoiFacetList([])[0]]
    drawn, base = np.zeros((SIDE, SIDE, 3), np.float32), any_colour(rng)
    spread = rng.uniform(0.07, 1.1)
    for cell in cells:
        tone = np.exp(rng.normal(0, spread)) * (1 + rng.normal(0, 0.2 * spread, 3))
        cv2.fillConvexPoly(drawn, cell, tuple(float(v) for v in (base * tone).clip(0, 1)))
    if rng.random() < 0.4:
        joint, thick = base * rng.uniform(0.03, 0.45), int(rng.integers(1, 6))
        cv2.polylines(drawn, cells, True, tuple(float(v) for v in joint), thick)
    return np.asarray(drawn, np.float64)


def _laid(rng: np.random.Generator) -> F64:
    """Planks, tiles or checks."""
    wide, high = rng.integers(20, 200, 2)
    y, x = np.mgrid[:SIDE, :SIDE]
    row = y // high
    column = (x + row % 2 * (rng.integers(0, 2) * wide // 2)) // wide
    tones = np.exp(rng.normal(0, rng.choice([0.04, 0.15, 0.6]), (64, 64)))
    if rng.random() < 0.2:
        checked = np.add.outer(np.arange(64), np.arange(64)) % 2
        tones = np.where(checked, 1.0, rng.uniform(0.2, 0.7))
    found = any_colour(rng) * tones[row % 64, column % 64][..., None]
    if rng.random() < 0.7:
        joint = rng.integers(1, 8)
        is_joint = (y % high < joint) | (x % wide < joint)
        found = np.where(is_joint[..., None], found * rng.uniform(0.2, 1.3), found)
    grain = rng.uniform(0, 0.15) * _noise(rng, rng.uniform(0.5, 4))
    return np.asarray(found * np.exp(grain)[..., None])


def _grained(rng: np.random.Generator) -> F64:
    sigmas = rng.uniform(0.5, 4), rng.uniform(10, 60)
    noise = cv2.GaussianBlur(rng.normal(size=(SIDE, SIDE)), (0, 0), sigmas[0], sigmaY=sigmas[1])
    return any_colour(rng) * np.exp(rng.uniform(0.05, 0.5) * noise / noise.std())[..., None]


def _blotched(rng: np.random.Generator) -> F64:
    noise = _noise(rng, rng.uniform(5, 50)) - rng.uniform(-1, 1)
    share = 1 / (1 + np.exp(np.clip(-rng.uniform(1, 20) * noise, -40, 40)))[..., None]
    grain = rng.uniform(0, 0.2) * _noise(rng, rng.uniform(0.4, 3))
    found = any_colour(rng) * share + any_colour(rng) * (1 - share)
    return np.asarray(found * np.exp(grain)[..., None])


WAYS: tuple[tuple[Callable[[np.random.Generator], F64], float], ...] = (
    (_photographed, 0.4), (_plain, 0.1), (_fractal, 0.1), (_pebbles, 0.1), (_laid, 0.1),
    (_grained, 0.1), (_blotched, 0.1),
)  # fmt: skip


def any_texture(rng: np.random.Generator) -> F32:
    """(SIDE, SIDE, 3) linear in [0, 1]."""
    way = WAYS[rng.choice(len(WAYS), p=[share for _, share in WAYS])][0]
    found = np.clip(way(rng), 0, 1)
    mean = float(found.mean())
    if mean < DARKEST:
        found = found * (DARKEST + 0.2 * rng.random()) / max(mean, 1e-3)
    return np.asarray(found, np.float32)


class Grounds:
    """Textures to choose from, a few of which are replaced now and then."""

    def __init__(self, rng: np.random.Generator, count: int = KEPT) -> None:
        self._rng = rng
        self._pyramids = [_pyramid(any_texture(rng)) for _ in range(count)]

    def at(self, places: F32) -> F32:
        """Linear colours (h, w, 3) of some ground at places (h, w, 2), as coarse as it is far."""
        rng = self._rng
        if rng.random() < FRESH:
            self._pyramids[rng.integers(len(self._pyramids))] = _pyramid(any_texture(rng))
        pyramid = self._pyramids[rng.integers(len(self._pyramids))]
        scale = np.exp(rng.uniform(*np.log(SCALES)))
        cos, sin = np.cos(turn := rng.uniform(0, 2 * np.pi)) * scale, np.sin(turn) * scale
        start = rng.uniform(0, SIDE, 2)
        u, v = np.moveaxis(places, -1, 0)
        x = (u * cos - v * sin + start[0]).astype(np.float32)
        y = (u * sin + v * cos + start[1]).astype(np.float32)
        level = _level(x, y)
        low = int(np.clip(np.median(level), 0, LEVELS - 2))
        high = int(np.clip(np.ceil(level.max()), low + 1, LEVELS - 1))
        share = np.clip((level - low) / (high - low), 0, 1)[..., None]
        found = (1 - share) * _sampled(pyramid[low], x, y) + share * _sampled(pyramid[high], x, y)
        if rng.random() < 0.3:
            found = found * (1 + rng.normal(0, 0.12, 3)).clip(0.5, 1.5)
        return np.asarray(found, np.float32)


def _pyramid(texture: F32) -> list[F32]:
    levels = [texture]
    while len(levels) < LEVELS:
        half = cv2.resize(levels[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(half, np.float32))
    return levels


def _level(x: F32, y: F32) -> F32:
    """(h, w) of the pyramid, by how many px of the texture a px of the picture steps over."""
    steps = [
        np.abs(np.diff(c, axis=axis, append=c.take([-1], axis))) for c in (x, y) for axis in (0, 1)
    ]
    step = cv2.blur(np.maximum.reduce(steps), (5, 5))
    return np.asarray(np.clip(np.log2(np.maximum(step, 1e-3)), 0, LEVELS - 1), np.float32)


def _sampled(level: F32, x: F32, y: F32) -> F32:
    """Values of a texture's level at px of the whole texture; it goes on as its mirror image."""
    side = len(level)
    maps = [np.mod(c * (side / SIDE), 2 * side) for c in (x, y)]
    maps = [np.where(c < side, c, 2 * side - 1e-3 - c) - np.float32(0.5) for c in maps]
    u, v = (m.astype(np.float32) for m in maps)
    way = cv2.BORDER_REFLECT_101
    return np.asarray(cv2.remap(level, u, v, cv2.INTER_LINEAR, borderMode=way), np.float32)
