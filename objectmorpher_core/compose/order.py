"""Which objects an edit draws, and in which order: the same in the view and the export."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..base.arrays import F64, Mask
from ..base.camera import Camera
from ..document.model import Document, EditObject, Matte
from ..document.placement import down_of
from ..raster.posed import PosedSplats
from .light.defocus import reach_of
from .plate.plate import hole_margin

MOSTLY = 0.5  # of a moved object: what hides more of it is hardly what was meant to
FRAMED = 3  # sides of the photo: what touches so many is its background
ALONG = 0.1  # of a side's length, from which it is touched
SHADOW = 0.5  # x an object's size, how far the edge of its shadow reaches
EDGE = 4.0  # x the spacing of the Gaussians, how far an object reaches around their means
DIGITS = 2  # of a row: what differs less is alike
FLAT = 0.3  # x its width, that what lies flat is high at most
LEAST_BELOW = 0.1  # x the photo's height, from the horizon down to what stands
Bounds = tuple[float, float, float, float]  # x0, y0, x1, y1 px of the photo
Posed = Callable[[int], PosedSplats]
Stack = dict[int, PosedSplats | None]  # None: drawn by its matte, it was never lifted


def stack(document: Document, posed: Posed) -> Stack:
    """Return the objects' indices in drawing order over the plate, back to front.

    These are the moved objects, also the hidden ones, whose holes show; and objects at rest, and
    what stays in front, where a moved one comes near, which may hide them or be hidden by them.
    `posed` gives an object's Gaussians where the edit has put them. Of copies that all rest, one
    is drawn.
    """
    objects = document.objects
    moved = {k: posed(k) for k, item in enumerate(objects) if item.is_moved}
    there: Stack = dict(moved)
    resting = [k for k, o in enumerate(objects) if _rests(o, o) or stands_in_front(o)]
    if resting and moved:
        reach = [_reach(document, k, splats) for k, splats in moved.items()]
        for k in resting:
            item = objects[k]
            is_second = any(_rests(other, item) for other in objects[:k])
            if item.matte and not is_second and any(_meet(item.matte.box, b) for b in reach):
                there[k] = None if item.stays_in_front else posed(k)
    return {k: there[k] for k in back_to_front(document, there)}


def stands_in_front(item: EditObject) -> bool:
    """Whether it covers what is edited, as it does in the photo."""
    return item.stays_in_front and item.matte is not None and item.is_visible and not item.is_moved


def doubt_about_front(document: Document, k: int, posed: Posed) -> str | None:
    """Return a doubt about object `k` as something in front, in words that follow its name.

    It hides most of what was moved, or touches three sides of the photo: both happen where a click
    has taken the background. `posed` gives a moved object's Gaussians where the edit has put them.
    """
    mask = document.objects[k].mask
    if mask is None:
        return None
    for number, item in enumerate(document.objects):
        if item.is_moved and item.is_visible:
            share = _hidden(mask, posed(number), document.photo.camera)
            if share > MOSTLY:
                return f"hides {share:.0%} of {item.name}"
    edges = (mask[0], mask[-1], mask[:, 0], mask[:, -1])
    touched = sum(float(edge.mean()) > ALONG for edge in edges)
    return f"touches {touched} sides of the photo" if touched >= FRAMED else None


def _hidden(mask: Mask, splats: PosedSplats, camera: Camera) -> float:
    """Return the share of an object's Gaussians within the photo that lie behind `mask` (H, W)."""
    height, width = mask.shape
    means = splats.means[splats.means[:, 2] > 0]
    x, y = np.floor(camera.project(means)).astype(np.int64).T
    is_seen = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return float(mask[y[is_seen], x[is_seen]].mean()) if is_seen.any() else 0.0


def back_to_front(document: Document, splats: Mapping[int, PosedSplats | None]) -> list[int]:
    """Return the keys of `splats` by layer, and within a layer by where they stand.

    The nearer is in front: what stands lower in the picture, and what stands on a plate is nearer
    than that. Of two alike the later is in front: a copy that was moved aside. What has no
    Gaussians, because it is to stay in front, is the nearest.
    """
    if len(splats) < 2:  # as in most drags
        return list(splats)
    objects, rows = document.objects, _rows(document, splats)
    return sorted(splats, key=lambda k: (objects[k].layer, rows[k], k))


def _rows(document: Document, splats: Mapping[int, PosedSplats | None]) -> dict[int, float]:
    """Photo px: the row in which each object stands; the lower it is, the nearer.

    A lift knows no distance, but all feet are on one ground. What floats, as the artist says, is
    where a foot would be seen at its depth, on the ground of the first that stands.
    """
    objects, camera = document.objects, document.photo.camera
    standing = [o.lifted for o in objects if o.lifted and not o.is_visitor and not o.is_floating]
    ground, below, depth = 0.0, float(camera.height), 1.0
    if standing:
        nodes = standing[0].world_points(standing[0].control_points)
        ground, depth = _row(nodes, camera, np.max), float(np.median(nodes[:, 2]))
        horizon = camera.height / 2 if document.horizon is None else document.horizon
        below = max(ground - horizon, LEAST_BELOW * camera.height)
    rows = {}
    for k, own in splats.items():
        if own is None:
            rows[k] = np.inf
        elif objects[k].is_floating:
            middle = max(float(np.median(own.nodes[:, 2])), 1e-9)
            rows[k] = round(ground + below * (depth / middle - 1), DIGITS)
        else:
            is_flat = _lies_flat(objects[k], document, own.nodes)
            # What stands on a plate is in front of it: that is where its far edge is.
            rows[k] = round(_row(own.nodes, camera, np.min if is_flat else np.max), DIGITS)
    return rows


