"""Flat things with a picture on them: signs, drawings, wings, leaves, coins, cards, cut-outs."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, F64

from ..materials import a_colour, a_crop
from ..solid import PrimitiveBuilder, turned
from .letters import STROKES, strokes
from .making import Rng, chance, ngon, pick, rounded, smooth, span

SIDE = 320  # px of a picture
REACH = 1.15  # lengths from its middle to its edge
SUPER = 3  # binary digits of a px, of what is drawn


def prints(rng: Rng) -> PrimitiveBuilder:
    """Make a flat thing: hanging, standing, leaning or lying, mostly plane."""
    drawn = a_drawing(rng)
    lean = pick(rng, (0.0, 0.0, -span(rng, 0, 0.6), -np.pi / 2))
    turn = turned(rng.normal(0, 0.2), lean) @ turned(0, 0, rng.normal(0, 0.3))
    half = float(np.exp(span(rng, np.log(0.008), np.log(0.04))))
    built = PrimitiveBuilder()
    built.part(0)
    if chance(rng, 0.3):
        waves = (span(rng, 0, 0.06), span(rng, 0, 4), span(rng, 0, 4), span(rng, 0, 6.3))
        built.sheet([0, 0, 0], [REACH, REACH], half, waves, rng.normal(0, 0.35), turn)
        built.prism([0, 0, 0], drawn.outline, 2.0, 0, turn, keep=True)
    else:
        built.prism([0, 0, 0], drawn.outline, half, span(rng, 0, 0.8) * half, turn)
    built.prints[0] = (drawn.picture, turn)
    return built


def repainted(rng: Rng, picture: F32) -> F32:
    """A picture (h, w, 3) in other colours, faded, as it was, or a photograph in its place."""
    kind = int(rng.integers(4))
    if kind == 0:
        gain = np.exp(rng.normal(0, 0.3, 3)).astype(np.float32)
        return np.ascontiguousarray(picture[..., rng.permutation(3)] * gain).clip(0, 1)
    if kind == 1:
        ground = a_colour(rng).astype(np.float32)
        faint = np.float32(rng.uniform(0, 0.25)) * (picture - picture.mean())
        return (ground * (1 + faint)).clip(0, 1)
    if kind == 2:
        size = picture.shape[1::-1]
        return np.asarray(cv2.resize(a_crop(rng), size, interpolation=cv2.INTER_AREA), np.float32)
    return picture


@dataclass(frozen=True, eq=False)
class _Drawn:
    """An outline and what is painted in it."""

    outline: F64  # (k, 2) within 1 of the middle, y up
    picture: F32  # (SIDE, SIDE, 3) linear, over [-REACH, REACH] both ways, y down


def a_drawing(rng: Rng) -> _Drawn:
    """Draw any flat thing."""
    kinds = (_sign, _sign, _drawing, _drawing, _wings, _wings, _leaf, _leaf, _coin, _card, _cut_out,
             _sticker)  # fmt: skip
    return pick(rng, kinds)(rng)


class _Canvas:
    """A picture that is being painted, in lengths of the outline, y up."""

    def __init__(self, ground: F64 | F32) -> None:
        self.picture = np.empty((SIDE, SIDE, 3), np.float32)
        self.picture[:] = ground

    def fill(self, corners: F64, colour: F64) -> None:
        cv2.fillPoly(self.picture, [_px(corners)], tuple(colour), cv2.LINE_8, SUPER)

    def line(self, corners: F64, wide: float, colour: F64, is_closed: bool = False) -> None:
        thick = max(1, round(wide * SIDE / REACH / 2))
        cv2.polylines(
            self.picture, [_px(corners)], is_closed, tuple(colour), thick, cv2.LINE_8, SUPER
        )

    def dot(self, at: F64, radius: float, colour: F64) -> None:
        self.fill(at + ngon(16, radius), colour)

    def done(self, rng: Rng, outline: F64, grain: float = 0.06) -> _Drawn:
        """Printed: a little blurred, and not quite even."""
        noise = cv2.resize(rng.normal(0, 1, (24, 24)).astype(np.float32), (SIDE, SIDE))
        wear = np.exp(span(rng, 0, grain) * noise)[..., None]
        soft = cv2.GaussianBlur(self.picture * wear, (0, 0), span(rng, 0.5, 1.2))
        return _Drawn(outline, soft.clip(0, 1).astype(np.float32))


def _px(corners: F64) -> np.ndarray:
    """Fixed-point pixels (k, 2) of a picture."""
    at = (corners * [1, -1] / REACH + 1) * 0.5 * SIDE - 0.5
    return np.rint(at * 2**SUPER).astype(np.int32)


def _grid() -> tuple[F64, F64]:
    """x and y (SIDE, SIDE) of a picture's pixels."""
    steps = ((np.arange(SIDE) + 0.5) / SIDE * 2 - 1) * REACH
    x, y = np.meshgrid(steps, -steps)
    return x, y


