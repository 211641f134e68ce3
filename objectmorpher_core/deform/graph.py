"""The deformable graph on the control points (paper 3.2.1)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import KDTree

from ..base.arrays import F64, I32, Mask
from ..document.rig import Seam
from ..document.settings import DeformSettings
from .surface_links import (
    CHUNK,
    TINY,
    Cells,
    PointPairs,
    SolidSurface,
    find_struts,
    weigh_struts,
    without_gaps,
)

AUXILIARY_RADIUS = 2.0  # x mean nearest-neighbour distance, paper 3.2.1
LINK_RADIUS = 0.3  # x diameter, paper 3.2.1
FALLOFF = 2.0  # x mean nearest-neighbour distance: the reach of a link's weight
REACH = 3.0  # x falloff: a longer link would weigh 1 % of a short one
NEIGHBOURS = 16  # control points along the surface that skinning chooses among
SOFTEST, STIFFEST = 0.25, 4.0  # x the usual radius of the links
USUAL = DeformSettings()


@dataclass(frozen=True, eq=False)
class ControlGraph:
    """Links between control points, and distances along the surface."""

    weights: csr_array  # (M, M) symmetric, sorted, no diagonal and no stored zeros
    auxiliary: csr_array  # (M, M) symmetric, lengths of the auxiliary edges, object units
    neighbours: I32  # (M, min(16, M)) nearest along the surface, itself first; -1: no more
    components: I32  # (M,) component of each control point
    mean_spacing: float  # object units, mean nearest-neighbour distance
    cells: Cells | None = None  # which control point a place belongs to, where that is a question

    @property
    def link_count(self) -> int:
        """Links, each counted once."""
        return self.weights.nnz // 2

    @property
    def component_count(self) -> int:
        return int(self.components.max()) + 1

    def distances_from(self, control_point: int) -> F64:
        """(M,) object units along the surface, inf on other parts."""
        return dijkstra(self.auxiliary, indices=control_point)


def build_graph(
    points: np.ndarray,
    settings: DeformSettings = USUAL,
    surface: SolidSurface | None = None,
    seams: tuple[Seam, ...] = (),
) -> ControlGraph:
    """Build the paper's graph on control points (M, 3), object frame.

    An auxiliary graph joins points closer than twice the mean spacing; shortest paths on it are
    the geodesics; points within 0.3 diameters along the surface are linked, or within six
    spacings where that is nearer: a longer link would weigh nothing. `settings.links` "euclidean"
    is the ablation that links by straight distance. Weights are exp(-g^2 / 2 s^2), and symmetric,
    so that the Laplacian is too. s is twice the mean spacing: the object
    behaves like a continuous body, and a dragged point takes its surroundings along. With
    `settings.is_faithful` it is the mean length of a link, some five spacings: then every point
    is tied to so many far ones that a dragged one leaves its neighbours behind, and makes a spike.
    `settings.stiffness` scales the radius of the links, and s with it. Auxiliary edges are links
    whatever the radius, so the links never split a part.

    With a `surface` struts join opposite sides of the body (`struts.py`), and auxiliary edges
    that bridge a gap, as between an arm and the body beside it, are left out: neither of the
    paper's two rules tells them apart. `seams` cut and glue by hand: glue bridges a gap, and a
    cut wins over everything. Raises ValueError for points that are not finite, a seam of other
    control points, and settings that do not exist.
    """
    _check(points, settings, seams)
    centre = points.mean(0, dtype=np.float64)
    p = points - centre  # far from the origin digits would be lost
    spacing = _mean_spacing(p)
    edges = PointPairs.within(p, AUXILIARY_RADIUS * spacing, TINY * spacing)
    solid = cells = None
    if surface is not None and len(surface.means) and not settings.is_faithful:
        solid = SolidSurface(surface.means - centre, surface.normals)
        edges, cells = without_gaps(edges, p, spacing, solid)
    edges = _sewn(edges, p, spacing, seams)
    auxiliary = edges.matrix(len(p), edges.lengths)
    diameter = _diameter(p)
    radius = LINK_RADIUS * diameter
    if not settings.is_faithful:
        radius = min(radius, REACH * FALLOFF * spacing)
    radius *= settings.stiffness
    links, neighbours = _along(auxiliary, radius, spacing)
    missing = edges.where(edges.lengths > radius)
    if settings.links == "euclidean":
        links, missing = PointPairs.within(p, radius, TINY * spacing), edges
    links = links.and_also(missing, len(p)) if len(missing) else links
    links = links.where(~_is_cut(links, len(p), seams))
    weights = _weights(links, len(p), spacing, settings)
    components = connected_components(weights, directed=False)[1]
    if solid is not None and settings.links == "geodesic":
        struts = find_struts(p, spacing, LINK_RADIUS * diameter, solid)
        is_within = components[struts.first] == components[struts.second]
        weights = _braced(weights, struts.where(is_within & ~_is_cut(struts, len(p), seams)))
    if cells is not None:
        cells = replace(cells, points=cells.points + centre)
    return ControlGraph(weights, auxiliary, neighbours, components.astype(np.int32), spacing, cells)


def _braced(weights: csr_array, struts: PointPairs) -> csr_array:
    """`weights` (M, M), and where a strut is the larger of its own and the link's."""
    if len(struts) == 0:
        return weights
    degree = np.asarray(weights.sum(1)).ravel()
    return csr_array(weights.maximum(struts.matrix(len(degree), weigh_struts(struts, degree))))


