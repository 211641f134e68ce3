"""Aeroplanes, helicopters, rockets and balloons; they fly along +x, or up."""

from __future__ import annotations

import numpy as np

from ..solid import PrimitiveBuilder, turned
from .making import Rng, chance, pick, profile, smooth, span, vec

BODY, GLASS, TYRE, METAL, MORE = range(5)
FLAT = turned(0, np.pi / 2)  # an outline's x and y become x and -z


def aeroplane(rng: Rng, built: PrimitiveBuilder) -> None:
    """Jets, airliners, biplanes, gliders."""
    fat, long = span(rng, 0.09, 0.17), 1.0
    kind = pick(rng, ("airliner", "light", "biplane", "jet"))
    built.part(BODY)
    built.limb([0.8 * long, 0, 0], [0, 0, 0], 0.75 * fat, fat)
    built.limb([0, 0, 0], [-long, 0.4 * fat, 0], fat, 0.35 * fat)
    if kind == "jet":
        built.limb([0.7, 0, 0], [1.1, -0.02, 0], 0.6 * fat, 0.02)
    sweep = {"airliner": 0.5, "light": 0.05, "biplane": 0.0, "jet": 0.7}[kind] * span(rng, 0.7, 1.3)
    reach, chord = span(rng, 0.8, 1.2) * (0.75 if kind == "jet" else 1), span(rng, 0.16, 0.26)
    tip = chord * span(rng, 0.3, 1.0)
    levels: tuple[float, ...] = (0.2 * fat,) if kind != "biplane" else (-0.6 * fat, 2.2 * fat)
    if kind == "light" and chance(rng, 0.5):
        levels = (fat,)
    wing = np.array(
        [
            [0.1 + chord, 0],
            [0.1 - sweep + tip, reach],
            [0.1 - sweep - tip, reach],
            [0.1 - chord, 0],
            [0.1 - sweep - tip, -reach],
            [0.1 - sweep + tip, -reach],
        ]
    )
    for y in levels:
        built.part(pick(rng, (BODY, MORE)))
        built.prism([0, y, 0], wing, 0.025, 0.012, FLAT)
    if kind == "biplane":
        built.part(METAL)
        for z in (0.55, -0.55):
            for x in (0.2, 0.0):
                built.limb([x, levels[0], z * reach], [x, levels[-1], z * reach], 0.015, 0.015)
    built.part(pick(rng, (BODY, MORE)))
    high, back = span(rng, 0.25, 0.42), span(rng, 0.1, 0.25)
    fin = np.array([[-0.65, 0], [-1.0, 0], [-1.0 - 0.4 * back, high], [-0.85 - 0.4 * back, high]])
    built.prism([0, 0.3 * fat, 0], fin, 0.022, 0.01)
    small = wing * [0.45, 0.38] + [-0.92, 0]
    built.prism(
        [0, 0.5 * fat if chance(rng, 0.7) else 0.3 * fat + high, 0], small, 0.02, 0.01, FLAT
    )
    built.part(GLASS)
    built.ellipsoid([0.55, 0.6 * fat, 0], [0.2, 0.7 * fat, 0.7 * fat])
    _engines(rng, built, kind, fat, reach)


def _engines(rng: Rng, built: PrimitiveBuilder, kind: str, fat: float, reach: float) -> None:
    """Jets beneath the wings or a propeller; wheels."""
    axle = turned(0, 0, np.pi / 2)
    if kind == "airliner":
        for z in (0.35, -0.35) if chance(rng, 0.6) else (0.3, -0.3, 0.6, -0.6):
            built.part(METAL)
            built.cylinder(
                [0.12 - 0.4 * abs(z), -0.5 * fat - 0.02, z * reach], 0.075, 0.14, 0.03, axle
            )
            built.cylinder(
                [0.27 - 0.4 * abs(z), -0.5 * fat - 0.02, z * reach],
                0.055,
                0.05,
                cut=True,
                turn=axle,
            )
    elif kind != "jet":
        built.part(METAL)
        turn = turned(0, span(rng, 0, 3))
        for k in range(pick(rng, (1, 2))):
            built.ellipsoid(
                [0.8 + 0.8 * fat, 0, 0], [0.02, 0.32, 0.045], turn @ turned(0, k * np.pi / 2)
            )
        built.ellipsoid([0.8 + 0.8 * fat, 0, 0], np.full(3, 0.05))
    if chance(rng, 0.5):
        for x, z in ((0.3, 0.2), (0.3, -0.2), (-0.85, 0.0)):
            built.part(TYRE)
            foot = vec(x, -fat - (0.2 if z else 0.1), z)
            built.limb([x, 0, 0.6 * z], foot, 0.018, 0.018)
            built.cylinder(foot, 0.08 if z else 0.04, 0.03, 0.015, FLAT)