def _blob(rng: Rng, low: int = 4, high: int = 11) -> F64:
    """(k, 2) an outline of no particular thing."""
    count = int(rng.integers(low, high))
    radii = rng.uniform(0.35, 1.0, (count, 1))
    return _fitted(smooth(ngon(count, 1.0, span(rng, 0, 6)) * radii, pick(rng, (0, 2, 3))))


def _fitted(outline: F64) -> F64:
    """The outline about its middle, with the longer side from -1 to 1."""
    low, high = outline.min(0), outline.max(0)
    return np.asarray((outline - 0.5 * (low + high)) * 2 / (high - low).max(), np.float64)


def _star(rng: Rng) -> F64:
    points = int(rng.integers(4, 9))
    outline = ngon(2 * points, 1.0, np.pi / 2)
    outline[1::2] *= span(rng, 0.35, 0.75)
    return outline


def _arrow() -> F64:
    half = np.array([[-1, 0.3], [0.1, 0.3], [0.1, 0.8], [1, 0]])
    return np.concatenate([half, half[2::-1] * [1, -1]])


def _fish(rng: Rng) -> F64:
    x = np.array([1, 0.5, 0, -0.5, -1])
    y = np.array([0, 0.45, 0.45, 0.1, 0.5]) * span(rng, 0.6, 1.3)
    return smooth(np.concatenate([np.stack([x, y], 1), np.stack([x, -y], 1)[:0:-1]]), 2)


def _heart() -> F64:
    t = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    y = 13 * np.cos(t) - 5 * np.cos(2 * t) - 2 * np.cos(3 * t) - np.cos(4 * t)
    return _fitted(np.stack([16 * np.sin(t) ** 3, y], 1))


def _motif(rng: Rng) -> F64:
    """(k, 2) something to paint, within 1 of the middle."""
    kind = int(rng.integers(5))
    if kind == 0:
        return _star(rng)
    if kind == 1:
        return _arrow() @ turned(0, 0, pick(rng, (0, 0.5, 1.0, 1.5)) * np.pi)[:2, :2].T
    if kind == 2:
        return _fish(rng)
    return _heart() if kind == 3 else _blob(rng)


def _write(rng: Rng, canvas: _Canvas, size: float, at: F64, colour: F64) -> None:
    """One to four letters side by side."""
    count, names = int(rng.integers(1, 5)), tuple(STROKES)
    scale = size / max(1.0, 0.7 * count)
    for k in range(count):
        shift = at + [1.35 * scale * (k - 0.5 * (count - 1)), 0]
        for line in strokes(pick(rng, names)):
            canvas.line(scale * line + shift, 0.25 * scale, colour)


