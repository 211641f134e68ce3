"""Drawn textures of grounds, walls and skins: what is laid, strewn, woven or grown."""

from __future__ import annotations

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.compose.shadow.shadow import GAMMA

SIDE = 512  # px of a texture
PIECES = 4096  # of slabs, each with a tone of its own
LEAST_LIT = 0.05  # from which a stone is drawn with a side in shade and one in light


def any_colour(rng: np.random.Generator) -> F64:
    """(3,) linear: greys, and colours more or less strong."""
    value, spread = rng.uniform(0.08, 0.85), rng.choice([0.02, 0.12, 0.3])
    encoded = value * (1 + rng.normal(0, spread, 3))
    return np.asarray(encoded.clip(0.02, 0.95) ** GAMMA)


def noise(rng: np.random.Generator, sigma: float) -> F64:
    """(SIDE, SIDE) smooth over `sigma` px, of deviation 1."""
    noise = cv2.GaussianBlur(rng.normal(size=(SIDE, SIDE)), (0, 0), max(sigma, 0.3))
    return np.asarray(noise / noise.std())


def plain(rng: np.random.Generator) -> F64:
    grain = rng.uniform(0, 0.08) * noise(rng, rng.uniform(0.3, 2))
    return any_colour(rng) * np.exp(grain)[..., None]


def fractal(rng: np.random.Generator) -> F64:
    along = np.fft.fftfreq(SIDE)
    frequency = np.hypot(along[:, None], along[None])
    frequency[0, 0] = 1
    spectrum = np.fft.fft2(rng.normal(size=(SIDE, SIDE))) / frequency ** rng.uniform(0.3, 1.6)
    noise = np.real(np.fft.ifft2(spectrum))
    return any_colour(rng) * np.exp(rng.uniform(0.05, 0.6) * noise / noise.std())[..., None]


def pebbles(rng: np.random.Generator) -> F64:
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


def laid(rng: np.random.Generator) -> F64:
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
    grain = rng.uniform(0, 0.15) * noise(rng, rng.uniform(0.5, 4))
    return np.asarray(found * np.exp(grain)[..., None])


def grained(rng: np.random.Generator) -> F64:
    sigmas = rng.uniform(0.5, 4), rng.uniform(10, 60)
    noise = cv2.GaussianBlur(rng.normal(size=(SIDE, SIDE)), (0, 0), sigmas[0], sigmaY=sigmas[1])
    return any_colour(rng) * np.exp(rng.uniform(0.05, 0.5) * noise / noise.std())[..., None]


def blotched(rng: np.random.Generator) -> F64:
    height = noise(rng, rng.uniform(5, 50)) - rng.uniform(-1, 1)
    share = 1 / (1 + np.exp(np.clip(-rng.uniform(1, 20) * height, -40, 40)))[..., None]
    grain = rng.uniform(0, 0.2) * noise(rng, rng.uniform(0.4, 3))
    found = any_colour(rng) * share + any_colour(rng) * (1 - share)
    return np.asarray(found * np.exp(grain)[..., None])


def slabs(rng: np.random.Generator, stuff: F64) -> F64:
    """Slabs, planks, hexagons or herringbone of some stuff, each piece of a tone of its own."""
    wide = rng.uniform(18, 190)
    piece, from_joint = _WAYS_TO_LAY[rng.integers(len(_WAYS_TO_LAY))](rng, *_turned(rng), wide)
    tone = np.exp(rng.normal(0, rng.choice([0.03, 0.1, 0.25, 0.6]), (PIECES, 1)))
    tone = tone * (1 + rng.normal(0, rng.choice([0.01, 0.06]), (PIECES, 3)))
    found = stuff * tone[piece]
    steep, joint = rng.uniform(0.7, 3), rng.uniform(0.4, 5)
    share = 1 / (1 + np.exp(-np.clip((from_joint - joint) * steep, -40, 40)))[..., None]
    between = stuff.mean((0, 1)) * rng.uniform(0.1, 1.4)
    return np.asarray(found * share + between * (1 - share))


