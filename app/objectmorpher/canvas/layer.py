"""What a frame is made of: the objects of a document, and their pictures on the canvas."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import U8
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.bounds import NORMAL
from objectmorpher_core.document.model import Document, EditObject

from ..editor.view import Shown
from .shape import CanvasShape

if TYPE_CHECKING:
    from objectmorpher_core.compose.light.lighting import Lit
    from objectmorpher_core.compose.paint import PaintedShare
    from objectmorpher_core.raster.posed import PosedSplats
    from objectmorpher_core.raster.texture import TextureLevels

Box = tuple[int, int, int, int]  # x0, y0, x1, y1 px
PAINTED = (Shown.DEPTH, Shown.NORMALS, Shown.STRAIN)


@dataclass(frozen=True, eq=False)
class CanvasLayer:
    """A rendered object on the canvas."""

    box: tuple[float, float, float, float]  # x0, y0, x1, y1 canvas px
    rgba: np.ndarray  # (h, w, 4) premultiplied sRGB, f32 in [0, 1] or u8
    # (h, w) u8, what of alpha is not the photo's but invented or painted: hatched
    invented: np.ndarray | None = None
    is_coarse: bool = False  # with fewer px than its box; else px for px
    is_draft: bool = False  # to be replaced by the exact picture
    is_tint: bool = False  # lies over everything, translucent
    is_weighed: bool = False  # by the edit's share already: the blend does not count
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)  # of its colours
    mode: str = NORMAL  # of MODES

    @property
    def pixels(self) -> U8:
        """(h, w, 4) u8."""
        return self.rgba if self.rgba.dtype == np.uint8 else as_u8(self.rgba)


@dataclass(frozen=True, eq=False)
class Rendered:
    """An exact picture."""

    rgba: np.ndarray  # (h, w, 4) u8, premultiplied
    invented: np.ndarray | None = None  # (h, w) u8, see `CanvasLayer`


@dataclass(frozen=True, eq=False)
class ExactPicture:
    """An exact picture to be rendered."""

    splats: PosedSplats
    texture: TextureLevels
    window: Camera
    camera: Camera  # the photo's
    part: ObjectPart
    paint: PaintedShare | None = None  # on a part that is marked


@dataclass(frozen=True)
class ObjectPart:
    """An object, and how it is shown: as it is, with what of it is invented, or painted."""

    k: int
    look: Shown

    @property
    def is_painted(self) -> bool:
        return self.look in PAINTED

    @property
    def is_marked(self) -> bool:
        return self.look is Shown.PROVENANCE


@dataclass(frozen=True, eq=False)
class PosedObject:
    """A lifted object of the document where the edit has put it."""

    k: int
    item: EditObject
    shape: CanvasShape
    posed: PosedSplats
    draft: PosedSplats  # of a large object fewer, wider Gaussians; else the same


@dataclass(frozen=True, eq=False)
class FrameObject(PosedObject):
    """The object as one frame shows it."""

    look: Shown
    lit: Lit  # light, focus, grain and shadow of its new place
    splats: PosedSplats  # `posed` in the colours of the look
    layer: CanvasLayer | None = None  # its picture, where it is drawn and on the canvas

    @property
    def part(self) -> ObjectPart:
        return ObjectPart(self.k, self.look)


def is_front(document: Document, k: int) -> bool:
    """Whether object `k` stays in front, and is shown as the photo has it."""
    from objectmorpher_core.compose.order import stands_in_front

    return stands_in_front(document.objects[k])


# A rendered object's picture in the light of its new place: focus, shading, colour and grain.

NEUTRAL = (1.0, 1.0, 1.0)


def in_light(shown: CanvasLayer, look: Lit, place: tuple[float, ...]) -> CanvasLayer:
    """Light an object in the order of the export; `place` is the `View.place` of the picture."""
    from objectmorpher_core.compose.light.defocus import sharpened_rgba
    from objectmorpher_core.compose.light.harmonize import lit_rgba, saturated

    left, top, zoom = place[:3]
    if look.blur > 0 and shown.invented is None:  # where what is the photo's is marked, it is exact
        shown = _out_of_focus(shown, look.blur * zoom, (int(place[3]), int(place[4])))
    if look.sharpness > 0 and shown.invented is None:
        shown = replace(shown, rgba=sharpened_rgba(shown.pixels, look.sharpness, zoom))
    x0, y0 = shown.box[:2]
    corner = (left + x0 / zoom, top + y0 / zoom, zoom)
    rgba, gain = shown.pixels, look.gain
    if look.relit is not None:
        rgba = look.relit.lit_rgba(rgba, *corner)
    if look.grain is not None:  # last: it is as strong as the photo's at the brightness shown
        rgba, gain = look.grain.grained_rgba(lit_rgba(rgba, gain), *corner), NEUTRAL
    if look.opacity < 1 or look.saturation != 1:
        whole = lit_rgba(rgba, gain).astype(np.float32)
        whole[..., :3] = saturated(whole[..., :3], whole[..., 3], look.saturation)
        rgba, gain = (whole * np.float32(look.opacity) + 0.5).astype(np.uint8), NEUTRAL
    return replace(shown, rgba=rgba, gain=gain, mode=look.mode)


def _out_of_focus(shown: CanvasLayer, blur: float, size: tuple[int, int]) -> CanvasLayer:
    """A picture px for px, blurred by so many canvas px, on a canvas of that `size`."""
    from objectmorpher_core.compose.light.defocus import blurred_rgba, reach_of

    rim = reach_of(blur)
    x0, y0, x1, y1 = (round(v) for v in shown.box)
    wide = max(x0 - rim, 0), max(y0 - rim, 0), min(x1 + rim, size[0]), min(y1 + rim, size[1])
    around = ((y0 - wide[1], wide[3] - y1), (x0 - wide[0], wide[2] - x1), (0, 0))
    rgba: U8 = np.pad(shown.pixels, np.maximum(around, 0))
    x0, y0, x1, y1 = (float(v) for v in wide)
    return replace(shown, box=(x0, y0, x1, y1), rgba=blurred_rgba(rgba, blur))


def as_u8(values: np.ndarray) -> U8:
    """Levels of values in [0, 1], rounded."""
    return (values * 255 + 0.5).clip(0, 255).astype(np.uint8)
