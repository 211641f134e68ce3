"""Points spread evenly over a body: its front, its back, the walls between, and a brim around.

The brim carries the matte's soft edge. Each sheet is spread apart: in a thin limb the back lies
closer to the front than one spacing, and at the rim the front is seen edge-on and leaves the brim
to cover it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import KDTree

from ...base.arrays import F64, Mask
from ...base.poisson_disk import nearest_in, scattered, thin_to_spacing
from ...base.threads import in_threads
from ...document.model import Matte
from .body import BACK, FRONT, MIDDLE, ReliefBody
from .canvas import bilinear
from .plain_solid import IN_LINE, INSET, PlainSolid
from .silhouette import ReliefSilhouette

# The outlines of a silhouette as lines, along which a surface has its rim.

SHORTEST = 4  # cells of a rim that is looked at
BESIDE = np.linspace(-1.5, 1.5, 13)  # cells from an outline, at which the matte is looked up
SHARP = 0.8, 0.2  # alpha at both ends of that, from which and up to which an edge is sharp
EVEN = 2.0  # cells, over which an outline's direction is evened
STAIRS, CORNERS = 4.0, 1.0  # cells, over which an outline's staircase is evened, and at corners
STAIR = 0.35  # cells: what evening moves by more is no stair


@dataclass(frozen=True, eq=False)
class RimLine:
    """A closed outline of a silhouette: of the object, or of a hole in it."""

    xy: F64  # (n, 2) grid coordinates on the outline itself, evened
    inward: F64  # (n, 2) unit

    @property
    def length(self) -> F64:
        """(n + 1,) cells from its first place."""
        steps = np.linalg.norm(np.roll(self.xy, -1, axis=0) - self.xy, axis=1)
        return np.r_[0.0, np.cumsum(steps)]


def _smooth(ring: F64, over: float) -> F64:
    """A closed line (n, 2) without waves, as wide as it was (Taubin 1995)."""
    first = gaussian_filter1d(ring, over, axis=0, mode="wrap")
    return first + gaussian_filter1d(ring - first, over, axis=0, mode="wrap")


def rim_lines(inside: Mask) -> list[RimLine]:
    """Return all outlines of cells (h, w) that are long enough to have a shape."""
    found, _ = cv2.findContours(inside.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    lines = []
    for ring in found:
        cells = ring[:, 0]
        if len(cells) < SHORTEST:
            continue
        smooth, xy = (_smooth(cells.astype(np.float64), over) for over in (STAIRS, CORNERS))
        share = 1 / (1 + (np.linalg.norm(smooth - xy, axis=1) / STAIR) ** 4)
        xy += share[:, None] * (smooth - xy)
        way = np.roll(xy, -1, axis=0) - np.roll(xy, 1, axis=0)
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        # The object lies to one side of all lines, at the centres of its outermost cells.
        away = np.column_stack([-way[:, 1], way[:, 0]])
        side = np.rint(xy + 1.5 * away).astype(int)
        h, w = inside.shape
        beyond = inside[np.clip(side[:, 1], 0, h - 1), np.clip(side[:, 0], 0, w - 1)]
        if beyond.mean() > 0.5:
            away = -away
        lines.append(RimLine(xy + 0.5 * away, -away))
    return lines


def _at_half(line: RimLine, outline: ReliefSilhouette, matte: Matte) -> RimLine:
    """`line` where the matte is half covered: of a sharp edge it knows that to a tenth of a px."""
    xy, cell = outline.photo_xy(line.xy), outline.cell
    at = xy[:, None] - cell * BESIDE[:, None] * line.inward[:, None]  # from within outwards
    at = at.reshape(-1, 2) - [matte.left + 0.5, matte.top + 0.5]
    alpha = bilinear(matte.alpha, at).reshape(len(xy), -1)
    falls = (alpha[:, :-1] >= 0.5) & (alpha[:, 1:] < 0.5)
    is_sharp = (alpha[:, 0] > SHARP[0]) & (alpha[:, -1] < SHARP[1]) & (falls.sum(1) == 1)
    k, rows = np.argmax(falls, axis=1), np.arange(len(xy))
    before, after = alpha[rows, k], alpha[rows, k + 1]
    share = (before - 0.5) / np.maximum(before - after, 1e-6)
    beside = np.where(is_sharp, BESIDE[k] + share * (BESIDE[1] - BESIDE[0]), 0.0)
    beside = gaussian_filter1d(beside, CORNERS, mode="wrap")
    moved = line.xy - beside[:, None] * line.inward
    smooth = gaussian_filter1d(moved, EVEN, axis=0, mode="wrap")
    way = np.roll(smooth, -1, axis=0) - np.roll(smooth, 1, axis=0)
    across = np.column_stack([-way[:, 1], way[:, 0]])
    across *= np.sign((across * line.inward).sum(1, keepdims=True))
    length = np.linalg.norm(across, axis=1, keepdims=True)
    is_even = (length > 1e-6) & is_sharp[:, None]  # a soft edge stays as it was
    return RimLine(moved, np.where(is_even, across / np.maximum(length, 1e-6), line.inward))


OVERSAMPLING = 20  # candidates per point before thinning: fewer leave gaps
PACKING = 0.68  # points per (spacing^2 of area) that thinning at that spacing leaves
WITHDRAWN = 0.3  # x mean spacing: so far inside an outline a sheet's points are, but for its chain
BARELY = 0.14  # likewise, at least, where a sheet is seen edge-on and a px of it is many deep
COVERED = 1.25  # x mean spacing: so far beyond a part's end it is drawn over what is behind
MIXED = 0.45  # x mean spacing: so far within a part's end the photo shows some of what is behind
BRIM = 1.8  # x mean spacing: how far points reach past the matte's soft band
WITHIN = 0.45  # cells from a near cell to its wall: just before the far one begins
MIN_SPACING = 1.0  # px: more points than pixels carry nothing


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points on a closed surface, in relief coordinates: photo px and height in px."""

    xy: F64  # (N, 2) photo px
    height: F64  # (N,) px towards the camera
    normals: F64  # (N, 3) outward, relief coordinates (x, y, height), unit
    is_front: Mask  # (N,) on the side of the camera
    is_seen: Mask  # (N,) by the photo
    is_brim: Mask  # (N,) outside the silhouette
    color_xy: F64  # (N, 2) photo px of which it has the colour

    def select(self, index: np.ndarray) -> SurfacePoints:
        return SurfacePoints(*(getattr(self, f.name)[index] for f in fields(self)))


