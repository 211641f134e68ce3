"""A relief that follows the depth which a network finds in the photo.

A monocular network tells inverse depth, of which neither scale nor shift is known. Both are found
so that the object bulges as much as its silhouette says: a plane is taken off either side first,
because how the object is slanted is just what a silhouette does not tell. The difference between
the two then goes into the relief in two parts. Its values along the rim are spanned by a membrane,
which moves the middle sheet, and the rest is detail of the front. At the rim there is no detail:
there the front still meets the back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.linalg import spsolve

from ...base.arrays import F32, F64, Mask
from .body import ReliefBody
from .canvas import bilinear
from .silhouette import ReliefSilhouette

RIM = (
    0.01,
    0.035,
)  # x extent from the outline: there the rim's depth is read; nearer it blurs
LEAST_CELLS = 30  # that are needed to align anything
HUBER = 1.5  # x the median deviation, from which on a cell pulls less
ROUNDS = 6
FLAT = 0.05  # x the spread of what the network sees, that counts as bulge even of a board
DOUBT = (0.0, 0.3)  # correlation with the silhouette's bulge: ignored, and believed
NEAREST, FARTHEST = 1.6, 0.6  # relative inverse depth that is not exceeded
THINNEST = 0.15  # x its half-thickness, that stays of the front wherever the depth goes
STIFF = 3.0  # x the membrane's own stiffness, of what holds it at its rim
COARSE = 96  # cells on the longer side of the grid on which the membrane is spanned


@dataclass(frozen=True, eq=False)
class NetworkDepth:
    """A network's depth of the object and its surroundings."""

    inverse: F32  # (h, w) relative inverse depth: larger is nearer, scale and shift unknown
    box: tuple[int, int, int, int]  # x0, y0, x1, y1 px of the photo that it covers

    def at(self, xy: F64) -> F64:
        """(...) at photo px (..., 2), clamped to the box."""
        x0, y0, x1, y1 = self.box
        h, w = self.inverse.shape
        own = (xy - [x0, y0]) * [w / (x1 - x0), h / (y1 - y0)] - 0.5
        return bilinear(self.inverse, own.reshape(-1, 2)).reshape(xy.shape[:-1])


def follow(
    body: ReliefBody, seen: NetworkDepth, focal: float, thickness: float, hidden: Mask | None
) -> ReliefBody:
    """`body`, whose thickness was multiplied by `thickness`, as deep as `seen` says.

    `hidden` (h, w) cells of its silhouette of which the photo shows something else.
    """
    outline = body.silhouette
    half, _ = body.front.sample(outline.cells.reshape(-1, 2), outline.cell)
    half = half.reshape(outline.shape) / thickness  # px, as the silhouette says
    relief = body.middle + half
    inverse = seen.at(outline.photo_xy(outline.cells))
    extent = outline.extent
    is_inner = outline.inside & (outline.depth > RIM[0] * extent)
    if hidden is not None:
        is_inner &= ~hidden
    aligned = align(inverse, 1 / (1 - relief / focal), is_inner)
    if aligned is None:
        return body
    gap = aligned.trust * (focal * (1 - 1 / aligned.inverse) - relief)
    rim = is_inner & (outline.depth < RIM[1] * extent)
    moved = membrane(gap, rim if rim.any() else is_inner, outline)
    share = np.clip(outline.depth / (RIM[1] * extent), 0, 1)
    if hidden is not None:
        share = share * _away(hidden, RIM[1] * extent / outline.cell)
    detail = np.where(is_inner, (gap - moved) * share, 0.0)
    detail = np.maximum(cv2.GaussianBlur(detail, (0, 0), 1.0), (THINNEST - 1) * half)
    return replace(body, middle=body.middle + moved, detail=thickness * detail, solid=None)


