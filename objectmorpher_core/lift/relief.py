"""A closed shape from the silhouette alone: no model, no download, half a second.

The silhouette is inflated: u solves -laplace u = 1 inside the mask with u = 0 on its edge.
sqrt(2 u) would be the half-thickness of a round limb (a strip) or a body 0.7 times as deep as
wide (a disc), but it leaves the edge at a right angle: there the photo sees the surface edge-on
and has no pixels to show when it turns. So the slope at the edge is held to 67 degrees, and the
two halves meet in a soft crease. Until the object is turned by some twenty degrees all that is
seen of it was seen in the photo. The front lies on the photo's own rays, so the photo is
reproduced at rest whatever the thickness. A brim around the silhouette carries the matte's soft
edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..arrays import F32, F64, Mask, Pixels
from ..camera import Camera
from ..deform.control_points import COUNT, sample_control_points
from ..document import LiftedObject, Matte, PhotoTexture
from ..gaussians import Gaussians
from ..pixels import crop
from ..poisson_disk import thin_to_spacing
from ..progress import Progress
from ..rotations import quats_along
from ..segment.matte import band_width, extended_mask, frame_extension, signed_distance
from . import LiftError
from .membrane import solve_membrane

GRID = 256  # cells on the longer side of the crop in which the shape is found
RIM_SLOPE = 2.0  # tangent of the angle, before FULLNESS, at which the front leaves the rim
FULLNESS = 1.2  # makes up for the thickness that the crease takes away
CREASE_BLUR = 4.0  # cells
DEEPEST = 0.3  # x extent: half-thickness that even the widest body does not exceed
OVERSAMPLING = 20  # candidates per Gaussian before thinning: fewer leave gaps
PACKING = 0.68  # Gaussians per (spacing^2 of area) that thinning at that spacing leaves
TANGENT_SIGMA = 0.66  # x mean spacing: neighbours overlap without gaps
NORMAL_SIGMA = 0.12  # x mean spacing: flat, but never degenerate seen edge-on
BRIM = 1.8  # x mean spacing: how far Gaussians reach past the matte's soft band
COLOUR_BLUR = 1.2  # x mean spacing: plain colours, so that neighbours agree
SOFTEST = 0.15  # x extent: a drawn soft edge that reaches farther out is cut there
MIN_SPACING = 1.0  # px: more Gaussians than pixels carry nothing


@dataclass(frozen=True, eq=False)
class Surface:
    """Points on the closed surface, in relief coordinates: photo px and height in px."""

    xy: F64  # (N, 2) photo px
    height: F64  # (N,) px towards the camera from the middle plane; < 0 on the back
    normals: F64  # (N, 3) outward, relief coordinates (x, y, height)
    is_brim: Mask  # (N,) outside the silhouette


class ReliefLifter:
    """`--lift relief`: the embedded default."""

    name = "relief"

    def missing(self) -> str | None:
        return None

    def lift(
        self,
        pixels: Pixels,
        mask: Mask,
        matte: Matte,
        camera: Camera,
        count: int,
        progress: Progress,
        seed: int = 0,
    ) -> LiftedObject:
        """See `Lifter`. Raises LiftError for an object of fewer than about 25 pixels."""
        if mask.sum() < 25:
            raise LiftError(f"the object is only {int(mask.sum())} pixels, too small to lift")
        progress(0.0, "Inflating the silhouette")
        shape = Inflation.of(mask)
        progress(0.4, "Placing Gaussians")
        rng = np.random.default_rng(seed)
        band = max(band_width(camera.width, camera.height), _softness(mask, matte, shape.extent))
        surface, spacing = _sample(shape, count, band, rng)
        progress(0.8, "Choosing control points")
        return _assemble(surface, spacing, matte, camera, shape.extent)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Inflation:
    """The membrane u over the silhouette, on a grid that covers its crop."""

    membrane: F64  # (h, w) u in px^2; below 0 in the ring outside, so that 0 is on the edge
    crease: F64  # (h, w) px, see `half_thickness`
    inside: Mask  # (h, w)
    cell: float  # px per grid cell
    left: float  # px, photo coordinates of the grid's corner
    top: float
    extent: float  # px, longer side of the silhouette's box

    @staticmethod
    def of(mask: Mask) -> Inflation:
        """Inflates `mask` (H, W). Where the object leaves the photo it goes on and stays open."""
        extension = frame_extension(mask)
        mask = extended_mask(mask, extension)
        height, width = mask.shape
        rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
        top, left = int(rows[0]), int(columns[0])
        crop = mask[top : rows[-1] + 1, left : columns[-1] + 1]
        extent = float(max(crop.shape))
        cell = max(1.0, extent / GRID)
        grid = tuple(int(np.ceil(n / cell)) for n in crop.shape)
        whole = np.zeros((round(grid[0] * cell) + 1, round(grid[1] * cell) + 1), np.float32)
        whole[: crop.shape[0], : crop.shape[1]] = crop
        warp = np.array([[1, 0, 0.5], [0, 1, 0.5]]) / cell - [0, 0, 0.5]
        if cell > 1.0:
            whole = cv2.GaussianBlur(whole, (0, 0), 0.4 * cell)
        inside = cv2.warpAffine(whole, warp, (grid[1], grid[0]), flags=cv2.INTER_LINEAR) > 0.5
        if not inside.any():
            inside[:] = True
        open_sides = (top == 0, rows[-1] == height - 1, left == 0, columns[-1] == width - 1)
        inside = np.pad(inside, 1)
        u = solve_membrane(inside, open_sides) * cell * cell
        # The edge runs midway between an inside and an outside cell: mirror u across it.
        near = cv2.blur(inside.astype(np.float64), (3, 3))
        mirrored = -cv2.blur(u, (3, 3)) / np.maximum(near, 1e-9)
        u = np.where(inside, u, np.where(near > 1e-6, mirrored, 0.0))
        corner = (left - extension[2] - cell, top - extension[0] - cell)
        return Inflation(u, _crease(u, inside, cell), inside, cell, *corner, extent)

    def half_thickness(self, u: F64, crease: F64) -> tuple[F64, F64]:
        """Height (N,) px of the front, and d height / d u, for membrane and crease (N,).

        sqrt(2 u + c^2) - c rises from the edge with the slope |grad u| / c, and c is the slope
        of u at the nearest edge over RIM_SLOPE; where deep it is flattened.
        """
        root = np.sqrt(2 * np.maximum(u, 0) + crease**2)
        deepest = DEEPEST * self.extent
        flattened = np.tanh(FULLNESS * (root - crease) / deepest)
        return deepest * flattened, FULLNESS * (1 - flattened**2) / np.maximum(root, 1e-9)

    def grid_xy(self, xy: F64) -> F64:
        """Grid coordinates (N, 2), cell centres at integers, of photo px."""
        return (xy - [self.left, self.top]) / self.cell - 0.5

    def sample(self, xy: F64) -> tuple[F64, F64]:
        """Height (N,) px of the front and its gradient (N, 2) at photo px (N, 2)."""
        padded = np.pad(self.membrane, 1)
        dy, dx = np.gradient(padded, self.cell)
        g = self.grid_xy(xy) + 1
        u, ux, uy = (bilinear(np.asarray(field), g) for field in (padded, dx, dy))
        height, slope = self.half_thickness(u, bilinear(self.crease, g - 1))
        return height, np.stack([ux * slope, uy * slope], axis=1)

    def outward(self, xy: F64) -> F64:
        """Unit directions (N, 2) away from the silhouette at photo px (N, 2) outside it."""
        pad = int(np.ceil(np.abs(self.grid_xy(xy)).max(initial=1))) + 2
        distance = cv2.distanceTransform(
            1 - np.pad(self.inside, pad).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
        )
        dy, dx = np.gradient(cv2.GaussianBlur(distance, (0, 0), 1.0))
        g = self.grid_xy(xy) + pad
        direction = np.stack([bilinear(dx, g), bilinear(dy, g)], axis=1)
        length = np.linalg.norm(direction, axis=1, keepdims=True)
        return np.where(length > 1e-6, direction / np.maximum(length, 1e-6), [0.0, -1.0])


def bilinear(field: np.ndarray, xy: F64) -> F64:
    """`field` (h, w, ...) at positions (N, 2) in its pixel indices, clamped to it."""
    height, width = field.shape[:2]
    x = np.clip(xy[:, 0], 0, width - 1.001)
    y = np.clip(xy[:, 1], 0, height - 1.001)
    j, i = x.astype(int), y.astype(int)
    shape = (-1,) + (1,) * (field.ndim - 2)
    s, t = (x - j).reshape(shape), (y - i).reshape(shape)
    j1, i1 = np.minimum(j + 1, width - 1), np.minimum(i + 1, height - 1)
    upper = field[i, j] * (1 - s) + field[i, j1] * s
    return upper * (1 - t) + (field[i1, j] * (1 - s) + field[i1, j1] * s) * t


def _sample(
    shape: Inflation, count: int, band: float, rng: np.random.Generator
) -> tuple[Surface, float]:
    """Evenly spread surface points and their mean spacing in px.

    Candidates are drawn in proportion to the true area, then thinned to one spacing in 3D.
    """
    cell = shape.cell
    dy, dx = np.gradient(shape.membrane, cell)
    _, slope = shape.half_thickness(shape.membrane, shape.crease)
    steepness = np.sqrt(1 + (dx**2 + dy**2) * slope**2)  # of the surface over its picture
    area = np.where(shape.inside, cell**2 * steepness, 0.0)
    spacing = float(np.sqrt(2 * area.sum() / count))
    spacing = max(spacing, MIN_SPACING)
    per_cell = area * (OVERSAMPLING / spacing**2)
    front = _draw(shape, per_cell, rng)
    back = _draw(shape, per_cell, rng)
    brim = _draw_brim(shape, spacing, band, rng)
    surface = _join(shape, front, back, brim)
    points = np.column_stack([surface.xy, surface.height])
    # Each sheet is thinned apart: in a thin limb the back lies closer to the front than one
    # spacing, and at the rim the front is seen edge-on and leaves the brim to cover it.
    first_back, first_brim = len(front), len(front) + len(back)
    kept = []
    for sheet in np.split(np.arange(len(points)), [first_back, first_brim]):
        order = rng.permutation(len(sheet))
        kept.append(sheet[thin_to_spacing(points[sheet], spacing * np.sqrt(PACKING), order)])
    kept = np.concatenate(kept)
    return Surface(
        surface.xy[kept], surface.height[kept], surface.normals[kept], surface.is_brim[kept]
    ), spacing  # fmt: skip


def _softness(mask: Mask, matte: Matte, extent: float) -> float:
    """How far outside the mask (H, W), in px, the matte still covers something."""
    distance = crop(signed_distance(mask), (0, 0, mask.shape[1], mask.shape[0]), matte.box)
    return min(-float(distance[matte.alpha > 0].min(initial=0.0)), SOFTEST * extent)


def _draw(shape: Inflation, expected: F64, rng: np.random.Generator) -> F64:
    """Photo px (N, 2) of random points, `expected` (h, w) of them per cell."""
    counts = np.floor(expected + rng.random(expected.shape)).astype(int)
    rows, columns = np.nonzero(counts)
    repeat = counts[rows, columns]
    cells = np.column_stack([np.repeat(columns, repeat), np.repeat(rows, repeat)])
    return (cells + rng.random((len(cells), 2))) * shape.cell + [shape.left, shape.top]


def _draw_brim(shape: Inflation, spacing: float, band: float, rng: np.random.Generator) -> F64:
    """Candidates just outside the silhouette, (N, 2) photo px."""
    reach = band + BRIM * spacing
    pad = int(np.ceil(reach / shape.cell)) + 1
    inside = np.pad(shape.inside, pad).astype(np.uint8)
    distance = cv2.distanceTransform(1 - inside, cv2.DIST_L2, 5) * shape.cell
    ring = (inside == 0) & (distance < reach)
    expected = np.where(ring, OVERSAMPLING * (shape.cell / spacing) ** 2, 0.0)
    return _draw(shape, expected, rng) - pad * shape.cell


def _join(shape: Inflation, front: F64, back: F64, brim: F64) -> Surface:
    """The three sheets as one set of points with outward normals."""
    xy = np.concatenate([front, back, brim])
    height, gradient = shape.sample(xy)
    side = np.repeat([1.0, -1.0, 0.0], [len(front), len(back), len(brim)])
    normals = np.column_stack([-gradient, side])
    is_brim = side == 0
    normals[is_brim] = np.column_stack([shape.outward(xy[is_brim]), np.zeros(is_brim.sum())])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Surface(xy, side * height, normals, is_brim)


def _crease(membrane: F64, inside: Mask, cell: float) -> F64:
    """(h, w) px: |grad u| at the nearest edge over RIM_SLOPE, made smooth."""
    dy, dx = np.gradient(membrane, cell)
    slope = np.hypot(dx, dy)
    solid = inside.astype(np.uint8)
    rim = (solid > 0) & (cv2.erode(solid, np.ones((3, 3), np.uint8)) == 0)
    if not rim.any():
        return np.full(membrane.shape, float(slope.max()) / RIM_SLOPE + 1e-6)
    _, labels = cv2.distanceTransformWithLabels(
        (~rim).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    at_rim = np.zeros(labels.max() + 1)
    at_rim[labels[rim]] = slope[rim]
    nearest = cv2.GaussianBlur(at_rim[labels], (0, 0), CREASE_BLUR)
    return np.maximum(nearest, 0.25 * cell) / RIM_SLOPE


def _assemble(
    surface: Surface, spacing: float, matte: Matte, camera: Camera, extent: float
) -> LiftedObject:
    """Relief coordinates -> world -> object frame, with texture and control points."""
    depth = camera.focal / extent  # world units: the object is one unit wide at this depth
    unit = depth / camera.focal  # world units per px there
    ray = (surface.xy - [camera.cx, camera.cy]) / camera.focal
    z = depth - surface.height * unit
    world = np.column_stack([ray * z[:, None], z])
    normals = _world_normals(surface.normals, ray, z, unit, camera.focal)
    centre = 0.5 * (world.min(0) + world.max(0))
    largest = float((world.max(0) - world.min(0)).max())
    world_from_object = np.diag([largest, largest, largest, 1.0])
    world_from_object[:3, 3] = centre
    means = (world - centre) / largest
    sigma = spacing * unit / largest
    # Flat on the surface; round on the brim, whose normal lies in its plane.
    across = np.where(surface.is_brim, TANGENT_SIGMA, NORMAL_SIGMA)
    along = np.full(len(means), TANGENT_SIGMA)
    scales = np.column_stack([along, along, across]) * sigma
    gaussians = Gaussians(
        means.astype(np.float32),
        quats_along(normals).astype(np.float32),
        scales.astype(np.float32),
        np.ones(len(means), np.float32),
        _colours(surface.xy, matte, spacing),
    )
    body = ~surface.is_brim
    texture = PhotoTexture(
        u0=camera.project(gaussians.means @ world_from_object[:3, :3].T + centre),
        visibility=(surface.normals[:, 2] >= 0).astype(np.float32),  # the back has height 0, too
        solidity=body.astype(np.float32),
    )
    points = sample_control_points(gaussians.means[body], gaussians.opacities[body], COUNT)
    return LiftedObject(gaussians, texture, points, world_from_object, sigma, "relief")


def _world_normals(normals: F64, ray: F64, z: F64, unit: float, focal: float) -> F64:
    """Outward unit normals (N, 3) in the world of relief normals (N, 3).

    The relief's axes map to the columns of J = d world / d (x, y, height); normals map by the
    inverse transpose. In closed form: a front normal stays in front of its own ray.
    """
    nx, ny, nh = normals.T
    # J = [(z/f) e_x, (z/f) e_y, -unit (ray, 1)], so J^-T n solves three triangular rows
    wx, wy = nx * focal / z, ny * focal / z
    wz = -nh / unit - wx * ray[:, 0] - wy * ray[:, 1]
    world = np.column_stack([wx, wy, wz])
    return world / np.linalg.norm(world, axis=1, keepdims=True)


def _colours(xy: F64, matte: Matte, spacing: float) -> F32:
    """(N, 3) the object's own colour around each Gaussian; the back mirrors the front."""
    blurred = cv2.GaussianBlur(matte.foreground, (0, 0), max(COLOUR_BLUR * spacing, 0.5))
    at = xy - [matte.left + 0.5, matte.top + 0.5]
    return np.clip(bilinear(blurred, at), 0, 1).astype(np.float32)