def spread(
    body: ReliefBody,
    count: int,
    band: float,
    rng: np.random.Generator,
    matte: Matte | None = None,
    is_fringed: bool = False,
) -> tuple[SurfacePoints, float]:
    """About `count` points and their mean spacing in px.

    `band`: how far outside the silhouette the matte covers something, px. The `matte` tells where
    exactly the outline is; where that `is_fringed`, nothing is put where the matte covers nothing.
    Candidates are drawn in proportion to the true area, then thinned to one spacing in 3D.
    """
    areas = [_area(body, side) for side in (FRONT, BACK)]
    outline, solid = body.silhouette, body.solid
    if solid is not None:  # which has a back of its own
        areas[1] = np.where(solid.own, 0.0, areas[1])
    lines, ends = rim_lines(outline.inside), []
    if matte is not None and body.behind is None:  # or the end of a hidden part is ragged
        lines = [_at_half(line, outline, matte) for line in lines]
    if body.behind is not None:
        ends = rim_lines(body.behind.stands)
    total = sum(area.sum() for area in areas) + _wall_area(body, lines) + _inner_area(body)
    total += 0.0 if solid is None else solid.hidden_area
    spacing = max(float(np.sqrt(total / count)), MIN_SPACING)
    density = OVERSAMPLING / spacing**2  # candidates per px^2
    chains = [_chain(body, lines + ends, FRONT, spacing), _chain(body, lines, BACK, spacing)]
    if solid is not None:
        chains[0] = chains[0][~_is_grazed(solid, outline, chains[0])]
        chains[0] = np.vstack([chains[0], _seen_edges(solid, lines, outline, spacing)])
        chains[1] = chains[1][~_is_own(solid, outline, chains[1])]
    drawn = []
    for chain, area, side in zip(chains, areas, (FRONT, BACK), strict=True):
        xy = _draw(outline, area * density, rng)
        drawn.append(np.vstack([chain, _withdrawn(body, xy, side, lines, spacing)]))
    fringe = matte if is_fringed else None
    around = [(_brim(body, band, spacing, density, rng, fringe), 0)]
    around += _inner(body, spacing, density, rng)
    # Most candidates of the sheets are dropped: their normals are found when that is done.
    clouds = [(xy, _heights(body, xy, side)) for xy, side in zip(drawn, (FRONT, BACK), strict=True)]
    clouds += [(surface.xy, surface.height) for surface, _ in around]
    first = [len(chain) for chain in chains] + [count for _, count in around]
    front, back, *others = _thinned(clouds, first, spacing, rng)
    sheets = [_sheet(body, drawn[0][front], FRONT), _sheet(body, drawn[1][back], BACK)]
    if body.behind is not None:
        sheets[0] = _own(sheets[0], body, spacing)
        around[0] = (_own(around[0][0], body, spacing), 0)
    sheets += [surface.select(kept) for (surface, _), kept in zip(around, others, strict=True)]
    sheets.append(_wall(body, lines, spacing))
    if solid is not None:
        sheets.append(_hidden(solid, outline, spacing, density, rng))
        # What one sees of its rim when it turns.
        rim, normals = solid.along_outline(spacing)
        sheets.append(_on_solid(solid, outline, rim, normals, len(rim), spacing, rng))
    return _joined(sheets), spacing


