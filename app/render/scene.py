"""What is to be drawn: plain inputs. The renderer knows no editor, history or ImGui."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from objectmorpher_core.arrays import F32, Mask, Pixels
from objectmorpher_core.camera import Camera
from objectmorpher_core.document import Plate

from ..layers import Layer

if TYPE_CHECKING:
    from objectmorpher_core.raster.posed import PosedSplats
    from objectmorpher_core.raster.texture import TextureLevels

Colour = tuple[float, float, float]  # sRGB in [0, 1]


@dataclass(frozen=True, eq=False)
class SplatObject:
    """A moved object for the GPU to draw."""

    splats: PosedSplats
    texture: TextureLevels
    camera: Camera  # the photo's


@dataclass(frozen=True, eq=False)
class Scene:
    """One picture of the canvas."""

    photo: Pixels
    surround: Colour
    plate: Plate | None = None  # shown where there is one
    layers: tuple[Layer, ...] = ()  # moved objects that are rendered already, back to front
    objects: tuple[SplatObject, ...] = ()  # moved objects to render, back to front
    mask: Mask | None = None  # what `veil` and `hatch` refer to
    veil: float = 0.0  # share of black outside the mask
    hatch: float = 0.0  # share of the hatching inside the mask
    blend: F32 | None = None  # (h, w) over the canvas: 0 shows the photo over the edit
    split: float = 0.0  # share of the canvas, from the left, that shows the photo as it was
