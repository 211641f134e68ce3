"""Grounds, walls and skins of any kind: photographed and drawn textures, at any scale and turn."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from objectmorpher_core.base.arrays import F32, F64, RGB
from objectmorpher_core.compose.shadow.shadow import GAMMA

from ...evaluation.error import EvaluationError
from ...photos import photo
from . import drawn
from .drawn import SIDE, any_colour

LEVELS = 6  # of a texture's pyramid
LONGEST = 1100  # px of a photograph
SMALLEST = 48  # px of a part of one
OBLIQUE = 0.4  # of the parts are seen aslant
KEPT = 220  # textures to choose from
FRESH = 0.03  # how often one of them is replaced
SCALES = (25.0, 400.0)  # px of a texture per unit of the ground
DARKEST = 0.06  # mean linear light of a texture

# Photographs that come with scikit-image and scikit-learn, but for those that docs/compositing
# measures on: gravel, leaves, floor, cloth, moon, astronaut, rocket, flower, motorcycle.
PHOTOGRAPHS = (
    "china", "chelsea", "coffee", "brick", "grass", "coins", "camera", "text", "page", "clock",
    "immunohistochemistry", "hubble_deep_field", "retina", "cell", "colorwheel",
)  # fmt: skip
SUFFIXES = (".jpg", ".jpeg", ".png")


@cache
def photographs(folder: Path | None = None) -> tuple[F32, ...]:
    """(h, w, 3) linear: the pictures of a folder, or those of PHOTOGRAPHS that are here.

    Those of which no part can be taken are left out. Raises ValueError for a folder without others.
    """
    if folder is not None:
        files = sorted(f for f in folder.rglob("*") if f.suffix.lower() in SUFFIXES)
        found = (_linear(np.asarray(Image.open(file).convert("RGB"))) for file in files)
        large = tuple(image for image in found if min(image.shape[:2]) >= SMALLEST)
        if not large:
            kinds = ", ".join(SUFFIXES)
            raise ValueError(f"{folder} holds no pictures ({kinds}) of at least {SMALLEST} px")
        return large
    shown = []
    for name in PHOTOGRAPHS:
        try:
            shown.append(photo(name))
        except EvaluationError:  # it would have to be fetched
            continue
    return tuple(_linear(image) for image in shown)


def _linear(image: RGB) -> F32:
    longer, shorter = max(image.shape[:2]), min(image.shape[:2])
    scale = max(min(LONGEST / longer, 1.0), 1 / shorter)  # it has a row of pixels at least
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return np.asarray((small / 255.0) ** GAMMA, np.float32)


def _photographed(rng: np.random.Generator, shown: tuple[F32, ...]) -> F64:
    """A part of a photograph, as it is or aslant, in its own colours or in others."""
    whole = shown[rng.integers(len(shown))]
    height, width = whole.shape[:2]
    most = min(height, width)
    side = int(np.exp(rng.uniform(*np.log([SMALLEST, most]))))
    start = rng.integers(width - side + 1), rng.integers(height - side + 1)
    unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    slant = rng.uniform(-0.22, 0.22, (4, 2)) if rng.random() < OBLIQUE else np.zeros((4, 2))
    corners = np.asarray((unit + slant) * side + start, np.float32)
    matrix = cv2.getPerspectiveTransform(corners, np.asarray(unit * SIDE, np.float32))
    part = cv2.warpPerspective(whole, matrix, (SIDE, SIDE), borderMode=cv2.BORDER_REFLECT_101)
    return recoloured(rng, np.asarray(part, np.float64))


def recoloured(rng: np.random.Generator, linear: F64) -> F64:
    """The same in other colours, of other contrast, and lighter or darker, in most cases."""
    found = linear[..., rng.permutation(3)] if rng.random() < 0.3 else linear
    if rng.random() < 0.35:  # other hues
        mixed = np.eye(3) + rng.normal(0, 0.15, (3, 3))
        found = np.maximum(found @ (mixed / np.maximum(mixed.sum(1, keepdims=True), 0.3)).T, 0)
    if rng.random() < 0.3:
        found = found.mean(-1, keepdims=True) * any_colour(rng) * 2
    if rng.random() < 0.6:
        mean = np.maximum(found.mean((0, 1)), 1e-3)
        found = mean * (np.maximum(found, 1e-3) / mean) ** rng.uniform(0.35, 1.3)
    if rng.random() < 0.7:
        found = found * rng.uniform(0.06, 0.5) / max(float(found.mean()), 1e-3)
    return np.asarray(found)


WAYS = (
    ("photographed", 0.34), ("slabs", 0.1), ("blades", 0.06), ("stones", 0.08), ("woven", 0.05),
    ("patches", 0.13), ("plain", 0.05), ("fractal", 0.05), ("pebbles", 0.04), ("laid", 0.04),
    ("grained", 0.03), ("blotched", 0.03),
)  # fmt: skip


def _drawn(rng: np.random.Generator, shown: tuple[F32, ...]) -> F64:
    name = WAYS[rng.choice(len(WAYS), p=[share for _, share in WAYS])][0]
    if name == "photographed":
        return _photographed(rng, shown)
    if name == "slabs":
        return drawn.slabs(rng, _photographed(rng, shown))
    if name == "stones":
        return drawn.stones(rng, _photographed(rng, shown) * rng.uniform(0.2, 1))
    if name == "patches":
        one = _drawn(rng, shown)
        is_worn = rng.random() < 0.4
        other = one * rng.uniform(0.3, 0.8) if is_worn else _drawn(rng, shown)
        return drawn.patches(rng, one, other)
    return np.asarray(getattr(drawn, name)(rng))


def any_texture(rng: np.random.Generator, shown: tuple[F32, ...]) -> F32:
    """(SIDE, SIDE, 3) linear in [0, 1], drawn, or of photographs."""
    found = np.clip(_drawn(rng, shown), 0, 1)
    mean = float(found.mean())
    if mean < DARKEST:
        found = found * (DARKEST + 0.2 * rng.random()) / max(mean, 1e-3)
    return np.asarray(found.clip(0, 1), np.float32)


class Grounds:
    """Textures to choose from, a few of which are replaced now and then."""

    def __init__(
        self, rng: np.random.Generator, count: int = KEPT, folder: Path | None = None
    ) -> None:
        self._rng, self.photographs = rng, photographs(folder)
        self._pyramids = [_pyramid(any_texture(rng, self.photographs)) for _ in range(count)]

    def at(self, places: F32) -> F32:
        """Linear colours (h, w, 3) of some ground at places (h, w, 2), as coarse as it is far."""
        rng = self._rng
        if rng.random() < FRESH:
            self._pyramids[rng.integers(len(self._pyramids))] = _pyramid(
                any_texture(rng, self.photographs)
            )
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