def _thinned(
    clouds: list[tuple[F64, F64]], first: list[int], spacing: float, rng: np.random.Generator
) -> list[np.ndarray]:  # fmt: skip
    """Which points of each cloud, xy (N, 2) and height (N,), are kept; its `first` go first."""
    orders = [
        np.r_[np.arange(n), n + rng.permutation(len(xy) - n)]
        for (xy, _), n in zip(clouds, first, strict=True)
    ]
    kept = [np.empty(0, np.int64)] * len(clouds)

    def thin(first: int, last: int) -> None:
        for k in range(first, last):
            points = np.column_stack(clouds[k])
            kept[k] = thin_to_spacing(points, spacing * np.sqrt(PACKING), orders[k])

    in_threads(thin, len(clouds), parts=len(clouds))
    return kept


def _joined(sheets: list[SurfacePoints]) -> SurfacePoints:
    return SurfacePoints(
        *(
            np.concatenate([getattr(sheet, f.name) for sheet in sheets])
            for f in fields(SurfacePoints)
        )
    )


def _area(body: ReliefBody, side: float) -> F64:
    """(h, w) px^2 of a sheet's true surface over each cell of the silhouette."""
    outline = body.silhouette
    rows, columns = np.nonzero(outline.inside)
    xy = outline.photo_xy(np.column_stack([columns, rows]).astype(np.float64))
    _, gradient = body.sample(xy, side)
    area = np.zeros(outline.shape)
    area[rows, columns] = outline.cell**2 * np.sqrt(1 + (gradient**2).sum(1))
    return area


def _draw(outline: ReliefSilhouette, expected: F64, rng: np.random.Generator) -> F64:
    """Photo px (N, 2) of random points, `expected` (h, w) of them per cell."""
    return outline.photo_xy(scattered(expected, rng) - 0.5)


