"""Which near control points have a gap between them.

The paper's auxiliary graph joins whatever is near. Between two control points on either side of a
gap the way along the object's surface is long, so it is measured: on the graph of the Gaussians,
much finer than that of the control points, in which two surfaces that face each other are not
joined. One search from all control points at once gives each Gaussian to its nearest one; the
shortest way between two control points is then found on the graph of these cells, which is never
too short, and exact where the way crosses no third cell (Mehlhorn 1988).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import KDTree

from ..base.arrays import F64, I32, Mask
from ..base.poisson_disk import thin_to_spacing

# Lengths are in mean spacings of the control points, of which there are `EVEN_COUNT` or more.
GRAIN = 0.15  # Gaussians nearer than this are thinned out: some 25 remain per control point
EVEN_COUNT = 512  # fewer control points: the grain stays what it is for so many
JOIN = 2.5  # x grain: Gaussians within it are neighbours; 2 would do for a surface without holes
SPARSE_JOIN = 1.25  # x distance to the sixth neighbour: of Gaussians at random, 9 are within it
WIDEST_JOIN = 1.0  # x mean spacing: sparser Gaussians tell nothing about the gaps
LEAST_CELL = 4  # Gaussians of a control point, from which its surroundings are known
DETOUR = 2.0  # x straight distance: along a crease of 60 degrees the way is as long
OUTSIDE = 0.0  # cosine of a normal and a link: from here on the link may leave the body
INSIDE = -0.5  # cosine of both normals and a link: up to here it runs through the body
THIN = -0.15  # the same where no gap is near: the sides of a thin wall, not of a contact
OPPOSED = -0.15  # cosine of the normals of two surfaces that may face each other
FACING = 0.3  # cosine of normal and link, from which a surface faces the link's other end
AWAY = -0.1  # cosine of both normals and the line between the two sides of a wall
CONTACT = -0.7  # cosine of the normals of two surfaces that touch without a crease
GAP_RINGS = 2  # neighbours of neighbours are near a gap, too
CHUNK = 256  # control points whose ways are held in memory together
ASKED = 6  # Gaussians near a place, of which the first on its side of the surface counts
TINY = 1e-9  # x mean spacing: coincident points; to scipy 0 is no edge


@dataclass(frozen=True, eq=False)
class SolidSurface:
    """The solid Gaussians between the control points."""

    means: np.ndarray  # (N, 3) object frame
    normals: np.ndarray  # (N, 3) outward, unit

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.means, balanced_tree=False, compact_nodes=False)

    def normals_near(self, points: F64, count: int = 1, within: float = np.inf) -> F64:
        """Normals (M, count, 3) of the Gaussians nearest to points (M, 3); 0 beyond `within`."""
        index = self._tree.query(points, count, distance_upper_bound=within)[1]
        index = index.reshape(len(points), count)
        normals = self.normals.take(index, 0, mode="clip").astype(np.float64)
        normals[index == len(self.normals)] = 0.0
        return normals


@dataclass(frozen=True, eq=False)
class Cells:
    """Which control point each place of the surface belongs to, by the way along it."""

    points: F64  # (K, 3) Gaussians, object frame
    normals: F64  # (K, 3)
    owners: I32  # (K,) control points
    has_gap: Mask  # (M,) control points near which another surface is; elsewhere nothing is asked

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.points, balanced_tree=False, compact_nodes=False)

    def owners_of(self, points: F64, normals: F64 | None = None) -> I32:
        """(N,) control points that surface points (N, 3), with `normals` where known, belong to."""
        count = 1 if normals is None else min(ASKED, len(self.points))
        index = self._tree.query(points, k=count)[1].reshape(len(points), count)
        if normals is None:
            return self.owners[index[:, 0]]
        is_same = np.einsum("nka,na->nk", self.normals[index], normals) > OPPOSED
        return self.owners[index[np.arange(len(index)), is_same.argmax(1)]]


@dataclass(frozen=True, eq=False)
class PointPairs:
    """Pairs of points, each pair once, with the smaller number first."""

    first: np.ndarray  # (E,)
    second: np.ndarray  # (E,)
    lengths: F64  # (E,) object units, > 0

    def __len__(self) -> int:
        return len(self.first)

    @staticmethod
    def within(points: F64, radius: float, shortest: float) -> PointPairs:
        """Return all pairs of points (N, 3) within `radius`; no length is below `shortest`."""
        # On a grid many pairs are just at the radius: rounding must not decide about them.
        tree = KDTree(points, balanced_tree=False, compact_nodes=False)
        first, second = tree.query_pairs(radius * (1 + 1e-9), output_type="ndarray").T.copy()
        gaps = points.take(second, 0) - points.take(first, 0)
        lengths = np.sqrt(np.einsum("ij,ij->i", gaps, gaps))
        return PointPairs(first, second, np.maximum(lengths, shortest))

    def where(self, kept: np.ndarray) -> PointPairs:
        """Return the edges named by `kept`, a list of numbers or a mask."""
        return PointPairs(self.first[kept], self.second[kept], self.lengths[kept])

    def and_also(self, others: PointPairs, count: int) -> PointPairs:
        """The edges of both, on `count` points; where both have one, the shorter."""
        first = np.concatenate([self.first, others.first])
        second = np.concatenate([self.second, others.second])
        lengths = np.concatenate([self.lengths, others.lengths])
        return PointPairs(first, second, lengths).shortest(count)

    def shortest(self, count: int) -> PointPairs:
        """Return the shortest of several edges between two of `count` points."""
        keys = self.first.astype(np.int64) * count + self.second
        keys, place = np.unique(keys, return_inverse=True)
        lengths = np.full(len(keys), np.inf)
        np.minimum.at(lengths, place, self.lengths)
        return PointPairs(keys // count, keys % count, lengths)

    def matrix(self, count: int, values: F64) -> csr_array:
        """(count, count) symmetric, of the edges' `values` (E,)."""
        i, j = self.first.astype(np.int32), self.second.astype(np.int32)
        both = np.concatenate([i, j]), np.concatenate([j, i])
        matrix = csr_array((np.tile(values, 2), both), shape=(count, count))
        matrix.sort_indices()
        return matrix


