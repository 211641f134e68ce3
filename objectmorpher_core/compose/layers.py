"""An edit as a pile of layers that any paint program can open, and that gives the export again.

From below: the photo; what is invented behind its objects; shadows; the objects, back to front;
and the photo once more, wherever the edit does not show. That layer is what makes the pile exact:
it covers all that lies under it as far as the composite does (`blend.blend_weights`). A refinement
lies above it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Mask, crop, pixels_from_unit, unit_pixels
from ..base.masks import box_of
from ..base.progress import Progress, part, silent
from ..document.bounds import NORMAL
from ..document.model import Document, EditObject, Matte, Plate
from ..document.settings import Refined
from ..document.transparency import alpha_behind
from .blend import Box
from .composite import Composite, Moved, composite, drawn_alone, whole_box
from .light.relight import Relit
from .order import holes
from .plate.plate import overlap, plate_of_holes
from .shadow.shadow import Shade

PHOTO, BACKGROUND, UNTOUCHED = "Photo", "Background", "Photo, untouched"
REFINEMENT = "Refinement"
EMPTY = "Background without all objects"
SHADOW = "Shadow of {name}"
SOLID = 1 - 1e-6  # alpha, from which on only its arithmetic is not opaque


@dataclass(frozen=True, eq=False)
class Layer:
    """A picture over those before it."""

    name: str
    pixels: np.ndarray  # (h, w, 3), or with straight alpha (h, w, 4), of the photo's bit depth
    left: int = 0  # px, corner in the photo
    top: int = 0
    is_shown: bool = True
    mode: str = NORMAL  # of MODES: how it is mixed with those before it

    @property
    def box(self) -> Box:
        """x0, y0, x1, y1 px in the photo."""
        height, width = self.pixels.shape[:2]
        return self.left, self.top, self.left + width, self.top + height


def layers(document: Document, progress: Progress = silent) -> tuple[Composite, list[Layer]]:
    """The edited photo, and its layers from below.

    Objects that were moved are layers, and those that they come near. Where none was moved all
    are. What is hidden is none. Behind those that stay, the background is a hidden layer.
    """
    result = composite(document, progress=part(progress, 0.0, 0.5), keeps_weights=True)
    photo, size = document.photo.pixels, document.photo.size
    pile: list[Layer] = []
    gone = holes(document)
    own = plate_of_holes(document, gone) if result.stack else document.plate
    whole = document.plate
    if own is not None and whole is not None and own.hole is not whole.hole:  # not merely darker
        pile.append(_background(EMPTY, whole, is_shown=False))
    if own is not None and own.hole.any():
        pile.append(_background(BACKGROUND, own))
    behind, ground = document.photo.picture.alpha, len(pile)
    if behind is not None and own is not None:
        behind = alpha_behind(behind, own, gone)
    shown = [thing for thing in result.stack if thing.item.is_visible]
    for thing in shown:
        if thing.look.shade is not None:
            pile += _shadow(thing.item.name, thing.look.shade, size, photo.dtype)
    for item in () if result.stack else _distinct(document):
        assert item.matte is not None
        pile += _clipped(item.name, *_resting(item.matte, photo.dtype), size)
    for k, thing in enumerate(shown):
        progress(0.5 + 0.4 * k / len(shown), "drawing")
        drawn = _clipped(thing.item.name, *_drawn(thing, document), size)
        pile += [replace(layer, mode=thing.look.mode) for layer in drawn]
    untouched = _untouched(document, result, pile, _is_open(behind, pile[ground:]))
    above = [] if document.refined is None or not result.stack else _refined(document.refined)
    return result, [Layer(PHOTO, photo), *pile, *untouched, *above]


def _refined(refined: Refined) -> list[Layer]:
    """Above all else: it is mixed with the finished composite."""
    alpha = pixels_from_unit(refined.weights, refined.pixels.dtype)
    return _trimmed(REFINEMENT, np.dstack([refined.pixels, alpha]), refined.box)


def _background(name: str, plate: Plate, is_shown: bool = True) -> Layer:
    hole = pixels_from_unit(plate.hole.astype(np.float32), plate.pixels.dtype)
    pixels = np.dstack([np.where(plate.hole[..., None], plate.pixels, 0), hole])
    return Layer(name, pixels, plate.left, plate.top, is_shown)


def _distinct(document: Document) -> list[EditObject]:
    """The visible objects that were cut out; of copies one, for they are in the same place."""
    found: dict[int, EditObject] = {}
    for item in document.objects:
        if item.matte_here is not None and item.is_visible:
            found.setdefault(id(item.matte), item)
    return list(found.values())


def _drawn(thing: Moved, document: Document) -> tuple[np.ndarray, Box]:
    dtype = document.photo.pixels.dtype
    if not thing.item.is_moved:
        return _resting(thing.matte, dtype, thing.look.relit)
    return drawn_alone((thing,), document.photo.camera, dtype)


def _resting(matte: Matte, dtype: np.dtype, shaded: Relit | None = None) -> tuple[np.ndarray, Box]:
    """(h, w, 4) what the photo shows of an object, `shaded` by others."""
    colour = matte.foreground
    if shaded is not None:
        colour = shaded.lit(colour, np.ones_like(matte.alpha), matte.left, matte.top)
    soft = np.dstack([colour, np.minimum(matte.alpha, 1.0)])
    return pixels_from_unit(np.where(soft[..., 3:] > 0, soft, 0), dtype), matte.box


def _shadow(name: str, shade: Shade, size: tuple[int, int], dtype: np.dtype) -> list[Layer]:
    box = overlap(whole_box(shade.bounds), (0, 0, *size))
    if box is None:
        return []
    there = shade.at(box)
    ink = np.broadcast_to(np.array(shade.colour, np.float32), (*there.shape, 3))
    return _trimmed(SHADOW.format(name=name), pixels_from_unit(np.dstack([ink, there]), dtype), box)


def _clipped(name: str, pixels: np.ndarray, own: Box, size: tuple[int, int]) -> list[Layer]:
    """What of a picture lies in the photo."""
    box = overlap(own, (0, 0, *size))
    return [] if box is None else _trimmed(name, crop(pixels, own, box), box)


def _trimmed(name: str, pixels: np.ndarray, box: Box) -> list[Layer]:
    """Without the rows and columns at its sides that are clear; none where all of it is."""
    x0, y0, x1, y1 = box_of(pixels[..., 3])
    if x0 == x1:
        return []
    inner = pixels[y0:y1, x0:x1].copy()
    inner[inner[..., 3] == 0] = 0
    return [Layer(name, inner, box[0] + x0, box[1] + y0)]


def _is_open(behind: np.ndarray | None, pile: list[Layer]) -> Mask | None:
    """(H, W) where a layer is mixed with what is not opaque in the edit, as it is in the pile.

    What of it lies over nothing has its own colours in the edit, whatever its mode. `behind`
    (H, W): the alpha of what lies below the `pile`; None: all of it is opaque.
    """
    if behind is None or all(layer.mode == NORMAL for layer in pile):
        return None
    cover, found = unit_pixels(behind), np.zeros(behind.shape, bool)
    for layer in pile:
        x0, y0, x1, y1 = layer.box
        own, below = unit_pixels(layer.pixels[..., 3]), cover[y0:y1, x0:x1]
        if layer.mode != NORMAL:
            found[y0:y1, x0:x1] |= (own > 0) & (below < SOLID)
        below += own * (1 - below)
    return found


def _untouched(
    document: Document, result: Composite, pile: list[Layer], is_open: Mask | None
) -> list[Layer]:
    """The photo over all that is drawn, as far as the edit does not show there.

    Where the result is not opaque, or is mixed with what is not (`is_open`, (H, W)), it is there
    itself: the layers below are over the photo's colours under clear ground, and not over nothing.
    """
    if not pile:
        return []
    width, height = document.photo.size
    drawn = np.zeros((height, width), bool)
    for layer in (each for each in pile if each.is_shown):
        x0, y0, x1, y1 = layer.box
        drawn[y0:y1, x0:x1] |= layer.pixels[..., 3] > 0
    alpha = np.ones((height, width), np.float32)
    if result.weights is not None and result.box is not None:
        x0, y0, x1, y1 = result.box
        alpha[y0:y1, x0:x1] -= result.weights
    alpha[~drawn] = 0
    photo = document.photo.pixels
    if result.alpha is not None:  # under the mask of the pile, what is soft has its own colour
        soft = drawn & (result.alpha < np.iinfo(photo.dtype).max)
        if is_open is not None:
            soft |= is_open
        alpha[soft] = 1
        photo = np.where(soft[..., None], result.pixels, photo)
    samples = np.dstack([photo, pixels_from_unit(alpha, photo.dtype)])
    return _trimmed(UNTOUCHED, samples, (0, 0, width, height))
