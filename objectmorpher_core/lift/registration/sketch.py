"""Quick small pictures of an object in any pose: what a registration compares with the photo.

The object is an even set of surfels. Each is a flat kernel on the picture; what is in front is
decided by weights that fall with the depth, not by a depth buffer. So a picture changes smoothly
with the pose, needs no sorting, and takes a fraction of a millisecond.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import KDTree

from ...base.arrays import F32, F64, Mask, Pixels, frozen
from ...base.camera import Camera
from ...base.kernel_files import numba
from ...base.masks import box_of
from ...base.poisson_disk import thin_to_spacing
from ...base.rotations import matrices_from_quats
from ...base.threads import FAST
from ...document.gaussians import Gaussians
from ...pictures.image import to_u8
from ...raster.rules import ONE, ZERO

# Matches between an object and a photo: pairs of details that look alike in two pictures.
#
# Outline and colours hardly tell a jar that is turned a little from one that is not; where the
# details of its surface have gone does. SIFT (Lowe 2004) describes them by the directions of their
# gradients, which another light hardly changes.

SIDE = 448  # px, to which the longer side of either object is resized before details are sought
MARGIN = 0.05  # x that side, around the object
INSIDE = 3  # px of that picture: nearer to the outline a detail is of the background
ALIASED = 0.4  # px of that picture, standard deviation: what is finer would be aliased
CONTRAST = 0.01  # of a detail, x the whole range: what is faint helps too, wrong pairs are few
MOST = 2000  # details of a picture
RATIO = 0.85  # x the distance to the second best detail, above which nobody knows which it is
NEAR_MATCH = 0.04  # x the object's size in the photo: what is farther off is not where it is seen
LEAST = 8  # pairs that must agree on a pose: fewer agree by chance
TRIES, SURE = 2000, 0.9999  # of RANSAC


@dataclass(frozen=True, eq=False)
class Matches:
    """Points of an object and where a photo shows them; some are wrong."""

    points: F64  # (n, 3) in the object's frame
    seen: F64  # (n, 2) photo px
    size: float  # photo px, square root of the object's area

    def __len__(self) -> int:
        return len(self.points)

    def moved(self, matrix: F64) -> Matches:
        """Return the same points in another frame, to which `matrix` (4, 4) leads."""
        points = self.points @ matrix[:3, :3].T + matrix[:3, 3]
        return Matches(frozen(points, np.float64), self.seen, self.size)

    def gaps(self, matrix: F64, camera: Camera) -> F64:
        """(n, 2) by how much each is beside where it is seen, x `NEAR_MATCH` of the size."""
        world = self.points @ matrix[:3, :3].T + matrix[:3, 3]
        world[:, 2] = np.maximum(world[:, 2], 1e-6)
        return (camera.project(world) - self.seen) / (NEAR_MATCH * self.size)

    def support(self, matrix: F64, camera: Camera) -> float:
        """Return the agreement of matches with a pose, beyond chance `reliable`, in [0, 1)."""
        gaps = self.gaps(matrix, camera)
        return float(np.maximum(1.0 - (gaps * gaps).sum(1), 0.0).sum() / self.reliable)

    @property
    def reliable(self) -> int:
        """Return how many matches may agree by chance and therefore say little."""
        return len(self) + LEAST

    def pose(self, camera: Camera) -> F64 | None:
        """(4, 4) world from object, of scale 1: the pose on which most agree, if enough do."""
        if len(self) < LEAST:
            return None
        lens = np.array([[camera.focal, 0, camera.cx], [0, camera.focal, camera.cy], [0, 0, 1]])
        found, turn, move, agreed = cv2.solvePnPRansac(
            self.points, self.seen, lens, None, iterationsCount=TRIES,
            reprojectionError=NEAR_MATCH * self.size, confidence=SURE, flags=cv2.SOLVEPNP_EPNP,
        )  # fmt: skip
        if not found or agreed is None or len(agreed) < LEAST:
            return None
        own = agreed.ravel().astype(np.int64)
        turn, move = cv2.solvePnPRefineLM(self.points[own], self.seen[own], lens, None, turn, move)
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = cv2.Rodrigues(turn)[0], move.ravel()
        world = self.points[own] @ matrix[:3, :3].T + matrix[:3, 3]
        return matrix if (world[:, 2] > 0).all() else None


def alike(one: tuple[Pixels, Mask], other: tuple[Pixels, Mask]) -> tuple[F64, F64]:
    """Find the places (n, 2), px, that look alike in two pictures, each with its object's mask."""
    found = [_details(*picture) for picture in (one, other)]
    (at, own), (there, others) = found
    if len(own) < 2 or len(others) < 2:
        return np.empty((0, 2)), np.empty((0, 2))
    likeness = own @ others.T
    best = likeness.argmax(1)
    two = np.sqrt(np.maximum(2 - 2 * -np.partition(-likeness, 1, axis=1)[:, :2], 0))
    is_mutual = likeness.argmax(0)[best] == np.arange(len(best))
    kept = is_mutual & (two[:, 0] < RATIO * two[:, 1])
    return at[kept], there[best[kept]]