def _withdrawn(body: ReliefBody, xy: F64, side: float, lines: list[RimLine], spacing: float) -> F64:
    """Those of the photo px (N, 2) of a sheet that do not stick out beyond its chain."""
    depth, outline = WITHDRAWN * spacing, body.silhouette
    is_within = _is_within(xy, lines, outline, depth)
    beside = np.flatnonzero(~is_within)
    _, gradient = body.sample(xy[beside], side)
    seen = depth / np.sqrt(1 + (gradient**2).sum(1))
    is_within[beside] = _is_within(xy[beside], lines, outline, np.maximum(seen, BARELY * spacing))
    if body.solid is not None and side == FRONT:  # nor beyond the rows along its edges
        own = np.flatnonzero(is_within & _is_own(body.solid, outline, xy))
        height, face, is_met = body.solid.met(xy[own])
        inset = body.solid.inset(body.solid.places(xy[own], height), face)
        is_within[own[is_met & (inset < INSET * spacing)]] = False
    return xy[is_within]


def _is_within(
    xy: F64, lines: list[RimLine], outline: ReliefSilhouette, depth: float | F64
) -> Mask:
    """Which photo px (N, 2) are `depth` px inside the lines, or half of what there is of a hair."""
    found = np.ones(len(xy), bool)
    if not lines:
        return found
    away, radius = bilinear(np.stack([outline.depth, outline.radius], -1), outline.grid_xy(xy)).T
    depth = np.broadcast_to(depth, len(xy))
    near = np.flatnonzero(away < depth + 2 * outline.cell)
    rim = outline.photo_xy(np.concatenate([line.xy for line in lines]))
    _, nearest = KDTree(rim).query(xy[near])
    inward = np.concatenate([line.inward for line in lines])[nearest]
    inside = ((xy[near] - rim[nearest]) * inward).sum(1)
    found[near] = inside >= np.minimum(depth, 0.5 * radius)[near]
    return found


