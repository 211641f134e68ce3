"""Flat Gaussians spread evenly over a mesh, each as wide and as coloured as its share of it.

Many spots are thrown on the surface and thinned to blue noise. Each spot then belongs to the
nearest Gaussian that was kept, and its spots tell a Gaussian's colour (their mean in linear
light: a prefilter as wide as the sampling, made on the surface, so that no seam of the texture's
layout bleeds) and its shape (their spread: on a wire it is a needle, elsewhere round).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arrays import F32, F64, Mask
from ...base.poisson_disk import OPPOSED, thin_to_spacing
from ...base.rotations import matrices_from_quats, quats_along, quats_from_matrices
from ...document.gaussians import Gaussians
from ..limits import SplatFileError
from ..splats.objects import sides
from .surface import Spots, TriangleMesh, srgb_from_linear

OVERSAMPLING = 20  # spots a Gaussian: fewer leave gaps
MOST_SPOTS = 3_000_000
MAX_COUNT = 500_000
PACKING = 0.68  # Gaussians per (spacing^2 of area) that thinning at that spacing leaves
CLOSE_ENOUGH = 0.02  # of the count
TANGENT_SIGMA = 0.72  # x mean spacing, on a plane: neighbours overlap without gaps
NORMAL_SIGMA = 0.12  # x mean spacing: flat, but never degenerate seen edge-on
CELL_SPREAD = 0.29  # x mean spacing: standard deviation of the spots of one Gaussian, on a plane
TRUST = 10.0  # spots of a plane that are taken for granted in a Gaussian's size
NOISE = 1.2  # / sqrt(spots): how much longer than wide a few spots of a plane look by chance
NARROWEST, WIDEST = 0.2, 1.6  # x TANGENT_SIGMA
SAME_FACE = 0.5  # cosine: what is around a corner neither colours nor shapes a Gaussian
CLEAR = 0.02  # opacity that nobody sees
NEAR_BACK = 4.0  # x mean spacing: a sheet with a back surface this near is no open sheet


@dataclass(frozen=True, eq=False)
class _Cover:
    """Spots that can be seen, and which of them became Gaussians."""

    points: F64  # (M, 3)
    normals: F64  # (M, 3)
    colors: F32  # (M, 4) premultiplied linear
    is_closed: np.ndarray  # (M,) on a part whose outside is known
    kept: np.ndarray  # (N,) indices of spots
    spacing: float  # mean, in the surface's units


def sample_surface(surface: TriangleMesh, count: int, seed: int = 0) -> Gaussians:
    """About `count` Gaussians on the surface; open sheets get one on either side.

    Raises SplatFileError for a surface without area, all transparent, or of 1e-40 units.
    """
    count = min(count, MAX_COUNT)
    surface, is_closed = oriented(surface)
    has_area = surface.areas() > 0  # only now: a triangle that is a line closes an edge, too
    if not has_area.any():
        raise SplatFileError("the mesh's triangles have no area")
    surface, is_closed = surface.select(has_area), is_closed[has_area]
    rng = np.random.default_rng(seed)
    cover = _thrown(surface, is_closed, count, rng)
    inward, is_sheet = _open_sides(cover)
    if is_sheet.mean() > CLOSE_ENOUGH:  # those count twice
        cover = _thinned(cover, round(count / (1 + is_sheet.mean())), rng)
        inward, is_sheet = _open_sides(cover)
    found = _gaussians(cover, inward, is_sheet)
    if not (found.scales > 0).all():  # in 32 bits
        raise SplatFileError("the mesh is too small to have a size")
    return found


def _thrown(
    surface: TriangleMesh, is_closed: np.ndarray, count: int, rng: np.random.Generator
) -> _Cover:
    amount = max(2000, min(OVERSAMPLING * count, MOST_SPOTS))
    spots = Spots.spread(surface, amount, rng)
    area = float(surface.areas().sum())
    colors = spots.colors(surface, np.sqrt(area / amount))
    seen = colors[:, 3] > CLEAR
    if not seen.any():
        raise SplatFileError("the mesh is wholly transparent")
    spacing = np.sqrt(area * seen.mean() / count)
    cover = _Cover(
        spots.points[seen], surface.normals()[spots.triangle[seen]], colors[seen],
        is_closed[spots.triangle[seen]], np.zeros(0, int), float(spacing),
    )  # fmt: skip
    return _thinned(cover, count, rng)


def _thinned(cover: _Cover, count: int, rng: np.random.Generator) -> _Cover:
    """With about `count` spots kept, none near another."""
    order = rng.permutation(len(cover.points))
    area = cover.spacing**2 * (len(cover.kept) or count)  # mean spacing^2 x Gaussians
    gap, kept = np.sqrt(PACKING * area / count), cover.kept
    for _ in range(4):
        kept = thin_to_spacing(cover.points, float(gap), order, cover.normals)
        if abs(len(kept) - count) <= CLOSE_ENOUGH * count or len(kept) == len(cover.points):
            break
        gap *= np.sqrt(len(kept) / count)
    spacing = float(np.sqrt(area / len(kept)))
    return _Cover(cover.points, cover.normals, cover.colors, cover.is_closed, kept, spacing)


def _open_sides(cover: _Cover) -> tuple[np.ndarray, np.ndarray]:
    """(N,) whether a Gaussian faces inwards, and whether it is seen from both sides."""
    from scipy.spatial import KDTree

    points, normals = cover.points[cover.kept], cover.normals[cover.kept]
    is_closed = cover.is_closed[cover.kept]
    if is_closed.all():
        return np.zeros(len(points), bool), np.zeros(len(points), bool)
    out = sides(points, normals)
    # The back of a thin plate is another surface, of its own colour: near, facing the other way.
    far = NEAR_BACK * cover.spacing
    tree = KDTree(np.column_stack([points, far * normals]))
    gaps, other = tree.query(
        np.column_stack([points, -far * normals]), distance_upper_bound=1.5 * far, workers=1
    )
    found, other = np.isfinite(gaps), np.asarray(other)
    has_back = found.copy()
    facing = (normals[found] * normals[other[found]]).sum(1)
    has_back[found] = facing < OPPOSED
    is_sheet = ~is_closed & np.isfinite(out.before) & np.isfinite(out.behind) & ~has_back
    return ~is_closed & (out.behind < out.before), is_sheet


def _gaussians(cover: _Cover, inward: np.ndarray, is_sheet: np.ndarray) -> Gaussians:
    owner = _owners(cover)
    count = len(cover.kept)
    normals = np.where(inward[:, None], -1.0, 1.0) * cover.normals[cover.kept]
    frames = matrices_from_quats(quats_along(normals))
    means, along, turns = _shapes(cover, owner, frames)
    spots = np.maximum(np.bincount(owner, minlength=count), 1)
    total = np.stack([np.bincount(owner, cover.colors[:, k], count) for k in range(4)], axis=1)
    colors = srgb_from_linear(total[:, :3] / np.maximum(total[:, 3:], 1e-9))
    opacities = np.clip(total[:, 3] / spots, 0, 1)
    scales = np.column_stack([along, np.full(count, NORMAL_SIGMA * cover.spacing)])
    # Local x along the longer side of its share, z still the normal
    cos, sin = np.cos(turns), np.sin(turns)
    x = cos[:, None] * frames[:, :, 0] + sin[:, None] * frames[:, :, 1]
    axes = np.stack([x, np.cross(frames[:, :, 2], x), frames[:, :, 2]], axis=2)
    lift = np.where(is_sheet, NORMAL_SIGMA * cover.spacing, 0.0)[:, None] * frames[:, :, 2]
    back = axes * np.array([1.0, -1.0, -1.0])  # columns: half a turn about x
    parts = (
        np.concatenate([means + lift, (means - lift)[is_sheet]]),
        quats_from_matrices(np.concatenate([axes, back[is_sheet]])),
        *(np.concatenate([part, part[is_sheet]]) for part in (scales, opacities, colors)),
    )
    return Gaussians(*(part.astype(np.float32) for part in parts))


def _owners(cover: _Cover) -> np.ndarray:
    """(M,) the Gaussian that each spot belongs to: the nearest that faces its way."""
    from scipy.spatial import KDTree

    points, normals = cover.points[cover.kept], cover.normals[cover.kept]
    owner = np.array(KDTree(points).query(cover.points, workers=1)[1])
    astray = (normals[owner] * cover.normals).sum(1) < SAME_FACE
    if astray.any():
        weight = 2 * cover.spacing
        tree = KDTree(np.column_stack([points, weight * normals]))
        there = np.column_stack([cover.points[astray], weight * cover.normals[astray]])
        owner[astray] = tree.query(there, workers=1)[1]
    return owner


def _shapes(cover: _Cover, owner: np.ndarray, frames: F64) -> tuple[F64, F64, F64]:
    """Means (N, 3), two standard deviations (N, 2), longer first, and the longer's angle (N,).

    From the spots of each Gaussian in its tangent plane, less what chance makes of a few of them.
    """
    count = len(cover.kept)
    offset = cover.points - cover.points[cover.kept][owner]
    same = np.abs((cover.normals * frames[owner, :, 2]).sum(1)) > SAME_FACE
    owner, offset = owner[same], offset[same]
    u, v = (np.einsum("ma,ma->m", offset, frames[owner, :, k]) for k in range(2))

    def mean(values: F64) -> F64:
        return np.bincount(owner, values, count) / spots

    spots = np.maximum(np.bincount(owner, minlength=count), 1)
    mu, mv = mean(u), mean(v)
    uu, vv, uv = mean(u * u) - mu * mu, mean(v * v) - mv * mv, mean(u * v) - mu * mv
    share = TRUST / (TRUST + spots)
    size = (1 - share) * (uu + vv) / 2 + share * (CELL_SPREAD * cover.spacing) ** 2
    chance = np.minimum(NOISE / np.sqrt(spots), 0.9)
    longness = 2 * np.hypot((uu - vv) / 2, uv) / np.maximum(uu + vv, 1e-300)
    longness = np.clip((longness - chance) / (1 - chance), 0, 1)
    both = np.sqrt(size[:, None] * np.stack([1 + longness, 1 - longness], axis=1))
    sigma = TANGENT_SIGMA * cover.spacing
    along = np.clip(both / CELL_SPREAD * TANGENT_SIGMA, NARROWEST * sigma, WIDEST * sigma)
    means = cover.points[cover.kept] + mu[:, None] * frames[:, :, 0] + mv[:, None] * frames[:, :, 1]
    return means, along, np.arctan2(2 * uv, uu - vv) / 2


# Which way the triangles of a mesh face, whatever the order of their corners.

SAME = 1e-6  # x extent: corners nearer than this are one


def oriented(surface: TriangleMesh) -> tuple[TriangleMesh, Mask]:
    """Return the surface with every closed part facing outwards, and (T,) whether a part is closed.

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
    return TriangleMesh(
        np.take_along_axis(surface.corners, turn, axis=1),
        np.take_along_axis(surface.uv, turn, axis=1),
        np.take_along_axis(surface.tint, turn, axis=1),
        surface.which, surface.looks,
    ), is_closed  # fmt: skip