def _details(pixels: Pixels, mask: Mask) -> tuple[F64, F32]:
    """Where (n, 2) px they are, and what they look like (n, 128), of unit length."""
    x0, y0, x1, y1 = box_of(mask)
    side = (1 + 2 * MARGIN) * max(x1 - x0, y1 - y0)
    zoom = SIDE / side
    corner = 0.5 * np.array([x0 + x1 - side, y0 + y1 - side])
    warp = np.array([[zoom, 0, 0.0], [0, zoom, 0.0]])
    warp[:, 2] = zoom * (0.5 - corner) - 0.5
    grey = cv2.cvtColor(to_u8(pixels), cv2.COLOR_RGB2GRAY)
    own = np.where(mask, grey, np.uint8(grey[mask].mean()))  # no background, no edge beyond it
    if zoom < 1:  # a warp of OpenCV looks at single pixels, whatever they are of
        own = cv2.GaussianBlur(own, (0, 0), ALIASED / zoom)
    way = cv2.INTER_CUBIC if zoom > 1 else cv2.INTER_LINEAR
    own = cv2.warpAffine(own, warp, (SIDE, SIDE), flags=way, borderMode=cv2.BORDER_REPLICATE)
    inside = cv2.warpAffine(mask.astype(np.uint8), warp, (SIDE, SIDE), flags=cv2.INTER_NEAREST)
    inside = cv2.erode(inside, np.ones((2 * INSIDE + 1, 2 * INSIDE + 1), np.uint8))
    sift = cv2.SIFT.create(nfeatures=MOST, contrastThreshold=CONTRAST)
    spots, looks = sift.detectAndCompute(own, inside)
    if looks is None or not len(spots):
        return np.empty((0, 2)), np.empty((0, 128), np.float32)
    at = (np.array([spot.pt for spot in spots]) + 0.5) / zoom + corner
    looks = np.sqrt(looks / np.maximum(looks.sum(1, keepdims=True), 1e-9))  # Arandjelovic 2012
    return at, np.asarray(looks, np.float32)


TANGENT_SIGMA = 0.66  # x spacing: neighbours overlap without gaps
NORMAL_SHARE = 0.15  # x that: how thick a surfel is
SUPPORT = 6.0  # squared Mahalanobis distance at which a kernel has fallen to 0
FILTER = 0.10  # px^2, added to a kernel's screen covariance: no surfel falls between pixels
VEIL = 1.5  # x spacing: depth over which the front fades into what is behind it
OPAQUE = 0.68  # x the sum of kernels, see `draw`: set so that the area of a ball comes out right
NEAR = 0.05  # object extents before the camera: nothing nearer is drawn
FLAT = 0.5  # x its second axis: a Gaussian whose third one is shorter knows its normal
NEIGHBOURS = 12  # of a surfel, whose plane is its own where its Gaussian has none
DRAWN = 10  # candidates per surfel before thinning
PACKING = 0.68  # surfels per (spacing^2 of area) that thinning at that spacing leaves
FAINT = 0.1  # opacity below which a Gaussian has no part in the shape
OUTLIER = 0.1  # x extent beyond the box of nearly all Gaussians: farther out is none of it
WIDEST = 0.25  # x extent: a standard deviation that is larger is taken for that
REACH = 0.6  # x standard deviation: how far around its mean a Gaussian is thought to be
CELL = 1 / 48  # x extent, of a grid in which areas are measured
MET = 1.5  # x (area over CELL^2): cells that a plane meets, the mean over all its directions
TAIL = 0.002  # share of the Gaussians beyond each side of the box: outliers
COVERAGE, COLOR, NORMAL, FRONT = 0, 1, 4, 7  # channels of a sketch: 1, 3, 3, and the sum of shares
CHANNELS = 8
LANES = 8  # px, width of the strips that a picture is drawn in