@dataclass(frozen=True, eq=False)
class _Attitude:
    """How the surfaces at both ends of each edge stand to it and to each other: cosines (E,)."""

    outward: F64  # the larger of both ends' normals with the direction to the other end
    facing: F64  # the smaller
    between: F64  # of the normals with each other

    @staticmethod
    def of(edges: PointPairs, points: F64, normals: F64) -> _Attitude:
        """`points` and `normals` (N, 3)."""
        along = points.take(edges.second, 0) - points.take(edges.first, 0)
        along /= edges.lengths[:, None]
        n, m = normals.take(edges.first, 0), normals.take(edges.second, 0)
        there, back = np.einsum("ij,ij->i", n, along), -np.einsum("ij,ij->i", m, along)
        between = np.einsum("ij,ij->i", n, m)
        return _Attitude(np.maximum(there, back), np.minimum(there, back), between)


def without_gaps(
    edges: PointPairs, points: F64, spacing: float, surface: SolidSurface
) -> tuple[PointPairs, Cells | None]:
    """Return the `edges` between control points (M, 3) that do not bridge a gap, and the cells.

    There are no cells where no gap is in question. `spacing` is the control points' mean one. An
    edge bridges a gap when it leaves the body, or joins opposed surfaces, and the way along the
    surface is longer than `DETOUR` times the edge. Edges through the inside of a limb or sheet
    stay. Where Gaussians are too few to say, surfaces that face each other have a gap between
    them. What hangs together by its surface still does so afterwards.
    """
    normals = surface.normals_near(points)[:, 0]
    attitude = _Attitude.of(edges, points, normals)
    is_suspect = (attitude.outward > OUTSIDE) | (attitude.between < OPPOSED)
    if not is_suspect.any():
        return edges, None
    sheet = _Sheet.of(points, normals, spacing, surface)
    ends = np.stack([edges.first, edges.second])
    is_known = (sheet.counts >= LEAST_CELL)[ends].all(0)
    is_at_gap = sheet.has_gap[ends].any(0)
    is_inside = attitude.outward < np.where(is_at_gap, INSIDE, THIN)
    ways = sheet.cells.and_also(edges.where(is_inside), len(points))
    ways = ways.matrix(len(points), ways.lengths)
    is_false = (attitude.facing > FACING) & ~is_known
    asked = np.flatnonzero((is_suspect | is_at_gap) & is_known & ~is_inside)
    is_false[asked] = _is_detour(edges.where(asked), ways)
    is_false[_still_needed(edges, is_false, ways)] = False
    return edges.where(~is_false), sheet.owned