def _sheet(body: ReliefBody, xy: F64, side: float) -> SurfacePoints:
    """The front, or the back, at photo px (N, 2)."""
    height, gradient = body.sample(xy, side)
    normals = side * np.column_stack([-gradient, np.ones(len(xy))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    is_front = np.full(len(xy), side == FRONT)
    if body.solid is not None and side == FRONT:
        own = _is_own(body.solid, body.silhouette, xy)
        height[own], face, is_met = body.solid.met(xy[own])
        met = np.flatnonzero(own)[is_met]
        places = body.solid.places(xy[met], height[met])
        normals[met] = body.solid.relief_normals(places, body.solid.normals[face[is_met]])
    return SurfacePoints(xy, height, normals, is_front, is_front, np.zeros(len(xy), bool), xy)


def _heights(body: ReliefBody, xy: F64, side: float) -> F64:
    """(N,) px of a sheet at photo px (N, 2)."""
    height = body.height(xy, side)
    if body.solid is not None and side == FRONT:
        own = _is_own(body.solid, body.silhouette, xy)
        height[own], _, _ = body.solid.met(xy[own])
    return height


def _is_grazed(solid: PlainSolid, outline: ReliefSilhouette, xy: F64) -> Mask:
    """Which photo px (N, 2) show a face of which the photo shows a sliver."""
    _, face, _ = solid.met(xy)
    return solid.is_grazing[face] & _is_own(solid, outline, xy)


def _own(surface: SurfacePoints, body: ReliefBody, spacing: float) -> SurfacePoints:
    """`surface`, the front or the brim, with the colours of its own parts.

    These colours show where the photo is drawn out too far, and at the ends of parts, where the
    photo mixes two of them.
    """
    outline, behind = body.silhouette, body.behind
    assert behind is not None, "parts are known"
    j, i = np.clip(
        np.rint(outline.grid_xy(surface.xy)).astype(int), 0, np.array(outline.shape[::-1]) - 1
    ).T
    i, j = np.divmod(nearest_in(outline.inside)[i, j], outline.shape[1])
    to_stands, to_rest = _away_from_parts(body)
    is_mixed = np.where(behind.stands, to_rest < MIXED * spacing, to_stands < COVERED * spacing)
    source = outline.photo_xy(behind.seen_beside.astype(np.float64))
    return replace(surface, is_seen=surface.is_seen & ~is_mixed[i, j], color_xy=source[i, j])


def _away_from_parts(body: ReliefBody, pad: int = 0) -> tuple[F64, F64]:
    """(h, w) px to the part that stands before the others, and to the others.

    There are `pad` cells more on each side.
    """
    outline, behind = body.silhouette, body.behind
    assert behind is not None, "parts are known"

    def away(part: Mask) -> F64:
        beyond = np.pad(~part, pad, constant_values=True).astype(np.uint8)
        found = cv2.distanceTransform(beyond, cv2.DIST_L2, 5) * outline.cell
        return np.asarray(found, np.float64)

    return away(behind.stands), away(outline.inside & ~behind.stands)


def _is_own(solid: PlainSolid, outline: ReliefSilhouette, xy: F64) -> Mask:
    """Which photo px (N, 2) are of cells whose far side is the solid's."""
    j, i = np.rint(outline.grid_xy(xy)).astype(int).T
    height, width = outline.shape
    return np.asarray(solid.own[np.clip(i, 0, height - 1), np.clip(j, 0, width - 1)])


def _seen_edges(
    solid: PlainSolid, lines: list[RimLine], outline: ReliefSilhouette, spacing: float
) -> F64:
    """Photo px (N, 2) in line along the edges of a solid that the photo shows."""
    places, face = solid.along_edges(spacing)
    xy, _ = solid.relief(places[solid.is_seen[face]])
    return xy[_is_own(solid, outline, xy) & _is_within(xy, lines, outline, 0.0)]


def _hidden(
    solid: PlainSolid,
    outline: ReliefSilhouette,
    spacing: float,
    density: float,
    rng: np.random.Generator,
) -> SurfacePoints:
    """The sides of a solid that the photo does not show, evenly, and in line along its edges."""
    lined, faces = solid.along_edges(spacing)
    lined, faces = lined[solid.is_hidden[faces]], faces[solid.is_hidden[faces]]
    places, further = solid.scattered(density, rng)
    places, normals = np.concatenate([lined, places]), solid.normals[np.r_[faces, further]]
    return _on_solid(solid, outline, places, normals, len(lined), spacing, rng)


def _on_solid(
    solid: PlainSolid,
    outline: ReliefSilhouette,
    places: F64,
    normals: F64,
    first: int,
    spacing: float,
    rng: np.random.Generator,
) -> SurfacePoints:
    """Places and unit normals (n, 3) of a solid, where it is the body; the `first` go first."""
    xy, height = solid.relief(places)
    kept = np.flatnonzero(_is_own(solid, outline, xy))
    leading = int(np.count_nonzero(kept < first))
    order = np.r_[np.arange(leading), leading + rng.permutation(len(kept) - leading)]
    points = np.column_stack([xy, height])[kept]
    kept = kept[thin_to_spacing(points, spacing * np.sqrt(PACKING), order)]
    normals, no = solid.relief_normals(places[kept], normals[kept]), np.zeros(len(kept), bool)
    return SurfacePoints(xy[kept], height[kept], normals, no, no, no, xy[kept])


def _wall_area(body: ReliefBody, lines: list[RimLine]) -> float:
    """px^2 between the sheets where they do not meet at the outlines."""
    total = 0.0
    for line in lines:
        xy = body.silhouette.photo_xy(line.xy)
        front, back = (body.sample(xy, side)[0] for side in (FRONT, BACK))
        wide = body.silhouette.cell * np.diff(line.length)
        total += float((wide * np.maximum(front - back, 0.0)).sum())
    return total


def _chain(body: ReliefBody, lines: list[RimLine], side: float, spacing: float) -> F64:
    """Photo px (N, 2) along the outlines, evenly apart on a sheet: an edge is a line.

    They lie so far inside that what is drawn of them ends at the outline.
    """
    found = [np.zeros((0, 2))]
    for line in lines:
        closed, inward = (np.vstack([part, part[:1]]) for part in (line.xy, line.inward))
        xy = body.silhouette.photo_xy(closed)
        _, gradient = body.sample(xy, side)
        flat = 1 / np.sqrt(1 + (gradient**2).sum(1))  # how much of a point's width is across
        xy = xy + (INSET * spacing * flat)[:, None] * inward
        height, _ = body.sample(xy, side)
        steps = np.hypot(np.linalg.norm(np.diff(xy, axis=0), axis=1), np.diff(height))
        length = np.r_[0.0, np.cumsum(steps)]
        found.append(_along(length, IN_LINE * spacing, xy[:-1]))
    return np.concatenate(found)


def _wall(body: ReliefBody, lines: list[RimLine], spacing: float) -> SurfacePoints:
    """What joins the sheets at the outlines: rows of points along them, as many as fit in.

    One at least: where the sheets meet it is what one sees of the rim when it turns.
    """
    step = IN_LINE * spacing
    places = [(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)))]
    for line in lines:
        both = np.hstack([line.xy, -line.inward])
        at, outward = np.split(_along(line.length, step / body.silhouette.cell, both), 2, axis=1)
        xy = body.silhouette.photo_xy(at)
        front, back = (body.sample(xy, side)[0] for side in (FRONT, BACK))
        rows = np.maximum(np.floor((front - back) / step), 1)
        if body.solid is not None:  # which has its own
            rows[_is_own(body.solid, body.silhouette, xy)] = 0
        for row in range(int(rows.max(initial=0))):
            there = row < rows
            share = (row + 0.5) / rows[there]
            height = back[there] + share * (front - back)[there]
            places.append((xy[there], height, outward[there]))
    xy, height, outward = (np.concatenate(part) for part in zip(*places, strict=True))
    points, order = np.column_stack([xy, height]), np.arange(len(xy))
    kept = thin_to_spacing(points, spacing * np.sqrt(PACKING), order)
    xy, height, outward = xy[kept], height[kept], outward[kept]
    length = np.linalg.norm(outward, axis=1, keepdims=True)  # 0 at the tip of a hair
    sure = outward / np.maximum(length, 1e-9)
    outward = np.where(length > 1e-6, sure, body.silhouette.outward(xy))
    normals = np.column_stack([outward, np.zeros(len(xy))])
    no = np.zeros(len(xy), bool)
    return SurfacePoints(xy, height, normals, no, no, no, xy)


