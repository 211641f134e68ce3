"""A picture of a scene: lamps mixed, on some ground, with or without the thing's shadow."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, F64, Mask
from objectmorpher_core.base.masks import box_of
from objectmorpher_core.compose.shadow.old_shadow import BLACK
from objectmorpher_core.compose.shadow.shadow import GAMMA
from objectmorpher_core.compose.shadow.shadow_fit import FREE, LUMA
from objectmorpher_core.compose.shadow.shadow_look import CELLS, enlarged, seen_planes, shrunk

from .drawn import any_colour
from .grounds import Grounds, recoloured
from .scenes import FINE, GROUND, NEIGHBOUR, SKY, THING_SEEN, WALL, SceneGeometry

SHADED = 0.58  # of the scenes show the thing's own shadow
OTHER_SHADE = 0.15  # of these, and all others: a shade that is not the thing's may lie there
PASTED = 0.3  # of those without a shadow: the thing is put into a photograph
OTHER_GROUND = 0.35
DARK = 0.12  # of the light, from which a cell counts as shaded
LARGE, NONE = 0.12, 0.01  # x the thing's area: a shadow that one sees, and hardly any
COLOURS = 16  # of a thing's parts
NEARER, NEAREST = 0.6, 1.8  # of the samples, how many are seen from nearer; x as large at most


@dataclass(frozen=True, eq=False)
class ShadowSample:
    """What the network sees, and what it should find."""

    planes: F32  # (5, SIDE, SIDE)
    dark: F32  # (SIDE, SIDE) share of the ground's light that the thing takes
    weight: F32  # (SIDE, SIDE) 1 where that counts
    label: float  # 1 a shadow that one sees, 0 none, NaN in between


def make_sample(
    rng: np.random.Generator, scene: SceneGeometry, other: SceneGeometry, grounds: Grounds
) -> ShadowSample:
    """Draw a sample. `other`: a scene whose shadows may lie in this one as a shade."""
    ambient, first = rng.uniform(0.12, 0.7), int(rng.integers(2))
    main = rng.uniform(0.3, 1) if rng.random() < 0.25 else 1.0
    shares = (1 - ambient) * main, (1 - ambient) * (1 - main), ambient
    light, facing = (
        shares[0] * field[first] + shares[1] * field[1 - first] + shares[2] * field[2]
        for field in (scene.light, scene.facing)
    )
    light = cv2.GaussianBlur(light, (0, 0), rng.uniform(0.5, 1.8))
    has_shadow = rng.random() < SHADED
    dark = np.clip(1 - light[..., 0] / np.maximum(light[..., 1], 1e-4), 0, 1)
    falls = light[..., 0 if has_shadow else 1]
    if not has_shadow or rng.random() < OTHER_SHADE:
        falls = falls * _other_shade(rng, dark, other)
    picture = _surfaces(rng, scene, grounds, falls, facing, has_shadow)
    shown = _photographed(rng, picture * _uneven(rng)[..., None])
    return _sample(rng, scene, shown, dark if has_shadow else np.zeros_like(dark))


def _sample(rng: np.random.Generator, scene: SceneGeometry, shown: F32, dark: F32) -> ShadowSample:
    """What the network sees of a picture, at the scale at which it always looks or from nearer."""
    cover, others, ground = (
        (scene.what == kind).astype(np.float32) for kind in (THING_SEEN, NEIGHBOUR, GROUND)
    )
    hidden = np.maximum(cover, others) if rng.random() < 0.25 else cover
    inside = _frame(rng, cover > 0)
    free = (inside & (cv2.dilate(hidden, np.ones((3, 3))) < FREE)).astype(np.float32)
    logarithm = np.log(shown + np.float32(BLACK))
    colour = logarithm[..., [0, 2]] - logarithm[..., 1:2]
    closer = rng.uniform(1, NEAREST) if rng.random() < NEARER else 1.0
    fields = logarithm @ LUMA, colour, cover, free, dark * ground, ground
    if closer > 1:
        fields = enlarged(fields, closer)
    planes = seen_planes(fields[:4])
    dark, ground = shrunk(fields[4]), shrunk(fields[5])
    is_free, is_ground = planes[4] > 0, ground > 0.5
    weight = is_free & is_ground if dark.any() else is_free
    dark = np.where(is_ground, dark / np.maximum(ground, 0.5), 0)
    area = float(((dark > DARK) & is_free).sum()) / max(float(planes[3].sum()), 1.0)
    label = 1.0 if area > LARGE else 0.0 if area < NONE else np.nan
    return ShadowSample(planes, dark.astype(np.float32), weight.astype(np.float32), label)


def _frame(rng: np.random.Generator, thing: Mask) -> Mask:
    """(FINE, FINE) what is looked at: as far as the photo goes, half of whose edges are near."""
    inside = np.zeros((FINE, FINE), bool)
    margin = (FINE - CELLS) // 2
    reach = np.minimum(rng.exponential(0.9, 4) + 0.03, 1) * margin
    reach = np.where(rng.random(4) < 0.5, reach, margin).astype(int)
    x0, y0, x1, y1 = box_of(thing)
    top, left = np.maximum(margin - reach[:2], np.maximum([y0 - CELLS, x0 - CELLS], 0))
    bottom, right = np.minimum(FINE - margin + reach[2:], [y1 + CELLS, x1 + CELLS])
    inside[top:bottom, left:right] = True
    return inside


def _other_shade(rng: np.random.Generator, dark: F32, other: SceneGeometry) -> F32:
    """(FINE, FINE) the light that something else leaves: shadows of other scenes, or its own,
    turned, where no lamp would throw it."""
    share, middle = rng.random(), (FINE / 2, FINE / 2)
    if share > 0.65:
        return np.ones_like(dark)
    if share < 0.5:
        ambient = rng.uniform(0.2, 0.7)
        light = (1 - ambient) * other.light[rng.integers(2)] + ambient * other.light[2]
        leaves = np.clip(light[..., 0] / np.maximum(light[..., 1], 1e-3), 0.05, 1)
        turn, size, away = rng.uniform(0, 360), rng.uniform(0.6, 1.6), 28
    else:
        leaves, turn, size, away = 1 - dark, rng.uniform(40, 320), 1.0, 20
    matrix = cv2.getRotationMatrix2D(middle, turn, size)
    matrix[:, 2] += rng.normal(0, away, 2)
    return np.asarray(cv2.warpAffine(leaves, matrix, (FINE, FINE), borderValue=1.0), np.float32)


def _uneven(rng: np.random.Generator) -> F64:
    """(FINE, FINE) light that falls off across the picture; some is dappled."""
    y, x = np.mgrid[-1 : 1 : FINE * 1j, -1 : 1 : FINE * 1j]
    tilt, bend = rng.normal(0, 0.25, 2), rng.uniform(0, 0.2)
    falls = np.exp(tilt[0] * x + tilt[1] * y - bend * (x * x + y * y))
    if rng.random() < 0.2:
        blobs = cv2.GaussianBlur(rng.normal(size=(FINE, FINE)), (0, 0), rng.uniform(6, 35))
        spots = (blobs > blobs.std() * rng.uniform(0, 1.3)).astype(np.float32)
        edge = cv2.GaussianBlur(spots, (0, 0), rng.uniform(0.6, 5))
        falls = falls * (1 - rng.uniform(0.2, 0.7) * edge)
    return np.asarray(falls)


def _surfaces(
    rng: np.random.Generator, scene: SceneGeometry, grounds: Grounds, falls: F32, facing: F32,
    has_shadow: bool,
) -> F32:  # fmt: skip
    """(FINE, FINE, 3) linear light of ground, wall, neighbours and the thing."""
    what = scene.what[..., None]
    if not has_shadow and rng.random() < PASTED:
        picture = _scenery(rng, grounds.photographs)
    else:
        light = falls[..., None]
        picture = _ground(rng, grounds, scene.place) * light
        if (what == WALL).any():
            picture = np.where(what == WALL, grounds.at(scene.place) * light, picture)
        picture = np.where(what == SKY, 2 * any_colour(rng), picture)
    for kind in (NEIGHBOUR, THING_SEEN):
        if (what == kind).any():
            skin = _skin(rng, grounds, scene.place) * facing[..., None]
            picture = np.where(what == kind, skin, picture)
    return np.asarray(picture, np.float32)


def _scenery(rng: np.random.Generator, shown: tuple[F32, ...]) -> F32:
    """(FINE, FINE, 3) a part of a photograph."""
    whole = shown[rng.integers(len(shown))]
    height, width = whole.shape[:2]
    side = int(rng.uniform(0.25, 1) * min(height, width))
    y, x = rng.integers(height - side + 1), rng.integers(width - side + 1)
    part: np.ndarray = whole[y : y + side, x : x + side]
    part = cv2.resize(part, (FINE, FINE), interpolation=cv2.INTER_AREA)
    part = part[:, ::-1] if rng.random() < 0.5 else part
    part = recoloured(rng, part) if rng.random() < 0.5 else part
    return np.asarray(part * rng.uniform(0.7, 1.2), np.float32)


def _ground(rng: np.random.Generator, grounds: Grounds, places: F32) -> F32:
    """The ground, with another beside it in some scenes: a half, a rug, a puddle, a dark patch."""
    ground = grounds.at(places)
    if rng.random() > OTHER_GROUND:
        return ground
    other = grounds.at(places)
    cos, sin = np.cos(turn := rng.uniform(0, np.pi)), np.sin(turn)
    x, y = np.moveaxis(places - rng.uniform(-0.9, 0.9, 2), -1, 0)
    u, v = x * cos - y * sin, x * sin + y * cos
    kind, half = rng.integers(3), rng.uniform(0.15, 1, 2)
    if rng.random() < 0.3:
        other = ground * np.float32(rng.uniform(0.25, 0.8))
    if kind == 0:
        is_other = v > rng.uniform(-0.3, 0.5)
    elif kind == 1:
        is_other = np.maximum(np.abs(u / half[0]), np.abs(v / half[1])) < 1
    else:
        is_other = (u / half[0]) ** 2 + (v / half[1]) ** 2 < 1
    share = cv2.GaussianBlur(is_other.astype(np.float32), (0, 0), rng.uniform(0.3, 2))[..., None]
    return np.asarray(ground * (1 - share) + other * share, np.float32)


def _skin(rng: np.random.Generator, grounds: Grounds, places: F32) -> F32:
    """(FINE, FINE, 3) of parts: a texture over all, or a colour for each."""
    if rng.random() < 0.4:
        y, x = np.mgrid[-1 : 1 : FINE * 1j, -1 : 1 : FINE * 1j]
        across, down = rng.uniform(0.5, 2, 2)
        return grounds.at(np.stack([x * across, y * down], -1).astype(np.float32))
    colours = np.stack([any_colour(rng) for _ in range(COLOURS)])
    if rng.random() < 0.3:
        colours[:] = colours[0]
    return np.asarray(colours[places[..., 0].astype(int) % COLOURS], np.float32)


def _photographed(rng: np.random.Generator, linear: F64) -> F32:
    """(FINE, FINE, 3) linear light as a camera has it: exposed, tinted, with noise, in range."""
    gain = np.exp(rng.normal(0, 0.25)) * np.exp(rng.normal(0, 0.08, 3))
    encoded = np.clip(linear * gain, 0, 1) ** (1 / GAMMA)
    encoded = encoded + rng.normal(0, rng.uniform(0, 0.02), encoded.shape)
    return (np.clip(encoded, 0, 1) ** GAMMA).astype(np.float32)