def _sign(rng: Rng) -> _Drawn:
    """A road sign, a badge, a plate with a number: plain colours, a border, a symbol."""
    corners = pick(rng, (3, 4, 4, 6, 8, 8, 40, 40))
    start = {4: np.pi / 4 * pick(rng, (0, 1)), 8: np.pi / 8, 6: 0.0}.get(corners, np.pi / 2)
    outline = ngon(corners, 1.0, start) * [1.0, pick(rng, (1.0, 1.0, span(rng, 0.5, 1.0)))]
    if chance(rng, 0.2):
        outline = rounded(1.0, span(rng, 0.3, 1.0), span(rng, 0.02, 0.3))
    if corners == 3 and chance(rng, 0.3):
        outline = outline * [1, -1]
    outline = smooth(outline, 1) if corners < 40 and chance(rng, 0.4) else outline
    ground, border, ink = a_colour(rng), a_colour(rng), a_colour(rng)
    canvas = _Canvas(border)
    inner = span(rng, 0.8, 0.96)
    if chance(rng, 0.8):
        canvas.fill(inner * outline, ground)
    if chance(rng, 0.3):
        canvas.line(inner * outline, 0.04, ink, True)
    if chance(rng, 0.55):
        canvas.fill(span(rng, 0.3, 0.55) * _motif(rng), ink)
    else:
        _write(rng, canvas, span(rng, 0.5, 0.9), np.zeros(2), ink)
    if chance(rng, 0.2):
        canvas.line(np.array([[-0.6, 0.6], [0.6, -0.6]]), 0.12, border)
    return canvas.done(rng, outline)


def _drawing(rng: Rng) -> _Drawn:
    """Drawn and cut out: dark lines, plain fills, spots or stripes, an eye."""
    outline = pick(rng, (_fish(rng), _blob(rng), _blob(rng, 9, 16), _heart(), _star(rng)))
    ink, fill = a_colour(rng) * span(rng, 0, 0.4), a_colour(rng)
    canvas = _Canvas(fill)
    other = a_colour(rng)
    if chance(rng, 0.5):
        canvas.fill(outline * span(rng, 0.5, 0.85) + rng.normal(0, 0.1, 2), other)
    if chance(rng, 0.5):
        for _ in range(rng.integers(3, 14)):
            canvas.dot(rng.uniform(-0.8, 0.8, 2), span(rng, 0.03, 0.12), other)
    elif chance(rng, 0.5):
        for x in np.arange(-1, 1, span(rng, 0.15, 0.4)):
            bow = np.array([[x, 1], [x + rng.normal(0, 0.1), 0], [x, -1]])
            canvas.line(smooth(bow, 2, False), span(rng, 0.02, 0.1), other)
    for _ in range(rng.integers(0, 5)):
        line = smooth(rng.uniform(-0.7, 0.7, (4, 2)), 2, False)
        canvas.line(line, span(rng, 0.01, 0.03), ink)
    if chance(rng, 0.5):
        eye = np.array([span(rng, 0.3, 0.6), span(rng, 0, 0.2)])
        canvas.dot(eye, 0.1, np.full(3, 0.95))
        canvas.dot(eye, 0.05, ink)
    if chance(rng, 0.7):
        canvas.line(outline, span(rng, 0.02, 0.1), ink, True)
    return canvas.done(rng, outline)


def _wings(rng: Rng) -> _Drawn:
    """A butterfly or a moth: two pairs of wings, veins, spots, dark borders, a body."""
    fore, hind = span(rng, 0.75, 1.0), span(rng, 0.4, 0.75)
    tip, tail = span(rng, 0.4, 0.9), span(rng, -0.95, -0.5)
    wing = np.array([
        [0.03, 0.2], [0.35 * fore, 0.75 * tip], [fore, tip], [0.9 * fore, 0.05],
        [0.55 * fore, -0.08], [hind + 0.1, -0.3], [0.9 * hind, tail], [0.3 * hind, 0.85 * tail],
        [0.03, -0.4],
    ])  # fmt: skip
    wing = smooth(wing + rng.normal(0, 0.03, wing.shape) * [[0]] * 2, 2)
    right = wing[wing[:, 0] >= 0.02]
    outline = np.concatenate([right, right[::-1] * [-1, 1]])
    ground, dark, spot = a_colour(rng), a_colour(rng) * 0.3, a_colour(rng)
    x, y = _grid()
    out = np.hypot(x / fore, y / 0.9)[..., None].clip(0, 1)
    canvas = _Canvas(ground * (1 - out) + out * (ground * 0.5 + 0.5 * a_colour(rng)))
    half = [right * span(rng, 0.35, 0.6)]
    if chance(rng, 0.6):
        canvas.fill(half[0], spot)
        canvas.fill(half[0] * [-1, 1], spot)
    root = np.array([0.04, 0.0])
    for k in range(1, len(right) - 1, pick(rng, (3, 4, 6))):
        for sense in (1, -1):
            vein = np.stack([root, right[k]]) * [sense, 1]
            canvas.line(vein, 0.015, dark)
    for _ in range(rng.integers(0, 6)):
        at = right[rng.integers(len(right))] * span(rng, 0.4, 0.85)
        size, colour = span(rng, 0.03, 0.1), pick(rng, (spot, dark, np.full(3, 0.9)))
        for sense in (1, -1):
            canvas.dot(at * [sense, 1], size, colour)
            canvas.dot(at * [sense, 1], 0.5 * size, dark)
    if chance(rng, 0.7):
        canvas.line(outline, span(rng, 0.03, 0.15), dark, True)
    canvas.fill(np.array([[0.04, 0.3], [0.05, -0.4], [-0.05, -0.4], [-0.04, 0.3]]), dark)
    return canvas.done(rng, outline, 0.12)