def _along(length: F64, step: float, values: F64) -> F64:
    """`values` (n, c) of a closed line, `length` (n + 1,), evenly `step` apart on it."""
    count = max(int(length[-1] / step), 1)
    at = np.linspace(0, length[-1], count, endpoint=False)
    closed = np.vstack([values, values[:1]])
    return np.column_stack([np.interp(at, length, column) for column in closed.T])


def _inner_area(body: ReliefBody) -> float:
    """px^2 of what is between parts of the object."""
    inner = body.overlaps
    if inner is None:
        return 0.0
    cell = body.silhouette.cell
    walls = cell * float((inner.walls.top - inner.walls.foot).sum())
    return walls + 2 * cell**2 * int(inner.is_apart.sum())


def _inner(
    body: ReliefBody, spacing: float, density: float, rng: np.random.Generator
) -> list[tuple[SurfacePoints, int]]:
    """Between parts of the object: the sides of near ones, their backs, and what is beneath.

    With each, how many of its points come first: they lie along its end.
    """
    inner, outline = body.overlaps, body.silhouette
    if inner is None:
        return []
    cell, walls = outline.cell, inner.walls
    expected = density * cell * (walls.top - walls.foot)
    which = np.repeat(
        np.arange(len(expected)), np.floor(expected + rng.random(len(expected))).astype(int)
    )
    along = walls.step[which][:, ::-1] * (rng.random((len(which), 1)) - 0.5)
    xy = outline.photo_xy(walls.near[which] + WITHIN * walls.step[which] + along)
    share = rng.random(len(which))
    height = walls.foot[which] + share * (walls.top - walls.foot)[which]
    normals = np.column_stack([walls.step[which], np.zeros(len(which))]).astype(np.float64)
    no = np.zeros(len(which), bool)
    behind = outline.photo_xy(walls.near[which] - walls.step[which].astype(np.float64))
    sheets = [(SurfacePoints(xy, height, normals, ~no, no, no, behind), 0)]
    assert body.cuts is not None, "there are overlaps"
    beneath = (inner.own_back, BACK, inner.own_beside), (inner.beneath, FRONT, inner.beside)
    ends = [] if body.behind is None else rim_lines(inner.is_apart)
    for field, side, beside in beneath:
        down, right = (slope / cell for slope in body.cuts.gradient(field))
        fields = np.stack([field, right, down], -1)
        area = np.where(inner.is_apart, cell**2 * np.sqrt(1 + down**2 + right**2), 0.0)
        chains = [_end(line, fields, outline, spacing) for line in ends]
        xy = np.concatenate([*chains, _draw(outline, area * density, rng)])
        at = outline.grid_xy(xy)
        near = body.cuts.settled(at)
        height, dx, dy = bilinear(fields, near).T
        step = cell * ((at - near) * np.column_stack([dx, dy])).sum(1)
        height = height + np.clip(step, -cell, cell)
        normals = side * np.column_stack([-dx, -dy, np.ones(len(xy))])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        no = np.zeros(len(xy), bool)
        j, i = np.clip(np.rint(at).astype(int), 0, np.array(field.shape[::-1]) - 1).T
        source = xy if beside is None else outline.photo_xy(beside[i, j].astype(np.float64))
        surface = SurfacePoints(xy, height, normals, ~no, no, no, source)
        sheets.append((surface, sum(map(len, chains))))
    return sheets


