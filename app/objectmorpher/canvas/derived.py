"""Everything that is computed from the document and never saved, remembered by identity.

The heavy modules of the core are imported when the first object is lifted, or by `import_core`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, F64, I32, Mask, Pixels, Sparse, crop
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document import edits, hold_edits, key_edits
from objectmorpher_core.document.model import (
    Document,
    EditObject,
    Photo,
    Plate,
    Pose,
)

from ..editor.view import ViewState
from .layer import is_front
from .memo import Memo
from .shape import CanvasShape, RestSurface, Shapes, build_shape

if TYPE_CHECKING:
    from scipy.spatial import KDTree

    from objectmorpher_core.compose.plate.residue import Ghost
    from objectmorpher_core.deform.deformer import Deformer
    from objectmorpher_core.deform.puppet import SurfacePoint
    from objectmorpher_core.deform.symmetry import MirrorPlane
    from objectmorpher_core.raster.posed import PosedSplats
    from objectmorpher_core.raster.tiles import Drawable

PICK_REACH = 3.0  # points beside an object within which its nearest point is picked
MOST_SHAPES = 24  # remembered: every object of a document needs its own in each frame
SPARE_SHAPES = 4  # more than there are objects: of what was undone
POSES = 3  # remembered of each object: as it is, as a stroke has it, as somebody looks at it
CARRIERS = 8  # Gaussians that tell how a place of the photo has moved
RIDGE = 1e-3  # px^2, where they lie on a line
OUTLINE_PIXELS = 2e6  # of the grid on which a mask's outline is followed
SHARES = 1000  # of what the background shows of its ghosts: a drag goes to and fro between a few


@dataclass(frozen=True, eq=False)
class Spot:
    """A place in the picture, and how far away."""

    xy: F64  # (2,) image px
    depth: float  # world units along z
    diameter: float  # of the object, world units

    def moved(self, delta: np.ndarray, diameters: float) -> Spot:
        """`delta` (2,) image px and so many object diameters away."""
        depth = max(self.depth + diameters * self.diameter, 0.05 * self.depth)
        return replace(self, xy=self.xy + delta, depth=depth)


@dataclass(frozen=True, eq=False)
class ObjectFrame:
    """The box around an object in the picture."""

    corners: F64  # (4, 2) image px: left top, right top, right bottom, left bottom
    centre: F64  # (2,) image px, of the placed object
    radius: float  # image px, of the ring around it


class Derived:
    """Solver, posed Gaussians and places of the document's objects."""

    def __init__(self) -> None:
        self._shapes = Memo(MOST_SHAPES)
        self._posed: dict[int, Memo] = {}  # of each object
        self._drafts: dict[int, Memo] = {}
        self._latest = Memo(MOST_SHAPES)  # the last shape of each lift, in a list of one
        self._drawables: dict[int, tuple[PosedSplats, tuple[float, ...], Drawable]] = {}
        self._shares, self._contours, self._holes = Memo(), Memo(), Memo()
        self._links, self._bodies = Memo(), Memo()
        self._plates, self._shaded = Memo(), Memo()
        self._carriers, self._invented, self._hidden = Memo(), Memo(), Memo()
        self._ghosts, self._standing, self._fitting = Memo(), Memo(), Memo()
        # The last background that was shown, and for which masks it was made
        self._filled: tuple[tuple[Mask, ...], Plate] | None = None
        self._seen, self._bare = Memo(2), Memo(2)
        self._order = Memo(2)

    def share(self, mask: Mask) -> float:
        """Share of the photo that a mask covers."""
        return self._shares(lambda: float(mask.mean()), mask)

    def with_background(self, document: Document) -> Document:
        """Return the document; while its background is made anew, with the one it had before."""
        there = [o.mask for o in document.objects if o.hides_background and o.mask is not None]
        if document.plate is not None:
            self._filled = tuple(there), document.plate
        elif self._filled is not None and len(_left(document)) > len(self._unfilled(document)):
            masks, whole = self._filled
            gone = [mask for mask in masks if all(mask is not one for one in there)]
            plate = whole
            if gone:
                args = whole, document.photo, gone, there
                plate = self._fitting(lambda: _fitting(*args), whole, *gone, None, *there)
            return self._standing(lambda: replace(document, plate=plate), document, plate)
        return document

    def unfilled(self, document: Document) -> Mask | None:
        """(H, W) what moved objects have left where `with_background` has nothing for it."""
        masks = self._unfilled(document)
        if document.plate is not None or not masks:
            return None
        return self._holes(lambda: np.logical_or.reduce(masks), *masks)

    def _unfilled(self, document: Document) -> list[Mask]:
        """The masks of what moved that the last background was not made for."""
        filled = () if self._filled is None else self._filled[0]
        return [mask for mask in _left(document) if all(mask is not one for one in filled)]

    def plate(self, document: Document) -> Plate | None:
        """Return the background of the view: the photo around the objects that are still there."""
        from objectmorpher_core.compose.order import holes
        from objectmorpher_core.compose.plate.plate import plate_of_holes, shaded, shaded_plate
        from objectmorpher_core.compose.plate.residue import shown_shares
        from objectmorpher_core.document.transparency import seen_plate

        gone, ghosts = holes(document), self.ghosts(document)
        shares = _the_same(shown_shares(document, ghosts, gone))
        base = self._shaded(
            lambda: shaded_plate(document, gone, ghosts),
            document.plate, ghosts, *gone, None, *shaded(document, gone),
        )  # fmt: skip

        def build() -> Plate | None:
            plate = plate_of_holes(document, gone, ghosts, base)
            return seen_plate(document.photo, plate, gone)

        mattes = (o.matte for o in document.objects)
        return self._plates(build, base, *gone, None, *mattes, shares)

    def bare_plate(self, document: Document) -> Plate | None:
        """Return the background of the view without any object."""
        from objectmorpher_core.document.transparency import seen_plate

        mattes = tuple(o.matte_here for o in document.objects if o.matte_here is not None)
        return self._bare(
            lambda: seen_plate(document.photo, document.plate, mattes),
            document.photo, document.plate, *mattes,
        )  # fmt: skip

    def photo(self, photo: Photo) -> Pixels:
        """(H, W, 3) the photo of the view: on a checker where it is transparent."""
        from objectmorpher_core.document.transparency import seen

        return self._seen(lambda: seen(photo), photo)

    def ghosts(self, document: Document) -> tuple[Ghost, ...]:
        """What the objects leave beside their cut-outs."""
        from objectmorpher_core.compose.plate.plate import SEAM, hole_margin
        from objectmorpher_core.compose.plate.residue import find_ghosts

        near = SEAM * hole_margin(*document.photo.size)
        parts = tuple(part for o in document.objects for part in (o.matte, o.lifted))
        return self._ghosts(lambda: find_ghosts(document, near), document.plate, *parts)

    def invented_background(self, document: Document) -> Mask | None:
        """(H, W) where the plate is invented; None while there is no plate."""
        plate = self.plate(document)
        if plate is None:
            return None
        width, height = document.photo.size
        return self._invented(lambda: crop(plate.hole, plate.box, (0, 0, width, height)), plate)

    def hidden(self, document: Document) -> Mask:
        """(H, W) what the objects hide."""
        from objectmorpher_core.compose.plate.plate import plate_cover

        return self._hidden(lambda: plate_cover(document), *(o.matte for o in document.objects))

    def contours(self, mask: Mask) -> tuple[F32, ...]:
        """A mask's outlines, each (N, 2) image px."""
        return self._contours(lambda: _outlines(mask), mask)

    def shape(self, photo: Photo, thing: EditObject) -> CanvasShape:
        """Solver, poser and texture; a fraction of a second the first time."""
        return self._shapes(lambda: self._build_shape(photo, thing), *_parts_of(thing))

    def _build_shape(self, photo: Photo, thing: EditObject) -> CanvasShape:
        """Of a rig, or of the colours of an edge, that changed, only what depends on it."""
        latest = self._latest(list, thing.lifted, thing.deform)
        shape = latest[0].changed_to(thing) if latest else build_shape(photo.camera, thing)
        latest[:] = [shape]
        return shape

    def adopt(self, shapes: Shapes) -> None:
        """Takes over shapes of the document's objects that were made elsewhere."""
        self.make_room(len(shapes))
        for thing, shape in shapes:
            self.remember(thing, shape)

    def remember(self, thing: EditObject, shape: CanvasShape) -> None:
        """Takes over an object's shape that was made in a thread, of one that is equal to it."""
        assert thing.matte is not None, "a lifted object has one"
        shape.rig, shape.matte = thing.rig, thing.matte  # known by identity from now on
        self._shapes(lambda: shape, *_parts_of(thing))
        self._latest(list, thing.lifted, thing.deform)[:] = [shape]

    def make_room(self, objects: int) -> None:
        """Remembers what so many objects need in each frame."""
        self._shapes.make_room(objects + SPARE_SHAPES)
        self._latest.make_room(objects + SPARE_SHAPES)

    def posed(self, document: Document, k: int) -> PosedSplats:
        """Object `k`'s Gaussians where the edit has put them, world."""
        thing = document.objects[k]
        puppet = self.shape(document.photo, thing).puppet
        return self._posed.setdefault(k, Memo(POSES))(
            lambda: puppet.posed(thing.pose, thing.placement), puppet, thing.pose, thing.placement
        )

    def order(self, document: Document) -> list[int]:
        """The lifted objects and what stays in front, back to front."""
        return list(self._order(lambda: self._ordered(document), document))

    def _ordered(self, document: Document) -> list[int]:
        from objectmorpher_core.compose.order import back_to_front

        objects = document.objects
        fronts = [k for k in range(len(objects)) if is_front(document, k)]
        there = [k for k, o in enumerate(objects) if o.lifted or k in fronts]
        if len(there) < 2:
            return there
        return back_to_front(
            document, {k: None if k in fronts else self.posed(document, k) for k in there}
        )

    def draft(self, document: Document, k: int) -> PosedSplats:
        """Return a draft for quick pictures: a large object gets fewer, wider Gaussians."""
        thing = document.objects[k]
        puppet = self.shape(document.photo, thing).puppet
        if not puppet.has_draft:
            return self.posed(document, k)
        return self._drafts.setdefault(k, Memo(POSES))(
            lambda: puppet.draft(thing.pose, thing.placement), puppet, thing.pose, thing.placement
        )

    def body_points(self, document: Document, k: int) -> F64:
        """(N, 3) object frame: object `k`'s solid Gaussians, deformed."""
        thing = document.objects[k]
        assert thing.lifted is not None
        if thing.pose is None:
            return thing.lifted.body.means.astype(np.float64)
        return self._bodies(lambda: self._deformed_body(document, k), thing.lifted, thing.pose)

    def _deformed_body(self, document: Document, k: int) -> F64:
        splats = self.posed(document, k)
        is_solid = splats.rest.lifted.texture.solidity > 0.5
        return splats.skinned.points[is_solid if is_solid.any() else slice(None)]

    def drawable_of(self, k: int, splats: PosedSplats, camera: Camera, view: ViewState) -> Drawable:
        """Object `k`'s Gaussians `splats` on the canvas; `camera` is the photo's."""
        from objectmorpher_core.raster import tiles

        key = view.place
        kept = self._drawables.get(k)
        if kept is None or kept[0] is not splats or kept[1] != key:
            kept = (splats, key, tiles.prepare(splats, view.camera(camera), camera))
            self._drawables[k] = kept
        return kept[2]

    def forget(self, lifted: set[int]) -> None:
        """Drops what was posed and projected of objects other than these."""
        self._posed = {k: kept for k, kept in self._posed.items() if k in lifted}
        self._drafts = {k: kept for k, kept in self._drafts.items() if k in lifted}
        self._drawables = {k: kept for k, kept in self._drawables.items() if k in lifted}

    def solved(self, document: Document, k: int, start: Pose | None, **effort: float) -> Document:
        """The document with object `k` in the pose that its handles ask for.

        `start` and little `effort` (`Deformer.solve`) give a drag's frame; without, the solve is
        complete.
        """
        thing = document.objects[k]
        if not thing.handles and thing.rig.shifts is None and thing.base.pose is None:
            return edits.set_pose(document, k, None)
        deformer = self.deformer(document, k)
        solution = deformer.solve(thing.handles, thing.footing, start, **effort)
        return edits.set_pose(document, k, solution.pose)

    def posed_again(self, document: Document, k: int) -> Document:
        """Object `k` of another shape in the pose that went over, or in that of its handles."""
        item = document.objects[k]
        is_over = item.pose is not None and hold_edits.keeps_pose(item)
        return self.held(document, k) if is_over else self.solved(document, k, None)

    def keys_again(self, document: Document, k: int) -> Document:
        """Object `k` of another shape, with its key poses as `posed_again` makes them."""
        return key_edits.with_keys_again(document, k, lambda there: self.posed_again(there, k))

    def deformer(self, document: Document, k: int) -> Deformer:
        """Return the solver of object `k`'s pose."""
        return self.shape(document.photo, document.objects[k]).puppet.deformer

    def held(self, document: Document, k: int, added: tuple[int, ...] = ()) -> Document:
        """Object `k` held as it is by the handles that it has now, of which some are `added`."""
        return hold_edits.hold(document, k, self.deformer(document, k), added)

    def anchors(self, document: Document, k: int) -> F64:
        """Return the automatic anchors in the view: (A, 2) image px."""
        thing = document.objects[k]
        deformer = self.shape(document.photo, thing).puppet.deformer
        index = deformer.anchors(thing.handles, thing.footing)
        points = thing.pose.points if thing.pose else deformer.points
        return self.project(document, k, points[index])

    def control_places(self, document: Document, k: int) -> F64:
        """Return the control points in the current pose: (M, 3) world."""
        thing = document.objects[k]
        assert thing.lifted is not None
        points = thing.pose.points if thing.pose else thing.lifted.control_points
        return self.world(document, k, points)

    def control_points(self, document: Document, k: int) -> F64:
        """Return the control points in the view: (M, 2) image px."""
        return document.photo.camera.project(self.control_places(document, k))

    def links(self, document: Document, k: int, count: int) -> F64:
        """The strongest links of each control point: (L, 2, 2) image px of their ends."""
        thing = document.objects[k]
        graph = self.shape(document.photo, thing).puppet.deformer.graph
        pairs = self._links(lambda: _strongest(graph.weights, count), graph)
        return self.control_points(document, k)[pairs]

    # Between the object's frame and the picture

    def world(self, document: Document, k: int, points: np.ndarray) -> F64:
        """World positions (..., 3) of object-frame points, after the placement."""
        thing = document.objects[k]
        assert thing.lifted is not None
        motion = thing.placement.matrix(thing.lifted, document.photo.camera)
        return thing.lifted.world_points(points) @ motion[:3, :3].T + motion[:3, 3]

    def carried(self, document: Document, k: int, xy: np.ndarray) -> F64:
        """Return the image px (N, 2) at which object `k` shows what the photo shows at `xy` (N, 2).

        What is around each place tells how it moved: of the Gaussians that carry the photo there.
        """
        splats = self.posed(document, k)
        seen, tree = self._carriers(lambda: _carriers(splats), splats)
        count = min(CARRIERS, len(seen))
        near = seen[tree.query(xy, k=count)[1].reshape(-1, count)]
        at = splats.rest.lifted.texture.u0[near].astype(np.float64)
        now = document.photo.camera.project(splats.means[near])
        middle, moved = at.mean(1), now.mean(1)
        spread = at - middle[:, None]
        square = spread.transpose(0, 2, 1) @ spread + np.eye(2) * RIDGE
        linear = np.linalg.solve(square, spread.transpose(0, 2, 1) @ (now - moved[:, None]))
        return moved + ((np.asarray(xy) - middle)[:, None] @ linear)[:, 0]

    def project(self, document: Document, k: int, points: np.ndarray) -> F64:
        """Image px (..., 2) of object-frame points (..., 3), after the placement."""
        return document.photo.camera.project(self.world(document, k, points))

    def spot(self, document: Document, k: int, point: np.ndarray) -> Spot:
        """Return the place of an object-frame point (3,) in the view."""
        lifted = document.objects[k].lifted
        assert lifted is not None
        world = self.world(document, k, np.asarray(point))
        xy = document.photo.camera.project(world)
        scale = document.objects[k].placement.scale
        return Spot(xy, float(world[2]), lifted.diameter * lifted.scale * scale)

    def unplaced(self, document: Document, k: int, world: np.ndarray) -> F64:
        """Object-frame position (3,) of a world point, the placement taken back."""
        thing = document.objects[k]
        return self.shape(document.photo, thing).puppet.unplaced(world, thing.placement)

    def frame(self, document: Document, k: int) -> ObjectFrame:
        """The box of the posed and placed object."""
        thing = document.objects[k]
        assert thing.lifted is not None
        xy = self.control_points(document, k)
        (x0, y0), (x1, y1) = xy.min(0), xy.max(0)
        camera = document.photo.camera
        motion = thing.placement.matrix(thing.lifted, camera)
        centre = camera.project(motion[:3, :3] @ thing.lifted.centre + motion[:3, 3])
        corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        radius = 0.62 * float(np.hypot(x1 - x0, y1 - y0))
        return ObjectFrame(corners, centre, radius)

    # The picture

    def surface_at(
        self, document: Document, k: int, view: ViewState, xy: np.ndarray
    ) -> SurfacePoint | None:
        """The surface of object `k` at canvas px `xy` or close beside it; None where it is not."""
        thing = document.objects[k]
        shape = self.shape(document.photo, thing)
        at, reach = (float(xy[0]), float(xy[1])), PICK_REACH * view.scale
        drawable = self.drawable_of(k, self.posed(document, k), document.photo.camera, view)
        return shape.puppet.pick_in(
            drawable, shape.texture, at, thing.pose, thing.placement, reach
        )  # fmt: skip


