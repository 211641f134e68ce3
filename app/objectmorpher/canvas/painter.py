"""The document's objects in the colours of a view, and where its pixels come from; remembered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, Mask
from objectmorpher_core.base.pixels import crop
from objectmorpher_core.document.model import Document

from ..editor.view import Shown, ToolName, View
from . import paint
from .blend import CELL, build_blend
from .memo import Memo

if TYPE_CHECKING:
    from objectmorpher_core.raster.posed import PosedSplats

    from .derived import Derived
    from .layers import Layer

PAINTED = (Shown.DEPTH, Shown.NORMALS, Shown.STRAIN)
SMALL = 320  # px, longer side of the picture on which shares are counted
LEAST = 0.02  # of a pixel that something new covers: with less it counts as unchanged


@dataclass(frozen=True)
class Shares:
    """Where the changed pixels come from; these sum to 1, or are 0 where nothing changed."""

    from_photo: float = 0.0
    from_lifter: float = 0.0
    from_inpainter: float = 0.0
    from_refiner: float = 0.0
    changed: float = 0.0  # of all pixels of the photo


def shown_now(document: Document | None, view: View) -> Shown:
    """The view that was chosen, as soon as there is an object for it; selecting needs the photo,
    and from elsewhere than the photo's view the composite's object is alone."""
    if document is None or not any(o.lifted for o in document.objects):
        return Shown.COMPOSITE
    if view.tool in (ToolName.SELECT, ToolName.MASK):
        return Shown.COMPOSITE
    is_orbiting = view.tool is ToolName.LOOK and view.orbit is not None
    if is_orbiting and view.shown is Shown.COMPOSITE:
        return Shown.OBJECT
    return view.shown


class Painter:
    """Paints objects; an unchanged one costs nothing."""

    def __init__(self, derived: Derived) -> None:
        self._derived = derived
        # of each object and view the last one, with what it was painted from
        self._painted: dict[tuple[int, Shown], tuple[PosedSplats, object, PosedSplats]] = {}
        self._spread: paint.DepthRange | None = None
        self._spreads, self._holes, self._shares = Memo(), Memo(), Memo()

    def painted(self, document: Document, k: int, shown: Shown) -> PosedSplats:
        """Object `k` as a view shows it: in plain colours, or as it is."""
        splats = self._derived.posed(document, k)
        if shown not in PAINTED:
            return splats
        spread = self.spread(document) if shown is Shown.DEPTH else None
        kept = self._painted.get((k, shown))
        if kept is None or kept[0] is not splats or kept[1] is not spread:
            colors = self._colors(document, k, splats, shown)
            kept = self._painted[k, shown] = (splats, spread, splats.painted(colors))
        return kept[2]

    def forget(self, count: int) -> None:
        """Objects from the `count`-th on are there no more."""
        self._painted = {key: kept for key, kept in self._painted.items() if key[0] < count}

    def measure(self, document: Document) -> paint.DepthRange:
        """Fits the depth's colours to all that is seen of the objects.

        Not to be called while something is dragged: what a colour means must hold still.
        """
        there = [k for k, o in enumerate(document.objects) if o.lifted and o.is_visible]
        splats = [self._derived.posed(document, k) for k in there]
        if splats:
            self._spread = self._spreads(lambda: _measured(splats), *splats)
        return self._spread or paint.DepthRange(0.0, 1.0, 1.0)

    def spread(self, document: Document) -> paint.DepthRange:
        """As it was measured last."""
        return self._spread or self.measure(document)

    def _colors(self, document: Document, k: int, splats: PosedSplats, shown: Shown) -> F32:
        """(N, 3), one for each Gaussian."""
        if shown is Shown.DEPTH:
            return paint.depth_colors(splats.means[:, 2], self.spread(document))
        if shown is Shown.NORMALS:
            return paint.normal_colors(splats.rest.normals, splats.linear)
        thing = document.objects[k]
        if thing.pose is None:  # moved as a whole, if at all
            return paint.ramp(paint.STRAIN_STOPS, np.zeros(len(splats)))
        deformer = self._derived.shape(document.photo, thing).puppet.deformer
        strain, binding = deformer.strain(thing.pose), deformer.binding
        if len(binding.weights) != len(splats):  # some were split
            from objectmorpher_core.deform.binding import bind

            binding = bind(splats.rest.means, deformer.points, deformer.graph)
        stretches = paint.stretch(strain.most, strain.least)
        return paint.strain_colors(stretches, binding.control_points, binding.weights)

    # Provenance

    def invented_background(self, document: Document) -> Mask | None:
        """(H, W) where the plate is invented; None while there is no plate."""
        plate = self._derived.plate(document)
        if plate is None:
            return None
        width, height = document.photo.size
        return self._holes(lambda: crop(plate.hole, plate.box, (0, 0, width, height)), plate)

    def shares(self, document: Document) -> Shares:
        """Where the changed pixels come from, counted on a small picture of the edit.

        The export counts at the photo's own size and reports the exact figures.
        """
        return self._shares(lambda: _count_shares(self._derived, document), document)

    def count_changed(self, document: Document) -> int:
        """About how many pixels of the photo the edit changes: two figures of the number."""
        if not any(o.is_moved for o in document.objects):
            return 0
        width, height = document.photo.size
        count = round(self.shares(document).changed * width * height)
        return round(count, 2 - len(str(count)))


def _measured(objects: list[PosedSplats]) -> paint.DepthRange:
    """Of the sides that face the camera: backs are not seen."""
    depths = []
    for splats in objects:
        normals = paint.moved_normals(splats.rest.normals, splats.linear)
        is_seen = (normals * splats.means).sum(1) < 0
        depths.append(splats.means[is_seen if is_seen.any() else slice(None), 2])
    lifted = [splats.rest.lifted for splats in objects]
    return paint.depth_range(np.concatenate(depths), max(o.diameter * o.scale for o in lifted))


def _count_shares(derived: Derived, document: Document) -> Shares:
    from objectmorpher_core.raster import tiles

    width, height = document.photo.size
    view = View(zoom=min(SMALL / max(width, height), 1.0))
    view.width, view.height = round(width * view.zoom), round(height * view.zoom)
    size, camera = (view.width, view.height), document.photo.camera
    coarse = build_blend(derived, document, view)
    across, down = coarse.shape[1] * CELL, coarse.shape[0] * CELL
    edited = cv2.resize(coarse, (across, down))[: view.height, : view.width]
    hole = derived.painter.invented_background(document)
    inpainted = np.zeros(size[::-1], np.float32)
    if hole is not None:
        inpainted = cv2.resize(hole.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    lifted, through_all = np.zeros_like(inpainted), 1 - inpainted
    for k, splats in derived.layers.order(document).items():
        if splats is None:
            through, own = 1 - _front_alpha(derived, document, k, view), np.float32(0)
        else:
            texture = derived.shape(document.photo, document.objects[k]).texture
            picture = tiles.render(derived.draft(document, k), texture, view.camera(camera), camera)
            through = 1 - np.minimum(picture.alpha, 1)
            own = np.maximum(picture.alpha - picture.from_photo, 0)
        lifted = through * lifted + own
        inpainted, through_all = through * inpainted, through * through_all
    is_changed = (edited > 0) & (through_all < 1 - LEAST)
    if not is_changed.any():
        return Shares()
    by_lifter = float((lifted * edited)[is_changed].mean())
    by_inpainter = float((inpainted * edited)[is_changed].mean())
    by_refiner = float(_refined_alpha(derived, document, view)[is_changed].mean())
    rest = 1 - by_refiner  # as the composite's figures: a refinement lies over all the others
    by_lifter, by_inpainter = rest * by_lifter, rest * by_inpainter
    from_photo = rest - by_lifter - by_inpainter
    return Shares(from_photo, by_lifter, by_inpainter, by_refiner, float(is_changed.mean()))


def _refined_alpha(derived: Derived, document: Document, view: View) -> F32:
    """(h, w) of the refinement, on a view's canvas."""
    alpha = np.zeros((view.height, view.width), np.float32)
    for layer in derived.refined.layers(document, view):
        _paste(layer, alpha)
    return alpha


def _front_alpha(derived: Derived, document: Document, k: int, view: View) -> F32:
    """(h, w) of what stays in front, on a view's canvas."""
    alpha = np.zeros((view.height, view.width), np.float32)
    layer = derived.fronts.layer(document.objects[k], view)
    if layer is not None:
        _paste(layer, alpha)
    return alpha


def _paste(layer: Layer, alpha: F32) -> None:
    x0, y0, x1, y1 = (int(v) for v in layer.box)
    alpha[y0:y1, x0:x1] = layer.rgba[..., 3] / np.float32(255)
