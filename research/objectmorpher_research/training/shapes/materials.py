"""Materials of made-up objects: photographs, prints, grain and plain colours, dull to shiny."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, partial

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, F64

from ...evaluation.truth.lookup import looked_up, triplanar
from ...photos import photo

PLAIN, PHOTO, GRAIN, STRIPES, CHECKS, PRINT, SPOTS, FACE = range(8)
WEIGHTS = (0.22, 0.27, 0.17, 0.09, 0.05, 0.12, 0.08)  # how often each but the last is chosen
SMALLEST_CROP = 90  # px of a photograph
LONGEST = 640  # px of one
PHOTOGRAPHS = (
    "astronaut", "chelsea", "coffee", "rocket", "brick", "grass", "gravel", "hubble_deep_field",
    "immunohistochemistry", "motorcycle", "china",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Material:
    """The material of a part; lengths are radii of the object's ball."""

    kind: int
    colours: F64  # (3, 3) in [0, 1], linear
    scale: float
    turn: F64  # (3, 3)
    shift: F64  # (3,)
    picture: F32 | None  # (h, w, 3) linear
    shine: float  # strength of the highlight
    gloss: float  # its exponent
    mirror: float  # share of the surroundings that are reflected
    bumps: float  # how much grain tilts the normals


@cache
def photographs() -> tuple[F32, ...]:
    """(h, w, 3) linear pictures in [0, 1]. Raises EvaluationError where one is not here."""
    pictures = []
    for name in PHOTOGRAPHS:
        image = photo(name)
        scale = LONGEST / max(image.shape[:2])
        small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        pictures.append(linear(np.asarray(small, np.float32) / np.float32(255)))
    return tuple(pictures)


def linear(srgb: F32) -> F32:
    """Light of sRGB values in [0, 1]."""
    return np.asarray(np.power(srgb, np.float32(2.2)), np.float32)


def a_crop(rng: np.random.Generator) -> F32:
    """(h, w, 3) of some photograph, its colours changed a little."""
    whole = photographs()[rng.integers(len(photographs()))]
    height, width = whole.shape[:2]
    side = int(rng.uniform(SMALLEST_CROP, min(height, width)))
    y, x = rng.integers(height - side + 1), rng.integers(width - side + 1)
    crop = whole[y : y + side, x : x + side]
    crop = crop[:, ::-1] if rng.random() < 0.5 else crop
    if rng.random() < 0.4:
        crop = crop[..., rng.permutation(3)]
    gain = np.exp(rng.normal(0, 0.25, 3)) * np.exp(rng.normal(0, 0.3))
    return np.asarray(np.clip(crop * gain, 0, 1), np.float32)


def a_colour(rng: np.random.Generator) -> F64:
    """(3,) linear; greys, browns and white are as common as colours."""
    value = rng.beta(1.6, 1.6)
    if rng.random() < 0.45:
        return np.clip(value**1.6 * (1 + rng.normal(0, 0.06, 3)), 0.01, 0.95)
    hue, strength = rng.random(), rng.beta(1.5, 1.5)
    wheel = 0.5 + 0.5 * np.cos(2 * np.pi * (hue + np.array([0, 1 / 3, 2 / 3])))
    return np.clip(value * (1 - strength + strength * wheel) ** 1.5, 0.01, 0.95)


def a_material(rng: np.random.Generator, base: F64 | None = None) -> Material:
    """`base` (3,): a colour that is kept, more or less, where parts of an object are alike."""
    kind = int(rng.choice(len(WEIGHTS), p=np.array(WEIGHTS) / sum(WEIGHTS)))
    first = a_colour(rng) if base is None else np.clip(base * np.exp(rng.normal(0, 0.08, 3)), 0, 1)
    second = a_colour(rng) if rng.random() < 0.5 else first * rng.uniform(0.35, 0.9)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    is_shiny = rng.random() < 0.45
    return Material(
        kind, np.stack([first, second, a_colour(rng)]), float(np.exp(rng.normal(-1.2, 0.7))),
        turn if kind == GRAIN or rng.random() < 0.3 else np.eye(3), rng.uniform(-1, 1, 3),
        a_crop(rng) if kind in (PHOTO, PRINT) else None,
        float(rng.uniform(0.1, 0.9)) if is_shiny else float(rng.uniform(0, 0.1)),
        float(np.exp(rng.uniform(1.5, 5.5))),
        float(rng.uniform(0, 0.5)) if is_shiny and rng.random() < 0.4 else 0.0,
        float(rng.uniform(0, 0.6)) if rng.random() < 0.35 else 0.0,
    )  # fmt: skip


