"""Birds, fish and insects."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .making import Rng, chance, curve, joint, pick, span, tube, two_bones, vec

SKIN, OTHER, EYES, HORN = 0, 1, 2, 3


def bird(rng: Rng) -> PrimitiveBuilder:
    """Make a bird, from ducks to storks; wings folded or spread."""
    built = PrimitiveBuilder()
    long, fat = 1.0, span(rng, 0.28, 0.45)
    leg = pick(rng, (0.05, 0.3, 0.35, 0.9)) * span(rng, 0.8, 1.2)
    pitch = span(rng, -0.1, 0.8)
    middle = vec(0, leg + fat + 0.3 * np.sin(pitch), 0)
    ahead = vec(np.cos(pitch), np.sin(pitch), 0)
    neck = pick(rng, (0.15, 0.25, 0.6, 0.9)) * span(rng, 0.8, 1.2)
    size = span(rng, 0.15, 0.24)
    built.part(SKIN)
    built.ellipsoid(middle, [0.55 * long, fat, 0.95 * fat], turned(0, 0, pitch))
    chest = middle + 0.38 * ahead
    rise = span(rng, 0.9, 1.6)
    top = chest + neck * vec(np.cos(rise), np.sin(rise), rng.normal(0, 0.1))
    bow = curve([chest, 0.5 * (chest + top) + vec(span(rng, -0.1, 0.25) * neck, 0, 0), top], 4)
    tube(built, bow, 0.6 * fat, 0.7 * size, soft=0.12)
    built.ellipsoid(top + vec(0.03, 0.05, 0), [1.1 * size, size, 0.95 * size], soft=0.08)
    look = rng.normal(0, 0.5)
    face = vec(np.cos(look), span(rng, -0.3, 0.05), np.sin(look))
    _beak(rng, built, top + vec(0.03, 0.05, 0), face, size)
    tail = middle - 0.45 * ahead
    built.part(OTHER if chance(rng, 0.5) else SKIN)
    fan = vec(span(rng, 0.2, 0.5), 0.045, span(rng, 0.1, 0.28))
    built.ellipsoid(tail - fan[0] * ahead, fan, turned(0, 0, pitch + span(rng, -0.5, 0.3)))
    is_spread = chance(rng, 0.35)
    for sign in (1, -1):
        _wing(rng, built, middle, fat, pitch, sign, is_spread)
        if leg > 0.15:
            _bird_leg(rng, built, middle, fat, sign)
    return built


def _beak(rng: Rng, built: PrimitiveBuilder, head: F64, face: F64, size: float) -> None:
    """A beak, eyes, now and then a comb."""
    built.part(HORN)
    long = size * pick(rng, (0.6, 0.8, 1.4, 2.4))
    start = head + face * 0.75 * size
    if chance(rng, 0.3):
        built.ellipsoid(
            start + 0.5 * long * face,
            [0.7 * long, 0.2 * size, 0.35 * size],
            turned(-float(np.arctan2(face[2], face[0]))),
        )
    else:
        hook = vec(0, -span(rng, 0, 0.5) * long, 0)
        line = [start, start + 0.7 * long * face, start + long * face + hook]
        tube(built, curve(line, 4), 0.35 * size, 0.07 * size)
    built.part(EYES)
    side = np.cross(face, vec(0, 1, 0))
    for sign in (1, -1):
        built.ellipsoid(
            head + size * (0.5 * face + 0.75 * sign * side + vec(0, 0.3, 0)),
            np.full(3, 0.17 * size),
        )
    if chance(rng, 0.2):  # a comb
        built.part(OTHER)
        for k in range(3):
            built.ellipsoid(
                head + vec(0.12 - 0.1 * k, 0.95 * size, 0), [0.07, 0.1, 0.03], soft=0.02
            )


def _wing(
    rng: Rng,
    built: PrimitiveBuilder,
    middle: F64,
    fat: float,
    pitch: float,
    sign: int,
    is_spread: bool,
) -> None:
    """Folded at the side, or spread in two pieces."""
    built.part(OTHER)
    if not is_spread:
        at = middle + vec(-0.08, 0.1 * fat, sign * 0.88 * fat)
        turn = turned(sign * span(rng, 0, 0.25), sign * 0.15, pitch + span(rng, -0.3, 0))
        built.ellipsoid(at, [span(rng, 0.42, 0.6), 0.7 * fat, 0.09], turn)
        return
    lift, sweep = span(rng, -0.2, 0.9), span(rng, -0.4, 0.2)
    near, far = vec(0.1, 0.5 * fat, 0.6 * fat * sign), span(rng, 0.5, 0.8)
    elbow = near + far * vec(0.1, np.sin(lift), sign * np.cos(lift))
    tip = elbow + far * vec(sweep, np.sin(lift - 0.4), sign * np.cos(lift - 0.4))
    for a, b, wide in ((near, elbow, 0.3), (elbow, tip, 0.24)):
        way = (b - a) / np.linalg.norm(b - a)
        across = np.cross(way, vec(1, 0, 0))
        across /= np.linalg.norm(across)
        axes = np.column_stack([np.cross(across, way), way, -across])
        half = [wide, 0.62 * float(np.linalg.norm(b - a)), 0.035]
        built.ellipsoid(middle + 0.5 * (a + b), half, axes, soft=0.06)


def _bird_leg(rng: Rng, built: PrimitiveBuilder, middle: F64, fat: float, sign: int) -> None:
    """A leg with four toes."""
    built.part(HORN)
    root = middle + vec(0, -0.6 * fat, sign * 0.4 * fat)
    foot = vec(root[0] + span(rng, -0.15, 0.15), 0.02, root[2] + sign * span(rng, 0, 0.05))
    knee = joint(root, foot, 1.06 * float(np.linalg.norm(root - foot)), [-1, 0, 0])
    two_bones(built, [root, knee, foot], [0.09, 0.035, 0.028], 0.02)
    for way in (-0.5, 0, 0.5, np.pi):
        toe = foot + 0.16 * vec(np.cos(way), 0, np.sin(way))
        built.limb(foot, toe, 0.028, 0.02)


def fish(rng: Rng) -> PrimitiveBuilder:
    """Make a fish, from eels to discs, sharks and dolphins; bent a little as if it swam."""
    built = PrimitiveBuilder()
    high, wide = span(rng, 0.14, 0.5), span(rng, 0.1, 0.24)
    wag = rng.normal(0, 0.12)
    built.part(SKIN)
    spine = curve([[0.9, 0, 0], [0.4, 0, 0], [-0.1, 0, 0.3 * wag], [-0.8, 0, wag]], 6)
    if high < 0.24:
        for k, radius in enumerate((0.5, 0.85, 1, 0.75, 0.45)):
            built.limb(
                spine[k],
                spine[k + 1],
                high * radius,
                high * (0.85, 1, 0.75, 0.45, 0.2)[k],
                soft=0.1,
            )
    else:
        built.ellipsoid([0.2, 0, 0], [0.75, high, wide])
        built.limb([-0.3, 0, 0], spine[-1], 0.5 * wide, 0.07, soft=0.3)
    body = [spine[2], spine[3]]
    built.part(EYES)
    for sign in (1, -1):
        built.ellipsoid([0.68, 0.22 * high, sign * 0.62 * min(wide, high)], [0.05, 0.05, 0.04])
    built.part(OTHER)  # the tail fin
    upright = chance(rng, 0.8)
    for sign in (1, -1):
        way = vec(-span(rng, 0.2, 0.35), sign * span(rng, 0.2, 0.5), 0)
        turn = turned(0, 0, float(np.arctan2(way[1], way[0])))
        turn = turn if upright else turned(0, np.pi / 2) @ turn
        half = [0.5 * float(np.linalg.norm(way)) + 0.05, 0.1, 0.022]
        offset = way if upright else vec(way[0], 0, way[1])
        built.ellipsoid(spine[-1] + 0.45 * offset, half, turn, soft=0.04)
    back = max(high, 0.16)
    built.part(OTHER)
    half = [span(rng, 0.15, 0.45), span(rng, 0.14, 0.3), 0.022]
    built.ellipsoid(body[0] + vec(-0.05, 0.9 * back, 0), half, turned(0, 0, span(rng, 0, 0.6)))
    if chance(rng, 0.7):
        built.part(OTHER)
        half = [0.16, span(rng, 0.1, 0.2), 0.022]
        built.ellipsoid(body[1] - vec(0.15, 0.8 * back, 0), half, turned(0, 0, -0.5))
    for sign in (1, -1):
        built.part(OTHER)
        turn = turned(sign * span(rng, 0.3, 1.2), sign * 0.4, -0.4)
        side = 0.95 * min(wide, high) * sign
        built.ellipsoid([0.25, -0.25 * high, side], [0.2, 0.1, 0.022], turn)
    return built


def insect(rng: Rng) -> PrimitiveBuilder:
    """Beetles, ants, flies, butterflies and spiders."""
    built = PrimitiveBuilder()
    pairs = pick(rng, (3, 3, 3, 4))
    sizes = np.exp(rng.normal([-1.0, -1.35, -1.5], 0.2))  # hind body, middle, head
    at, high = 0.0, span(rng, 0.22, 0.4)
    places = []
    built.part(SKIN)
    for k, size in enumerate(sizes):
        half = size * vec(span(rng, 0.9, 1.6) if k == 0 else 1, span(rng, 0.7, 1), 1)
        at += 0.85 * half[0] if k else 0
        places.append(vec(at, high + rng.normal(0, 0.03), 0))
        built.ellipsoid(places[-1], half, soft=0.05)
        at += 0.85 * half[0]
        if chance(rng, 0.4):
            built.part(pick(rng, (SKIN, OTHER)))
    head, size = places[2], float(sizes[2])
    reach = span(rng, 0.45, 0.8)
    for sign in (1, -1):
        for k in range(pairs):
            built.part(HORN)
            root = places[1] + vec((k - 1) * 0.6 * sizes[1], -0.2 * sizes[1], sign * 0.5 * sizes[1])
            foot = vec(
                root[0] + (k - 0.5 * pairs + 0.4) * 0.35 + rng.normal(0, 0.05), 0.02, sign * reach
            )
            knee = joint(root, foot, 1.25 * float(np.linalg.norm(root - foot)), [0, 1, 0.2 * sign])
            two_bones(built, [root, knee, foot], [0.045, 0.03, 0.018])
        built.part(EYES)
        built.ellipsoid(head + size * vec(0.5, 0.4, 0.65 * sign), np.full(3, 0.3 * size))
        built.part(HORN)
        line = head + np.array([[0.5, 0.5, 0.3], [1.4, 1.3, 0.6], [2.2, 1.2, 1.1]]) * size * [
            1,
            1,
            sign,
        ]
        tube(built, curve(line, 4), 0.02, 0.014)
    if chance(rng, 0.65):
        _insect_wings(rng, built, places[1], float(sizes[1]))
    return built


def _insect_wings(rng: Rng, built: PrimitiveBuilder, root: F64, size: float) -> None:
    """One or two pairs, flat."""
    lift, wide = span(rng, 0.05, 1.2), span(rng, 0.15, 0.4)
    for back in (0.0, 0.8)[: pick(rng, (1, 2))]:
        long = span(rng, 0.4, 0.75)
        for sign in (1, -1):
            built.part(OTHER)
            way = vec(-back + 0.15, 0, 0) + sign * vec(0, 0, 1)
            turn = turned(-sign * float(np.arctan2(-way[0], 1)), -sign * lift, 0)
            at = root + vec(0, 0.7 * size, 0) + turn @ vec(0, 0, sign * 0.95 * long)
            built.ellipsoid(at, [wide, 0.016, long], turn)
