"""Pictures whose truth is known to the pixel: things put in front of photographed backgrounds.

What hand-outlined photos have too few of: fruit that touch, fur before leaves, thin limbs, and gaps
that an object's own parts enclose. Edges are soft, by the lens' blur or by hairs; what covers more
than half of a pixel is in the truth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, RGB, Mask
from tests.core.segment.truth_masks import truth, truth_mask
from tests.photos import photo

HEIGHT, WIDTH = 400, 560  # px
FINER = 4  # subpixels a pixel is cut into, each way, where a shape is drawn
BLUR = 0.8  # px, standard deviation of an edge
NOISE = 2.0  # grey levels, of the sensor
LIGHT = np.array([-0.5, -0.65, 0.57])  # where it comes from: left, above, in front
LEAF, FUR, SKIN = (0.24, 0.38, 0.13), (0.46, 0.31, 0.17), (0.76, 0.56, 0.44)
BARK, IRON = (0.27, 0.21, 0.16), (0.30, 0.31, 0.34)

Color = tuple[float, float, float]
Points = Sequence[tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Layer:
    """One thing in front of what is behind it."""

    color: F32  # (HEIGHT, WIDTH, 3) sRGB in [0, 1]
    alpha: F32  # (HEIGHT, WIDTH)


@dataclass(frozen=True)
class Composite:
    """What is in a picture; the first of the layers that `draw` makes are the object."""

    name: str
    is_held_out: bool  # nothing was tuned on it
    background: str
    draw: Callable[[], tuple[list[Layer], list[Layer]]]  # of the object, and in front of it


@cache
def picture(name: str) -> tuple[RGB, Mask]:
    """(H, W, 3) the composite called `name`, and (H, W) its object."""
    each = composite(name)
    object_layers, front = each.draw()
    image = _background(each.background)
    covered = np.zeros((HEIGHT, WIDTH), np.float32)
    for layer in object_layers:
        image, covered = _over(image, layer), covered + layer.alpha * (1 - covered)
    for layer in front:
        image, covered = _over(image, layer), covered * (1 - layer.alpha)
    rng = np.random.default_rng(len(name))
    pixels = image * 255 + rng.normal(0, NOISE, image.shape)
    return pixels.round().clip(0, 255).astype(np.uint8), covered > 0.5


def composite(name: str) -> Composite:
    """The one called `name`."""
    return next(each for each in COMPOSITES if each.name == name)


# Backgrounds ------------------------------------------------------------------------------------


def _background(name: str) -> F32:
    """(HEIGHT, WIDTH, 3) a place of a photo, a little out of focus."""
    if name in ("grass", "gravel", "brick"):
        from skimage import data

        tint = {"grass": (0.75, 1.05, 0.45), "gravel": (1.05, 1.0, 0.93), "brick": (1.25, 0.9, 0.7)}
        grey = getattr(data, name)()[:HEIGHT, :HEIGHT]
        wide = cv2.resize(np.hstack([grey, grey[:, ::-1]]), (2 * HEIGHT, HEIGHT))[:, :WIDTH]
        image = wide[..., None] * np.array(tint[name]) / 255
    else:
        places = {
            "leaves": ("china", 290, 0, 427, 192),
            "sky": ("china", 5, 330, 205, 610),
            "wood": ("coffee", 0, 0, 180, 126),
            "garden": ("flower", 0, 380, 186, 640),
            "garage": ("motorcycle", 0, 330, 293, 740),
            "lake": ("china", 0, 80, 400, 640),
        }
        photo_name, top, left, bottom, right = places[name]
        crop = photo(photo_name)[top:bottom, left:right]
        image = cv2.resize(crop, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC) / 255
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 1.2), np.float32).clip(0, 1)


def _over(image: F32, layer: Layer) -> F32:
    alpha = layer.alpha[..., None]
    return np.asarray(image * (1 - alpha) + layer.color * alpha, np.float32)


# Things -----------------------------------------------------------------------------------------


def _noise(seed: int, *scales: float) -> F32:
    """(HEIGHT, WIDTH) of unit deviation, blurred by each of the scales, px."""
    rng, total = np.random.default_rng(seed), np.zeros((HEIGHT, WIDTH))
    for scale in scales:
        field = cv2.GaussianBlur(rng.normal(size=(HEIGHT, WIDTH)), (0, 0), scale)
        total += field / field.std()
    return np.asarray(total / len(scales) ** 0.5, np.float32)


def _shape(draw: Callable[[np.ndarray], object], blur: float = BLUR) -> F32:
    """(HEIGHT, WIDTH) coverage of what `draw` draws as ones into a finer picture."""
    fine = np.zeros((HEIGHT * FINER, WIDTH * FINER), np.uint8)
    draw(fine)
    small = cv2.resize(fine.astype(np.float32), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(small, (0, 0), blur), np.float32)


def _solid(alpha: F32, color: Color, seed: int, texture: float = 0.08, round_by: int = 60) -> Layer:
    """A thing of that outline, rounded towards its edge, lit and textured."""
    depth = cv2.distanceTransform((alpha > 0.5).astype(np.uint8), cv2.DIST_L2, 5)
    height = np.sqrt(np.minimum(depth, round_by) * (2 * round_by - np.minimum(depth, round_by)))
    height = cv2.GaussianBlur(height, (0, 0), 2.0)
    down, across = np.gradient(height)
    normal = np.stack([-across, -down, np.ones_like(depth)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    light = 0.45 + 0.65 * np.maximum(normal @ LIGHT, 0) + texture * _noise(seed, 1.0, 3.0, 12.0)
    shine = 0.25 * np.maximum(normal @ LIGHT, 0) ** 30
    lit = np.array(color) * light[..., None] + shine[..., None]
    return Layer(np.asarray(lit.clip(0, 1), np.float32), alpha)


def _ellipse(x: float, y: float, across: float, down: float, turn: float = 0.0) -> F32:
    at, axes = (round(x * FINER), round(y * FINER)), (round(across * FINER), round(down * FINER))
    return _shape(lambda fine: cv2.ellipse(fine, at, axes, turn, 0, 360, (1,), -1))


def _tube(points: Points, begin: float, end: float, blur: float = BLUR) -> F32:
    """A line that is `begin` px wide at its first point and `end` px at its last."""
    corners = np.array(points, np.float64)
    t = np.linspace(0, len(points) - 1, 60 * len(points))
    k = np.arange(len(points))
    x, y = np.interp(t, k, corners[:, 0]), np.interp(t, k, corners[:, 1])

    def draw(fine: np.ndarray) -> None:
        for a, b, width in zip(x, y, np.linspace(begin, end, len(t)), strict=True):
            cv2.circle(
                fine, (round(a * FINER), round(b * FINER)), round(width * FINER / 2), (1,), -1
            )

    return _shape(draw, blur)


def _union(*alphas: F32) -> F32:
    return np.max(alphas, axis=0)


def _furry(alpha: F32, color: Color, seed: int, length: float = 9.0) -> Layer:
    """A thing of that outline with hairs that stand out from its edge, and lie on it."""
    rng = np.random.default_rng(seed)
    inside = cv2.GaussianBlur(alpha, (0, 0), 3.0)
    down, across = np.gradient(inside)
    lit = _solid(alpha, color, seed, 0.16).color
    soft = alpha.copy()
    rows, columns = np.nonzero((alpha > 0.3) & (inside < 0.97))
    for k in rng.choice(len(rows), min(len(rows), 2600), replace=False):
        y, x = float(rows[k]), float(columns[k])
        angle = np.arctan2(-down[int(y), int(x)], -across[int(y), int(x)]) + rng.normal(0, 0.5)
        far = length * rng.uniform(0.3, 1.0)
        tip = x + far * np.cos(angle), y + far * np.sin(angle)
        hair, ends = np.zeros_like(soft), np.round(np.array([[x, y], tip]) * 16).astype(int)
        box = np.s_[
            max(int(y - far) - 3, 0) : int(y + far) + 4, max(int(x - far) - 3, 0) : int(x + far) + 4
        ]
        cv2.line(hair, ends[0].tolist(), ends[1].tolist(), (0.7,), 1, cv2.LINE_AA, 4)
        tone = np.array(color, np.float32) * np.float32(rng.uniform(0.6, 1.4))
        lit[box] += hair[box][..., None] * (tone - lit[box])
        soft[box] = np.maximum(soft[box], hair[box])
    return Layer(lit.clip(0, 1), soft)


def _cut_out(name: str, height: float, x: float, y: float, flip: bool = False) -> Layer:
    """A hand-outlined thing of a photo, `height` px tall, its middle at x, y."""
    pixels, mask = photo(truth(name).photo), truth_mask(name)
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    inner = cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8))  # no old background
    seen = cv2.inpaint(pixels, 1 - inner, 3, cv2.INPAINT_TELEA)[box][:, :: -1 if flip else 1]
    own = mask[box][:, :: -1 if flip else 1].astype(np.float32)
    scale = height / own.shape[0]
    move = np.array([[scale, 0, x - scale * own.shape[1] / 2], [0, scale, y - height / 2]])
    size, how = (WIDTH, HEIGHT), cv2.INTER_AREA
    color = cv2.warpAffine(seen.astype(np.float32) / 255, move, size, flags=cv2.INTER_LINEAR)
    alpha = cv2.warpAffine(own, move, size, flags=how)
    soft = cv2.GaussianBlur(alpha, (0, 0), BLUR)
    return Layer(np.asarray(color, np.float32), np.asarray(soft, np.float32))


def _horse(height: float, x: float, y: float) -> F32:
    from skimage import data

    own = 1 - np.atleast_2d(data.horse()).astype(np.float32)
    scale = height / own.shape[0]
    move = np.array([[scale, 0, x - scale * own.shape[1] / 2], [0, scale, y - height / 2]])
    moved = cv2.warpAffine(own, move, (WIDTH, HEIGHT))
    return np.asarray(cv2.GaussianBlur(moved, (0, 0), BLUR), np.float32)


def _squirrel(x: float, y: float, color: Color, seed: int) -> list[Layer]:
    """Its tail curls up behind and over it: tail, back and head enclose a gap."""
    tail = _tube(
        [
            (x - 50, y + 60),
            (x - 95, y + 20),
            (x - 105, y - 50),
            (x - 70, y - 105),
            (x - 10, y - 118),
            (x + 32, y - 88),
        ],
        30,
        40,
    )
    body = _union(
        _ellipse(x, y + 30, 40, 62, 20),
        _ellipse(x + 45, y - 45, 30, 24, 20),
        _ellipse(x + 34, y - 70, 7, 12, -10),
    )
    limbs = _union(
        _tube([(x + 25, y + 5), (x + 62, y + 20), (x + 66, y + 8)], 14, 8),
        _tube([(x, y + 80), (x + 50, y + 90)], 18, 10),
    )
    paler = (1.25 * color[0], 1.25 * color[1], 1.25 * color[2])
    return [_furry(tail, paler, seed), _furry(_union(body, limbs), color, seed + 1, 6.0)]


def _kitten(x: float, y: float, color: Color) -> list[Layer]:
    ears = [_tube([(x + a, y - 95), (x + 1.35 * a, y - 150)], 40, 4) for a in (-38, 38)]
    head, body = _ellipse(x, y - 70, 66, 54), _ellipse(x, y + 45, 78, 86)
    tail = _tube([(x + 60, y + 95), (x + 135, y + 70), (x + 150, y + 5)], 26, 16)
    return [
        _furry(_union(body, tail), color, 7),
        _furry(_union(head, *ears), color, 8, 6.0),
        _solid(_ellipse(x - 26, y - 76, 12, 12), (0.45, 0.5, 0.1), 9, 0.03, 12),
        _solid(_ellipse(x + 26, y - 76, 12, 12), (0.45, 0.5, 0.1), 9, 0.03, 12),
        _solid(_ellipse(x, y - 48, 8, 6), (0.55, 0.3, 0.28), 9, 0.03, 6),
    ]


def _figure(x: float, y: float, shirt: Color, shorts: Color) -> list[Layer]:
    """Hands on the hips, legs apart: arms and trunk enclose two gaps."""
    legs = _union(
        _tube([(x - 14, y + 40), (x - 28, y + 100), (x - 34, y + 155)], 24, 12),
        _tube([(x + 14, y + 40), (x + 30, y + 100), (x + 40, y + 155)], 24, 12),
    )
    arms = _union(
        _tube([(x - 30, y - 55), (x - 66, y - 12), (x - 26, y + 22)], 15, 11),
        _tube([(x + 30, y - 55), (x + 66, y - 12), (x + 26, y + 22)], 15, 11),
    )
    trunk = _tube([(x, y - 50), (x, y + 25)], 62, 50)
    hips = _tube([(x - 10, y + 35), (x + 10, y + 35), (x + 16, y + 70)], 50, 34)
    hips = _union(hips, _tube([(x - 10, y + 35), (x - 18, y + 70)], 50, 34))
    head = _union(_ellipse(x, y - 110, 21, 26), _tube([(x, y - 90), (x, y - 70)], 18, 20))
    hair = _tube([(x - 18, y - 118), (x, y - 132), (x + 18, y - 118)], 16, 16)
    return [
        _solid(legs, SKIN, 1),
        _solid(arms, SKIN, 2),
        _solid(hips, shorts, 3),
        _solid(trunk, shirt, 4),
        _solid(head, SKIN, 5),
        _solid(hair, (0.13, 0.09, 0.06), 6),
    ]


def _stool(x: float, y: float, color: Color) -> list[Layer]:
    legs = [_tube([(x + a, y - 60), (x + 1.5 * a, y + 130)], 9, 6) for a in (-70, -25, 25, 70)]
    bar = _tube([(x - 88, y + 50), (x + 88, y + 50)], 5, 5)
    return [_solid(_union(*legs, bar), color, 1), _solid(_ellipse(x, y - 65, 95, 24), color, 2)]


def _tree(x: float, y: float, seed: int, color: Color, depth: int = 6) -> list[Layer]:
    rng, tubes = np.random.default_rng(seed), []

    def grow(at: tuple[float, float], angle: float, length: float, width: float, left: int) -> None:
        tip = at[0] + length * np.cos(angle), at[1] - length * np.sin(angle)
        tubes.append((at, tip, width))
        if left:
            for side in (-1, 1):
                turn = angle + side * rng.uniform(0.2, 0.6)
                grow(tip, turn, length * rng.uniform(0.7, 0.88), width * 0.68, left - 1)

    grow((x, y), np.pi / 2, 78, 20, depth - 1)
    alpha = _union(*(_tube([a, b], w, w * 0.75, 0.6) for a, b, w in tubes))
    return [_solid(alpha, color, seed)]


def _bird(x: float, y: float) -> list[Layer]:
    legs = [
        _tube([(x + a, y + 45), (x + a + 6, y + 85), (x + a - 4, y + 125)], 5, 4) for a in (-14, 14)
    ]
    feet = [
        _tube([(x + a - 20, y + 128), (x + a - 4, y + 124), (x + a + 14, y + 129)], 3, 3)
        for a in (-14, 14)
    ]
    tail = _tube([(x - 60, y + 10), (x - 150, y + 55)], 30, 14)
    beak = _tube([(x + 92, y - 58), (x + 150, y - 50)], 10, 2)
    breast = (0.72, 0.38, 0.20)
    return [
        _solid(_union(*legs, *feet), BARK, 1),
        _solid(tail, (0.25, 0.22, 0.2), 2),
        _solid(_ellipse(x, y, 82, 52, -15), (0.42, 0.36, 0.3), 3),
        _solid(_ellipse(x + 30, y + 12, 50, 34, -25), breast, 4),
        _solid(_ellipse(x + 70, y - 55, 32, 29), (0.36, 0.30, 0.26), 5),
        _solid(beak, (0.2, 0.18, 0.15), 6),
    ]


def _mug(x: float, y: float, color: Color) -> list[Layer]:
    ring = _shape(
        lambda fine: cv2.ellipse(
            fine,
            (round((x + 78) * FINER), round(y * FINER)),
            (42 * FINER, 48 * FINER),
            0,
            0,
            360,
            (1,),
            15 * FINER,
        )
    )
    corners = np.round(
        np.array([(x - 78, y - 95), (x + 78, y - 95), (x + 68, y + 95), (x - 68, y + 95)]) * FINER
    )
    wall = _shape(lambda fine: cv2.fillPoly(fine, [corners.astype(np.int32)], (1,)))
    wall = _union(wall, _ellipse(x, y + 95, 68, 16), _ellipse(x, y - 95, 78, 20))
    return [
        _solid(ring, color, 1, 0.03, 12),
        _solid(wall, color, 2, 0.03),
        _solid(_ellipse(x, y - 95, 68, 14), (0.25, 0.14, 0.08), 3, 0.03, 10),
    ]


def _aloe(x: float, y: float, color: Color) -> list[Layer]:
    angles = np.linspace(0.12, np.pi - 0.12, 11)
    leaves = [
        _tube(
            [
                (x, y),
                (x + 75 * np.cos(a), y - 90 * np.sin(a)),
                (x + 150 * np.cos(a) ** 3 + 40 * np.cos(a), y - 200 * np.sin(a)),
            ],
            30,
            2,
        )
        for a in (*angles[::2], *angles[1::2])
    ]
    return [_solid(leaf, color, k, 0.06, 14) for k, leaf in enumerate(leaves)]


def _wreath(x: float, y: float, seed: int) -> list[Layer]:
    rng = np.random.default_rng(seed)
    parts = []
    for angle in rng.permutation(np.linspace(0, 2 * np.pi, 46, endpoint=False)):
        far = 105 + rng.normal(0, 9)
        at = x + far * np.cos(angle), y + far * np.sin(angle)
        parts.append(
            _solid(
                _ellipse(*at, 26, 10, float(np.degrees(angle) + rng.uniform(30, 120))),
                (0.5 + rng.uniform(0, 0.2), 0.3, 0.12),
                seed,
                0.05,
                8,
            )
        )
    return parts


def _fruit(x: float, y: float, radius: float, color: Color, seed: int, long: float = 1.0) -> Layer:
    return _solid(_ellipse(x, y, radius * long, radius, 15), color, seed, 0.05, round(radius))


LEMON, ORANGE, APPLE, PLUM = (
    (0.90, 0.78, 0.18),
    (0.90, 0.50, 0.10),
    (0.72, 0.13, 0.10),
    (0.34, 0.15, 0.30),
)

COMPOSITES = (
    Composite(
        "lemon",
        False,
        "wood",
        lambda: ([_fruit(330, 220, 78, LEMON, 1, 1.2)], [_fruit(175, 200, 95, ORANGE, 2)]),
    ),
    Composite(
        "orange",
        True,
        "garden",
        lambda: ([_fruit(200, 210, 95, ORANGE, 3)], [_fruit(350, 240, 70, LEMON, 4, 1.25)]),
    ),
    Composite(
        "apple",
        False,
        "leaves",
        lambda: ([_fruit(215, 210, 88, APPLE, 5)], [_fruit(375, 225, 84, APPLE, 6)]),
    ),
    Composite(
        "plum",
        True,
        "wood",
        lambda: (
            [_fruit(280, 190, 80, PLUM, 7)],
            [_fruit(150, 235, 78, PLUM, 8), _fruit(405, 245, 82, PLUM, 9)],
        ),
    ),
    Composite("squirrel", False, "leaves", lambda: (_squirrel(285, 215, FUR, 1), [])),
    Composite(
        "red squirrel", True, "brick", lambda: (_squirrel(270, 215, (0.55, 0.27, 0.12), 5), [])
    ),
    Composite(
        "horse",
        False,
        "grass",
        lambda: ([_solid(_horse(330, 280, 200), (0.36, 0.22, 0.13), 1)], []),
    ),
    Composite(
        "grey horse",
        True,
        "gravel",
        lambda: ([_solid(_horse(310, 280, 200), (0.66, 0.64, 0.62), 2)], []),
    ),
    Composite("stool", False, "gravel", lambda: (_stool(280, 200, (0.62, 0.42, 0.22)), [])),
    Composite("bird", True, "sky", lambda: (_bird(270, 170), [])),
    Composite("tree", False, "sky", lambda: (_tree(280, 395, 3, BARK), [])),
    Composite("bare tree", True, "lake", lambda: (_tree(270, 395, 8, (0.36, 0.3, 0.25)), [])),
    Composite("mug", False, "wood", lambda: (_mug(260, 210, (0.80, 0.80, 0.78)), [])),
    Composite("wreath", True, "grass", lambda: (_wreath(280, 200, 2), [])),
    Composite(
        "player",
        False,
        "garage",
        lambda: (_figure(280, 215, (0.75, 0.12, 0.14), (0.88, 0.88, 0.9)), []),
    ),
    Composite(
        "walker",
        True,
        "lake",
        lambda: (_figure(240, 215, (0.30, 0.38, 0.25), (0.22, 0.24, 0.30)), []),
    ),
    Composite(
        "front dahlia",
        False,
        "grass",
        lambda: ([_cut_out("dahlia", 230, 215, 200)], [_cut_out("dahlia", 200, 400, 225, True)]),
    ),
    Composite("aloe", True, "gravel", lambda: (_aloe(280, 340, (0.36, 0.52, 0.32)), [])),
    Composite("kitten", False, "leaves", lambda: (_kitten(290, 235, (0.50, 0.43, 0.33)), [])),
    Composite(
        "cup",
        True,
        "brick",
        lambda: ([_cut_out("coffee", 240, 210, 220)], [_cut_out("coffee", 220, 440, 210, True)]),
    ),
)
