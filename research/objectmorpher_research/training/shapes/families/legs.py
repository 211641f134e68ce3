"""Four legs of one piece of furniture."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder
from .making import Rng, chance, pick, profile, span, vec

WOOD, SOFT, METAL = range(3)


def legs(
    rng: Rng, built: PrimitiveBuilder, half: F64, high: float, kind: str | None = None
) -> None:
    """Four legs beneath a seat or a top of half sizes (2,), x and z; each a part."""
    kind = kind or pick(rng, ("square", "round", "splayed", "turned", "taper"))
    thick, out = span(rng, 0.03, 0.07), span(rng, 0.05, 0.2)
    for sx in (1, -1):
        for sz in (1, -1):
            built.part(METAL if kind == "round" else WOOD)
            at = vec(sx * (half[0] - thick), 0, sz * (half[1] - thick))
            if kind == "square":
                built.box(at + [0, 0.5 * high, 0], [thick, 0.5 * high, thick], 0.01)
            elif kind == "turned":
                outline = [
                    [0.6, 0],
                    [0.6, 0.05],
                    [1, 0.1],
                    [0.6, 0.2],
                    [1.1, 0.55],
                    [0.8, 0.8],
                    [1.2, 1],
                ]
                built.lathe(at, profile(np.array(outline) * [thick, high], 1))
            else:
                spread = vec(sx, 0, sz) * (out if kind == "splayed" else 0)
                foot = 0.6 * thick if kind != "round" else 0.7 * thick
                top = thick if kind != "round" else foot
                built.limb(at + [0, high, 0], at + spread + [0, foot, 0], top, foot)
    if chance(rng, 0.3):
        built.part(WOOD)
        for sx in (1, -1):
            y = span(rng, 0.15, 0.4) * high
            x = sx * (half[0] - thick)
            built.limb([x, y, -half[1] + thick], [x, y, half[1] - thick], 0.6 * thick, 0.6 * thick)
        built.limb([-half[0], y, 0], [half[0], y, 0], 0.6 * thick, 0.6 * thick)
