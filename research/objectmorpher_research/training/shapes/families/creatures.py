"""Animals: four-legged ones, which stand, walk, sit and lie; birds, fish and insects."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .making import Rng, ahead, chance, curve, joint, pick, span, tube, two_bones, vary, vec
from .small_creatures import bird, fish, insect

SKIN, OTHER, EYES, HORN = 0, 1, 2, 3


class _Plan(NamedTuple):
    """Proportions of an animal; the body's length is 1."""

    girth: float  # radius of the body
    leg: float  # length
    shin: float  # radius of the lower leg
    neck: float  # length
    rise: float  # radians, of the neck over the horizon
    head: float  # radius
    snout: float  # length
    muzzle: float  # radius at the snout's end
    ear: str
    tail: str


PLANS = {
    "dog": _Plan(0.22, 0.62, 0.05, 0.32, 0.8, 0.17, 0.22, 0.075, "flap", "up"),
    "cat": _Plan(0.19, 0.5, 0.045, 0.22, 0.7, 0.16, 0.08, 0.07, "point", "long"),
    "horse": _Plan(0.24, 0.95, 0.045, 0.62, 0.9, 0.15, 0.36, 0.09, "point", "brush"),
    "cow": _Plan(0.31, 0.68, 0.06, 0.34, 0.35, 0.19, 0.28, 0.12, "side", "brush"),
    "pig": _Plan(0.31, 0.38, 0.06, 0.16, 0.2, 0.21, 0.2, 0.1, "flap", "curl"),
    "elephant": _Plan(0.36, 0.7, 0.1, 0.22, 0.3, 0.26, 0.1, 0.13, "fan", "thin"),
    "lizard": _Plan(0.14, 0.26, 0.035, 0.2, 0.1, 0.12, 0.17, 0.05, "none", "thick"),
    "bear": _Plan(0.31, 0.48, 0.09, 0.2, 0.4, 0.22, 0.18, 0.09, "round", "stub"),
    "sheep": _Plan(0.33, 0.48, 0.045, 0.24, 0.6, 0.14, 0.16, 0.08, "side", "stub"),
    "rabbit": _Plan(0.24, 0.3, 0.05, 0.14, 0.8, 0.17, 0.1, 0.07, "long", "stub"),
    "giraffe": _Plan(0.22, 1.1, 0.045, 1.05, 1.15, 0.13, 0.22, 0.07, "side", "brush"),
    "mouse": _Plan(0.22, 0.22, 0.03, 0.12, 0.4, 0.15, 0.17, 0.035, "fan", "thin"),
    "hippo": _Plan(0.36, 0.36, 0.1, 0.2, 0.1, 0.24, 0.25, 0.19, "round", "stub"),
    "turtle": _Plan(0.24, 0.26, 0.07, 0.3, 0.4, 0.12, 0.07, 0.08, "none", "stub"),
}


def creatures(rng: Rng) -> PrimitiveBuilder:
    """Half of them have four legs."""
    kind = rng.random()
    if kind < 0.56:
        return _four_legged(rng)
    return bird(rng) if kind < 0.74 else fish(rng) if kind < 0.87 else insect(rng)


def _four_legged(rng: Rng) -> PrimitiveBuilder:
    """Any of the plans, varied, in one of the poses."""
    name = pick(rng, tuple(PLANS))
    base = PLANS[name]
    ear = base.ear if chance(rng, 0.8) else pick(rng, ("flap", "point", "round", "long", "side"))
    plan = _Plan(
        vary(rng, base.girth), vary(rng, base.leg), vary(rng, base.shin), vary(rng, base.neck),
        vary(rng, base.rise), vary(rng, base.head), vary(rng, base.snout), vary(rng, base.muzzle),
        ear, base.tail,
    )  # fmt: skip
    pose = pick(rng, ("stand", "stand", "walk", "walk", "sit", "lie"))
    if name in ("turtle", "hippo", "giraffe", "cow") and pose == "sit":
        pose = "stand"
    built = PrimitiveBuilder()
    lift = {"stand": plan.leg, "walk": 0.97 * plan.leg, "sit": 0.3 * plan.girth, "lie": 0.0}[pose]
    hip = vec(-0.5, lift + 0.9 * plan.girth, 0)
    chest = vec(0.5, plan.leg + 0.9 * plan.girth if pose == "sit" else hip[1], 0)
    if pose == "sit":  # the back stands as steeply as the forelegs are long
        rise = min(chest[1] - hip[1], 0.92)
        chest = hip + vec(np.sqrt(1 - rise**2), rise, 0)
    _torso(rng, built, plan, hip, chest)
    _legs(rng, built, plan, pose, hip, chest)
    _tail(rng, built, plan, hip, pose)
    if name == "turtle":
        built.part(OTHER)
        middle = 0.5 * (hip + chest) + vec(0, 0.3 * plan.girth, 0)
        built.ellipsoid(
            middle, [0.62, 0.34, 0.5], turned(0, 0, float(np.arcsin(chest[1] - hip[1])))
        )
        built.box(middle - [0, 0.66, 0], [1.2, 0.5, 1.2], cut=True)
    return built


