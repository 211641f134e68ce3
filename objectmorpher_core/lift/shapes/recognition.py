"""Which explicit shape an object is, how surely, and where."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from ...arrays import F64, Mask
from ...camera import Camera
from ...distances import nearest_in
from ..shape_look import SeenShape
from ..silhouette import Silhouette
from .boxes import fit_box
from .drawing import Grid, Mesh, drawn
from .evidence import Evidence, Misfit
from .flats import fit_flat
from .round import fit_ellipsoid, fit_revolution

SHEET = 0.012  # x extent: half of a flat thing's thickness
REACH = 0.03  # x extent, over which a shape gives way to what sticks out beside it
STRAY = 3.0  # errors of the front, from which a place is something else
WEIGHTS = (3.0, 0.5, 0.5)  # of outline, depth and normals, in a description
PROFILE = 0.4  # of a description: a surface of revolution may have any profile
LONGEST = 2.8  # description, of which half are what they are said to be
OUTLINED = 0.4  # misfit of an outline that is surely a box's
SECOND = 0.1  # x what is seen of a box, of its second side
WIDTH = 0.35  # of descriptions, over which that changes


@dataclass(frozen=True, eq=False)
class Recognised:
    """An explicit shape and how much it is believed, in [0, 1]."""

    kind: str  # of KINDS
    misfit: Misfit
    weight: float
    evidence: Evidence
    mesh: Mesh | None = None
    plane: F64 | None = None

    def over(self, outline: Silhouette, camera: Camera) -> Places:
        """The shape on the cells of a silhouette."""
        first = (outline.photo_xy(np.zeros(2)) - [camera.cx, camera.cy]) / camera.focal
        grid = Grid((float(first[0]), float(first[1])), outline.cell / camera.focal, outline.shape)
        if self.plane is not None:
            rays = np.concatenate([grid.tangents, np.ones((*grid.shape, 1))], -1)
            near = np.maximum(rays @ self.plane, 0.3 * float(np.median(rays @ self.plane)))
            return Places(1 / near, 1 / near, np.ones(outline.shape), self.weight)
        assert self.mesh is not None
        seen = drawn(self.mesh, grid)
        met = (seen.near > 0) & outline.inside
        if not met.any():
            return Places(*np.ones((2, *outline.shape)), np.zeros(outline.shape), 0.0)
        nearest = nearest_in(met)
        near, far = (1 / field.ravel()[nearest] for field in (seen.near, seen.far))
        gap = cv2.distanceTransform((~met).astype(np.uint8), cv2.DIST_L2, 3) * outline.cell
        share = np.clip(2 - gap / (REACH * outline.extent), 0, 1)
        return Places(near, far, share, self.weight)


@dataclass(frozen=True, eq=False)
class Places:
    """A shape over cells (h, w), depths in units of its own."""

    near: F64
    far: F64
    share: F64  # in [0, 1], of a place that is the shape's
    weight: float


def recognised(seen: SeenShape, kind: str = "auto") -> Recognised | None:
    """The shape of what is seen; None where it is none of these.

    `kind`: "auto", or what the artist says it is: "round", "flat", "box".
    """
    evidence = Evidence.of(seen)
    if evidence.sure.sum() < 20:
        return None
    core = evidence.core()
    found = []
    if kind in ("auto", "flat"):
        plane, misfit = fit_flat(evidence)
        found.append(Recognised("flat", misfit, _flatness(evidence, misfit), evidence, None, plane))
    if kind in ("auto", "round"):
        found += _solid("round", fit_ellipsoid, core) + _solid("round", fit_revolution, core, PROFILE)
    if kind in ("auto", "box"):
        found += _solid("box", fit_box, core)
    if not found:
        return None
    if kind == "auto" and any(_shows_sides(each) for each in found):
        found = [each for each in found if each.kind != "flat"]
    best = max(found, key=lambda each: each.weight)
    if kind == "auto" and best.weight < 0.05:
        return None
    return best


def _shows_sides(found: Recognised) -> bool:
    """Whether it is a box of which more than one side is seen for sure: no sheet has corners so."""
    if found.kind != "box" or found.misfit.outline > OUTLINED or found.mesh is None:
        return False
    seen = drawn(found.mesh, found.evidence.grid)
    shares = np.bincount(seen.face[seen.face >= 0] // 2, minlength=6)
    return bool(np.sort(shares)[-2] > SECOND * shares.sum())


Fit = Callable[[Evidence], tuple[Mesh, Misfit] | None]


def _solid(kind: str, fit: Fit, evidence: Evidence, more: float = 0.0) -> list[Recognised]:
    found = fit(evidence)
    if found is None:
        return []
    mesh, misfit = found
    total = sum(w * m for w, m in zip(WEIGHTS, misfit, strict=True)) + more
    weight = 1 / (1 + np.exp(np.clip((total - LONGEST) / WIDTH, -30, 30)))
    return [Recognised(kind, misfit, float(weight), evidence, mesh)]


def _flatness(evidence: Evidence, misfit: Misfit) -> float:
    """How surely it is a sheet, in [0, 1]."""
    size = float(np.sqrt(evidence.mask.sum())) * evidence.grid.step * float(
        np.median(evidence.depth[evidence.sure]))
    thick = float(np.median(evidence.thick[evidence.sure])) / size
    normals = evidence.normal[evidence.sure]
    spread = 1 - float(np.linalg.norm(normals.mean(0)))
    doubt = (thick - 0.3) / 0.05 + (spread - 0.1) / 0.02
    return float(1 / (1 + np.exp(np.clip(doubt, -30, 30))))