def _end(line: RimLine, fields: F64, outline: ReliefSilhouette, spacing: float) -> F64:
    """Photo px (N, 2) along the end of a hidden sheet: its heights and slopes (h, w, 3)."""
    _, dx, dy = bilinear(fields, line.xy).T
    flat = 1 / np.sqrt(1 + dx**2 + dy**2)
    xy = outline.photo_xy(line.xy) + (INSET * spacing * flat)[:, None] * line.inward
    height = bilinear(fields, outline.grid_xy(xy))[:, 0]
    closed = np.column_stack([xy, height])
    steps = np.linalg.norm(np.roll(closed, -1, axis=0) - closed, axis=1)
    return _along(np.r_[0.0, np.cumsum(steps)], IN_LINE * spacing, xy)


def _brim(
    body: ReliefBody,
    band: float,
    spacing: float,
    density: float,
    rng: np.random.Generator,
    fringe: Matte | None,
) -> SurfacePoints:
    """Around the silhouette, a little past the matte's `band` px, at the height of its middle.

    Of a `fringe` only as far as it covers something.
    """
    outline, reach = body.silhouette, band + BRIM * spacing
    pad = int(np.ceil(reach / outline.cell)) + 1
    inside = np.pad(outline.inside, pad).astype(np.uint8)
    distance = cv2.distanceTransform(1 - inside, cv2.DIST_L2, 5) * outline.cell
    ring = (inside == 0) & (distance < reach)
    if body.behind is not None:  # between two parts its height would be that of neither
        ring &= np.abs(np.subtract(*_away_from_parts(body, pad))) > spacing
    xy = _draw(outline, np.where(ring, density * outline.cell**2, 0.0), rng) - pad * outline.cell
    if fringe is not None:
        wide = 2 * int(np.ceil(BRIM * spacing)) + 1
        covered = cv2.dilate(fringe.alpha, np.ones((wide, wide), np.uint8))
        xy = xy[bilinear(covered, xy - [fringe.left + 0.5, fringe.top + 0.5]) > 0]
    height, _ = body.sample(xy, MIDDLE)
    if body.solid is not None:
        own = _is_own(body.solid, outline, xy)
        height[own] = body.solid.beside(xy[own])
    normals = np.column_stack([outline.outward(xy), np.zeros(len(xy))])
    yes = np.ones(len(xy), bool)
    return SurfacePoints(xy, height, normals, yes, yes, yes, xy)