def _torso(rng: Rng, built: PrimitiveBuilder, plan: _Plan, hip: F64, chest: F64) -> None:
    """The body with the neck and the head, which are one skin."""
    g = plan.girth
    soft = g * span(rng, 0.25, 0.6)
    built.part(SKIN)
    thin = span(rng, 0.75, 1.1)
    built.limb(hip + vec(0.08, 0, 0), chest - vec(0.08, 0, 0), g * span(rng, 0.8, 1), g * thin)
    middle = 0.5 * (hip + chest) - vec(0, 0.12 * g, 0)
    slope = float(np.arctan2(chest[1] - hip[1], chest[0] - hip[0]))
    belly = vec(0.42, g * span(rng, 0.8, 1.15), g * span(rng, 0.85, 1.15))
    built.ellipsoid(middle, belly, turned(0, 0, slope), soft=soft)
    rise = plan.rise + span(rng, -0.5, 0.35)
    aside = rng.normal(0, 0.35)
    way = vec(np.cos(rise) * np.cos(aside), np.sin(rise), np.cos(rise) * np.sin(aside))
    start = chest + vec(0.02, 0.25 * g, 0)
    head = start + way * (plan.neck + 0.5 * g)
    built.limb(start, head, 0.75 * g, 0.75 * plan.head, soft=soft)
    look = aside + rng.normal(0, 0.4)
    drop = span(rng, -0.15, 0.7)
    face = vec(np.cos(look) * np.cos(drop), -np.sin(drop), np.sin(look) * np.cos(drop))
    if chance(rng, 0.5):
        built.part(SKIN)
    _head(rng, built, plan, head, face)


def _head(rng: Rng, built: PrimitiveBuilder, plan: _Plan, head: F64, face: F64) -> None:
    """Skull, snout, ears, eyes; a trunk or horns for some."""
    r = plan.head
    axes = ahead(face)
    up = axes[:, 1]
    built.ellipsoid(head, [1.1 * r, r, span(rng, 0.8, 1.05) * r], axes, soft=0.3 * r)
    tip = head + face * (0.5 * r + plan.snout) - up * 0.25 * r
    built.limb(head + face * 0.3 * r - up * 0.15 * r, tip, 0.7 * r, plan.muzzle, soft=0.4 * r)
    if plan.ear == "fan" and plan.girth > 0.28:  # an elephant's trunk
        reach = [tip, tip + face * 0.25 - up * 0.3, tip + face * span(rng, 0, 0.4) - up * 0.6]
        reach.append(reach[-1] + face * 0.2 + up * span(rng, -0.2, 0.3))
        tube(built, curve(reach, 9), 0.95 * plan.muzzle, 0.4 * plan.muzzle, soft=0.03)
    else:
        built.part(EYES)
        built.ellipsoid(
            tip + face * 0.75 * plan.muzzle + up * 0.2 * plan.muzzle, np.full(3, 0.45 * plan.muzzle)
        )
    built.part(EYES)
    for sign in (1, -1):
        eye = head + axes @ (r * vec(0.75, 0.38, sign * 0.55))
        built.ellipsoid(eye, np.full(3, span(rng, 0.1, 0.18) * r))
    _ears(rng, built, plan, head, axes)
    if (plan.ear == "side" and chance(rng, 0.7)) or chance(rng, 0.06):
        _horns(rng, built, head, axes * r)


def _ears(rng: Rng, built: PrimitiveBuilder, plan: _Plan, head: F64, axes: F64) -> None:
    """Two ears of the shape that the plan asks for."""
    r = plan.head
    shape = {  # where on the head, half sizes, and turn of the ear: forward, up, aside
        "flap": (vec(-0.1, 0.25, 0.95), vec(0.35, 0.65, 0.14), -0.25),
        "point": (vec(-0.1, 1.0, 0.6), vec(0.16, 0.5, 0.28), 0.25),
        "round": (vec(-0.1, 0.85, 0.75), vec(0.13, 0.36, 0.36), 0.3),
        "side": (vec(-0.15, 0.5, 1.15), vec(0.16, 0.24, 0.5), 0.1),
        "fan": (vec(-0.3, 0.25, 1.3), vec(0.12, 0.95, 0.75), 0.2),
        "long": (vec(-0.2, 1.5, 0.4), vec(0.14, 1.0, 0.28), 0.2),
    }.get(plan.ear)
    if shape is None:
        return
    at, half, lean = shape
    half = half * np.exp(rng.normal(0, 0.15, 3))
    own = pick(rng, (SKIN, SKIN, OTHER))
    for sign in (1, -1):
        built.part(own)
        tilt = sign * (lean + rng.normal(0, 0.12))
        turn = axes @ turned(sign * span(rng, -0.4, 0.4), tilt, rng.normal(0, 0.15))
        built.ellipsoid(head + axes @ (r * at * [1, 1, sign]), np.maximum(half * r, 0.014), turn)