def _fitting(plate: Plate, photo: Photo, gone: list[Mask], there: list[Mask]) -> Plate:
    """The plate without what was filled in for objects that are `gone`: it is the photo again.

    It ends halfway to what is still `there`.
    """
    x0, y0, x1, y1 = plate.box
    to_gone, to_there = (
        cv2.distanceTransform(
            (~np.logical_or.reduce(masks)[y0:y1, x0:x1]).astype(np.uint8), cv2.DIST_L2, 5
        )
        for masks in (gone, there)
    )
    hole = plate.hole & (to_there <= to_gone)
    painted = None if plate.painted is None else plate.painted & hole
    pixels = np.where(hole[..., None], plate.pixels, photo.pixels[y0:y1, x0:x1])
    return replace(plate, pixels=pixels, hole=hole, painted=painted)


def _left(document: Document) -> list[Mask]:
    """The masks of the objects that have moved away from where they were in the photo."""
    from objectmorpher_core.compose.order import leaves_a_hole

    objects = document.objects
    there = [o for k, o in enumerate(objects) if o.is_moved and leaves_a_hole(objects, k)]
    return [o.mask for o in there if o.mask is not None]


def _parts_of(thing: EditObject) -> tuple[object, ...]:
    """Return what a shape is made of."""
    return thing.lifted, thing.matte, thing.deform, thing.rig