@dataclass(frozen=True, eq=False)
class Surfels:
    """An even sample of a surface, in a frame of its own: centred, largest extent 1."""

    points: F64  # (n, 3)
    normals: F64  # (n, 3) unit, of either sign
    colors: F64  # (n, 3) sRGB in [0, 1]
    spacing: float  # mean distance of neighbours

    def __len__(self) -> int:
        return len(self.points)


def own_frame(gaussians: Gaussians) -> F64:
    """(4, 4) from the frame of `gaussians` to one that is centred, the largest extent 1.

    The box is that of all solid Gaussians but a few outliers.
    """
    solid = gaussians.means[_is_solid(gaussians)].astype(np.float64)
    low, high = np.quantile(solid, [TAIL, 1 - TAIL], axis=0)
    extent = float((high - low).max())
    if not extent > 0:
        raise ValueError("the object is a single point")
    matrix = np.eye(4) / extent
    matrix[:3, 3] = -0.5 * (low + high) / extent
    matrix[3, 3] = 1.0
    return matrix


def _is_solid(gaussians: Gaussians) -> np.ndarray:
    """(N,) whether a Gaussian is part of the shape; all are where the object is faint."""
    solid = np.asarray(gaussians.opacities >= FAINT)
    return solid if solid.sum() >= 4 else np.ones(len(gaussians), bool)


def even_surfels(
    gaussians: Gaussians, frame: F64, counts: tuple[int, ...], seed: int = 0
) -> tuple[Surfels, ...]:
    """About `counts` surfels each of the surface of `gaussians`, seen from `frame` (4, 4).

    Points are drawn from the Gaussians in proportion to their area, and thinned to one spacing.
    Raises ValueError where there is no surface to draw from.
    """
    rng = np.random.default_rng(seed)
    gaussians = gaussians.select(np.flatnonzero(_is_solid(gaussians)))
    wanted = DRAWN * max(counts)
    points, normals, parents, area = _drawn(gaussians, frame, wanted, rng)
    order = rng.permutation(len(points))
    sets = []
    for count in counts:
        spacing = math.sqrt(area / count)
        offered = order[: DRAWN * count]
        kept = offered
        everything = np.arange(len(offered))
        for _ in range(3):  # the area is only estimated: what is left says how well
            own = thin_to_spacing(points[offered], spacing * math.sqrt(PACKING), everything)
            kept = offered[own]
            if len(kept) < 1.25 * count:
                break
            spacing *= math.sqrt(len(kept) / count)
        own = _with_planes(points[kept], normals[kept])
        colors = gaussians.colors[parents[kept]].astype(np.float64)
        sets.append(Surfels(frozen(points[kept]), frozen(own), frozen(colors), spacing))
    return tuple(sets)


