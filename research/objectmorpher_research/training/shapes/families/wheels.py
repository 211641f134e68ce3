"""Wheels and lights of what drives."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .making import Rng, chance, span, vec

TYRE, METAL = 2, 3  # as in `vehicles`
LYING = turned(0, np.pi / 2)  # an axle along z


def wheel(
    rng: Rng, built: PrimitiveBuilder, at: F64, radius: float, half: float, style: int
) -> None:
    """About z; the hub is a part of its own."""
    built.part(TYRE)
    built.cylinder(at, radius, half, 0.4 * half, LYING)
    built.part(METAL)
    if style == 0:
        built.cylinder(at, 0.6 * radius, 1.08 * half, 0.02, LYING)
    elif style == 1:
        built.ellipsoid(at, [0.5 * radius, 0.5 * radius, 1.5 * half])
    else:
        built.cylinder(at, 0.65 * radius, 1.04 * half, 0, LYING)
        for k in range(5):
            way = 1.2566 * k
            spot = at + 0.4 * radius * vec(np.cos(way), np.sin(way), 0)
            built.cylinder(spot, 0.13 * radius, 3 * half, 0, LYING, cut=True)


def wheels(
    rng: Rng, built: PrimitiveBuilder, xs: tuple[float, ...], radius: float, track: float
) -> None:
    """Pairs of wheels at places along x, `track` from the middle."""
    half, style = span(rng, 0.06, 0.1), int(rng.integers(3))
    for x in xs:
        for sign in (1, -1):
            wheel(rng, built, vec(x, radius, sign * (track - 0.5 * half)), radius, half, style)


def lights(rng: Rng, built: PrimitiveBuilder, long: float, y: float, wide: float) -> None:
    """Lamps before and behind at height y; often bumpers."""
    built.part(METAL)
    size = span(rng, 0.04, 0.08)
    for sign in (1, -1):
        built.ellipsoid([0.97 * long, y, sign * 0.7 * wide], [0.6 * size, size, 1.2 * size])
        built.box([-0.98 * long, y, sign * 0.7 * wide], [0.03, size, size], 0.01)
    if chance(rng, 0.6):
        for x in (long, -long):
            built.box([x, y - 0.14, 0], [0.04, 0.04, 0.95 * wide], 0.02)