def _turned(rng: np.random.Generator) -> tuple[F64, F64]:
    """(SIDE, SIDE) places along two axes, some of them laid unevenly."""
    y, x = np.mgrid[:SIDE, :SIDE].astype(float)
    cos, sin = np.cos(turn := rng.uniform(0, np.pi)), np.sin(turn)
    x, y = x * cos - y * sin, x * sin + y * cos
    if rng.random() < 0.4:
        x = x + rng.uniform(1, 8) * noise(rng, rng.uniform(20, 60))
        y = y + rng.uniform(1, 8) * noise(rng, 40)
    return x, y


def _numbered(column: F64, row: F64) -> np.ndarray:
    return (column.astype(int) * 131 + row.astype(int) * 57) % PIECES


def _from_whole(steps: F64) -> F64:
    return np.asarray(np.abs(steps - np.round(steps)))


def _in_rows(
    rng: np.random.Generator, x: F64, y: F64, wide: float
) -> tuple[np.ndarray, F64]:  # fmt: skip
    """Which piece (SIDE, SIDE) and how far from its edge: tiles and bricks."""
    high = wide * rng.choice([1, 1, 0.5, 0.33, 2])
    row = np.floor(y / high)
    along = x / wide + row * rng.choice([0, 0.5, 0.33])
    edge = np.minimum(_from_whole(along) * wide, _from_whole(y / high) * high)
    return _numbered(np.floor(along), row), edge


def _as_planks(
    rng: np.random.Generator, x: F64, y: F64, wide: float
) -> tuple[np.ndarray, F64]:  # fmt: skip
    high = wide / rng.uniform(3, 9)
    row = np.floor(y / high)
    along = x / (2 * wide) + rng.random(97)[row.astype(int) % 97]
    edge = np.minimum(_from_whole(along) * 2 * wide, _from_whole(y / high) * high)
    return _numbered(np.floor(along), row), edge


def _as_hexagons(
    rng: np.random.Generator, x: F64, y: F64, wide: float
) -> tuple[np.ndarray, F64]:  # fmt: skip
    del rng
    high, away, numbers = wide * np.sqrt(3), [], []
    for k in range(2):  # the nearest middle, of two lattices
        u, v = np.round(x / wide - k / 2), np.round(y / high - k / 2)
        away.append(np.hypot(x - (u + k / 2) * wide, y - (v + k / 2) * high))
        numbers.append(_numbered(2 * u + k, 2 * v + k))
    return np.where(away[1] < away[0], numbers[1], numbers[0]), np.abs(away[1] - away[0]) / 1.2


def _as_herringbone(
    rng: np.random.Generator, x: F64, y: F64, wide: float
) -> tuple[np.ndarray, F64]:  # fmt: skip
    del rng
    u, v = x / wide, y / wide
    column, row = np.floor(u), np.floor(v)
    kind = (column + row) % 4  # left, right, upper or lower half of a piece
    sides = (u - column, 1 - u + column, v - row, 1 - v + row)
    open_in = (1, 0, 3, 2)  # where it goes on in its other half
    edge = np.minimum.reduce(
        [np.where(kind == k, 9.0, side) for k, side in zip(open_in, sides, strict=True)]
    )
    piece = _numbered(np.where(kind == 1, column - 1, column), np.where(kind == 3, row - 1, row))
    return piece, edge * wide


_WAYS_TO_LAY = (_in_rows, _as_planks, _as_hexagons, _as_herringbone)


def blades(rng: np.random.Generator) -> F64:
    """Grass, hay or pile: many strokes, most of them along one way."""
    base, count = any_colour(rng), int(rng.integers(800, 6000))
    found = np.tile((base * rng.uniform(0.2, 1)).astype(np.float32), (SIDE, SIDE, 1))
    length = np.exp(rng.uniform(np.log(5), np.log(60))) * rng.uniform(0.4, 1.3, (count, 1))
    way = rng.uniform(0, 2 * np.pi) + rng.normal(0, rng.choice([0.15, 0.5, 2]), count)
    starts = rng.uniform(0, SIDE, (count, 2))
    ends = starts + np.stack([np.cos(way), np.sin(way)], 1) * length
    tones = np.exp(rng.normal(0, rng.uniform(0.1, 0.7), (count, 1)))
    colours = (base * tones * (1 + rng.normal(0, 0.12, (count, 3)))).clip(0, 1)
    thick = int(rng.integers(1, 4))
    for start, end, colour in zip(starts.astype(int), ends.astype(int), colours, strict=True):
        cv2.line(found, start.tolist(), end.tolist(), colour.tolist(), thick)
    return np.asarray(found, np.float64)