def _horns(rng: Rng, built: PrimitiveBuilder, head: F64, axes: F64) -> None:
    """Two horns, short or long; `axes` (3, 3) are as long as the head is thick."""
    high, wide, on = span(rng, 0.6, 1.8), span(rng, 0.4, 1.2), span(rng, -0.6, 0.6)
    for sign in (1, -1):
        built.part(HORN)
        knots = [[0, 0.7, 0.5], [0, 1.1, 0.5 + 0.5 * wide], [on, 0.9 + high, 0.6 + wide]]
        line = head + (np.array(knots) * [1, 1, sign]) @ axes.T
        tube(built, curve(line, 6), 0.035, 0.012)


def _legs(rng: Rng, built: PrimitiveBuilder, plan: _Plan, pose: str, hip: F64, chest: F64) -> None:
    """Two fore, two hind; each is a part of its own, in some the skin runs on."""
    g, is_low = plan.girth, plan.tail == "thick"
    own = pick(rng, (SKIN, SKIN, SKIN, OTHER))
    stride = span(rng, 0.15, 0.4) * plan.leg if pose == "walk" else span(rng, 0, 0.05)
    for fore in (True, False):
        for sign in (1, -1):
            root = (chest if fore else hip) + vec(-0.1 if fore else 0.02, -0.2 * g, sign * 0.62 * g)
            step = stride * sign * (1 if fore else -1) * span(rng, 0.6, 1.1)
            foot = vec(root[0] + step, 0, root[2] + sign * span(rng, 0, 0.08))
            length = 1.04 * plan.leg + 0.5 * g
            bend = vec(-1 if fore else 1, 0, 0.2 * sign)
            if is_low:  # spread legs
                foot = vec(root[0] + span(rng, -0.1, 0.25), 0, sign * (g + 0.8 * plan.leg))
                bend = vec(0, 1, 0.3 * sign)
                length *= 1.5
            elif pose == "lie" or (pose == "sit" and not fore):  # folded, beside the body
                foot = vec(root[0] + span(rng, 0.25, 0.6) * plan.leg, 0, sign * 1.05 * g)
                bend = vec(0.6, 0.8, 0.2 * sign)
                length = 1.2 * plan.leg
            elif abs(root[1]) > 1.5 * length:
                length = 1.05 * root[1]
            foot[1] = plan.shin
            knee = joint(root, foot, max(length, 1.02 * float(np.linalg.norm(root - foot))), bend)
            knee[1] = max(knee[1], plan.shin)
            built.part(own)
            thigh = min(plan.shin * span(rng, 1.7, 2.6), 0.8 * g)
            soft = 0.5 * plan.shin
            two_bones(built, [root, knee, foot], [thigh, 1.25 * plan.shin, plan.shin], soft)
            paw = vec(1.7, 0.75, 1.25) * plan.shin * span(rng, 0.8, 1.1)
            built.ellipsoid(foot + vec(0.5 * plan.shin, -0.3 * plan.shin, 0), paw, soft=soft)


def _tail(rng: Rng, built: PrimitiveBuilder, plan: _Plan, hip: F64, pose: str) -> None:
    """One tail of the kind that the plan asks for."""
    start = hip - vec(0.75 * plan.girth, -0.35 * plan.girth, 0)
    sway = rng.normal(0, 0.25, 3)
    ways = {
        "up": [[-0.2, 0.15, 0], [-0.25, 0.45, 0]],
        "long": [[-0.3, 0, 0], [-0.6, 0.1, 0], [-0.7, 0.4, 0]],
        "brush": [[-0.15, -0.1, 0], [-0.2, -0.55, 0]],
        "curl": [[-0.1, 0.1, 0.06], [-0.15, 0, -0.05]],
        "thin": [[-0.1, -0.2, 0], [-0.2, -0.45, 0]],
        "stub": [[-0.06, 0.03, 0]],
        "thick": [[-0.4, -0.05, 0], [-0.8, -0.1, 0.2], [-1.2, -0.1, -0.1]],
    }
    line = [start] + [
        start + np.array(w) * (1 + 0.3 * sway[0]) + vec(0, 0, sway[1] * abs(w[0]))
        for w in ways[plan.tail]
    ]
    thick = {"thick": 0.7 * plan.girth, "stub": 0.06, "brush": 0.05, "up": 0.05, "long": 0.04}
    near = thick.get(plan.tail, 0.03) * span(rng, 0.8, 1.3)
    far = {"brush": 1.8 * near, "stub": near}.get(plan.tail, 0.4 * near)
    path = curve(line, 7)
    path[:, 1] = np.maximum(path[:, 1], near)
    built.part(SKIN if chance(rng, 0.75) else OTHER)
    tube(built, path, near, far, soft=0.5 * near)
