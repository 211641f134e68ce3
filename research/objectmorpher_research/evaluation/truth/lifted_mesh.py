"""The lifted body as a closed textured mesh: the front carries the photo, the rest plain colours.

It is deformed by the same control points and placed by the same numbers as the Gaussians are, and
takes the same light.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import Delaunay, KDTree

from objectmorpher_core.base.arrays import F64, I32, RGB, Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.light.harmonize import lit
from objectmorpher_core.document.model import LiftedObject, Matte
from objectmorpher_core.lift import LiftSubject
from objectmorpher_core.lift.relief.body import BACK, FRONT, ReliefBody
from objectmorpher_core.lift.relief.lifter import ReliefLifter

from .cases import EditOutcome, TruthCase
from .chain import LIFTS, OWN, Chain
from .layer import CutOut, TexturedMesh, draw_sheet

STEP = 3.0  # px between the front's vertices
FINE = 4  # x, that the outline is magnified to be found between pixels


@dataclass(frozen=True, eq=False)
class BodyMesh:
    """Front, back and the wall between them."""

    points: F64  # (V, 3) object frame
    normals: F64  # (V, 3) outward, unit
    sheet: TexturedMesh


def draw_mesh(chain: Chain, case: TruthCase, matte: Matte, plate: RGB) -> EditOutcome:
    """The edit with the mesh."""
    document, puppet, grips = chain.moved(case)
    mesh = _mesh(case, matte, puppet.lifted)
    item, camera = document.objects[0], document.photo.camera
    points = mesh.points
    if item.pose is not None:
        points = puppet.deformer.skin_points(points, item.pose, mesh.normals).points
    motion = item.placement.matrix(puppet.lifted, camera)
    world = puppet.lifted.world_points(points) @ motion[:3, :3].T + motion[:3, 3]
    height, width = case.mask.shape
    at = camera.project(world)
    layer = draw_sheet(mesh.sheet, at, world[:, 2], matte, (width, height))
    result = composite(document, {0: puppet})
    if result.stack:
        look = result.stack[0].look
        alpha = layer.alpha.astype(np.float32)
        color = lit((layer.color * layer.alpha[..., None]).astype(np.float32), alpha, look.gain)
        if look.relit is not None:
            color = look.relit.lit(color, alpha, 0, 0)
        if look.grain is not None:
            color = look.grain.grained(color, alpha, 0, 0)
        straight = np.asarray(color, np.float64) / np.maximum(layer.alpha, 1e-6)[..., None]
        layer = CutOut(np.where(layer.alpha[..., None] > 0, straight, 0), layer.alpha)
    pixels = layer.over(plate, case.photo, matte)
    reached = [puppet.picture_of(p, item.pose, item.placement) for p in grips]
    return EditOutcome(pixels, layer.alpha, np.array(reached))


def _mesh(case: TruthCase, matte: Matte, lifted: LiftedObject) -> BodyMesh:
    subject = LiftSubject(case.photo, case.camera, case.mask, matte)
    body = ReliefLifter().body(subject, LIFTS[OWN])
    outline, inner, loops = _vertices(case.mask)
    xy = np.concatenate([outline, inner])
    faces = Delaunay(xy).simplices
    middles = xy[faces].mean(1)
    faces = faces[_inside(case.mask, middles)]
    front, back = (_world(body, case.camera, xy, side) for side in (FRONT, BACK))
    count, wall = len(xy), _wall(loops)
    rows = np.concatenate([front, back, front[: len(outline)], back[: len(outline)]])
    turned = _outward(front, faces)
    everything = np.concatenate([turned, turned[:, ::-1] + count, wall + 2 * count]).astype(
        np.int32
    )
    points = lifted.object_points(rows)
    uv = np.concatenate([xy, xy, outline, outline])
    colours = _nearest_colours(points, lifted)
    sheet = TexturedMesh(uv, everything, True, colours, len(faces))
    return BodyMesh(points, _normals(points, everything), sheet)


def _vertices(mask: Mask) -> tuple[F64, F64, list[I32]]:
    """Px of the outline (n, 2), of what is inside it (m, 2), and the outline's loops."""
    height, width = mask.shape
    size = (width * FINE, height * FINE)
    fine = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_LINEAR) > 0.5
    found, _ = cv2.findContours(fine.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    points, loops, start = [], [], 0
    for loop in found:
        chosen = loop[:: round(STEP * FINE * 0.6), 0]
        if len(chosen) < 4:
            continue
        points.append((chosen + 0.5) / FINE)
        loops.append(np.arange(start, start + len(chosen), dtype=np.int32))
        start += len(chosen)
    away = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
    x, y = np.meshgrid(np.arange(0, width, STEP) + 0.5, np.arange(0, height, STEP) + 0.5)
    is_in = away[y.astype(int), x.astype(int)] > 0.8 * STEP
    return np.concatenate(points), np.column_stack([x[is_in], y[is_in]]), loops


def _inside(mask: Mask, xy: F64) -> Mask:
    column, row = np.floor(xy).astype(int).T
    height, width = mask.shape
    return mask[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]


def _wall(loops: list[I32]) -> I32:
    """Triangles between the outlines of the front (0...) and of the back (n...)."""
    count = sum(map(len, loops))
    faces = []
    for loop in loops:
        following = np.roll(loop, -1)
        faces.append(np.column_stack([loop, following, following + count]))
        faces.append(np.column_stack([loop, following + count, loop + count]))
    return np.concatenate(faces)


def _world(body: ReliefBody, camera: Camera, xy: F64, side: float) -> F64:
    """(n, 3) of the front or the back at px (n, 2); see `relief._assemble`."""
    depth = camera.focal / body.silhouette.extent
    height, _ = body.sample(xy, side)
    return camera.unproject(xy, depth - height * depth / camera.focal)


def _outward(points: F64, faces: I32) -> I32:
    """The front's faces (F, 3), all with their normals towards the camera."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    away = (np.cross(b - a, c - a) * a).sum(1) > 0
    faces = faces.copy()
    faces[away] = faces[away, ::-1]
    return faces


def _normals(points: F64, faces: I32) -> F64:
    a, b, c = (points[faces[:, k]] for k in range(3))
    cross, sums = np.cross(b - a, c - a), np.zeros_like(points)
    for k in range(3):
        np.add.at(sums, faces[:, k], cross)
    return sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12)


def _nearest_colours(points: F64, lifted: LiftedObject) -> F64:
    """(V, 3) of the nearest Gaussian that the photo does not show."""
    gaussians, texture = lifted.gaussians, lifted.texture
    is_own = (texture.solidity > 0.5) & (texture.visibility < 0.5)
    if not is_own.any():
        is_own = texture.solidity > 0.5
    _, nearest = KDTree(gaussians.means[is_own]).query(points)
    return gaussians.colors[is_own][nearest].astype(np.float64)
