"""People, dolls, robots and toys, standing, walking and sitting, with arms in all poses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, along, turned
from .making import Rng, chance, joint, pick, span, two_bones, vary, vec

SKIN, SHIRT, TROUSERS, HAIR, SHOES, MORE = range(6)


class _Body(NamedTuple):
    """Lengths of a figure whose torso is 1 high; it looks along +z."""

    shoulder: float  # half the width
    waist: float
    hip: float
    deep: float  # half the depth of the chest
    head: float  # radius
    neck: float
    arm: float  # length of the whole arm
    leg: float
    thick: float  # radius of the upper arm
    is_stiff: bool  # boxes and cylinders: a robot


def figures(rng: Rng) -> PrimitiveBuilder:
    """Make a figure, sometimes with a thing in its hand."""
    is_toy, is_stiff = chance(rng, 0.35), chance(rng, 0.2)
    body = _Body(
        vary(rng, 0.42),
        vary(rng, 0.3),
        vary(rng, 0.34),
        vary(rng, 0.22),
        vary(rng, 0.42 if is_toy else 0.24),
        span(rng, 0.04, 0.14),
        vary(rng, 0.9 if is_toy else 1.15),
        vary(rng, 0.85 if is_toy else 1.6, 0.2),
        vary(rng, 0.13 if is_toy else 0.1, 0.2),
        is_stiff,
    )
    built = PrimitiveBuilder()
    is_sitting = chance(rng, 0.25)
    high = 0.5 * body.leg if is_sitting and chance(rng, 0.5) else 0.12 if is_sitting else body.leg
    hip = vec(0, 0.96 * high, 0)
    lean, aside = rng.normal(0, 0.12), rng.normal(0, 0.08)
    axes = turned(rng.normal(0, 0.2), lean, aside)
    _torso(rng, built, body, hip, axes)
    _head(rng, built, body, hip + axes @ vec(0, 1.0 + body.neck + 0.85 * body.head, 0), axes)
    skirt = chance(rng, 0.22) and not is_stiff
    if skirt:
        _skirt(rng, built, body, hip, is_sitting)
    _legs(rng, built, body, hip, is_sitting)
    _arms(rng, built, body, hip, axes)
    if chance(rng, 0.25):
        built.part(MORE)
        half = vec(0.8 * body.shoulder, span(rng, 0.25, 0.45), span(rng, 0.1, 0.25))
        built.box(hip + axes @ vec(0, 0.6, -body.deep - 0.8 * half[2]), half, 0.08, axes)
    if is_sitting and high > 0.2 and chance(rng, 0.6):  # what it sits on
        built.part(MORE)
        if chance(rng, 0.5):
            built.box([0, 0.4 * high, 0], [0.5, 0.4 * high, 0.4], 0.03)
        else:
            built.cylinder([0, 0.4 * high, 0], 0.4, 0.4 * high, 0.03)
    return built


def _torso(rng: Rng, built: PrimitiveBuilder, body: _Body, hip: F64, axes: F64) -> None:
    """Chest, belly, shoulders, hips and neck; a box or a drum for a robot."""
    built.part(SHIRT)
    if body.is_stiff:
        half = vec(body.shoulder, 0.5, body.deep)
        if chance(rng, 0.5):
            built.box(hip + axes @ vec(0, 0.52, 0), half, span(rng, 0.02, 0.15), axes)
        else:
            built.cylinder(hip + axes @ vec(0, 0.52, 0), body.shoulder, 0.5, 0.06, axes)
        built.part(MORE)
        at = vec(span(rng, -0.1, 0.1), span(rng, 0.5, 0.7), body.deep)
        panel = vec(0.5 * body.shoulder, 0.16, 0.06)
        built.box(hip + axes @ at, panel, 0.02, axes)
        built.part(TROUSERS)
        built.box(hip, [body.hip, 0.12, 0.8 * body.deep], 0.04)
        return
    soft = span(rng, 0.08, 0.2)
    built.ellipsoid(hip + axes @ vec(0, 0.72, 0), [0.95 * body.shoulder, 0.36, body.deep], axes)
    belly = body.deep * span(rng, 0.75, 1.4)
    built.ellipsoid(
        hip + axes @ vec(0, 0.36, 0.1 * belly), [body.waist, 0.36, belly], axes, soft=soft
    )
    for sign in (1, -1):
        built.limb(
            hip + axes @ vec(0, 0.9, 0),
            hip + axes @ vec(sign * 0.8 * body.shoulder, 0.86, 0),
            0.1,
            body.thick,
            soft=0.08,
        )
    if chance(rng, 0.25):
        for sign in (1, -1):
            at = vec(sign * 0.4 * body.shoulder, 0.68, 0.75 * body.deep)
            built.ellipsoid(hip + axes @ at, [0.15, 0.14, 0.13], soft=0.06)
    if chance(rng, 0.6):
        built.part(TROUSERS)
    built.ellipsoid(hip + vec(0, 0.06, 0), [body.hip, 0.24, 0.95 * body.deep], soft=soft)
    built.part(SKIN)
    built.limb(
        hip + axes @ vec(0, 0.9, 0),
        hip + axes @ vec(0, 1.05 + body.neck, 0.03),
        0.12,
        min(0.1, 0.4 * body.head),
    )


def _head(rng: Rng, built: PrimitiveBuilder, body: _Body, at: F64, axes: F64) -> None:
    """A head with eyes, ears, a nose and hair, or that of a robot."""
    r = body.head
    turn = axes @ turned(rng.normal(0, 0.4), rng.normal(0, 0.2), rng.normal(0, 0.1))
    built.part(SKIN)
    if body.is_stiff:
        shape = pick(rng, ("box", "drum", "ball"))
        if shape == "box":
            built.box(at, [1.1 * r, 0.9 * r, 0.9 * r], span(rng, 0.05, 0.4) * r, turn)
        elif shape == "drum":
            built.cylinder(at, r, 0.9 * r, 0.1 * r, turn)
        else:
            built.ellipsoid(at, np.full(3, r))
        built.part(MORE)
        built.limb(at + [0, 0.9 * r, 0], at + [0, 1.6 * r, 0], 0.03, 0.03)
        built.ellipsoid(at + [0, 1.65 * r, 0], np.full(3, 0.07))
    else:
        built.ellipsoid(at, [0.82 * r, r, 0.9 * r], turn)
        built.ellipsoid(
            at + turn @ (r * vec(0, -0.5, 0.25)), [0.55 * r, 0.5 * r, 0.6 * r], turn, soft=0.3 * r
        )
        nose = span(rng, 0.1, 0.22) * r
        built.ellipsoid(
            at + turn @ (r * vec(0, -0.1, 0.92)), [0.8 * nose, nose, nose], turn, soft=0.1 * r
        )
        for sign in (1, -1):
            built.ellipsoid(
                at + turn @ (r * vec(0.82 * sign, -0.05, 0)), [0.1 * r, 0.22 * r, 0.15 * r]
            )
        _hair(rng, built, r, at, turn)
    built.part(MORE)
    for sign in (1, -1):
        eye = at + turn @ (r * vec(0.32 * sign, 0.12, 0.83 if not body.is_stiff else 0.9))
        built.ellipsoid(eye, np.full(3, span(rng, 0.08, 0.16) * r))


def _hair(rng: Rng, built: PrimitiveBuilder, r: float, at: F64, turn: F64) -> None:
    """Hair short or long, or a hat, a cap, a helmet."""
    kind = pick(rng, ("short", "short", "long", "bun", "hat", "cap", "helmet", "bald", "cone"))
    if kind == "bald":
        return
    built.part(HAIR)
    if kind in ("short", "long", "bun"):
        built.ellipsoid(at + turn @ (r * vec(0, 0.22, -0.15)), r * vec(0.95, 0.92, 0.98), turn)
        if kind == "long":
            built.limb(
                at + turn @ (r * vec(0, 0.1, -0.5)),
                at + turn @ (r * vec(0, -span(rng, 1, 2), -0.6)),
                0.75 * r,
                0.5 * r,
                soft=0.2 * r,
            )
        if kind == "bun":
            built.ellipsoid(
                at + turn @ (r * vec(0, span(rng, 0.2, 1.2), -0.8)), np.full(3, 0.45 * r)
            )
        built.box(
            at + turn @ (r * vec(0, -0.55, 0.8)), r * vec(1.2, 0.95, 0.55), 0.1, turn, cut=True
        )
        return
    if kind == "helmet":
        built.ellipsoid(at + turn @ (r * vec(0, 0.15, -0.05)), r * vec(1.08, 1.1, 1.12), turn)
        built.box(at + turn @ (r * vec(0, -0.75, 0.6)), r * vec(1.5, 0.9, 1.1), 0.1, turn, cut=True)
        return
    up = at + turn @ (r * vec(0, 0.55, 0))
    if kind == "cone":
        built.limb(up, up + turn @ (r * vec(span(rng, -0.5, 0.5), 1.6, -0.3)), 0.8 * r, 0.12 * r)
    elif kind == "hat":
        built.cylinder(up + turn @ (r * vec(0, 0.5, 0)), 0.8 * r, 0.5 * r, 0.2 * r, turn)
        built.cylinder(up, span(rng, 1.2, 1.8) * r, 0.07 * r, 0.05 * r, turn, soft=0.05 * r)
    else:
        built.ellipsoid(at + turn @ (r * vec(0, 0.35, 0)), r * vec(0.95, 0.8, 1.0), turn)
        built.ellipsoid(at + turn @ (r * vec(0, 0.42, 0.95)), r * vec(0.7, 0.09, 0.6), turn)


def _skirt(rng: Rng, built: PrimitiveBuilder, body: _Body, hip: F64, is_sitting: bool) -> None:
    """From the waist over the legs."""
    built.part(TROUSERS)
    long = (0.35 if is_sitting else span(rng, 0.3, 0.85)) * body.leg
    low = max(hip[1] - long, 0.05)
    wide = body.hip * span(rng, 1.2, 2.0)
    top = hip[1] + 0.3
    outline = np.array(
        [[0, low], [wide, low], [1.05 * body.hip, hip[1]], [body.waist, top], [0, top]]
    )
    built.lathe([0, 0, 0], outline, soft=0.0)


def _legs(rng: Rng, built: PrimitiveBuilder, body: _Body, hip: F64, is_sitting: bool) -> None:
    """Two legs, each with a shoe, walking, standing or sitting."""
    stride = pick(rng, (0.0, 0.1, 0.5)) * body.leg * span(rng, 0.6, 1.1)
    wide = span(rng, 0.45, 0.75) * body.hip
    thick = min(1.4 * body.thick, 0.5 * body.hip)
    spread = span(rng, 0, 0.25)
    for sign in (1, -1):
        root = hip + vec(sign * wide, 0, 0)
        foot = vec(sign * (wide + spread), 0.6 * thick, sign * 0.5 * stride)
        if is_sitting:
            far = span(rng, 0.35, 0.6) if hip[1] > 0.2 else span(rng, 0.6, 1.0)
            foot[2] = far * body.leg
        gap = float(np.linalg.norm(root - foot))
        bend = span(rng, 1.0, 1.06) if not is_sitting else span(rng, 1.02, 1.3)
        knee = joint(
            root, foot, max(bend * gap, 1.01 * gap), vec(0.1 * sign, 0.4 if is_sitting else 0, 1)
        )
        built.part(TROUSERS if chance(rng, 0.8) else SKIN)
        if body.is_stiff and chance(rng, 0.6):
            for a, b in ((root, knee), (knee, foot)):
                half = 0.5 * float(np.linalg.norm(b - a))
                built.box(0.5 * (a + b), [0.9 * thick, half, 0.9 * thick], 0.03, along(b - a))
        else:
            two_bones(built, [root, knee, foot], [1.25 * thick, 0.95 * thick, 0.7 * thick], 0.05)
        built.part(SHOES)
        toe = vec(0.25 * sign * spread, 0, 1)
        yaw = float(np.arctan2(toe[0], 1))
        built.ellipsoid(
            foot + vec(0, -0.15 * thick, 0.7 * thick) + 0.1 * toe,
            [0.85 * thick, 0.6 * thick, 1.8 * thick],
            turned(yaw),
        )


def _arms(rng: Rng, built: PrimitiveBuilder, body: _Body, hip: F64, axes: F64) -> None:
    """Each arm is a part; many lie before the torso."""
    poses = ("down", "down", "up", "akimbo", "across", "across", "ahead", "side", "wave")
    both = pick(rng, poses)
    sleeve = pick(rng, (SHIRT, SHIRT, SKIN))
    for sign in (1, -1):
        pose = both if chance(rng, 0.6) else pick(rng, poses)
        root = vec(sign * (body.shoulder + 0.3 * body.thick), 0.86, 0)
        hand, bend = _hand(rng, body, pose, sign, root)
        way = hand - root
        gap = float(np.linalg.norm(way))
        if gap > 0.99 * body.arm:
            hand, gap = root + way * (0.99 * body.arm / gap), 0.99 * body.arm
        elbow = joint(root, hand, body.arm, bend)
        points = [hip + axes @ p for p in (root, elbow, hand)]
        built.part(sleeve)
        radii = [body.thick, 0.85 * body.thick, 0.65 * body.thick]
        if body.is_stiff and chance(rng, 0.5):
            built.ellipsoid(points[0], np.full(3, 1.3 * body.thick))
            for a, b in ((points[0], points[1]), (points[1], points[2])):
                half = 0.5 * float(np.linalg.norm(b - a))
                built.cylinder(0.5 * (a + b), 0.7 * body.thick, half, 0.02, along(b - a))
        else:
            two_bones(built, points, radii, 0.04)
        built.part(SKIN)
        end = points[2] + (points[2] - points[1]) * 0.18
        turn = along(points[2] - points[1])
        built.ellipsoid(end, body.thick * vec(span(rng, 0.5, 0.9), 1.25, 0.8), turn)
        if chance(rng, 0.18):
            _held(rng, built, end)


def _hand(rng: Rng, body: _Body, pose: str, sign: int, root: F64) -> tuple[F64, F64]:
    """Where a hand is, in the torso's frame, and where the elbow points."""
    out, front = sign * body.shoulder, body.deep + body.thick
    arm = body.arm
    there = {
        "down": (vec(out * 1.35, 0.9 - 0.97 * arm, 0.1), vec(sign, 0, -0.5)),
        "up": (root + arm * vec(0.35 * sign, 0.9, 0.1), vec(sign, 0, -0.3)),
        "akimbo": (vec(sign * 1.05 * max(body.waist, body.hip), 0.18, 0.1), vec(sign, 0, -0.4)),
        "across": (
            vec(-out * span(rng, -0.3, 0.9), span(rng, 0.1, 0.75), front),
            vec(sign, -0.6, 0.6),
        ),
        "ahead": (root + arm * vec(-0.1 * sign, span(rng, -0.3, 0.3), 0.9), vec(0.5 * sign, -1, 0)),
        "side": (root + arm * vec(0.95 * sign, span(rng, -0.2, 0.2), 0.1), vec(0, -1, -0.2)),
        "wave": (root + arm * vec(0.45 * sign, 0.45, 0.15), vec(sign, -0.6, 0)),
    }
    hand, bend = there[pose]
    return hand + rng.normal(0, 0.05, 3), bend


def _held(rng: Rng, built: PrimitiveBuilder, at: F64) -> None:
    """A ball, a stick, a bag or a book."""
    built.part(MORE)
    kind = pick(rng, ("ball", "stick", "bag", "book"))
    turn = turned(span(rng, 0, 3), rng.normal(0, 0.4), rng.normal(0, 0.4))
    if kind == "ball":
        built.ellipsoid(at + [0, 0.1, 0.12], np.full(3, span(rng, 0.12, 0.3)))
    elif kind == "stick":
        built.limb(at - turn @ vec(0, 0.7, 0), at + turn @ vec(0, span(rng, 0.4, 1), 0), 0.04, 0.04)
    elif kind == "bag":
        built.box(at - [0, 0.4, 0], [0.24, 0.22, 0.12], 0.05)
        built.ring(at - [0, 0.14, 0], 0.13, 0.025, turn=turned(0, np.pi / 2))
    else:
        built.box(at, [0.2, 0.26, 0.04], 0.01, turn)