def helicopter(rng: Rng, built: PrimitiveBuilder) -> None:
    """A cabin, a boom and rotors."""
    built.part(BODY)
    built.ellipsoid([0.2, 0, 0], [span(rng, 0.38, 0.5), span(rng, 0.26, 0.34), 0.27])
    built.limb([0, 0.1, 0], [-1.1, 0.2, 0], 0.15, 0.05, soft=0.08)
    built.prism([0, 0, 0], np.array([[-1.0, 0.2], [-1.2, 0.2], [-1.25, 0.5], [-1.15, 0.5]]), 0.02)
    built.part(GLASS)
    built.ellipsoid([0.35, 0.05, 0], [0.36, 0.24, 0.255])
    built.part(METAL)
    built.limb([0.1, 0.2, 0], [0.1, 0.45, 0], 0.05, 0.04)
    first = span(rng, 0, 3)
    for k in range(pick(rng, (1, 2))):
        turn = turned(first + k * np.pi / 2)
        built.box([0.1, 0.45, 0], [span(rng, 0.8, 1.1), 0.018, 0.05], 0.01, turn)
    built.ellipsoid([-1.15, 0.22, 0.06], [0.03, 0.2, 0.02], turned(0, 0, first))
    for sign in (1, -1):
        built.part(METAL)
        z = 0.25 * sign
        built.limb([-0.2, -0.42, z], [0.6, -0.42, z], 0.025, 0.025)
        for x in (0.0, 0.4):
            built.limb([x, -0.2, 0.5 * z], [x, -0.42, z], 0.02, 0.02)


def rocket(rng: Rng, built: PrimitiveBuilder) -> None:
    """A rocket with fins, standing or tilted."""
    wide, high = span(rng, 0.15, 0.32), span(rng, 0.8, 1.8)
    lean = turned(0, *(rng.normal(0, 0.4, 2) * (rng.random() < 0.5)))
    nose, tail = span(rng, 0.3, 0.7), span(rng, 0.5, 1.0) * wide
    outline = [
        [tail, 0.1],
        [wide, 0.25 * high],
        [wide, 0.75 * high],
        [0.6 * wide, high + 0.4 * nose],
        [0.02, high + nose],
    ]
    built.part(BODY)
    built.lathe([0, 0, 0], profile(smooth(outline, 1, False), 1), lean)
    built.part(METAL)
    built.lathe([0, 0, 0], profile([[0.8 * tail, -0.1], [0.5 * tail, 0.15]], 0), lean)
    fins = pick(rng, (3, 4))
    out, down = span(rng, 0.2, 0.5), span(rng, -0.2, 0.15)
    fin = np.array(
        [[0.5 * wide, 0.15], [wide + out, down], [wide + out, down + 0.2], [0.9 * wide, 0.5 * high]]
    )
    for k in range(fins):
        built.part(MORE)
        built.prism(
            [0, 0, 0],
            smooth(fin, pick(rng, (0, 1))),
            0.025,
            0.01,
            lean @ turned(k * 2 * np.pi / fins),
        )
    built.part(GLASS)
    for k in range(rng.integers(0, 3)):
        built.ellipsoid(
            lean @ vec(0, 0.75 * high - 0.28 * k, 0.93 * wide), [0.09, 0.09, 0.05], lean
        )
    if chance(rng, 0.35):
        for sign in (1, -1):
            built.part(MORE)
            at = vec(sign * (wide + 0.1), 0.0, 0)
            built.limb(lean @ at, lean @ (at + [0, 0.6 * high, 0]), 0.1, 0.09)


def balloon(rng: Rng, built: PrimitiveBuilder) -> None:
    """A hot-air balloon with its basket, or an airship."""
    if chance(rng, 0.4):
        built.part(BODY)
        built.ellipsoid([0, 0, 0], [1.0, span(rng, 0.26, 0.38), 0.32])
        for k in range(4):
            built.part(MORE)
            turn = turned(0, k * np.pi / 2)
            built.prism(
                [0, 0, 0],
                np.array([[-0.6, 0.1], [-0.95, 0.1], [-1.0, 0.35], [-0.85, 0.36]]),
                0.02,
                0,
                turn,
            )
        built.part(METAL)
        built.box([0.1, -0.42, 0], [0.3, 0.1, 0.1], 0.06)
        return
    built.part(BODY)
    high = span(rng, 0.6, 0.9)
    built.lathe(
        [0, 0, 0],
        profile(
            [
                [0.12, 0.1],
                [0.6, high - 0.1],
                [0.72, high + 0.4],
                [0.5, high + 0.8],
                [0.05, high + 0.95],
            ],
            3,
        ),
    )
    built.part(MORE)
    built.box([0, -0.35, 0], [0.15, 0.13, 0.15], 0.03)
    built.box([0, -0.25, 0], [0.12, 0.13, 0.12], 0, cavity=True)
    for x in (0.13, -0.13):
        for z in (0.13, -0.13):
            built.limb([x, -0.25, z], [0.8 * x, 0.15, 0.8 * z], 0.014, 0.014)