def _drawn(
    gaussians: Gaussians, frame: F64, wanted: int, rng: np.random.Generator
) -> tuple[F64, F64, np.ndarray, float]:
    """Points (n, 3), normals (n, 3) or NaN, their Gaussians (n,), and the area of all."""
    scale = float(np.cbrt(np.linalg.det(frame[:3, :3])))
    means = gaussians.means @ frame[:3, :3].T + frame[:3, 3]
    inside = np.flatnonzero((np.abs(means) < 0.5 + OUTLIER).all(1))
    gaussians, means = gaussians.select(inside), means[inside]
    if len(means) < 4:
        raise ValueError(f"the object has {len(means)} Gaussians, too few to be recognised")
    axes = np.sort(gaussians.scales.astype(np.float64), axis=1)[:, ::-1] * scale  # longest first
    share = np.minimum(axes[:, 0] * axes[:, 1], WIDEST**2) * gaussians.opacities
    expected = wanted * share / share.sum()
    parents = np.repeat(
        np.arange(len(means)), np.floor(expected + rng.random(len(means))).astype(int)
    )
    rows = np.argsort(gaussians.scales, axis=1)[:, ::-1]
    turns = matrices_from_quats(gaussians.quats.astype(np.float64))
    turns = frame[:3, :3] / scale @ np.take_along_axis(turns, rows[:, None, :], axis=2)
    offsets = rng.normal(size=(len(parents), 3)).clip(-1.5, 1.5) * REACH
    axes = axes.clip(None, WIDEST)
    points = means[parents] + (turns[parents] @ (axes[parents] * offsets)[:, :, None])[:, :, 0]
    is_flat = axes[:, 2] < FLAT * axes[:, 1]
    normals = np.where(is_flat[:, None], turns[:, :, 2], np.nan)[parents]
    return points, normals, parents, _area(points, rng)


def _area(points: F64, rng: np.random.Generator) -> float:
    """Of the surface that points (n, 3) lie on: how many small cells of space it meets."""
    cells = np.unique(np.floor((points + rng.random(3)) / CELL).astype(np.int64), axis=0)
    return len(cells) * CELL * CELL / MET


def _with_planes(points: F64, normals: F64) -> F64:
    """`normals` (n, 3), with those that are NaN found from the points around."""
    blank = np.flatnonzero(np.isnan(normals[:, 0]))
    if not len(blank):
        return normals
    count = min(NEIGHBOURS, len(points))
    near = KDTree(points).query(points[blank], k=count)[1]
    around = points[near] - points[near].mean(1, keepdims=True)
    _, axes = np.linalg.eigh(around.transpose(0, 2, 1) @ around)
    normals = normals.copy()
    normals[blank] = axes[:, :, 0]
    return normals


