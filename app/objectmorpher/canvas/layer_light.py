"""A rendered object's picture in the light of its new place: focus, shading, colour and grain."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import U8

if TYPE_CHECKING:
    from objectmorpher_core.compose.light.lighting import Lit

    from .layers import Layer

NEUTRAL = (1.0, 1.0, 1.0)


def in_light(shown: Layer, look: Lit, place: tuple[float, ...]) -> Layer:
    """What the export does, in its order; `place` is the `View.place` of the picture."""
    from objectmorpher_core.compose.light.harmonize import lit_rgba

    left, top, zoom = place[:3]
    if look.blur > 0 and shown.invented is None:  # where what is the photo's is marked, it is exact
        shown = _out_of_focus(shown, look.blur * zoom, (int(place[3]), int(place[4])))
    x0, y0 = shown.box[:2]
    corner = (left + x0 / zoom, top + y0 / zoom, zoom)
    rgba, gain = shown.pixels, look.gain
    if look.relit is not None:
        rgba = look.relit.lit_rgba(rgba, *corner)
    if look.grain is not None:  # last: it is as strong as the photo's at the brightness shown
        rgba, gain = look.grain.grained_rgba(lit_rgba(rgba, gain), *corner), NEUTRAL
    return replace(shown, rgba=rgba, gain=gain)


def _out_of_focus(shown: Layer, blur: float, size: tuple[int, int]) -> Layer:
    """A picture px for px, blurred by so many canvas px, on a canvas of that `size`."""
    from objectmorpher_core.compose.light.defocus import blurred_rgba, reach_of

    rim = reach_of(blur)
    x0, y0, x1, y1 = (round(v) for v in shown.box)
    wide = max(x0 - rim, 0), max(y0 - rim, 0), min(x1 + rim, size[0]), min(y1 + rim, size[1])
    around = ((y0 - wide[1], wide[3] - y1), (x0 - wide[0], wide[2] - x1), (0, 0))
    rgba: U8 = np.pad(shown.pixels, np.maximum(around, 0))
    x0, y0, x1, y1 = (float(v) for v in wide)
    return replace(shown, box=(x0, y0, x1, y1), rgba=blurred_rgba(rgba, blur))
