"""The document's refinement on the canvas: over the edit, as `compose/refined.py` mixes it.

Mixing a pixel with weight w of another one is what covering it with alpha w does, so it is one more
layer. Its alpha says already how much of the edit is seen: the blend does not weigh it again.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.document.model import Document
from objectmorpher_core.document.refinement import Refined

from ..editor.view import View
from .fronts import drawn
from .layers import Layer
from .memo import Memo

if TYPE_CHECKING:
    from objectmorpher_core.raster.texture import TextureLevels


class RefinedView:
    """Its picture in the last view, remembered."""

    def __init__(self) -> None:
        self._levels = Memo()
        self._kept: tuple[Refined, tuple[object, ...], Layer | None] | None = None

    def layers(self, document: Document, view: View, is_marked: bool = False) -> tuple[Layer, ...]:
        """Px for px; none where the edit is not refined, or nothing of it is on the canvas.

        `is_marked`: all of it is the network's, which a view tells by hatching.
        """
        refined = document.refined
        if refined is None or refined.strength == 0:
            return ()
        kept = self._kept
        place = (*view.place, is_marked)
        if kept is None or kept[0] is not refined or kept[1] != place:
            # Of another strength they are the same: it is dragged.
            levels = self._levels(lambda: _levels(refined), refined.pixels, refined.alpha)
            layer = drawn(levels, view, refined.strength)
            if layer is not None:
                invented = layer.rgba[..., 3] if is_marked else None
                layer = replace(layer, is_weighed=True, invented=invented)
            kept = self._kept = (refined, place, layer)
        return () if kept[2] is None else (kept[2],)


def _levels(refined: Refined) -> TextureLevels:
    """At full strength: premultiplied, with halved copies for what is shown smaller than it is."""
    from objectmorpher_core.base.pixels import unit_pixels
    from objectmorpher_core.raster.texture import build_levels

    weights = refined.alpha.astype(np.float32) / np.float32(255)
    premultiplied = np.asarray(unit_pixels(refined.pixels) * weights[..., None], np.float32)
    return build_levels(premultiplied, weights, refined.left, refined.top)
