"""The deformable graph on the control points (paper 3.2.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from ..arrays import F64, I32, Mask

AUXILIARY_RADIUS = 2.0  # x mean nearest-neighbour distance, paper 3.2.1
FALLOFF = 2.0  # x mean nearest-neighbour distance: the reach of a link's weight
REACH = 3.0  # x falloff: a longer link would weigh 1 % of a short one
FACING = 0.3  # cosine of normal and link, from which a surface faces the link's other end
LINK_RADIUS = 0.3  # x diameter, paper 3.2.1


@dataclass(frozen=True, eq=False)
class Graph:
    """Links between control points, and distances along the surface."""

    weights: F64  # (M, M) symmetric, 0 = no link
    geodesics: F64  # (M, M) object units, inf between components
    components: I32  # (M,) component of each control point
    mean_spacing: float  # object units, mean nearest-neighbour distance

    @property
    def link_count(self) -> int:
        """Links, each counted once."""
        return int(np.count_nonzero(self.weights)) // 2

    @property
    def component_count(self) -> int:
        return int(self.components.max()) + 1


def build_graph(
    points: np.ndarray,
    links: str = "geodesic",
    is_faithful: bool = False,
    normals: np.ndarray | None = None,
) -> Graph:
    """The paper's graph on control points (M, 3), with outward `normals` (M, 3) where known.

    An auxiliary graph joins points closer than twice the mean spacing; shortest paths on it are
    the geodesics; points within 0.3 diameters along the surface are linked, or within six
    spacings where that is nearer: a longer link would weigh nothing. `links="euclidean"` is the
    ablation that links by straight distance. Weights are exp(-g^2 / 2 s^2), and symmetric,
    so that the Laplacian is too (DESIGN section 4). s is twice the mean spacing: the object
    behaves like a continuous body, and a dragged point takes its surroundings along. With
    `is_faithful` it is the mean length of a link, some five spacings: then every point is tied to
    so many far ones that a dragged one leaves its neighbours behind, and makes a spike.

    Surfaces that face each other across a gap, as an arm and the body beside it do, are not
    joined by the auxiliary graph although they are near: neither of the paper's two rules tells
    them apart. The two sides of a thin limb face away from each other and stay joined.
    """
    if links not in ("geodesic", "euclidean"):
        raise ValueError(f"links must be geodesic or euclidean, not {links!r}")
    p = points.astype(np.float64)
    distances = np.sqrt(np.maximum(((p[:, None] - p[None]) ** 2).sum(-1), 0.0))
    off_diagonal = distances + np.diag(np.full(len(p), np.inf))
    mean_spacing = float(off_diagonal.min(1).mean())
    auxiliary = np.where(off_diagonal <= AUXILIARY_RADIUS * mean_spacing, distances, 0.0)
    # A coincident pair would be "no edge" to scipy: keep it as a very short one.
    auxiliary[(off_diagonal <= AUXILIARY_RADIUS * mean_spacing) & (auxiliary == 0)] = 1e-12
    if normals is not None and not is_faithful:
        auxiliary[_face_each_other(p, normals, off_diagonal)] = 0.0
    sparse = csr_matrix(auxiliary)
    geodesics = dijkstra(sparse, directed=False)
    lengths = geodesics if links == "geodesic" else distances
    radius = LINK_RADIUS * distances.max()
    falloff = FALLOFF * mean_spacing
    if not is_faithful:
        radius = min(radius, REACH * falloff)
    linked = lengths <= radius
    np.fill_diagonal(linked, False)
    if not linked.any():
        linked = (auxiliary > 0) & ~np.eye(len(p), dtype=bool)
    if is_faithful and linked.any():
        falloff = float(lengths[linked].mean())
    weights = np.where(linked, np.exp(-(np.where(linked, lengths, 0) ** 2) / (2 * falloff**2)), 0)
    weights = np.maximum(weights, weights.T)
    count, components = connected_components(csr_matrix(weights), directed=False)
    assert count >= 1 and np.array_equal(weights, weights.T), "Eq. 3 needs symmetric weights"
    return Graph(weights, geodesics, components.astype(np.int32), mean_spacing)


def _face_each_other(p: F64, normals: np.ndarray, distances: F64) -> Mask:
    """(M, M) whether the surfaces at two points look at each other."""
    n = normals.astype(np.float64)
    towards = n @ p.T - (n * p).sum(1)[:, None]  # n_i . (p_j - p_i)
    faces = towards > FACING * distances
    return faces & faces.T