def _lies_flat(item: EditObject, document: Document, nodes: F64) -> bool:
    """Whether it is known to lie as a plate does; `nodes` (N, 3) world are its points."""
    down = None if item.lifted is None else down_of(item, document)
    if down is None:
        return False
    own = nodes - nodes.mean(0)
    heights = own @ down
    around = own - np.outer(heights, down)
    _, narrow, _ = np.sqrt(np.linalg.eigvalsh(around.T @ around / len(own)).clip(0))
    return float(heights.std()) < FLAT * float(narrow)


def _row(nodes: F64, camera: Camera, end: Callable[[F64], float]) -> float:
    """Px: the row at an `end` of those where points (N, 3) are seen; inf around the camera."""
    if (nodes[:, 2] <= 0).any():
        return np.inf
    return float(end(camera.project(nodes)[:, 1]))


def reordered(document: Document, k: int, order: Sequence[int], posed: Posed) -> Document:
    """The document with layers such that these objects are drawn in `order`, back to front.

    Object `k` is the one that was put elsewhere; other layers are raised only where they must be.
    """
    objects = list(document.objects)
    there = {i: None if stands_in_front(objects[i]) else posed(i) for i in order}
    rows = _rows(document, there)

    def is_nearer(one: int, other: int) -> bool:
        return (rows[one], one) > (rows[other], other)

    def least(below: int, above: int) -> int:
        """The lowest layer of `above` that puts it in front of `below`."""
        return objects[below].layer + (0 if is_nearer(above, below) else 1)

    place = list(order).index(k)
    if place > 0:
        objects[k] = replace(objects[k], layer=least(order[place - 1], k))
    elif len(order) > 1:
        above = order[1]
        lower = 0 if is_nearer(above, k) else 1
        objects[k] = replace(objects[k], layer=objects[above].layer - lower)
    for below, above in pairwise(order):
        objects[above] = replace(
            objects[above], layer=max(objects[above].layer, least(below, above))
        )
    return replace(document, objects=tuple(objects), refined=None)


def brought_into_sight(document: Document, k: int, posed: Posed) -> Document:
    """The document with object `k` in front of others, where they hide most of it.

    What is to stay in front stays there.
    """
    objects, camera = document.objects, document.photo.camera
    seen = [i for i, o in enumerate(objects) if o.lifted is not None and o.is_visible]
    order = back_to_front(document, {i: posed(i) for i in seen})
    own = posed(k)
    before = order[order.index(k) + 1 :]
    hidden = {i: _behind(own, posed(i), camera) for i in before if not stands_in_front(objects[i])}
    if not hidden or np.mean(np.any(list(hidden.values()), axis=0)) <= MOSTLY:
        return document
    last = max(order.index(i) for i, points in hidden.items() if points.any())
    order = [*order[: last + 1], k, *order[last + 1 :]]
    order.remove(k)
    return reordered(document, k, order, posed)


def _behind(own: PosedSplats, other: PosedSplats, camera: Camera) -> Mask:
    """(N,) which points of an object are seen where another one is."""
    depth = max(float(np.median(other.means[:, 2])), 1e-9)
    cell = max(EDGE * other.rest.spacing * other.scale * camera.focal / depth, 1.0)
    cells = []
    for splats in (own, other):
        xy = np.floor(camera.project(splats.means) / cell).clip(-1e6, 1e6).astype(np.int64)
        cells.append(np.where(splats.means[:, 2] > 0, xy[:, 0] + (xy[:, 1] << 32), -1))
    return np.isin(*cells)


def leaves_a_hole(objects: tuple[EditObject, ...], k: int) -> bool:
    """Whether nothing stands where object `k` was in the photo: no copy of it at rest."""
    item = objects[k]
    if item.is_visitor:
        return False
    return not any(_rests(other, item) for i, other in enumerate(objects) if i != k)


def holes(document: Document) -> tuple[Matte, ...]:
    """Return the places of the photo that objects have left."""
    objects = document.objects
    return tuple(
        item.matte
        for k, item in enumerate(objects)
        if item.is_moved and item.matte is not None and leaves_a_hole(objects, k)
    )


def _rests(other: EditObject, item: EditObject) -> bool:
    """Whether `other` is a copy of `item`, or it itself, where it was in the photo."""
    return other.mask is item.mask and other.lifted is not None and not other.is_moved


def _reach(document: Document, k: int, splats: PosedSplats) -> Bounds:
    """All of the photo that a moved object can change."""
    item, camera = document.objects[k], document.photo.camera
    assert item.matte is not None
    x0, y0, x1, y1 = (float(v) for v in item.matte.box)
    means = splats.means
    if item.is_visible and (means[:, 2] > 0).all():
        xy = camera.project(means)
        zoom = camera.focal / float(means[:, 2].min())  # px per world unit, the largest
        edge = EDGE * splats.rest.spacing * splats.scale * zoom
        x, y = xy.T
        x0, y0 = min(x0, float(x.min()) - edge), min(y0, float(y.min()) - edge)
        x1, y1 = max(x1, float(x.max()) + edge), max(y1, float(y.max()) + edge)
    elif item.is_visible:
        x0, y0, x1, y1 = -np.inf, -np.inf, np.inf, np.inf
    margin = hole_margin(camera.width, camera.height) + reach_of(item.finish.blur)
    if item.is_visible and item.shadow.strength > 0:  # which may fall on what it comes near
        margin += (item.shadow.length + SHADOW) * max(x1 - x0, y1 - y0)
    return x0 - margin, y0 - margin, x1 + margin, y1 + margin


def _meet(a: tuple[int, int, int, int], b: Bounds) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
