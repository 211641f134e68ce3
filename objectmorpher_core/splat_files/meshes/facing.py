"""Which way the triangles of a mesh face, whatever the order of their corners."""

from __future__ import annotations

import numpy as np

from ...base.arrays import Mask
from .surface import Surface

SAME = 1e-6  # x extent: corners nearer than this are one


def oriented(surface: Surface) -> tuple[Surface, Mask]:
    """The surface with every closed part facing outwards, and (T,) whether a part is closed.

    A part is closed where each edge has one triangle on either side, turned the same way: then
    the sign of its volume tells outside. Nothing is known of the others.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    corners = surface.corners.reshape(-1, 3)
    extent = float(np.ptp(corners, axis=0).max()) or 1.0
    cells = np.round((corners - corners.min(0)) / (SAME * extent)).astype(np.int64)
    _, vertex = np.unique(cells, axis=0, return_inverse=True)
    faces = vertex.reshape(-1, 3)
    count = int(faces.max()) + 1
    starts, ends = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    links = coo_array((np.ones(len(starts), np.int8), (starts, ends)), shape=(count, count))
    part = connected_components(links, directed=False)[1][faces[:, 0]]

    is_flat = (faces == np.roll(faces, 1, axis=1)).any(1)  # a triangle that is a line
    forward, backward = starts * count + ends, ends * count + starts
    used = np.repeat(~is_flat, 3)
    if not used.any():
        return surface, np.zeros(len(faces), bool)
    unique, uses = np.unique(forward[used], return_counts=True)
    at = np.minimum(np.searchsorted(unique, backward), len(unique) - 1)
    ahead = np.minimum(np.searchsorted(unique, forward), len(unique) - 1)
    is_matched = (unique[at] == backward) & (uses[at] == 1) & (uses[ahead] == 1)
    parts = int(part.max()) + 1
    loose = np.bincount(np.repeat(part, 3)[used & ~is_matched], minlength=parts)
    is_closed = (loose == 0)[part]

    a, b, c = (surface.corners[:, k] - corners.mean(0) for k in range(3))
    volume = np.bincount(part, np.einsum("ta,ta->t", a, np.cross(b, c)), minlength=parts)
    inward = is_closed & (volume[part] < 0)
    turn = np.where(inward[:, None], [2, 1, 0], [0, 1, 2])[:, :, None]
    return Surface(
        np.take_along_axis(surface.corners, turn, axis=1),
        np.take_along_axis(surface.uv, turn, axis=1),
        np.take_along_axis(surface.tint, turn, axis=1),
        surface.which, surface.looks,
    ), is_closed  # fmt: skip