@dataclass(frozen=True, eq=False)
class _Sheet:
    """The Gaussians as cells around the control points."""

    cells: PointPairs  # of neighbouring cells, as long as the way between their control points
    counts: np.ndarray  # (M,) Gaussians of each cell
    has_gap: Mask  # (M,) whether another surface faces the cell or its surroundings
    owned: Cells

    @staticmethod
    def of(points: F64, normals: F64, spacing: float, surface: SolidSurface) -> _Sheet:
        """Build the links of control points (M, 3) with `normals` (M, 3), `spacing` apart."""
        count = len(points)
        grain = GRAIN * spacing * min(1.0, np.sqrt(count / EVEN_COUNT))
        x, n = _thinned(points, normals, grain, surface)
        sixth = KDTree(x).query(x[:: max(1, len(x) // 1000)], k=min(7, len(x)))[0][:, -1]
        radius = min(max(JOIN * grain, SPARSE_JOIN * np.median(sixth)), WIDEST_JOIN * spacing)
        near = PointPairs.within(x, radius, TINY * spacing)
        is_across, is_near_gap = _gaps(near, x, n)
        joined = near.where(~is_across)
        upper = csr_array((joined.lengths, (joined.first, joined.second)), shape=(len(x),) * 2)
        distances, _, owners = dijkstra(
            upper, False, np.arange(count), return_predecessors=True, min_only=True
        )
        a, b = owners[joined.first], owners[joined.second]
        lengths = distances[joined.first] + joined.lengths + distances[joined.second]
        between = PointPairs(np.minimum(a, b), np.maximum(a, b), lengths).where((a != b) & (a >= 0))
        is_owned = owners >= 0
        counts = np.bincount(owners[is_owned], minlength=count)
        gaps = np.bincount(owners[is_owned & is_near_gap], minlength=count)
        owned = Cells(x[is_owned], n[is_owned], owners[is_owned].astype(np.int32), gaps > 0)
        return _Sheet(between.shortest(count), counts, gaps > 0, owned)


def _thinned(points: F64, normals: F64, grain: float, surface: SolidSurface) -> tuple[F64, F64]:
    """Positions and normals (K, 3): control points, and Gaussians between, a `grain` apart."""
    x = np.concatenate([points, surface.means])
    n = np.concatenate([normals, surface.normals])
    kept = thin_to_spacing(x, grain, np.arange(len(x)), n)
    kept = np.concatenate([np.arange(len(points)), kept[kept >= len(points)]])
    return x[kept], n[kept]


def _gaps(near: PointPairs, x: F64, n: F64) -> tuple[Mask, Mask]:
    """Which pairs (E,) of near Gaussians face each other, and which Gaussians (K,) are near such.

    The sides of a crease face each other, too, and are joined by the Gaussians close to it: what
    looks at each other there lies side by side. Only where the normals are nearly opposite is
    that no crease but a contact. A wall without thickness looks the same, but nowhere near it do
    surfaces face each other.
    """
    attitude = _Attitude.of(near, x, n)
    is_facing = (attitude.between < OPPOSED) & (attitude.outward > FACING)
    is_near_gap = np.zeros(len(x), bool)
    is_near_gap[near.first[is_facing]] = is_near_gap[near.second[is_facing]] = True
    for _ in range(GAP_RINGS):
        seen = is_near_gap[near.first] | is_near_gap[near.second]
        is_near_gap[near.first[seen]] = is_near_gap[near.second[seen]] = True
    likeness = np.clip((CONTACT - attitude.between) / (CONTACT + 1), 0, 1)  # 1: opposite normals
    is_touching = attitude.outward > FACING + (AWAY - FACING) * likeness
    is_touching &= (attitude.between < CONTACT) & is_near_gap[near.first]
    return is_facing | is_touching, is_near_gap


def _is_detour(edges: PointPairs, ways: csr_array) -> Mask:
    """(E,) whether the way between the ends on the graph `ways` (M, M) is much longer."""
    detour = np.ones(len(edges), bool)
    if not len(edges):
        return detour
    limit = DETOUR * edges.lengths
    sources, row = np.unique(edges.first, return_inverse=True)
    for start in range(0, len(sources), CHUNK):
        distances = dijkstra(ways, indices=sources[start : start + CHUNK], limit=limit.max())
        own = np.flatnonzero((row >= start) & (row < start + CHUNK))
        detour[own] = distances[row[own] - start, edges.second[own]] > limit[own]
    return detour


def _still_needed(edges: PointPairs, is_false: Mask, ways: csr_array) -> list[int]:
    """Numbers of the false edges without which a part of the graph `ways` would fall apart.

    The shortest that do (Kruskal 1956): a narrow neck, say, all of whose edges look false.
    """
    parts = connected_components(ways, directed=False)[1]
    kept = edges.where(~is_false)
    matrix = kept.matrix(len(parts), kept.lengths)
    pieces = connected_components(matrix, directed=False)[1]
    is_bridge = is_false & (parts[edges.first] == parts[edges.second])
    is_bridge &= pieces[edges.first] != pieces[edges.second]
    bridges = np.flatnonzero(is_bridge)
    needed: list[int] = []
    for bridge in bridges[np.argsort(edges.lengths[bridges], kind="stable")]:
        one, other = pieces[edges.first[bridge]], pieces[edges.second[bridge]]
        if one != other:
            needed.append(int(bridge))
            pieces[pieces == other] = one
    return needed


# Links through the body, from one side of a limb to the other (after Zhou et al. 2005).

SHARE = 0.2  # x the mean sum of a control point's links: what all its struts weigh together
INWARD = 0.85  # cosine of strut and inward normal, at both ends
OPPOSITE = -0.5  # cosine of the normals at its ends, at most
LONGEST = 12.0  # x mean spacing
HIT = 0.8  # x mean spacing: a Gaussian this near to a point under the surface is met there
MET = 6  # Gaussians that are looked at there: where two surfaces touch, some are of each
EXIT = 0.3  # cosine of its normal and the way in, from which the way leaves the body
ROOM = 1.0  # x mean spacing, that a strut may be longer than the body is thick


def find_struts(points: F64, spacing: float, reach: float, surface: SolidSurface) -> PointPairs:
    """Pairs of control points (M, 3) on opposite sides of a limb, at most `reach` apart.

    A strut ends where the body does: one from the far side of a finger through the next finger,
    which touches it, would be a false link.
    """
    radius = min(reach, LONGEST * spacing)
    normals = surface.normals_near(points)[:, 0]
    pairs = KDTree(points).query_pairs(radius, output_type="ndarray")
    i, j = pairs.T
    ways = points[j] - points[i]
    lengths = np.linalg.norm(ways, axis=1)
    ways /= np.maximum(lengths, 1e-300)[:, None]
    inward = np.minimum(
        -np.einsum("na,na->n", normals[i], ways), np.einsum("na,na->n", normals[j], ways)
    )
    is_through = (inward > INWARD) & (lengths > 0)
    is_through &= np.einsum("na,na->n", normals[i], normals[j]) < OPPOSITE
    i, j, lengths = i[is_through], j[is_through], lengths[is_through]
    limits = np.zeros(len(points))
    asked = np.union1d(i, j)
    depths = thickness(points[asked], normals[asked], spacing, radius, surface)
    limits[asked] = depths + ROOM * spacing
    is_flesh = lengths <= np.minimum(limits[i], limits[j])
    return PointPairs(i[is_flesh], j[is_flesh], lengths[is_flesh])


def thickness(
    points: F64, normals: F64, spacing: float, radius: float, surface: SolidSurface
) -> F64:
    """Return the body's thickness (M,) under surface points (M, 3), measured against their normals.

    The first of some points on the way in at which a surface faces outwards; 0 where there is none
    within `radius`.
    """
    thickness = np.zeros(len(points))
    for depth in spacing * np.arange(0.75, radius / spacing, 1.0)[::-1]:  # the nearest is last
        met = surface.normals_near(points - depth * normals, MET, HIT * spacing)
        thickness[(np.einsum("nka,na->nk", met, normals) < -EXIT).any(1)] = depth
    return thickness


def weigh_struts(struts: PointPairs, degree: F64) -> F64:
    """Weights (E,) of the struts; `degree` (M,) is the sum of each control point's links."""
    counts = np.bincount(np.concatenate([struts.first, struts.second]), minlength=len(degree))
    crowd = np.sqrt(counts[struts.first] * counts[struts.second])
    return SHARE * float(degree.mean()) / np.maximum(crowd, 1.0)
