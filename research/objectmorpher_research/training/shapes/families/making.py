"""Common parts of all families: choices, outlines, tubes and limbs with a joint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder

Rng = np.random.Generator
T = TypeVar("T")


def pick(rng: Rng, choices: Sequence[T]) -> T:
    """Pick one of them, all as likely."""
    return choices[int(rng.integers(len(choices)))]


def chance(rng: Rng, share: float) -> bool:
    """True that often."""
    return bool(rng.random() < share)


def span(rng: Rng, low: float, high: float) -> float:
    """A number in between."""
    return float(rng.uniform(low, high))


def vary(rng: Rng, value: float, spread: float = 0.15) -> float:
    """About that much, never less than nothing."""
    return float(value * np.exp(np.clip(rng.normal(0, spread), -2 * spread, 2 * spread)))


def vec(*numbers: float) -> F64:
    """(n,) of them."""
    return np.array(numbers, np.float64)


def smooth(points: ArrayLike, times: int = 1, is_closed: bool = True) -> F64:
    """(k, 2 or 3) corners cut (Chaikin 1974); the ends of an open line stay."""
    line = np.asarray(points, np.float64)
    for _ in range(times):
        after = np.roll(line, -1, 0) if is_closed else line[1:]
        before = line if is_closed else line[:-1]
        cut = np.stack([0.75 * before + 0.25 * after, 0.25 * before + 0.75 * after], 1)
        cut = cut.reshape(-1, line.shape[1])
        line = cut if is_closed else np.concatenate([line[:1], cut[1:-1], line[-1:]])
    return line


def profile(points: ArrayLike, times: int = 1) -> F64:
    """(k, 2) the outline of something turned: radius and y from below to the top, smoothed.

    A point given twice stays a corner.
    """
    line = np.asarray(points, np.float64)
    line = smooth(line, times, False) if times else line
    low, high = vec(0, line[0, 1]), vec(0, line[-1, 1])
    return np.concatenate([low[None], line, high[None]])


def ngon(count: int, radius: float = 1.0, turn: float = 0.0) -> F64:
    """(count, 2) a regular polygon."""
    angle = 2 * np.pi * np.arange(count) / count + turn
    return radius * np.stack([np.cos(angle), np.sin(angle)], 1)


def rounded(half_x: float, half_y: float, radius: float, steps: int = 4) -> F64:
    """(4 * steps, 2) a rectangle with round corners."""
    radius = min(radius, 0.98 * min(half_x, half_y))
    corners = []
    for quarter in range(4):
        angle = 0.5 * np.pi * (quarter + np.linspace(0, 1, steps))
        sx, sy = (1, -1, -1, 1)[quarter], (1, 1, -1, -1)[quarter]
        centre = vec(sx * (half_x - radius), sy * (half_y - radius))
        corners.append(centre + radius * np.stack([np.cos(angle), np.sin(angle)], 1))
    return np.concatenate(corners)


def curve(points: ArrayLike, count: int, is_closed: bool = False) -> F64:
    """(count, 3) a smooth line through points (Catmull and Rom 1974)."""
    knots = np.asarray(points, np.float64)
    last = len(knots) if is_closed else len(knots) - 1
    at = np.linspace(0, last, count, endpoint=not is_closed)
    k = np.minimum(at.astype(int), last - 1)
    t = (at - k)[:, None]
    index = [k - 1, k, k + 1, k + 2]
    index = [i % len(knots) if is_closed else np.clip(i, 0, len(knots) - 1) for i in index]
    a, b, c, d = (knots[i] for i in index)
    return 0.5 * (
        2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * (b - c) + d - a) * t**3
    )


def tube(
    built: PrimitiveBuilder,
    points: F64,
    near: float,
    far: float | None = None,
    is_closed: bool = False,
    soft: float = 0.0,
) -> None:
    """Limbs along a line (k, 3), from the radius `near` to `far`; `soft` where it begins."""
    radii = np.linspace(near, near if far is None else far, len(points))
    for k in range(len(points) - (0 if is_closed else 1)):
        j = (k + 1) % len(points)
        built.limb(points[k], points[j], radii[k], radii[j], soft=0.0 if k else soft)


def joint(a: F64, b: F64, length: float, towards: ArrayLike) -> F64:
    """(3,) where a limb of that length from a to b has its knee, pointing `towards`."""
    middle, gap = 0.5 * (a + b), float(np.linalg.norm(b - a))
    way = np.asarray(towards, np.float64)
    way = way - (b - a) * (way @ (b - a)) / max(gap**2, 1e-9)
    out = np.sqrt(max((length / 2) ** 2 - (gap / 2) ** 2, 0.0))
    return middle + way / max(float(np.linalg.norm(way)), 1e-6) * out


def two_bones(
    built: PrimitiveBuilder, points: Sequence[F64], radii: Sequence[float], soft: float = 0.0
) -> None:
    """A limb along points, with a radius at each."""
    for k in range(len(points) - 1):
        built.limb(points[k], points[k + 1], radii[k], radii[k + 1], soft=soft if k else 0.0)


def ahead(face: F64) -> F64:
    """(3, 3) axes: forward, up and to the right of something that looks along `face` (3,)."""
    up = vec(0, 1, 0) - face * face[1]
    up = up / float(np.linalg.norm(up))
    return np.column_stack([face, up, np.cross(face, up)]).astype(np.float64)


def depth(rng: Rng) -> tuple[float, float]:
    """Half the depth and how round its edges are."""
    half = span(rng, 0.05, 0.4)
    return half, min(half, 0.12) * span(rng, 0, 0.9)
