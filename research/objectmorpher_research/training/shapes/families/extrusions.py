"""Outlines given a depth: letters, digits, stars, hearts, gears, arrows, puzzle pieces, signs."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .cutouts import blob, comb, cookie, sign, stairs
from .letters import letter, word
from .making import Rng, chance, depth, ngon, pick, smooth, span, vec
from .tools import tool

BODY, MORE, THIRD = range(3)


def extrusions(rng: Rng) -> PrimitiveBuilder:
    """Make an extrusion that stands, leans or lies."""
    kinds = (
        letter,
        letter,
        word,
        _star,
        _heart,
        _gear,
        _gear,
        _arrow,
        _puzzle,
        sign,
        blob,
        cookie,
        comb,
        stairs,
    )
    built = PrimitiveBuilder()
    if chance(rng, 0.35):
        tool(rng, built, _pose(rng))
    else:
        pick(rng, kinds)(rng, built, _pose(rng))
    return built


def _pose(rng: Rng) -> F64:
    """Standing, leaning back, or lying."""
    lean = pick(rng, (0.0, 0.0, -span(rng, 0, 0.5), -np.pi / 2))
    return (
        turned(span(rng, 0, 6.3)) @ turned(0, lean) @ turned(0, 0, rng.normal(0, 0.2) * (lean != 0))
    )


def _star(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """Some have a smaller star on them, a hole, or a stick: a wand."""
    half, bevel = depth(rng)
    points, inner = int(rng.integers(4, 9)), span(rng, 0.35, 0.75)
    outline = ngon(2 * points, 1.0, np.pi / 2)
    outline[1::2] *= inner
    built.part(BODY)
    built.prism([0, 0, 0], smooth(outline, pick(rng, (0, 0, 2))), half, bevel, turn)
    if chance(rng, 0.4):
        built.part(MORE)
        built.prism(turn @ vec(0, 0, half), 0.6 * outline, 0.05, 0.02, turn)
    if chance(rng, 0.2):
        built.cylinder([0, 0, 0], 0.25 * inner, 1.0, 0, turn @ turned(0, np.pi / 2), cut=True)
    if chance(rng, 0.25):
        built.part(THIRD)
        built.limb(turn @ vec(0, -0.5, 0), turn @ vec(0, -2.2, 0), 0.08, 0.08)


def _heart(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """Flat, with a hole, or swollen."""
    t = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    x = 16 * np.sin(t) ** 3
    y = 13 * np.cos(t) - 5 * np.cos(2 * t) - 2 * np.cos(3 * t) - np.cos(4 * t)
    outline = np.stack([x * span(rng, 0.85, 1.1), y], 1) / 16
    half, bevel = depth(rng)
    built.part(BODY)
    if chance(rng, 0.4):  # swollen
        for sign in (1, -1):
            built.limb(
                turn @ vec(0, -0.85, 0), turn @ vec(0.45 * sign, 0.3, 0), 0.12, 0.5, soft=0.08
            )
        return
    built.prism([0, 0, 0], outline, half, bevel, turn)
    if chance(rng, 0.4):
        built.prism([0, 0, 0], 0.7 * outline, 3 * half, 0, turn, cut=True)
    elif chance(rng, 0.4):
        built.part(MORE)
        built.prism(turn @ vec(0, 0, half), 0.7 * outline, 0.06, 0.02, turn)


def _gear(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """One wheel with teeth, or two that mesh, on axles."""
    half, bevel = depth(rng)
    for k in range(pick(rng, (1, 1, 2))):
        teeth, size = int(rng.integers(6, 13)), span(rng, 0.6, 1.0)
        deep = span(rng, 0.12, 0.25) * size
        angle = 2 * np.pi * (np.arange(4 * teeth) + 0.5) / (4 * teeth)
        radius = np.where(np.arange(4 * teeth) % 4 < 2, size, size - deep)
        outline = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
        at, axle = turn @ vec(1.75 * k, 0.2 * k, 0), turn @ turned(0, np.pi / 2)
        built.part(BODY + k)
        built.prism(at, outline, half, 0.5 * bevel, turn)
        kind = pick(rng, ("spokes", "plain", "holes"))
        if kind == "spokes":
            built.cylinder(at, 0.65 * size, 3 * half, 0, axle, cut=True)
            for j in range(3):
                built.box(
                    at,
                    [0.7 * size, 0.09 * size, 0.8 * half],
                    0.01,
                    turn @ turned(0, 0, j * np.pi / 3),
                )
            built.cylinder(at, 0.25 * size, half, 0.01, axle)
        elif kind == "holes":
            for j in range(5):
                spot = turn @ (0.45 * size * vec(np.cos(1.2566 * j), np.sin(1.2566 * j), 0))
                built.cylinder(at + spot, 0.14 * size, 3 * half, 0, axle, cut=True)
        built.cylinder(at, span(rng, 0.08, 0.15) * size, 3 * half, 0, axle, cut=True)
        if chance(rng, 0.3):
            built.part(THIRD)
            built.cylinder(at, 0.1 * size, half + span(rng, 0.1, 0.5), 0.02, axle)


def _arrow(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """Arrows, bolts of lightning, crosses, ticks."""
    half, bevel = depth(rng)
    wide, head = span(rng, 0.1, 0.25), span(rng, 0.4, 0.7)
    outlines = (
        [[-1, -wide], [0.3, -wide], [0.3, -head], [1, 0], [0.3, head], [0.3, wide], [-1, wide]],
        [
            [-0.2, -1],
            [0.45, 0.15],
            [0.05, 0.15],
            [0.4, 1],
            [-0.25, 1],
            [-0.45, -0.1],
            [-0.05, -0.1],
        ],
        [
            [-wide, -1],
            [wide, -1],
            [wide, -wide],
            [1, -wide],
            [1, wide],
            [wide, wide],
            [wide, 1],
            [-wide, 1],
            [-wide, wide],
            [-1, wide],
            [-1, -wide],
            [-wide, -wide],
        ],
        [[-1, 0], [-0.7, 0.3], [-0.3, -0.1], [0.7, 0.9], [1, 0.6], [-0.3, -0.7]],
        [[-1, -0.6], [1, -0.6], [0, 1]],
        [[-0.4, -1], [0.4, -1], [1, 0], [0.4, 1], [-0.4, 1], [-1, 0]],
    )
    spin = turn @ turned(0, 0, pick(rng, (0.0, np.pi / 2, -np.pi / 2, np.pi)))
    outline = np.array(pick(rng, outlines))
    built.part(BODY)
    built.prism([0, 0, 0], smooth(outline, 2) if chance(rng, 0.3) else outline, half, bevel, spin)


def _puzzle(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """One to four pieces with knobs and hollows."""
    half, bevel = span(rng, 0.06, 0.2), 0.03
    axle = turn @ turned(0, np.pi / 2)
    spots = [vec(0, 0), vec(1.25, 0), vec(0, 1.25), vec(1.25, 1.25)][: pick(rng, (1, 1, 2, 4))]
    for k, spot in enumerate(spots):
        built.part(BODY if chance(rng, 0.5) else 10 + k)
        at = vec(*spot, 0) * (1.0 if len(spots) > 2 else 1.15)
        built.box(turn @ at, [0.6, 0.6, half], bevel, turn)
        ways = (vec(1, 0, 0), vec(0, 1, 0), vec(-1, 0, 0), vec(0, -1, 0))
        cuts = [chance(rng, 0.5) for _ in ways]
        for is_cut in (False, True):
            for way, own in zip(ways, cuts, strict=True):
                if own != is_cut:
                    continue
                knob = turn @ (at + way * (0.45 if own else 0.72))
                built.cylinder(
                    knob, 0.2, 3 * half if own else half, 0 if own else bevel, axle, cut=own
                )
                if own:
                    built.box(turn @ (at + 0.62 * way), [0.1, 0.1, 3 * half], 0, turn, cut=True)
                else:
                    built.box(turn @ (at + 0.6 * way), [0.12, 0.12, half], 0.01, turn)
