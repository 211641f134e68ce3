"""The input of the renderer, in plain values. It knows no editor, history or ImGui."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from objectmorpher_core.base.arrays import F32, Pixels, Selection
from objectmorpher_core.base.brush import Box
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.bounds import NORMAL
from objectmorpher_core.document.model import Plate

from ..canvas.layer import CanvasLayer

if TYPE_CHECKING:
    from objectmorpher_core.compose.light.grain import Grain
    from objectmorpher_core.compose.light.relight import Relit
    from objectmorpher_core.raster.posed import PosedSplats
    from objectmorpher_core.raster.texture import TextureLevels

Colour = tuple[float, float, float]  # sRGB in [0, 1]


@dataclass(frozen=True, eq=False)
class Hatch:
    """Stripes over what is not the photo's."""

    ink: Colour
    strength: float = 0.9  # share of the ink in a stripe
    brightness: float = 0.75  # share of the picture that is left under it
    slant: float = 1.0  # 1: rising to the right, -1: falling, 0: upright


@dataclass(frozen=True, eq=False)
class SplatObject:
    """An object for the GPU to draw."""

    splats: PosedSplats
    texture: TextureLevels
    camera: Camera  # the photo's
    is_marked: bool = False  # hatched where it shows nothing of the photo
    is_tint: bool = False  # lies over everything, translucent
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)  # of its colours
    relit: Relit | None = None  # and of each place
    grain: Grain | None = None  # and added to them
    blur: float = 0.0  # px of the photo, standard deviation, before all that
    saturation: float = 1.0  # after all that
    opacity: float = 1.0
    sharpness: float = 0.0  # after the blur
    mode: str = NORMAL  # of MODES


@dataclass(frozen=True, eq=False)
class Scene:
    """A picture of the canvas."""

    photo: Pixels
    surround: Colour
    plate: Plate | None = None  # shown where there is one
    shades: tuple[CanvasLayer, ...] = ()  # shadows, below all objects
    layers: tuple[CanvasLayer, ...] = ()  # objects that are rendered already, back to front
    # objects to render, back to front, and between them what is rendered already
    objects: tuple[SplatObject | CanvasLayer, ...] = ()
    mask: Selection | None = None  # what `veil` and `hatch` refer to
    touched: tuple[Box, ...] = ()  # of a mask that is painted in place: what changed, in its order
    veil: float = 0.0  # share of black outside the mask
    hatch: Hatch | None = None  # inside the mask
    marks: Hatch | None = None  # on what an object invents, where its layer says so
    refined: Hatch | None = None  # the same on a refinement
    paper: tuple[Colour, Colour] | None = None  # squares of these instead of the photo
    blend: F32 | None = None  # (h, w) over the canvas: 0 shows the photo over the edit
    split: float = 0.0  # share of the canvas, from the left, that shows the photo as it was