def _leaf(rng: Rng) -> _Drawn:
    """Whole, toothed or lobed, with veins and a stalk."""
    count = 48
    t = np.linspace(0, np.pi, count)
    wide = np.sin(t) ** span(rng, 0.7, 1.4) * span(rng, 0.25, 0.65)
    wide *= 1 + span(rng, 0, 0.35) * np.cos(2 * int(rng.integers(2, 6)) * t)
    wide += 0.03 * (np.arange(count) % 2) * chance(rng, 0.4)
    y = -np.cos(t)
    right = np.stack([wide + 0.02, y], 1)
    outline = np.concatenate([right, right[::-1] * [-1, 1]])
    fresh = np.array([0.08, 0.25, 0.04]) * np.exp(rng.normal(0, 0.4, 3))
    colour = fresh if chance(rng, 0.5) else a_colour(rng)
    x, _ = _grid()
    across = (np.abs(x)[..., None] / 0.5).clip(0, 1)
    canvas = _Canvas(colour * (1 + span(rng, -0.4, 0.4) * across))
    vein = (colour * pick(rng, (0.5, 1.8, 2.5))).clip(0, 1)
    canvas.line(np.array([[0, -1], [0, 1]]), span(rng, 0.02, 0.05), vein)
    slant = span(rng, 0.2, 0.6)
    for at in np.arange(-0.85, 0.7, span(rng, 0.12, 0.3)):
        for sense in (1, -1):
            bow = np.array([[0, at], [0.3 * sense, at + 0.6 * slant], [0.7 * sense, at + slant]])
            canvas.line(smooth(bow, 1, False), 0.015, vein)
    for _ in range(rng.integers(0, 8) * chance(rng, 0.4)):
        canvas.dot(rng.uniform(-0.6, 0.6, 2), span(rng, 0.02, 0.08), a_colour(rng))
    spin = turned(0, 0, span(rng, 0, 6.3))[:2, :2]
    drawn = canvas.done(rng, outline, 0.15)
    degrees = float(np.degrees(np.arctan2(spin[1, 0], spin[0, 0])))
    middle = (0.5 * SIDE - 0.5, 0.5 * SIDE - 0.5)
    matrix = cv2.getRotationMatrix2D(middle, degrees, 1.0)
    picture = cv2.warpAffine(drawn.picture, matrix, (SIDE, SIDE), borderMode=cv2.BORDER_REFLECT)
    return _Drawn(outline @ spin.T, np.asarray(picture, np.float32))