def stones(rng: np.random.Generator, under: F64) -> F64:
    """Gravel, pebbles or leaves that lie over each other on something, lit from one side."""
    base, found = any_colour(rng), np.ascontiguousarray(under, np.float32)
    size = np.exp(rng.uniform(np.log(4), np.log(45)))
    count = int(min(rng.uniform(0.2, 2.2) * SIDE * SIDE / (3 * size * size), 3500))
    spread, hue = rng.uniform(0.08, 0.6), rng.choice([0.02, 0.1, 0.3])
    lit, flat, way = rng.uniform(0, 0.35), rng.uniform(0.4, 1), rng.uniform(0, 2 * np.pi)
    aside = 0.25 * size * np.array([np.cos(way), np.sin(way)])
    for _ in range(count):
        half = size * np.exp(rng.normal(0, 0.35)) * np.array([1, flat * rng.uniform(0.5, 1)])
        at, turn = rng.uniform(0, SIDE, 2), float(rng.uniform(0, 180))
        colour = base * np.exp(rng.normal(0, spread)) * (1 + rng.normal(0, hue, 3))
        layers = [(at, half, 1.0)]
        if lit > LEAST_LIT:
            layers = [(at + aside, half, 0.35), *layers, (at - 0.8 * aside, half / 2, 1 + lit)]
        for middle, axes, tone in layers:
            where, long = middle.astype(int).tolist(), np.maximum(axes, 1).astype(int).tolist()
            cv2.ellipse(found, where, long, turn, 0, 360, (tone * colour).clip(0, 1).tolist(), -1)
    grain = rng.uniform(0, 0.15) * noise(rng, rng.uniform(0.5, 3))
    return np.asarray(found * np.exp(grain)[..., None], np.float64)


def woven(rng: np.random.Generator) -> F64:
    """A motif that is repeated, and mirrored in most: carpets, cloths, wallpaper."""
    side, colours = int(rng.choice([16, 24, 32, 48, 64, 96, 128])), int(rng.integers(2, 6))
    motif = rng.integers(0, colours, (8, 8)).astype(np.float32)
    motif = cv2.resize(motif, (side, side), interpolation=cv2.INTER_NEAREST)
    if rng.random() < 0.5:
        blobs = cv2.GaussianBlur(rng.normal(size=(side, side)), (0, 0), side / 10)
        edges = np.sort(rng.normal(0, blobs.std(), colours - 1))
        motif = np.digitize(blobs, edges).astype(np.float32)
    motif = np.hstack([motif, motif[:, ::-1]]) if rng.random() < 0.7 else motif
    motif = np.vstack([motif, motif[::-1]]) if rng.random() < 0.7 else motif
    repeats = [-(-SIDE // n) for n in motif.shape]
    which = np.tile(motif, repeats)[:SIDE, :SIDE].astype(int)
    base, spread = any_colour(rng), rng.choice([0.1, 0.3, 1.0])
    alike = (
        base * np.exp(rng.normal(0, spread, (colours, 1))) * (1 + rng.normal(0, 0.2, (colours, 3)))
    )
    unlike = np.stack([any_colour(rng) for _ in range(colours)])
    drawn = (alike if rng.random() < 0.6 else unlike)[which]
    soft = cv2.GaussianBlur(drawn, (0, 0), rng.uniform(0.4, 2.5))
    return soft * np.exp(rng.uniform(0, 0.25) * noise(rng, rng.uniform(0.4, 2)))[..., None]


def patches(rng: np.random.Generator, one: F64, other: F64) -> F64:
    """One stuff in patches on another: moss, dirt, wear, stains."""
    rough = [np.exp(rng.uniform(*np.log(sizes))) for sizes in ((3, 60), (1, 12))]
    height = noise(rng, rough[0]) + 0.5 * noise(rng, rough[1]) - rng.uniform(-0.6, 1.6)
    share = 1 / (1 + np.exp(np.clip(-rng.uniform(1.5, 25) * height, -40, 40)))[..., None]
    return np.asarray(one * (1 - share) + other * share)
