"""Which explicit shape an object is, how surely, and where."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import F64, Mask
from ...base.camera import Camera
from ...base.poisson_disk import nearest_in
from ...document.model import Matte
from ..relief.body import ReliefBody
from ..relief.canvas import carried_on
from ..relief.cuts import Cuts
from ..relief.plain_solid import PlainSolid
from ..relief.shape_look import SeenShape
from ..relief.silhouette import ReliefSilhouette
from ..relief.thickness import Thickness
from .boxes import fit_about, fit_box, fit_flat
from .evidence import Evidence, Misfit
from .rims import Rim
from .rods import Axis, AzimuthOf, TurnedBody
from .round import fit_closed_ring, fit_ellipsoid, fit_revolution, fit_ring
from .solids import Drawn, Mesh, RayGrid, drawn

SHEET, DRAWN = 0.012, 0.004  # x extent: half of a flat thing's thickness, and of a drawing's
BEYOND = 2.0  # cells from a shape's own outline, up to which its sides go on
MISSED = 4.0  # cells from a shape's outline, up to which a silhouette ends as it does
REACH = 0.03  # x extent, over which a shape gives way to what sticks out beside it
# Of a shape's description: outline, depth and normals, each 1 where it is as far off as expected;
# what of the mask it leaves out; that a surface of revolution may have any profile, and of the
# profile's bend (radians) the logarithm of one more. The outline counts most: the network's depth
# and normals are blurred, and rounder than what they are of.
WEIGHTS, LEFT_OUT, PROFILE = (3.0, 0.5, 0.5), 8.0, (0.1, 0.5)
STEM = 0.2  # description that is left out, from which a thing is looked at with all its thin parts
LONGEST = 2.5  # description, of which half are what they are said to be
WIDTH = 0.25  # of descriptions, over which that changes
LEAST = 0.3  # weight, below which an object is free
WHOLE = 0.85  # weight, from which it is nothing but the shape
# Log odds of a sheet over a solid, as the network says, from which a thing is flat. A solid that is
# taken for a sheet loses 4 dB when it turns; a sheet that is left free is only puffed.
FLAT = 2.0
SIDED = 2.0  # log odds that are asked on top where a box shows two sides: no sheet does
RECTANGLE = 1.0  # log odds that an outline adds which is a rectangle in perspective
# Of a drawing: its colours, the share of it that has one of these to a level, the levels between
# any two, and how much of it must be neither nearly white nor dark. A cartoon with a contour has
# .86, small drawings in JPEG files .45 and more, and photographed things up to .1.
PALETTE, PAINTED, APART, TELLING, DARK, LIGHT = 5, 0.4, 12, 0.3, 48, 250
OPAQUE, SAMPLE, LEAST_DRAWN = 0.99, 80_000, 100  # alpha; px that are looked at; px
OUTLINED = 0.4  # misfit of an outline that is surely a box's
EXPLAINED = 0.95  # weight, from which no other shape is tried
# Misfit, from which a first guess does not become what is recognised: of drawn solids those that
# did began at 8.7 or less. Of 62 objects in photographs it changes only the time, by a third.
FRUITLESS = 25.0
STANDS, LYING = 0.5, 0.5  # weight of a shape that shows what is up, and cosine to the upright
# Of what a plate's rim encloses: how near its middle the far half is looked at, x the rim's radius
# from the rim, how much of that faces as the rim does, and the description and the misfit of the
# normals of a ring that may be. Of 48 made rings with such a rim 38 are found, and of 80 plates,
# bowls and cups none is taken for one.
INMOST, PLANE, LIKELY, FACED = -0.5, 0.93, 2.9, 1.12
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
    likeness: float = 1.0  # how much it would be believed if the artist did not say so
    half: float = SHEET  # x extent: half of a sheet's thickness

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

    def axis(self, size: float) -> Axis | None:
        """Of a surface of revolution, `size` times as large and as far away."""
        if self.kind != "round" or self.mesh is None or len(self.mesh.axes) != 1:
            return None
        return Axis(size * self.mesh.vertices.mean(0), self.mesh.axes[0])

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
            whole = np.ones(outline.shape)
            return PlacedShape(1 / near, 1 / near, whole, weight, whole > 0, whole > 0)
        assert self.mesh is not None
        seen = drawn(self.mesh, grid)
        met = (seen.near > 0) & outline.inside
        if not met.any():
            ones = np.ones(outline.shape)
            return PlacedShape(ones, ones, 0 * ones, 0.0, met, met)
        near, far = (1 / field for field in _carried_on(seen, met))
        gap = cv2.distanceTransform((~met).astype(np.uint8), cv2.DIST_L2, 3) * outline.cell
        share = np.clip(2 - gap / (REACH * outline.extent), 0, 1)
        return PlacedShape(near, far, share, weight, met, gap < MISSED * outline.cell)


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
    is_met: Mask  # (h, w) by rays
    is_near: Mask  # (h, w) that, or nearly


def closed_ring(seen: SeenShape, rim: Rim) -> Recognised | None:
    """A ring of which `rim` is the outline, and whose nearer side hides its hole; None elsewhere.

    A doughnut seen aslant has the outline of a plate. Of a plate the far half is seen; of a ring
    the hole's far side is, which is steep.
    """
    evidence = Evidence.of(seen)
    tangents = evidence.grid.tangents
    is_far = evidence.sure & (rim.outside(tangents) < INMOST * rim.radius / rim.centre[2])
    is_far &= (tangents - rim.centre[:2] / rim.centre[2]) @ rim.slope > 0
    if not is_far.any() or float((evidence.normal[is_far] @ rim.normal).mean()) > PLANE:
        return None
    if (found := fit_closed_ring(evidence, rim.normal)) is None:
        return None
    ring = _described("round", found, evidence, 0.0)
    return ring if ring.description < LIKELY and ring.misfit.normal < FACED else None


def recognised(seen: SeenShape, kind: str = "auto", is_drawing: bool = False) -> Recognised | None:
    """The shape of what is seen; None where it is none of these.

    `kind`: "auto", or what the artist says it is: "round", "flat" or "box". A drawing is a sheet,
    but of a box: that has sides of one colour each in a picture that was computed, too.
    """
    evidence = Evidence.of(seen)
    if evidence.sure.sum() < LEAST_SURE or kind not in ("auto", "round", "flat", "box"):
        return None
    if kind != "auto":
        is_flat = kind == "flat"
        found = _sheet(evidence, is_drawing) if is_flat else _solid(kind, evidence, np.inf)
        likeness = found.weight
        if kind == "box" and likeness < LEAST:
            found = _described(kind, fit_about(evidence.core()), evidence, 0.0)
        return replace(found, weight=1.0, likeness=likeness)
    odds = seen.flatness + (RECTANGLE if evidence.is_four_cornered else 0.0) - FLAT
    odds = max(odds, 0.0) if is_drawing else odds
    if odds >= SIDED:
        return _sheet(evidence, is_drawing)
    box = _solid("box", evidence)
    if _shows_sides(box):
        if box.weight > EXPLAINED:
            return box
    elif odds >= 0:
        return _sheet(evidence, is_drawing)
    best = min(box, _solid("round", evidence), key=_length)
    return best if best.weight >= LEAST else None


def looks_drawn(matte: Matte) -> bool:
    """Whether the object has a handful of colours, each all over alike: no light falls on it."""
    step = int((matte.alpha.size / SAMPLE) ** 0.5) + 1
    own = matte.alpha[::step, ::step] > OPAQUE
    pixels = np.rint(255 * matte.foreground[::step, ::step][own]).astype(np.int64)
    says_nothing = (pixels < DARK).all(1) | (pixels > LIGHT).all(1)  # so exposed, all things are
    left = pixels[~says_nothing]
    count = len(left)
    if count < max(LEAST_DRAWN, TELLING * len(pixels)):
        return False
    codes, counts = np.unique(left @ (1 << 16, 1 << 8, 1), return_counts=True)
    colours, painted = codes[:, None] >> (16, 8, 0) & 255, 0
    for _ in range(PALETTE):
        if len(counts) == 0:
            break
        off = np.abs(colours - colours[counts.argmax()]).max(1)
        painted += counts[off <= 1].sum()
        colours, counts = colours[off > APART], counts[off > APART]
    return bool(painted > PAINTED * count)


def _length(found: Recognised) -> float:
    return found.description


def _sheet(evidence: Evidence, is_drawing: bool) -> Recognised:
    plane, misfit = fit_flat(evidence)
    half = DRAWN if is_drawing else SHEET
    return Recognised("flat", misfit, 1.0, evidence, None, plane, half=half)


def _solid(kind: str, evidence: Evidence, hopeless: float = FRUITLESS) -> Recognised:
    """The best box, or the best round thing."""
    core = evidence.core()
    left_out = LEFT_OUT * (1 - float(core.mask.sum()) / float(evidence.mask.sum()))
    if kind == "box":
        return _described(kind, fit_box(core, hopeless), evidence, left_out)
    if (ring := fit_ring(core)) is not None:
        return _described(kind, ring, evidence, left_out)
    fits = [_described(kind, fit_ellipsoid(core), evidence, left_out)]
    if fits[0].weight < EXPLAINED:
        fits += _turned(core, evidence, left_out, hopeless)
    best = min(fits, key=_length)
    if left_out > STEM:  # a vase's neck, or a foot on a thin stem, is no handle
        for whole in _turned(evidence, evidence, 0.0, hopeless):
            # How it leans says what is seen within its outline, not that it is longer.
            is_known = best.weight >= WHOLE and _inner(whole) > _inner(best)
            best = best if is_known else min(best, whole, key=_length)
    return best


def _inner(found: Recognised) -> float:
    """How far a shape is from what is seen within its outline."""
    return found.misfit.depth + found.misfit.normal


def _turned(part: Evidence, evidence: Evidence, more: float, hopeless: float) -> list[Recognised]:
    """The best surface of revolution for a `part` of the evidence, if there is any."""
    if (turned := fit_revolution(part, hopeless)) is None:
        return []
    more += PROFILE[0] + PROFILE[1] * float(np.log1p(turned[2]))
    return [_described("round", turned[:2], evidence, more)]


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


# A body that becomes the shape it was recognised as, where that explains it.

STRAY = 0.2  # x extent, from which a front is something else than the shape's
# Of a thing whose outline is surely a box's: the network's front is often far off at its corners.
SURELY, FARTHER = 0.2, 3.0  # misfit of the outline, up to which that is so; x STRAY
ROUNDS = 4  # of a plane that is fitted to most of a front
SOFT = 0.02  # x extent, over which one gives way to the other
ALONE = 0.95  # share, from which a body is nothing but the shape there
ALONG = 0.05  # x extent, over which a tube's middle is smoothed
INNER = 0.02  # x extent from the outline, nearer to which fronts are hardly compared
AT_RIM = 0.2  # of a weight, that is left there


def completed(
    body: ReliefBody, shape: Recognised, camera: Camera, thickness: float, trust: float,
    azimuth_of: AzimuthOf = lambda _: None,
) -> ReliefBody:  # fmt: skip
    """`body`, whose thickness was multiplied by `thickness`, as `shape` as far as that is sure.

    `trust` in [0, 1]: 0 leaves the body as it is. How far away it is the body says, and
    `azimuth_of` how what sticks out of a surface of revolution lies about its axis.
    """
    outline, focal = body.silhouette, camera.focal
    places = shape.over(outline, camera)
    half = body.front.half(outline.cells.reshape(-1, 2)).reshape(outline.shape)
    front = body.middle + half / thickness
    compared = outline.inside & (places.share > 0.5) & (outline.depth > INNER * outline.extent)
    if not compared.any():
        return body
    away = float(np.median(np.log((focal - front[compared]) / places.near[compared])))
    near, far = (focal - np.exp(away) * side for side in (places.near, places.far))
    if shape.plane is not None:
        share = np.full(outline.shape, trust * places.weight)
        return _as_sheet(body, near - shape.half * outline.extent, share, thickness * shape.half)
    # The shape shows how it leans better than a network does, also of what sticks out of it.
    lean = _plane(near - front, compared, outline)
    body = replace(body, middle=body.middle + trust * places.weight * lean)
    is_sure = shape.kind == "box" and shape.misfit.outline < SURELY
    stray = STRAY * (FARTHER if is_sure else 1)
    share = trust * _share(places, _across(front + lean - near, near, outline.cell), body, stray)
    half = 0.5 * (near - far)
    sides = [side.towards(thickness * half, share) for side in (body.front, body.back)]
    middle = body.middle + share * (near - half - body.middle)
    body = replace(body, middle=middle, front=sides[0], back=sides[1], kind=shape.kind)
    body = replace(body, likeness=shape.likeness)
    body = replace(body, up=body.up if shape.up is None else shape.up)
    own = (share > ALONE) & places.is_near & (thickness == 1)
    body = replace(_whole(body, share), solid=_solid_of(shape, own, away, camera))
    if (axis := shape.axis(np.exp(away))) is None:
        return body
    share = trust * places.weight
    turned = TurnedBody(body, places.is_met, axis, camera, share, thickness)
    return turned.with_rods(azimuth_of)


def _solid_of(shape: Recognised, own: Mask, away: float, camera: Camera) -> PlainSolid | None:
    """The box itself, where a body is nothing but it in its `own` cells (h, w), if in any.

    `away`: the logarithm of its size in px.
    """
    if shape.mesh is None or shape.kind != "box" or shape.likeness < LEAST or not own.any():
        return None
    return PlainSolid(np.exp(away) * shape.mesh.vertices, shape.mesh.faces, camera, own)


def flattened(body: ReliefBody, thickness: float) -> ReliefBody:
    """`body` as a sheet that lies as its middle does."""
    return _as_sheet(body, body.middle, np.ones(body.silhouette.shape), thickness * SHEET)


def rounded(body: ReliefBody, thickness: float) -> ReliefBody:
    """`body` as a tube: every cross-section of its outline is a circle (Blum 1967).

    Its front stays where it is, smoothed along.
    """
    outline = body.silhouette
    half = np.sqrt(Thickness.balls(outline))
    front = body.middle + body.front.half(outline.cells.reshape(-1, 2)).reshape(outline.shape)
    weight = half * outline.inside
    sigma = ALONG * outline.extent / outline.cell
    middle = cv2.GaussianBlur((front - half) * weight, (0, 0), sigma)
    middle /= np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-6)
    share = np.ones(outline.shape)
    sides = [side.towards(thickness * half, share) for side in (body.front, body.back)]
    body = replace(body, middle=middle, front=sides[0], back=sides[1], kind="tube")
    return _whole(body, share)


def _as_sheet(body: ReliefBody, middle: F64, share: F64, half_extent: float) -> ReliefBody:
    half = np.full(share.shape, half_extent * body.silhouette.extent)
    sides = [side.mixed(half, share) for side in (body.front, body.back)]
    middle = body.middle + share * (middle - body.middle)
    body = replace(body, middle=middle, front=sides[0], back=sides[1], kind="flat")
    return _whole(body, share)


def _plane(field: F64, known: Mask, outline: ReliefSilhouette) -> F64:
    """(h, w) the plane nearest to most of `field` (h, w) where that is `known` (h, w)."""
    cells = np.concatenate([outline.cells, np.ones((*outline.shape, 1))], -1)
    own, values, weight = cells[known], field[known], np.ones(int(known.sum()))
    plane = np.zeros(3)
    for _ in range(ROUNDS):
        scaled = own * weight[:, None]
        plane = np.linalg.lstsq(scaled.T @ own, scaled.T @ values)[0]
        off = (values - own @ plane) / (STRAY * outline.extent)
        weight = 1 / (1 + off**2) ** 2
    return cells @ plane


def _whole(body: ReliefBody, share: F64) -> ReliefBody:
    """Without cuts where most of the body, `share` (h, w), is one shape."""
    cuts = None if body.cuts is None else _uncut(body.cuts, share > 0.5)
    own = None if cuts is None or body.own is None else 1 - (1 - share) * (1 - body.own)
    sides = [replace(side, cuts=cuts) for side in (body.front, body.back)]
    return replace(body, front=sides[0], back=sides[1], cuts=cuts, own=own)


def _across(off: F64, near: F64, cell: float) -> F64:
    """(h, w) px: how far off a front that is `off` along the rays is across a shape, `near` it.

    Of a lid that is seen nearly edge-on a pixel is as deep as the lid is wide.
    """
    square = np.ones(near.shape)
    for axis in (0, 1):
        steps = np.abs(np.diff(near, axis=axis)) / cell
        sides = [np.insert(steps, at, np.inf, axis=axis) for at in (0, steps.shape[axis])]
        slope = np.minimum(*sides)  # where a surface ends before another it is that surface's
        square += np.where(np.isfinite(slope), slope, 0.0) ** 2
    return np.asarray(off / np.sqrt(square), np.float64)


def _share(places: PlacedShape, off: F64, body: ReliefBody, stray: float) -> F64:
    """(h, w) how much of each cell is the shape's, whose front is `off` (h, w) px wrong."""
    outline = body.silhouette
    sigma = SOFT * outline.extent / outline.cell
    # A network's fronts are round at their rims, also those of boxes.
    weight = outline.inside * np.clip(outline.depth / (INNER * outline.extent), AT_RIM, 1) ** 2
    smooth = cv2.GaussianBlur(off * weight, (0, 0), sigma)
    smooth = smooth / np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-6)
    explained = 1 / (1 + (smooth / (stray * outline.extent)) ** 4)
    return places.weight * places.share * explained


def _uncut(cuts: Cuts, is_whole: Mask) -> Cuts | None:
    """Without cuts within what is whole (h, w)."""
    down = cuts.down & ~(is_whole[1:] & is_whole[:-1])
    right = cuts.right & ~(is_whole[:, 1:] & is_whole[:, :-1])
    return Cuts(down, right) if down.any() or right.any() else None