def _coin(rng: Rng) -> _Drawn:
    """A coin, a medal, a button: struck metal, whose relief is much flatter than it looks."""
    outline = ngon(pick(rng, (64, 64, 12)), 1.0)
    height = _Canvas(np.zeros(3))
    rim = span(rng, 0.82, 0.94)
    height.line(rim * outline, 0.05, np.ones(3), True)
    if chance(rng, 0.7):
        height.fill(span(rng, 0.35, 0.6) * _motif(rng), np.full(3, 0.8))
    else:
        _write(rng, height, 0.8, np.zeros(2), np.full(3, 0.8))
    for angle in np.arange(0, 2 * np.pi, span(rng, 0.15, 0.5)):
        if chance(rng, 0.6):
            at = 0.72 * np.array([np.cos(angle), np.sin(angle)])
            height.line(at + rng.normal(0, 0.05, (3, 2)), 0.03, np.full(3, 0.6))
    raised = cv2.GaussianBlur(height.picture[..., 0], (0, 0), span(rng, 1.0, 3.0))
    rows, columns = np.gradient(raised)
    angle = span(rng, 0, 6.3)
    light = 1 + span(rng, 2, 6) * (np.cos(angle) * columns + np.sin(angle) * rows)
    metal = a_colour(rng) if chance(rng, 0.4) else np.array([0.6, 0.45, 0.25]) * span(rng, 0.5, 1.4)
    canvas = _Canvas(metal * light[..., None])
    return canvas.done(rng, outline, 0.15)


def _card(rng: Rng) -> _Drawn:
    """A photograph, a poster, a page, a book's cover, a note, a playing card."""
    outline = rounded(*pick(rng, ((0.7, 1.0), (1.0, 0.7), (0.62, 0.9), (1.0, 0.45), (0.9, 0.9))),
                      pick(rng, (0.002, 0.002, 0.08)))  # fmt: skip
    paper, ink = 0.3 * a_colour(rng) + 0.6, a_colour(rng) * span(rng, 0, 0.5)
    kind = pick(rng, ("photo", "page", "cover", "card"))
    canvas = _Canvas(a_colour(rng) if kind == "cover" else paper)
    half = np.abs(outline).max(0)
    if kind in ("photo", "cover"):
        inner = half * span(rng, 0.75, 1.0) * [1.0, 1.0 if kind == "photo" else span(rng, 0.4, 1)]
        low, high = (_px(c[None])[0] >> SUPER for c in (inner * [-1, 1], inner * [1, -1]))
        shape = tuple(int(v) for v in np.maximum(high - low, 2))
        found = cv2.resize(a_crop(rng), shape, interpolation=cv2.INTER_AREA)
        canvas.picture[low[1] : low[1] + shape[1], low[0] : low[0] + shape[0]] = found
        if kind == "cover":
            _write(rng, canvas, 0.5 * half[0], half * [0, span(rng, -0.6, 0.6)], ink)
    elif kind == "page":
        for y in np.arange(-0.85, 0.85, span(rng, 0.06, 0.15)):
            end = span(rng, 0.3, 0.85)
            canvas.line(half * np.array([[-0.85, y], [end, y]]), 0.025, ink)
    else:
        for sign in (1, -1):
            canvas.fill(half * sign * 0.7 * np.array([-1, 1]) + 0.12 * _motif(rng), ink)
        canvas.fill(0.5 * half.min() * _motif(rng), ink)
        canvas.line(0.9 * outline, 0.02, ink, True)
    return canvas.done(rng, outline)


def _cut_out(rng: Rng) -> _Drawn:
    """A photograph along some outline, now and then with a pale border."""
    outline = pick(rng, (_blob(rng), _blob(rng, 9, 18), _star(rng), _heart(), _fish(rng)))
    photo = cv2.resize(a_crop(rng), (SIDE, SIDE), interpolation=cv2.INTER_AREA)
    canvas = _Canvas(np.asarray(photo, np.float32))
    if chance(rng, 0.3):
        canvas.line(outline, span(rng, 0.04, 0.15), np.full(3, span(rng, 0.6, 0.95)), True)
    return canvas.done(rng, outline)


def _sticker(rng: Rng) -> _Drawn:
    """A motif in plain colours, with a wide border."""
    outline = _fitted(_motif(rng))
    canvas = _Canvas(a_colour(rng))
    canvas.fill(span(rng, 0.6, 0.9) * outline, a_colour(rng))
    _write(rng, canvas, span(rng, 0.3, 0.6), rng.normal(0, 0.1, 2), a_colour(rng))
    return canvas.done(rng, outline)
