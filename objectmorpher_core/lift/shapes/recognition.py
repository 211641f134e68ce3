"""Which explicit shape an object is, how surely, and where."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import F64, Mask
from ...base.camera import Camera
from ...base.poisson_disk import nearest_in
from ..relief.canvas import carried_on
from ..relief.shape_look import SeenShape
from ..relief.silhouette import ReliefSilhouette
from .boxes import fit_box, fit_flat
from .drawing import Drawn, Mesh, RayGrid, drawn
from .evidence import Evidence, Misfit
from .round import fit_ellipsoid, fit_revolution, fit_ring

SHEET = 0.012  # x extent: half of a flat thing's thickness
BEYOND = 2.0  # cells from a shape's own outline, up to which its sides go on
REACH = 0.03  # x extent, over which a shape gives way to what sticks out beside it
# Of a shape's description: outline, depth and normals, each 1 where it is as far off as expected;
# what of the mask it leaves out; and that a surface of revolution may have any profile. The outline
# counts most: the network's depth and normals are blurred, and rounder than what they are of.
WEIGHTS, LEFT_OUT, PROFILE = (3.0, 0.5, 0.5), 8.0, (0.1, 0.5)
LONGEST = 2.5  # description, of which half are what they are said to be
WIDTH = 0.25  # of descriptions, over which that changes
LEAST = 0.3  # weight, below which an object is free
WHOLE = 0.85  # weight, from which it is nothing but the shape
# Weight from which a thing is flat. A solid that is taken for a sheet loses 4 dB when it turns; a
# sheet that is left free is only puffed. Of forty solids none is above this, of forty sheets 29.
FLAT = 0.93
# Log odds of a sheet over a solid: the logarithms of its thickness as the network sees it, over the
# root of its area, and of the spread of its normals. By logistic regression on 150 made cut-outs
# and 200 made solids; 0.7 less than there, so that hardly a solid is taken for a sheet.
FLATNESS = (-2.71, -3.25, -12.6)
RECTANGLE = 1.5  # log odds, of an outline that is one in perspective
OUTLINED = 0.4  # misfit of an outline that is surely a box's
EXPLAINED = 0.95  # weight, from which no other shape is tried
STANDS, LYING = 0.5, 0.5  # weight of a shape that tells what is up, and cosine to the upright
LEAST_SURE = 20  # cells, from which anything is recognised
SECOND = 0.1  # x what is seen of a box, of its second side


@dataclass(frozen=True, eq=False)
class Recognised:
    """An explicit shape and how much it is believed, in [0, 1]."""

    kind: str  # round, flat or box
    misfit: Misfit
    weight: float
    evidence: Evidence
    mesh: Mesh | None = None
    plane: F64 | None = None  # (3,) of a sheet: see `flats`
    description: float = 0.0  # length, of a solid

    @property
    def up(self) -> F64 | None:
        """(3,) camera axes, unit: the axis along which it stands; None where it has none.

        Of a box it is the one that is nearest to the picture's upright.
        """
        if self.mesh is None or not len(self.mesh.axes) or self.weight < STANDS:
            return None
        up = self.mesh.axes[int(np.abs(self.mesh.axes[:, 1]).argmax())]
        up = -np.sign(up[1]) * up
        return up if -up[1] > LYING else None

    def over(self, outline: ReliefSilhouette, camera: Camera) -> PlacedShape:
        """The shape on the cells of a silhouette."""
        weight = min(self.weight / WHOLE, 1.0)
        first = (outline.photo_xy(np.zeros(2)) - [camera.cx, camera.cy]) / camera.focal
        grid = RayGrid(
            (float(first[0]), float(first[1])), outline.cell / camera.focal, outline.shape
        )
        if self.plane is not None:
            rays = np.concatenate([grid.tangents, np.ones((*grid.shape, 1))], -1)
            near = np.maximum(rays @ self.plane, 0.3 * float(np.median(rays @ self.plane)))
            return PlacedShape(1 / near, 1 / near, np.ones(outline.shape), weight)
        assert self.mesh is not None
        seen = drawn(self.mesh, grid)
        met = (seen.near > 0) & outline.inside
        if not met.any():
            ones = np.ones(outline.shape)
            return PlacedShape(ones, ones, 0 * ones, 0.0)
        near, far = (1 / field for field in _carried_on(seen, met))
        gap = cv2.distanceTransform((~met).astype(np.uint8), cv2.DIST_L2, 3) * outline.cell
        share = np.clip(2 - gap / (REACH * outline.extent), 0, 1)
        return PlacedShape(near, far, share, weight)


def _carried_on(seen: Drawn, met: Mask) -> tuple[F64, F64]:
    """Inverse depths (h, w) of both sides of a shape, also beside where rays have `met` (h, w) it.

    Each goes on as it is about to; beyond their common edge as the one that changes less.
    """
    nearest = nearest_in(met)
    first, last = (field.ravel()[nearest] for field in (seen.near, seen.far))
    near, far = (carried_on(field, met, BEYOND) for field in (seen.near, seen.far))
    changes = np.abs(near - first), np.abs(far - last)
    edge = (near * changes[1] + far * changes[0]) / np.maximum(sum(changes), 1e-12)
    is_crossed = (near < far) & ~met
    near, far = (np.where(is_crossed, edge, field) for field in (near, far))
    return near.clip(last.min(), first.max()), far.clip(last.min(), first.max())


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A shape over cells (h, w), depths in units of its own."""

    near: F64
    far: F64
    share: F64  # in [0, 1], of a place that is the shape's
    weight: float