def a_print(
    rng: np.random.Generator, picture: F32, frame: F64, ball: tuple[F64, float], reach: float
) -> Material:
    """A picture that lies over [-reach, reach] in the plane of a frame (3, 3); `ball` as built."""
    plain = a_material(rng)
    middle, radius = ball
    return replace(
        plain, kind=FACE, picture=picture, turn=frame.T, scale=reach / radius,
        shift=middle @ frame / reach,
        bumps=0.3 * plain.bumps,
    )  # fmt: skip


def albedo(material: Material, at: F64, normal: F64, noise: F32) -> F64:
    """(n, 3) the colour of places (n, 3) with normals (n, 3), object frame. `noise` (s, s, s)."""
    place = (at @ material.turn.T) / max(material.scale, 0.05) + material.shift
    first, second, third = material.colours
    if material.kind == PLAIN:
        share = 0.25 * grain(noise, place)
        return first * (1 - share[:, None])
    if material.kind == FACE:  # a picture on a flat thing
        assert material.picture is not None
        return _looked_up(material.picture, 0.5 * (place[:, :2] + 1))
    if material.kind == PHOTO:
        assert material.picture is not None
        return triplanar(partial(_looked_up, material.picture), 0.5 * place, normal)
    if material.kind == GRAIN:  # wood, marble, fur: noise along one axis
        share = grain(noise, place * [1.0, 4.0, 4.0])
        return first + (second - first) * _ramp(share, 0.35, 0.65)[:, None]
    if material.kind == STRIPES:
        wave = np.sin(2 * np.pi * (place[:, 1] + 0.15 * grain(noise, place)))
        return first + (second - first) * _ramp(wave, -0.1, 0.1)[:, None]
    if material.kind == CHECKS:
        odd = np.floor(2 * place).sum(1) % 2
        return np.where(odd[:, None] > 0, first, second)
    if material.kind == SPOTS:
        share = _ramp(grain(noise, 1.6 * place), 0.55, 0.62)
        return first + (third - first) * share[:, None]
    assert material.picture is not None  # a print all around: a label, a tile, a poster
    around = np.arctan2(at[:, 0], at[:, 2]) / (2 * np.pi)
    uv = np.column_stack([around * 2, at[:, 1] * 0.8]) / max(2 * material.scale, 0.3)
    printed = _looked_up(material.picture, uv + material.shift[:2])
    is_label = np.abs(at[:, 1] - 0.3 * material.shift[1]) < 0.4
    return np.where(is_label[:, None], printed, first)


def grain(noise: F32, at: F64) -> F64:
    """(n,) in [0, 1]: noise of three sizes at places (n, 3)."""
    total = np.zeros(len(at))
    for octave, weight in ((1.0, 0.5), (2.3, 0.3), (5.1, 0.2)):
        total += weight * _trilinear(noise, at * octave * 4)
    return np.clip(0.5 + 1.6 * (total - 0.5), 0, 1)


def noise_block(rng: np.random.Generator, size: int = 24) -> F32:
    """(size, size, size) in [0, 1], of which copies join."""
    return rng.random((size, size, size), np.float32)


def _trilinear(noise: F32, at: F64) -> F64:
    size = noise.shape[0]
    low = np.floor(at).astype(np.int64)
    t = at - low
    t = t * t * (3 - 2 * t)
    total = np.zeros(len(at))
    for corner in range(8):
        step = np.array([corner & 1, corner >> 1 & 1, corner >> 2 & 1])
        index = (low + step) % size
        weight = np.where(step, t, 1 - t).prod(1)
        total += weight * noise[index[:, 0], index[:, 1], index[:, 2]]
    return total


def _looked_up(picture: F32, uv: F64) -> F64:
    """(n, 3) of a picture that goes on mirrored; y up."""
    height, width = picture.shape[:2]
    folded = np.abs((uv + 1) % 2 - 1)
    at = np.column_stack([folded[:, 0] * (width - 1), (1 - folded[:, 1]) * (height - 1)])
    return looked_up(picture, at)


def _ramp(value: F64, low: float, high: float) -> F64:
    t = np.clip((value - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)