def sketch(surfels: Surfels, pose: F64, camera: Camera) -> F32:
    """(h, w, CHANNELS) the object at `pose` (4, 4, world from the surfels' frame).

    Straight colours and normals in camera axes, facing the camera; 0 where coverage is.
    """
    out = np.empty((camera.height, camera.width, CHANNELS), np.float32)
    intrinsics = frozen(np.array([camera.focal, camera.cx, camera.cy], np.float64))
    own = np.array(pose, np.float64)  # writable, as `search` has it: else `draw` is compiled twice
    draw(surfels.points, surfels.normals, surfels.colors, surfels.spacing, own, intrinsics, out)
    return out


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def draw(points, normals, colors, spacing, pose, intrinsics, out):
    """Fills `out`: see `sketch`.

    Coverage is 1 - exp(-(OPAQUE x the sum of the kernels)^3): inside it is 1, at the rim it falls
    to 0 within a pixel or two, and it has a derivative everywhere.
    """
    height, width = out.shape[:2]
    fade = 1.0 / (VEIL * spacing)
    # In strips, whose pixels lie side by side in the memory: loops without a branch draw a kernel.
    strips = (width + LANES - 1) // LANES
    plane = np.uint64(strips * height * LANES)
    sums = np.zeros(CHANNELS * plane, np.float32)
    pixel = np.arange(height * LANES)
    across, down = (pixel % LANES).astype(np.float32), (pixel // LANES).astype(np.float32)
    share = np.empty(height * LANES, np.float32)
    values = np.empty(CHANNELS, np.float32)
    for i in range(len(points)):
        u, v, z, fxx, fxy, fyy, own = _project(
            points[i], normals[i], spacing, pose, intrinsics, values
        )
        if z < NEAR:
            continue
        reach_x, reach_y = math.sqrt(SUPPORT * fxx), math.sqrt(SUPPORT * fyy)
        x0, x1 = max(int(u - reach_x), 0), min(int(u + reach_x) + 1, width)
        y0, y1 = max(int(v - reach_y), 0), min(int(v + reach_y) + 1, height)
        if x0 >= x1 or y0 >= y1:
            continue
        front = own * math.exp(min(max((pose[2, 3] - z) * fade, -60.0), 60.0))
        values[COVERAGE], values[FRONT] = own, front
        for c in range(3):
            values[COLOR + c] = front * colors[i, c]
            values[NORMAL + c] *= front
        inverse = 1.0 / (SUPPORT * (fxx * fyy - fxy * fxy))
        slope, drop = np.float32(fyy * inverse), np.float32(fxx * inverse)
        skew = np.float32(-2.0 * fxy * inverse)
        count = np.uint64((y1 - y0) * LANES)
        for strip in range(x0 // LANES, (x1 + LANES - 1) // LANES):
            dx, dy = np.float32(strip * LANES + 0.5 - u), np.float32(y0 + 0.5 - v)
            for k in range(count):
                x_k, y_k = dx + across[k], dy + down[k]
                bell = max(ONE - (slope * x_k + skew * y_k) * x_k - drop * y_k * y_k, ZERO)
                share[k] = bell * bell * bell
            at = np.uint64((strip * height + y0) * LANES)
            for c in range(np.uint64(CHANNELS)):
                value, base = values[c], at + c * plane
                for k in range(count):
                    sums[base + k] += share[k] * value
    _finish(sums, plane, out)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _project(point, normal, spacing, pose, intrinsics, values):
    """A surfel on the picture: its centre u, v, its depth, its covariance xx, xy, yy with the
    filter's, and what it weighs for that. Its normal, facing the camera, goes into `values`."""
    x, y, z = pose[0, 3], pose[1, 3], pose[2, 3]
    nx, ny, nz = 0.0, 0.0, 0.0
    for a in range(3):
        x += pose[0, a] * point[a]
        y += pose[1, a] * point[a]
        z += pose[2, a] * point[a]
        nx += pose[0, a] * normal[a]
        ny += pose[1, a] * normal[a]
        nz += pose[2, a] * normal[a]
    if z < NEAR:
        return 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0
    focal, cx, cy = intrinsics
    x, y = x / z, y / z
    sign = -1.0 if nx * x + ny * y + nz > 0.0 else 1.0
    values[NORMAL], values[NORMAL + 1], values[NORMAL + 2] = sign * nx, sign * ny, sign * nz
    # J (I - thin n n^T) J^T, with J = focal / z [1 0 -x; 0 1 -y]
    zoom = (TANGENT_SIGMA * spacing * focal / z) ** 2
    thin = 1.0 - NORMAL_SHARE**2
    gx, gy = nx - x * nz, ny - y * nz
    sxx = zoom * (1.0 + x * x - thin * gx * gx)
    sxy = zoom * (x * y - thin * gx * gy)
    syy = zoom * (1.0 + y * y - thin * gy * gy)
    fxx, fyy = sxx + FILTER, syy + FILTER
    own = math.sqrt(max(sxx * syy - sxy * sxy, 0.0) / (fxx * fyy - sxy * sxy))
    return focal * x + cx, focal * y + cy, z, fxx, sxy, fyy, own


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _finish(sums, plane, out):
    """Sums of kernels into coverage and means; see `draw`."""
    height, width = out.shape[:2]
    for row in range(height):
        for column in range(width):
            o = out[row, column]
            at = np.uint64((column // LANES * height + row) * LANES + column % LANES)
            total = sums[FRONT * plane + at]
            if total <= ZERO:
                for c in range(CHANNELS):
                    o[c] = ZERO
                continue
            covered = OPAQUE * sums[at]
            o[COVERAGE] = 1.0 - math.exp(-covered * covered * covered) if covered < 2.2 else 1.0
            share = ONE / total
            for c in range(1, FRONT):
                o[c] = sums[c * plane + at] * share
            o[FRONT] = total
