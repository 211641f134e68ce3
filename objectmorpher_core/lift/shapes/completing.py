"""A body that becomes the shape it was recognised as, where that explains it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ...base.arrays import F64, Mask
from ...base.camera import Camera
from ..relief.body import ReliefBody
from ..relief.cuts import Cuts
from ..relief.silhouette import ReliefSilhouette
from ..relief.thickness import Thickness
from .recognition import SHEET, PlacedShape, Recognised

STRAY = 0.2  # x extent, from which a front is something else than the shape's
ROUNDS = 4  # of a plane that is fitted to most of a front
SOFT = 0.02  # x extent, over which one gives way to the other
ALONG = 0.05  # x extent, over which a tube's middle is smoothed
INNER = 0.02  # x extent from the outline, nearer to which fronts are not compared


def completed(
    body: ReliefBody, shape: Recognised, camera: Camera, thickness: float, trust: float
) -> ReliefBody:
    """`body`, whose thickness was multiplied by `thickness`, as `shape` as far as that is sure.

    `trust` in [0, 1]: 0 leaves the body as it is. How far away it is the body says.
    """
    outline, focal = body.silhouette, camera.focal
    places = shape.over(outline, camera)
    half = body.front.half(outline.cells.reshape(-1, 2)).reshape(outline.shape)
    front = body.middle + half / thickness
    compared = outline.inside & (places.share > 0.5) & (outline.depth > INNER * outline.extent)
    if not compared.any():
        return body
    away = float(np.median(np.log((focal - front[compared]) / places.near[compared])))
    near, far = (focal - np.exp(away) * side for side in (places.near, places.far))
    if shape.plane is not None:
        share = np.full(outline.shape, trust * places.weight)
        return _sheet(body, near - SHEET * outline.extent, share, thickness)
    # How it leans the shape tells better than a network, also of what sticks out of it.
    lean = _plane(near - front, compared, outline)
    body = replace(body, middle=body.middle + trust * places.weight * lean)
    share = trust * _share(places, front + lean - near, body)
    half = 0.5 * (near - far)
    sides = [side.towards(thickness * half, share) for side in (body.front, body.back)]
    middle = body.middle + share * (near - half - body.middle)
    body = replace(body, middle=middle, front=sides[0], back=sides[1], kind=shape.kind)
    body = replace(body, up=body.up if shape.up is None else shape.up)
    return _whole(body, share)


def flattened(body: ReliefBody, thickness: float) -> ReliefBody:
    """`body` as a sheet that lies as its middle does."""
    return _sheet(body, body.middle, np.ones(body.silhouette.shape), thickness)


def rounded(body: ReliefBody, thickness: float) -> ReliefBody:
    """`body` as a tube: every cross-section of its outline is a circle (Blum 1967).

    Its front stays where it is, smoothed along.
    """
    outline = body.silhouette
    half = np.sqrt(Thickness.balls(outline))
    front = body.middle + body.front.half(outline.cells.reshape(-1, 2)).reshape(outline.shape)
    weight = half * outline.inside
    sigma = ALONG * outline.extent / outline.cell
    middle = cv2.GaussianBlur((front - half) * weight, (0, 0), sigma)
    middle /= np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-6)
    share = np.ones(outline.shape)
    sides = [side.towards(thickness * half, share) for side in (body.front, body.back)]
    body = replace(body, middle=middle, front=sides[0], back=sides[1], kind="tube")
    return _whole(body, share)


def _sheet(body: ReliefBody, middle: F64, share: F64, thickness: float) -> ReliefBody:
    half = np.full(share.shape, thickness * SHEET * body.silhouette.extent)
    sides = [side.mixed(half, share) for side in (body.front, body.back)]
    middle = body.middle + share * (middle - body.middle)
    body = replace(body, middle=middle, front=sides[0], back=sides[1], kind="flat")
    return _whole(body, share)


def _plane(field: F64, known: Mask, outline: ReliefSilhouette) -> F64:
    """(h, w) the plane nearest to most of `field` (h, w) where that is `known` (h, w)."""
    cells = np.concatenate([outline.cells, np.ones((*outline.shape, 1))], -1)
    own, values, weight = cells[known], field[known], np.ones(int(known.sum()))
    plane = np.zeros(3)
    for _ in range(ROUNDS):
        scaled = own * weight[:, None]
        plane = np.linalg.lstsq(scaled.T @ own, scaled.T @ values)[0]
        off = (values - own @ plane) / (STRAY * outline.extent)
        weight = 1 / (1 + off**2) ** 2
    return cells @ plane


def _whole(body: ReliefBody, share: F64) -> ReliefBody:
    """Without cuts where most of the body, `share` (h, w), is one shape."""
    cuts = None if body.cuts is None else _uncut(body.cuts, share > 0.5)
    own = None if cuts is None or body.own is None else 1 - (1 - share) * (1 - body.own)
    sides = [replace(side, cuts=cuts) for side in (body.front, body.back)]
    return replace(body, front=sides[0], back=sides[1], cuts=cuts, own=own)


def _share(places: PlacedShape, off: F64, body: ReliefBody) -> F64:
    """(h, w) how much of each cell is the shape's, whose front is `off` (h, w) px wrong."""
    outline = body.silhouette
    sigma = SOFT * outline.extent / outline.cell
    weight = outline.inside.astype(np.float64)
    smooth = cv2.GaussianBlur(off * weight, (0, 0), sigma)
    smooth = smooth / np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-6)
    explained = 1 / (1 + (smooth / (STRAY * outline.extent)) ** 4)
    return places.weight * places.share * explained


def _uncut(cuts: Cuts, is_whole: Mask) -> Cuts | None:
    """Without cuts within what is whole (h, w)."""
    down = cuts.down & ~(is_whole[1:] & is_whole[:-1])
    right = cuts.right & ~(is_whole[:, 1:] & is_whole[:, :-1])
    return Cuts(down, right) if down.any() or right.any() else None
