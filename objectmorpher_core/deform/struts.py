"""Links through the body, from one side of a limb to the other (after Zhou et al. 2005).

Links along the surface alone make an object a hollow skin: twisted or bent, a limb grows thin.
Struts hold its sides apart, as the flesh between them would.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from ..base.arrays import F64
from .surface_links import Edges, Surface

SHARE = 0.2  # x the mean sum of a control point's links: what all its struts weigh together
INWARD = 0.85  # cosine of strut and inward normal, at both ends
OPPOSITE = -0.5  # cosine of the normals at its ends, at most
LONGEST = 12.0  # x mean spacing
HIT = 0.8  # x mean spacing: a Gaussian this near to a point under the surface is met there
MET = 6  # Gaussians that are looked at there: where two surfaces touch, some are of each
EXIT = 0.3  # cosine of its normal and the way in, from which the way leaves the body
ROOM = 1.0  # x mean spacing, that a strut may be longer than the body is thick


def find_struts(points: F64, spacing: float, reach: float, surface: Surface) -> Edges:
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
    return Edges(i[is_flesh], j[is_flesh], lengths[is_flesh])


def thickness(points: F64, normals: F64, spacing: float, radius: float, surface: Surface) -> F64:
    """How thick (M,) the body is under surface points (M, 3), seen against their normals.

    The first of some points on the way in at which a surface faces outwards; 0 where there is none
    within `radius`.
    """
    thickness = np.zeros(len(points))
    for depth in spacing * np.arange(0.75, radius / spacing, 1.0)[::-1]:  # the nearest is last
        met = surface.normals_near(points - depth * normals, MET, HIT * spacing)
        thickness[(np.einsum("nka,na->nk", met, normals) < -EXIT).any(1)] = depth
    return thickness


def weigh_struts(struts: Edges, degree: F64) -> F64:
    """Weights (E,) of the struts; `degree` (M,) is the sum of each control point's links."""
    counts = np.bincount(np.concatenate([struts.first, struts.second]), minlength=len(degree))
    crowd = np.sqrt(counts[struts.first] * counts[struts.second])
    return SHARE * float(degree.mean()) / np.maximum(crowd, 1.0)