def _strongest(weights: Sparse, count: int) -> I32:
    """(L, 2) the ends of each control point's strongest links, each link once."""
    pairs = set()
    for i, (first, last) in enumerate(pairwise(weights.indptr)):
        strongest = np.argsort(-weights.data[first:last], kind="stable")[:count]
        ends = weights.indices[first + strongest]
        pairs |= {(min(i, int(j)), max(i, int(j))) for j in ends}
    return np.array(sorted(pairs), np.int32).reshape(-1, 2)


def _carriers(splats: PosedSplats) -> tuple[np.ndarray, KDTree]:
    """The Gaussians that carry the photo, and where in it."""
    from scipy.spatial import KDTree

    texture = splats.rest.lifted.texture
    seen = np.flatnonzero(texture.visibility > 0.5)
    return seen, KDTree(texture.u0[seen])


def _outlines(mask: Mask) -> tuple[F32, ...]:
    """Along the pixels' edges, corners cut: half a pixel of rounding makes the line quiet."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    if len(rows) == 0:
        return ()
    top, left = rows[0], columns[0]
    crop = mask[top : rows[-1] + 1, left : columns[-1] + 1].view(np.uint8)
    # Twice the size, so that the outline runs around pixels and not through their centres; of a
    # large photo less, which nobody sees unless far zoomed in.
    scale = min(2.0, float(np.sqrt(OUTLINE_PIXELS / crop.size)))
    size = (max(round(crop.shape[1] * scale), 1), max(round(crop.shape[0] * scale), 1))
    sized = cv2.resize(crop * np.uint8(255), size, interpolation=cv2.INTER_AREA) > 127
    sized = np.pad(sized.view(np.uint8), 1)  # so that the photo's border closes the outline
    found, _ = cv2.findContours(sized, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    outlines = []
    for contour in found:
        if len(contour) < 8:
            continue
        points = contour[:, 0].astype(np.float32)
        for _ in range(2):
            points = (np.roll(points, 1, 0) + 2 * points + np.roll(points, -1, 0)) / 4
        simple = cv2.approxPolyDP(points[:, None], 0.4, True)[:, 0]
        per_px = np.array([crop.shape[1] / size[0], crop.shape[0] / size[1]])
        outlines.append(((simple - 0.5) * per_px + (left, top)).astype(np.float32))
    return tuple(outlines)


def import_core() -> None:
    """Imports what the first lift needs, in a quiet moment."""
    from objectmorpher_core.deform import puppet

    assert puppet


# Facts about a lifted object's surface at its control points and handles; remembered.

AROUND = 12  # Gaussians whose normals make a handle's


class SurfaceFacts:
    """Facts about a surface, each computed when it is first asked for."""

    def __init__(self, derived: Derived) -> None:
        self._derived = derived
        self._seen, self._influences, self._mirrors = Memo(), Memo(), Memo()

    def surface(self, document: Document, k: int) -> RestSurface:
        return self._derived.shape(document.photo, document.objects[k]).surface

    def turn_of(self, document: Document, k: int) -> F64:
        """(3, 3) the rotation that takes directions of the object frame into the world."""
        thing = document.objects[k]
        assert thing.lifted is not None
        matrix = thing.placement.matrix(thing.lifted, document.photo.camera)
        linear = matrix[:3, :3] @ thing.lifted.world_from_object[:3, :3]
        return linear / np.cbrt(np.linalg.det(linear))

    def normal_at(self, document: Document, k: int, point: np.ndarray) -> F64:
        """(3,) world, unit: outward at a rest surface point (3,), as it is posed and placed."""
        thing = document.objects[k]
        assert thing.lifted is not None
        surface = self.surface(document, k)
        near = surface.tree.query(point, min(AROUND, len(surface.normals)))[1]
        normal = surface.normals[np.atleast_1d(near)].sum(0)
        if thing.pose is not None:
            deformer = self._derived.shape(document.photo, thing).puppet.deformer
            motion = deformer.skin_points(np.asarray(point), thing.pose).linear[0]
            normal = np.linalg.solve(motion.T, normal)
        normal = self.turn_of(document, k) @ normal
        return normal / np.linalg.norm(normal)

    def seen(self, document: Document, k: int) -> Mask:
        """(M,) which control points are on the side that is seen."""
        return self._seen(lambda: self._find_seen(document, k), self._derived.posed(document, k))

    def _find_seen(self, document: Document, k: int) -> Mask:
        from objectmorpher_core.raster.picking import seen_points

        thing = document.objects[k]
        assert thing.lifted is not None
        normals = self.surface(document, k).control_normals
        if thing.pose is not None:
            normals = (thing.pose.rotations @ normals[..., None])[..., 0]
        points = self._derived.control_places(document, k)
        normals = normals @ self.turn_of(document, k).T
        texture = self._derived.shape(document.photo, thing).texture
        splats = self._derived.posed(document, k)
        return seen_points(splats, texture, document.photo.camera, points, normals)

    def spacing(self, document: Document, k: int) -> float:
        """Image px between neighbouring control points, where the object is."""
        thing = document.objects[k]
        assert thing.lifted is not None
        deformer = self._derived.shape(document.photo, thing).puppet.deformer
        depth = float(np.median(self._derived.control_places(document, k)[:, 2]))
        scale = thing.lifted.scale * thing.placement.scale
        return deformer.graph.mean_spacing * scale * document.photo.camera.focal / depth

    def influence(self, document: Document, k: int, h: int) -> F64:
        """(M,) how much each control point goes along with handle `h`, 1 = as far as it does."""
        thing = document.objects[k]
        deformer = self._derived.shape(document.photo, thing).puppet.deformer
        handle = thing.handles[h]
        return self._influences(
            lambda: deformer.influence(thing.handles, h, thing.footing, thing.pose),
            deformer, handle, thing.handles, thing.pose, thing.footing.anchors,
        )  # fmt: skip

    def mirror(self, document: Document, k: int) -> MirrorPlane:
        """The object's mirror plane at rest, object frame; else an upright one through it."""
        thing = document.objects[k]
        assert thing.lifted is not None
        return self._mirrors(lambda: _find_mirror(document, k), thing.lifted)


@lru_cache(SHARES)
def _the_same(shares: tuple[float, ...]) -> tuple[float, ...]:
    """Return one tuple for equal ones: what comes from it is remembered by identity."""
    return shares


def _find_mirror(document: Document, k: int) -> MirrorPlane:
    from objectmorpher_core.deform.symmetry import find_mirror, plane_through

    lifted = document.objects[k].lifted
    assert lifted is not None
    sight = lifted.world_from_object[:3, :3].T @ lifted.centre
    across = lifted.world_from_object[:3, :3].T @ np.array([1.0, 0.0, 0.0])
    found = find_mirror(lifted.body.means, sight, across)
    if found is not None:
        return found
    return plane_through(lifted.object_points(lifted.centre), across)
