"""The document's objects in the colours of a view, and where its pixels come from; remembered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, F64, I32, Mask
from objectmorpher_core.base.pixels import crop
from objectmorpher_core.document.model import Document

from ..editor.view import Shown, ToolName, View
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
        self._spread: DepthRange | None = None
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

    def measure(self, document: Document) -> DepthRange:
        """Fits the depth's colours to all that is seen of the objects.

        Not to be called while something is dragged: what a colour means must hold still.
        """
        there = [k for k, o in enumerate(document.objects) if o.lifted and o.is_visible]
        splats = [self._derived.posed(document, k) for k in there]
        if splats:
            self._spread = self._spreads(lambda: _measured(splats), *splats)
        return self._spread or DepthRange(0.0, 1.0, 1.0)

    def spread(self, document: Document) -> DepthRange:
        """As it was measured last."""
        return self._spread or self.measure(document)

    def _colors(self, document: Document, k: int, splats: PosedSplats, shown: Shown) -> F32:
        """(N, 3), one for each Gaussian."""
        if shown is Shown.DEPTH:
            return depth_colors(splats.means[:, 2], self.spread(document))
        if shown is Shown.NORMALS:
            return normal_colors(splats.rest.normals, splats.linear)
        thing = document.objects[k]
        if thing.pose is None:  # moved as a whole, if at all
            return ramp(STRAIN_STOPS, np.zeros(len(splats)))
        deformer = self._derived.shape(document.photo, thing).puppet.deformer
        strain, binding = deformer.strain(thing.pose), deformer.binding
        if len(binding.weights) != len(splats):  # some were split
            from objectmorpher_core.deform.binding import bind

            binding = bind(splats.rest.means, deformer.points, deformer.graph)
        stretches = stretch(strain.most, strain.least)
        return strain_colors(stretches, binding.control_points, binding.weights)

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


def _measured(objects: list[PosedSplats]) -> DepthRange:
    """Of the sides that face the camera: backs are not seen."""
    depths = []
    for splats in objects:
        normals = moved_normals(splats.rest.normals, splats.linear)
        is_seen = (normals * splats.means).sum(1) < 0
        depths.append(splats.means[is_seen if is_seen.any() else slice(None), 2])
    lifted = [splats.rest.lifted for splats in objects]
    return depth_range(np.concatenate(depths), max(o.diameter * o.scale for o in lifted))


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


# What the views paint an object with: a colour for each Gaussian. Numpy only.

Stops = tuple[tuple[float, float, float], ...]  # sRGB in [0, 1], evenly spaced

# Lightness falls from near to far, so that it reads without colour, too.
DEPTH_STOPS: Stops = (
    (1.00, 0.97, 0.86), (0.98, 0.77, 0.47), (0.86, 0.46, 0.40), (0.55, 0.29, 0.50),
    (0.25, 0.22, 0.45),
)  # fmt: skip
STRAIN_STOPS: Stops = ((0.15, 0.38, 0.95), (1.0, 0.85, 0.25), (0.88, 0.15, 0.15))
FULL_STRAIN = 0.1  # longer or shorter by this share is red; a careful edit stays below half of it
BEYOND = 0.1  # x the range that the depth's colours reach past it, for what a drag moves


@dataclass(frozen=True, eq=False)
class DepthRange:
    """What the first and the last colour of the depth stand for."""

    near: float  # world units along z
    far: float
    diameter: float  # of the object, world units

    @property
    def half(self) -> float:
        """Object diameters from the middle of the range to its ends."""
        return (self.far - self.near) / (2 * self.diameter)


def depth_range(depths: np.ndarray, diameter: float) -> DepthRange:
    """For what is at these `depths` (N,)."""
    near, far = float(depths.min()), float(depths.max())
    more = BEYOND * (far - near) + 1e-6 * diameter
    return DepthRange(near - more, far + more, diameter)


def ramp(stops: Stops, amounts: np.ndarray) -> F32:
    """(N, 3) sRGB of `amounts` (N,): 0 is the first of the stops, 1 the last."""
    table, places = np.array(stops), np.linspace(0, 1, len(stops))
    amounts = np.nan_to_num(np.clip(amounts, 0, 1), nan=1.0)
    channels = [np.interp(amounts, places, table[:, c]) for c in range(3)]
    return np.stack(channels, axis=-1).astype(np.float32)


def depth_colors(depths: np.ndarray, spread: DepthRange) -> F32:
    """(N, 3) of depths (N,), world units."""
    return ramp(DEPTH_STOPS, (depths - spread.near) / (spread.far - spread.near))


def normal_colors(normals: np.ndarray, linear: np.ndarray) -> F32:
    """(N, 3) of rest `normals` (N, 3), world, whose surroundings are moved by `linear` (N, 3, 3).

    As normal maps are painted: red to the right, green up, blue towards the camera.
    """
    turned = moved_normals(normals, linear) * (1, -1, -1)  # world: y down, z away
    return (0.5 + 0.5 * turned).astype(np.float32)


def moved_normals(normals: np.ndarray, linear: np.ndarray) -> F64:
    """(N, 3) unit. Normals move by the cofactors, also where the motion flattens or mirrors."""
    a, b, c = (linear[:, :, k] for k in range(3))  # columns
    x, y, z = (_cross(v, w) for v, w in ((b, c), (c, a), (a, b)))  # columns of the cofactors
    moved = x * normals[:, :1] + y * normals[:, 1:2] + z * normals[:, 2:]
    moved *= np.where((a * x).sum(1, keepdims=True) < 0, -1, 1)
    return moved / np.maximum(np.linalg.norm(moved, axis=1, keepdims=True), 1e-30)


def _cross(v: np.ndarray, w: np.ndarray) -> F64:
    """Of rows (N, 3); numpy's own takes several times as long."""
    x = v[:, 1] * w[:, 2] - v[:, 2] * w[:, 1]
    y = v[:, 2] * w[:, 0] - v[:, 0] * w[:, 2]
    return np.stack([x, y, v[:, 0] * w[:, 1] - v[:, 1] * w[:, 0]], axis=1)


def stretch(most: np.ndarray, least: np.ndarray) -> F64:
    """(M,) by which share anything at a control point is longer, or shorter, than at rest."""
    return np.maximum(most, 1 / np.maximum(least, 1e-9)) - 1


def strain_colors(stretches: np.ndarray, control_points: I32, weights: np.ndarray) -> F32:
    """(N, 3) of Gaussians bound by `weights` to `control_points`, both (N, K), see `stretch`."""
    return ramp(STRAIN_STOPS, (stretches[control_points] * weights).sum(1) / FULL_STRAIN)