def _weights(links: PointPairs, count: int, spacing: float, settings: DeformSettings) -> csr_array:
    """(M, M) exp(-g^2 / 2 s^2) of the links between `count` control points."""
    falloff = FALLOFF * settings.stiffness * spacing
    if settings.is_faithful and len(links):
        falloff = float(links.lengths.mean())
    # A link beyond the reach, an auxiliary edge, must hold its part together all the same.
    weights = np.exp(-(np.minimum(links.lengths / falloff, REACH) ** 2) / 2)
    return links.matrix(count, weights)


def _check(points: np.ndarray, settings: DeformSettings, seams: tuple[Seam, ...]) -> None:
    """Raises ValueError for what no graph can be built of."""
    if settings.links not in ("geodesic", "euclidean"):
        raise ValueError(f"links must be geodesic or euclidean, not {settings.links!r}")
    if not SOFTEST <= settings.stiffness <= STIFFEST:
        limits = f"between {SOFTEST:g} and {STIFFEST:g}"
        raise ValueError(f"stiffness must be {limits}, not {settings.stiffness:g}")
    if len(points) < 2:
        raise ValueError(f"a graph needs at least two control points, not {len(points)}")
    if not np.isfinite(points).all():
        raise ValueError("the control points hold values that are not finite")
    for seam in seams:
        both = np.concatenate([seam.first, seam.second])
        if len(both) and (both.min() < 0 or both.max() >= len(points)):
            raise ValueError(f"a seam names control points that are not among the {len(points)}")


def _mean_spacing(points: F64) -> float:
    """Mean distance of points (M, 3) to their nearest neighbours; coincident ones count once."""
    nearest = KDTree(points).query(points, k=2)[0][:, 1]
    if not nearest.all():
        distinct = np.unique(points, axis=0)
        if len(distinct) == 1:
            return 1.0  # any length will do
        nearest = KDTree(distinct).query(distinct, k=2)[0][:, 1]
    return float(nearest.mean())


def _diameter(points: F64) -> float:
    """Largest distance between two of points (M, 3) around the origin (paper's D_scene)."""
    squares = (points * points).sum(1)
    largest = 0.0
    for start in range(0, len(points), CHUNK):
        own = slice(start, start + CHUNK)
        farthest = (squares - 2 * (points[own] @ points.T)).max(1)
        largest = max(largest, float((squares[own] + farthest).max()))
    return float(np.sqrt(largest))


def _sewn(edges: PointPairs, points: F64, spacing: float, seams: tuple[Seam, ...]) -> PointPairs:
    """The auxiliary edges with those of glue, and without those that are cut."""
    for seam in seams:
        if not (seam.is_glued and len(seam.first) and len(seam.second)):
            continue
        second, first = seam.second, seam.first
        there = second[KDTree(points[second]).query(points[first])[1]]
        back = first[KDTree(points[first]).query(points[second])[1]]
        a, b = np.concatenate([first, second]), np.concatenate([there, back])
        a, b = np.minimum(a, b)[a != b], np.maximum(a, b)[a != b]
        edges = edges.and_also(PointPairs(a, b, np.full(len(a), spacing)), len(points))
    return edges.where(~_is_cut(edges, len(points), seams))


def _is_cut(edges: PointPairs, count: int, seams: tuple[Seam, ...]) -> Mask:
    """(E,) whether an edge on `count` control points crosses a cut."""
    crosses = np.zeros(len(edges), bool)
    for seam in seams:
        if not seam.is_glued:
            first, second = np.zeros((2, count), bool)
            first[seam.first], second[seam.second] = True, True
            crosses |= first[edges.first] & second[edges.second]
            crosses |= second[edges.first] & first[edges.second]
    return crosses


def _along(auxiliary: csr_array, radius: float, spacing: float) -> tuple[PointPairs, I32]:
    """Pairs within `radius` along the surface, and each control point's nearest (M, 16)."""
    parts = connected_components(auxiliary, directed=False)[1]
    count = len(parts)
    wanted = np.minimum(np.bincount(parts)[parts], NEIGHBOURS)
    neighbours = np.empty((count, min(NEIGHBOURS, count)), np.int32)
    limit = usual = max(radius, REACH * FALLOFF * spacing)
    found: list[PointPairs] = []
    rows = np.arange(count)
    while len(rows):
        for start in range(0, len(rows), CHUNK):
            own = rows[start : start + CHUNK]
            distances = dijkstra(auxiliary, indices=own, limit=limit)
            neighbours[own] = _nearest(distances, neighbours.shape[1])
            if limit == usual:
                i, j = np.nonzero((distances <= radius) & (np.arange(count) > own[:, None]))
                found.append(PointPairs(own[i], j, distances[i, j]))
        # On a thin limb sixteen neighbours are far: once more for those who miss some.
        rows = np.flatnonzero((neighbours >= 0).sum(1) < wanted)
        limit *= 2
    first, second = (np.concatenate([getattr(e, k) for e in found]) for k in ("first", "second"))
    return PointPairs(first, second, np.concatenate([e.lengths for e in found])), neighbours


def _nearest(distances: F64, count: int) -> I32:
    """The `count` columns (R, count) of least distance (R, M) in each row; -1 where it is inf."""
    nearest = np.sort(np.argpartition(distances, count - 1, axis=1)[:, :count], axis=1)
    of_them = np.take_along_axis(distances, nearest, 1)
    order = np.argsort(of_them, axis=1, kind="stable")
    is_reached = np.isfinite(np.take_along_axis(of_them, order, 1))
    return np.where(is_reached, np.take_along_axis(nearest, order, 1), -1).astype(np.int32)
