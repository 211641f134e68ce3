"""Links through the body, from one side of a limb to the other (after Zhou et al. 2005).

Links along the surface alone make an object a hollow skin: twisted or bent, a limb grows thin.
Struts hold its sides apart, as the flesh between them would.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from ..arrays import F64
from .surface_links import Edges, Surface

SHARE = 0.3  # x the mean sum of a control point's links: what all its struts weigh together
INWARD = 0.85  # cosine of strut and inward normal, at both ends
OPPOSITE = -0.5  # cosine of the normals at its ends, at most
NEAREST = 1.25  # x the shortest strut of either end: what lies beyond the other side is no flesh
LONGEST = 12.0  # x mean spacing


def find_struts(points: F64, spacing: float, reach: float, surface: Surface) -> Edges:
    """Pairs of control points (M, 3) on opposite sides of a limb, at most `reach` apart."""
    radius = min(reach, LONGEST * spacing)
    normals = surface.normals[KDTree(surface.means).query(points)[1]].astype(np.float64)
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
    shortest = np.full(len(points), np.inf)
    np.minimum.at(shortest, i, lengths)
    np.minimum.at(shortest, j, lengths)
    is_near = lengths <= NEAREST * np.minimum(shortest[i], shortest[j])
    return Edges(i[is_near], j[is_near], lengths[is_near])


def weigh_struts(struts: Edges, degree: F64) -> F64:
    """Weights (E,) of the struts; `degree` (M,) is the sum of each control point's links."""
    counts = np.bincount(np.concatenate([struts.first, struts.second]), minlength=len(degree))
    crowd = np.sqrt(counts[struts.first] * counts[struts.second])
    return SHARE * float(degree.mean()) / np.maximum(crowd, 1.0)
