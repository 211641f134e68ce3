"""The document's objects in the colours of a view, remembered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import F32, F64, I32
from objectmorpher_core.document.model import Document

from ..editor.view import Shown, ToolName, ViewState
from .derived import Derived
from .layer import ObjectPart, PosedObject
from .memo import Memo

if TYPE_CHECKING:
    from objectmorpher_core.raster.posed import PosedSplats


def shown_now(document: Document | None, view: ViewState) -> Shown:
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
        self._painted: dict[ObjectPart, tuple[PosedSplats, object, PosedSplats]] = {}
        self._spread: DepthRange | None = None
        self._spreads = Memo()

    def painted(self, document: Document, own: PosedObject, look: Shown) -> PosedSplats:
        """An object as a view shows it: in plain colours, or as it is."""
        splats, part = own.posed, ObjectPart(own.k, look)
        if not part.is_painted:
            return splats
        spread = self.spread(document) if look is Shown.DEPTH else None
        kept = self._painted.get(part)
        if kept is None or kept[0] is not splats or kept[1] is not spread:
            colors = self._colors(own, look, spread)
            kept = self._painted[part] = (splats, spread, splats.painted(colors))
        return kept[2]

    def forget(self, count: int) -> None:
        """Objects from the `count`-th on are there no more."""
        self._painted = {part: kept for part, kept in self._painted.items() if part.k < count}

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
        """Return the last spread that was measured."""
        return self._spread or self.measure(document)

    def _colors(self, own: PosedObject, look: Shown, spread: DepthRange | None) -> F32:
        """(N, 3), one for each Gaussian."""
        splats, pose = own.posed, own.item.pose
        if spread is not None:
            return depth_colors(splats.means[:, 2], spread)
        if look is Shown.NORMALS:
            return normal_colors(splats.rest.normals, splats.linear)
        if pose is None:  # moved as a whole, if at all
            return ramp(STRAIN_STOPS, np.zeros(len(splats)))
        deformer = own.shape.puppet.deformer
        strain, binding = deformer.strain(pose), deformer.binding
        if len(binding.weights) != len(splats):  # some were split
            from objectmorpher_core.deform.binding import bind

            binding = bind(splats.rest.means, deformer.points, deformer.graph)
        stretches = stretch(strain.most, strain.least)
        return strain_colors(stretches, binding.control_points, binding.weights)


def _measured(objects: list[PosedSplats]) -> DepthRange:
    """Of the sides that face the camera: backs are not seen."""
    depths = []
    for splats in objects:
        normals = moved_normals(splats.rest.normals, splats.linear)
        is_seen = (normals * splats.means).sum(1) < 0
        depths.append(splats.means[is_seen if is_seen.any() else slice(None), 2])
    lifted = [splats.rest.lifted for splats in objects]
    return depth_range(np.concatenate(depths), max(o.diameter * o.scale for o in lifted))


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
    """The depths that the first and the last colour stand for."""

    near: float  # world units along z
    far: float
    diameter: float  # of the object, world units

    @property
    def half(self) -> float:
        """Object diameters from the middle of the range to its ends."""
        return (self.far - self.near) / (2 * self.diameter)


def depth_range(depths: np.ndarray, diameter: float) -> DepthRange:
    """Return the range of these `depths` (N,)."""
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