@dataclass(frozen=True, eq=False)
class Aligned:
    """A network's depth in the relief's units."""

    inverse: F64  # (h, w) relative inverse depth, 1 amid the relief
    alike: float  # correlation of the two bulges

    @property
    def trust(self) -> float:
        """Return the trust in it, in [0, 1]; 0 where it contradicts the silhouette."""
        return float(np.clip((self.alike - DOUBT[0]) / (DOUBT[1] - DOUBT[0]), 0, 1))


def align(seen: F64, relief: F64, is_known: Mask) -> Aligned | None:
    """`seen` (h, w) scaled by s >= 0 and shifted to `relief` (h, w), both inverse depths.

    Both are fitted where `is_known` (h, w), robustly. None where that is too little, or
    `seen` is flat.
    """
    rows, columns = np.nonzero(is_known)
    if len(rows) < LEAST_CELLS:
        return None
    s, r = seen[rows, columns], relief[rows, columns]
    spread = float(np.std(s))
    if not np.isfinite(spread) or spread <= 1e-9 * max(float(np.abs(s).max()), 1e-30):
        return None
    s = (s - np.median(s)) / spread
    plane = np.column_stack([rows, columns, np.ones(len(rows))]).astype(np.float64)
    weight = np.ones(len(rows))
    scale = alike = 0.0
    for _ in range(ROUNDS):
        bulges = [values - plane @ _fitted(plane, values, weight) for values in (s, r)]
        own, theirs = (float((weight * b * b).sum() / weight.sum()) for b in bulges)
        both = float((weight * bulges[0] * bulges[1]).sum() / weight.sum())
        scale = np.sqrt(theirs / (own + FLAT**2))
        alike = both / max(np.sqrt(own * theirs), 1e-30)
        off = np.abs(scale * bulges[0] - bulges[1])
        weight = np.minimum(1.0, HUBER * max(float(np.median(off)), 1e-12) / np.maximum(off, 1e-12))
    shift = float(np.median(r - scale * s))
    whole = scale * (seen - np.median(seen[rows, columns])) / spread + shift
    return Aligned(np.clip(whole, FARTHEST, NEAREST), alike)


def _fitted(basis: F64, values: F64, weight: F64) -> F64:
    """Coefficients of the weighted least squares fit."""
    own = (basis * weight[:, None]).T
    found = np.linalg.solve(own @ basis + 1e-9 * np.eye(basis.shape[1]), own @ values)
    return np.asarray(found, np.float64)


def membrane(values: F64, is_known: Mask, outline: ReliefSilhouette) -> F64:
    """(h, w) the smoothest sheet through `values` (h, w) where they are known."""
    h, w = outline.shape
    step = max(1, int(np.ceil(max(h, w) / COARSE)))
    size = -(-w // step), -(-h // step)
    weight = cv2.resize(is_known.astype(np.float64), size, interpolation=cv2.INTER_AREA)
    sums = cv2.resize(np.where(is_known, values, 0.0), size, interpolation=cv2.INTER_AREA)
    number = np.arange(size[0] * size[1]).reshape(size[1], size[0])
    pairs = [(number[:, 1:], number[:, :-1]), (number[1:], number[:-1])]
    a, b = (np.concatenate([pair[k].ravel() for pair in pairs]) for k in (0, 1))
    one, where = np.ones(len(a)), (np.r_[a, b, a, b], np.r_[b, a, a, b])
    springs = coo_array((np.r_[-one, -one, one, one], where), shape=(number.size,) * 2)
    held = coo_array((STIFF * weight.ravel(), (number.ravel(),) * 2))
    system = (csr_array(springs) + csr_array(held)).tocsc()
    sheet = np.asarray(spsolve(system, STIFF * sums.ravel()), np.float64).reshape(number.shape)
    return np.asarray(cv2.resize(sheet, (w, h), interpolation=cv2.INTER_CUBIC), np.float64)


def _away(hidden: Mask, reach: float) -> F64:
    """(h, w) 0 where hidden, 1 beyond `reach` cells from there."""
    far = cv2.distanceTransform((~hidden).astype(np.uint8), cv2.DIST_L2, 5)
    return np.clip(far.astype(np.float64) / reach, 0, 1)