def recognised(seen: SeenShape, kind: str = "auto") -> Recognised | None:
    """The shape of what is seen; None where it is none of these.

    `kind`: "auto", or what the artist says it is: "round", "flat" or "box".
    """
    evidence = Evidence.of(seen)
    if evidence.sure.sum() < LEAST_SURE or kind not in ("auto", "round", "flat", "box"):
        return None
    if kind != "auto":
        found = _sheet(evidence) if kind == "flat" else _solid(kind, evidence)
        return replace(found, weight=1.0)
    sheet, box = _sheet(evidence), _solid("box", evidence)
    # No sheet shows two sides.
    if sheet.weight >= FLAT and not _shows_sides(box):
        return sheet
    if _shows_sides(box) and box.weight > EXPLAINED:
        return box
    best = min(box, _solid("round", evidence), key=_length)
    return best if best.weight >= LEAST else None


def _length(found: Recognised) -> float:
    return found.description


def _sheet(evidence: Evidence) -> Recognised:
    plane, misfit = fit_flat(evidence)
    depth = float(np.median(evidence.depth[evidence.sure]))
    size = float(np.sqrt(evidence.mask.sum())) * evidence.grid.step * depth
    thick = max(float(np.median(evidence.thick[evidence.sure])) / size, 1e-3)
    spread = max(1 - float(np.linalg.norm(evidence.normal[evidence.sure].mean(0))), 1e-4)
    odds = FLATNESS[0] * np.log(thick) + FLATNESS[1] * np.log(spread) + FLATNESS[2]
    odds += RECTANGLE if evidence.is_four_cornered else 0.0
    return Recognised("flat", misfit, _believed(-float(odds)), evidence, None, plane)


def _solid(kind: str, evidence: Evidence) -> Recognised:
    """The best box, or the best round thing."""
    core = evidence.core()
    left_out = LEFT_OUT * (1 - float(core.mask.sum()) / float(evidence.mask.sum()))
    if kind == "box":
        return _described(kind, fit_box(core), evidence, left_out)
    if (ring := fit_ring(core)) is not None:
        return _described(kind, ring, evidence, left_out)
    fits = [_described(kind, fit_ellipsoid(core), evidence, left_out)]
    if fits[0].weight < EXPLAINED and (turned := fit_revolution(core)) is not None:
        more = left_out + PROFILE[0] + PROFILE[1] * turned[2]
        fits.append(_described(kind, turned[:2], evidence, more))
    return min(fits, key=_length)


def _described(
    kind: str, found: tuple[Mesh, Misfit], evidence: Evidence, more: float
) -> Recognised:
    mesh, misfit = found
    description = sum(w * m for w, m in zip(WEIGHTS, misfit[:3], strict=True)) + more
    weight = _believed((description - LONGEST) / WIDTH)
    return Recognised(kind, misfit, weight, evidence, mesh, None, description)


def _believed(doubt: float) -> float:
    """In [0, 1] of a log odds against."""
    return float(1 / (1 + np.exp(np.clip(doubt, -30, 30))))


def _shows_sides(found: Recognised) -> bool:
    """Whether it is surely a box of which more than one side is seen."""
    if found.misfit.outline > OUTLINED or found.mesh is None:
        return False
    seen = drawn(found.mesh, found.evidence.grid)
    shares = np.bincount(seen.face[seen.face >= 0] // 2, minlength=6)
    return bool(np.sort(shares)[-2] > SECOND * shares.sum())
