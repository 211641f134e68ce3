"""The fast twin of `reference`: numba, tile by tile, all cores.

The picture is cut into tiles of 16 x 16 pixels. Each tile gets the list of the Gaussians that
touch it, front to back, and walks through them once with its pixels' layer sums in cache.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from ..arrays import F64, frozen
from ..camera import Camera
from ..threads import in_threads
from .depth_order import depth_order
from .posed import PosedSplats, TextureLevels
from .reference import Picture3D
from .rules import RULES, coverage, facing_weight, ramp

TILE = 16  # px
PARTS = 8  # pieces of the picture for each thread: they are not equally full
SPAN = 25  # floats that describe a projected Gaussian, see _project
OPAQUE = 0.999  # alpha from which what lies behind is not looked at

# columns of a projected Gaussian
CX, CY, QXX, QXY, QYY, EX, EY, Z, ZX, ZY, SX, SY, AXX, AXY, AYX, AYY = range(16)
LOD, PHOTO, BODY, SEEN, RED, GREEN, BLUE, MATTED, SOLID = range(16, 25)

# columns of a pixel's layer sums
TOTAL, BODIED, GX, GY, BGX, BGY, DEPTH, SHX, SHY, LEVEL, SEES, R, G, B = range(14)
DEEPEST, MATTES, SOLIDS = 14, 15, 16
SUMS = 17

# columns of a pixel's result, after its colour (0..2) and alpha (3)
D_OUT, PHOTO_OUT, X_OUT, Y_OUT, LAST_X, LAST_Y, LAST_THROUGH, LAST_WHOLE = range(4, 12)
RESULTS = 12


def render(
    splats: PosedSplats, texture: TextureLevels, camera: Camera, photo_camera: Camera
) -> Picture3D:
    """The object as `camera` sees it; see `reference.render`, with which it agrees."""
    height, width = camera.height, camera.width
    view, photo = _intrinsics(camera), _intrinsics(photo_camera)
    projected = frozen(project(splats, camera, photo_camera))
    across, down = -(-width // TILE), -(-height // TILE)
    keep, order = _depth_order(projected, width, height)
    starts, members = _bin(projected, frozen(keep[order]), across, down)
    out = np.zeros((height, width, 8), np.float32)
    flat, shapes, offsets = _flatten(texture)
    inputs = (
        projected, frozen(starts), frozen(members), across, width, height, view, photo,
        float(splats.gap), float(splats.texture_gap), frozen(flat), frozen(shapes),
        frozen(offsets), float(texture.left), float(texture.top), RULES, out,
    )  # fmt: skip
    in_threads(lambda first, last: _draw(first, last, *inputs), across * down, PARTS)
    return Picture3D(out[..., :3], out[..., 3], out[..., 4], out[..., 5], out[..., 6:8])


def project(splats: PosedSplats, camera: Camera, photo_camera: Camera) -> F64:
    """Gaussians on the screen (N, SPAN), columns as named above; unseen ones are all 0.

    Steps 1 and 2 of the reference, and what the GPU draws from.
    """
    fields = (
        splats.means, splats.linear, splats.rest_covariances, splats.rest_pictures,
        splats.normals, splats.u0, splats.visibility, splats.solidity, splats.colors,
        splats.opacities, splats.rest_zoom, splats.rest_cosines,
    )  # fmt: skip
    near = RULES.near * splats.gap
    out = np.zeros((len(splats), SPAN))
    inputs: tuple[Any, ...] = (
        *(frozen(a) for a in fields), _intrinsics(camera), _intrinsics(photo_camera),
        near, RULES, out,
    )  # fmt: skip
    in_threads(lambda first, last: _project(first, last, *inputs), len(splats))
    return out


def _intrinsics(camera: Camera) -> F64:
    return frozen(
        np.array([camera.focal, camera.cx, camera.cy, camera.width, camera.height], np.float64)
    )


def _flatten(texture: TextureLevels):
    """The levels as one array of texels, with each one's height, width and start."""
    shapes = np.array([level.shape[:2] for level in texture.levels])
    offsets = np.concatenate([[0], np.cumsum(shapes.prod(1))])
    return np.concatenate([v.reshape(-1, 4) for v in texture.levels]), shapes, offsets


def _depth_order(projected, width, height):
    """Gaussians that can be seen, and the order of their depth."""
    centre, extent = projected[:, [CX, CY]], projected[:, [EX, EY]]
    low, high = centre + extent, centre - extent
    visible = (projected[:, PHOTO] + projected[:, BODY] > 0) & (low > 0).all(1)
    visible &= (high[:, 0] < width) & (high[:, 1] < height)
    keep = np.flatnonzero(visible)
    return keep, depth_order(projected[keep, Z])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _project(
    first, last, means, linear, rest, pictures, normals, u0, visibility, solidity, colors,
    opacities, rest_zoom, rest_cosines, view, photo, near, rules, out,
):  # fmt: skip
    """Fills the rows first..last of `out`; see the columns above."""
    f = view[0]
    ratio = photo[0] / f
    for i in range(first, last):
        x, y, z = means[i, 0], means[i, 1], means[i, 2]
        if not (z > near and math.isfinite(x + y + z)):
            continue
        # J1 = [[j, 0, jx], [0, j, jy]]
        j = f / z
        jx, jy = -j * x / z, -j * y / z
        m00, m01, m02 = linear[i, 0, 0], linear[i, 0, 1], linear[i, 0, 2]
        m10, m11, m12 = linear[i, 1, 0], linear[i, 1, 1], linear[i, 1, 2]
        m20, m21, m22 = linear[i, 2, 0], linear[i, 2, 1], linear[i, 2, 2]
        # the rows of J1 F: a screen px in terms of the rest world
        a0, a1, a2 = j * m00 + jx * m20, j * m01 + jx * m21, j * m02 + jx * m22
        b0, b1, b2 = j * m10 + jy * m20, j * m11 + jy * m21, j * m12 + jy * m22
        # Sigma (J1 F)^T, column by column
        r00, r01, r02 = rest[i, 0, 0], rest[i, 0, 1], rest[i, 0, 2]
        r11, r12, r22 = rest[i, 1, 1], rest[i, 1, 2], rest[i, 2, 2]
        p0, p1, p2 = (
            r00 * a0 + r01 * a1 + r02 * a2,
            r01 * a0 + r11 * a1 + r12 * a2,
            r02 * a0 + r12 * a1 + r22 * a2,
        )
        q0, q1, q2 = (
            r00 * b0 + r01 * b1 + r02 * b2,
            r01 * b0 + r11 * b1 + r12 * b2,
            r02 * b0 + r12 * b1 + r22 * b2,
        )
        sxx = a0 * p0 + a1 * p1 + a2 * p2
        sxy = a0 * q0 + a1 * q1 + a2 * q2
        syy = b0 * q0 + b1 * q1 + b2 * q2
        szx = m20 * p0 + m21 * p1 + m22 * p2  # depth against the screen
        szy = m20 * q0 + m21 * q1 + m22 * q2
        ridge = rules.ridge * (sxx + syy) + 1e-12
        det = (sxx + ridge) * (syy + ridge) - sxy * sxy
        ixx, ixy, iyy = (syy + ridge) / det, -sxy / det, (sxx + ridge) / det
        # A = J0 Sigma (J1 F)^T (...)^-1
        c00 = pictures[i, 0, 0] * a0 + pictures[i, 0, 1] * a1 + pictures[i, 0, 2] * a2
        c01 = pictures[i, 0, 0] * b0 + pictures[i, 0, 1] * b1 + pictures[i, 0, 2] * b2
        c10 = pictures[i, 1, 0] * a0 + pictures[i, 1, 1] * a1 + pictures[i, 1, 2] * a2
        c11 = pictures[i, 1, 0] * b0 + pictures[i, 1, 1] * b1 + pictures[i, 1, 2] * b2
        axx, axy = c00 * ixx + c01 * ixy, c00 * ixy + c01 * iyy
        ayx, ayy = c10 * ixx + c11 * ixy, c10 * ixy + c11 * iyy
        # its singular values
        total = axx * axx + axy * axy + ayx * ayx + ayy * ayy
        area = abs(axx * ayy - axy * ayx)
        spread = math.sqrt(max(total * total - 4 * area * area, 0.0))
        largest = math.sqrt(max(0.5 * (total + spread), 1e-30))
        smallest = area / largest
        # normals turn with the cofactors of F
        k00, k01, k02 = m11 * m22 - m12 * m21, m12 * m20 - m10 * m22, m10 * m21 - m11 * m20
        k10, k11, k12 = m02 * m21 - m01 * m22, m00 * m22 - m02 * m20, m01 * m20 - m00 * m21
        k20, k21, k22 = m01 * m12 - m02 * m11, m02 * m10 - m00 * m12, m00 * m11 - m01 * m10
        determinant = m00 * k00 + m01 * k01 + m02 * k02
        sign = 1.0 if determinant >= 0 else -1.0
        n0, n1, n2 = normals[i, 0], normals[i, 1], normals[i, 2]
        nx = sign * (k00 * n0 + k01 * n1 + k02 * n2)
        ny = sign * (k10 * n0 + k11 * n1 + k12 * n2)
        nz = sign * (k20 * n0 + k21 * n1 + k22 * n2)
        lengths = math.sqrt((nx * nx + ny * ny + nz * nz) * (x * x + y * y + z * z))
        cosine = -(nx * x + ny * y + nz * z) / max(lengths, 1e-30)
        stretch = smallest * abs(determinant) ** (1.0 / 3.0) * j / rest_zoom[i]
        fxx, fyy = sxx + rules.filter, syy + rules.filter
        fdet = fxx * fyy - sxy * sxy
        weight = opacities[i] * facing_weight(cosine, visibility[i], solidity[i], rules)
        weight *= math.sqrt(max(sxx * syy - sxy * sxy, 0.0) / fdet)
        carried = ramp(stretch, rules.streak_end, rules.streak_start)
        px, py = j * x + view[1], j * y + view[2]
        out[i, CX], out[i, CY], out[i, Z] = px, py, z
        out[i, QXX], out[i, QXY], out[i, QYY] = fyy / fdet, -sxy / fdet, fxx / fdet
        out[i, EX], out[i, EY] = math.sqrt(rules.cutoff * fxx), math.sqrt(rules.cutoff * fyy)
        out[i, ZX], out[i, ZY] = szx * ixx + szy * ixy, szx * ixy + szy * iyy
        out[i, SX] = u0[i, 0] - (j * x * ratio + photo[1])
        out[i, SY] = u0[i, 1] - (j * y * ratio + photo[2])
        out[i, AXX], out[i, AXY], out[i, AYX], out[i, AYY] = axx - ratio, axy, ayx, ayy - ratio
        out[i, LOD] = math.log2(max(largest, 1.0))
        out[i, PHOTO] = weight * carried
        out[i, BODY] = weight * (1.0 - carried) * solidity[i]
        turned = cosine - rest_cosines[i]
        out[i, MATTED] = ramp(stretch, rules.matte_end, rules.matte_start) * ramp(
            turned, rules.turned_end, rules.turned_start
        )
        out[i, SOLID], out[i, SEEN] = solidity[i], visibility[i]
        out[i, RED], out[i, GREEN], out[i, BLUE] = colors[i, 0], colors[i, 1], colors[i, 2]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _bin(projected, order, across, down):
    """Members of each tile, front to back: (tiles + 1,) starts into (members,)."""
    counts = np.zeros(across * down + 1, np.int64)
    boxes = np.empty((len(order), 4), np.int64)
    for k in range(len(order)):
        i = order[k]
        boxes[k, 0] = max(int(projected[i, CX] - projected[i, EX]) // TILE, 0)
        boxes[k, 1] = min(int(projected[i, CX] + projected[i, EX]) // TILE, across - 1)
        boxes[k, 2] = max(int(projected[i, CY] - projected[i, EY]) // TILE, 0)
        boxes[k, 3] = min(int(projected[i, CY] + projected[i, EY]) // TILE, down - 1)
        for ty in range(boxes[k, 2], boxes[k, 3] + 1):
            for tx in range(boxes[k, 0], boxes[k, 1] + 1):
                counts[ty * across + tx + 1] += 1
    for tile in range(across * down):
        counts[tile + 1] += counts[tile]
    fill = np.empty(across * down, np.int64)
    for tile in range(across * down):
        fill[tile] = counts[tile]
    members = np.empty(counts[across * down], np.int64)
    for k in range(len(order)):
        for ty in range(boxes[k, 2], boxes[k, 3] + 1):
            for tx in range(boxes[k, 0], boxes[k, 1] + 1):
                tile = ty * across + tx
                members[fill[tile]] = order[k]
                fill[tile] += 1
    return counts, members


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _draw(
    first, last, projected, starts, members, across, width, height, view, photo,
    gap, texture_gap, texels, shapes, offsets, left, top, rules, out,
):  # fmt: skip
    """Draws the tiles first..last into `out` (height, width, 8)."""
    ratio = photo[0] / view[0]
    sums = np.zeros((TILE, TILE, SUMS))
    result = np.zeros((TILE, TILE, RESULTS))
    sample, value = np.zeros(4), np.zeros(4)
    wx, wy = np.zeros(4), np.zeros(4)
    for tile in range(first, last):
        x0, y0 = (tile % across) * TILE, (tile // across) * TILE
        x1, y1 = min(x0 + TILE, width), min(y0 + TILE, height)
        for y in range(TILE):
            for x in range(TILE):
                for c in range(SUMS):  # opaque pixels of the last tile left theirs
                    sums[y, x, c] = 0.0
                for c in range(RESULTS):
                    result[y, x, c] = 0.0
                result[y, x, D_OUT] = result[y, x, LAST_X] = np.inf
        for slot in range(starts[tile], starts[tile + 1]):
            s = projected[members[slot]]
            both = s[PHOTO] + s[BODY]
            left_px = max(x0, int(math.floor(s[CX] - s[EX])))
            right_px = min(x1, int(math.ceil(s[CX] + s[EX])))
            for y in range(
                max(y0, int(math.floor(s[CY] - s[EY]))), min(y1, int(math.ceil(s[CY] + s[EY])))
            ):
                dy = y + 0.5 - s[CY]
                for x in range(left_px, right_px):
                    dx = x + 0.5 - s[CX]
                    gx, gy = s[QXX] * dx + s[QXY] * dy, s[QXY] * dx + s[QYY] * dy
                    q = gx * dx + gy * dy
                    if q >= rules.cutoff:
                        continue
                    r = result[y - y0, x - x0]
                    if r[3] > OPAQUE:
                        continue
                    layer = sums[y - y0, x - x0]
                    bell = math.exp(-0.5 * q)
                    kernel = bell - rules.tail
                    depth = s[Z] + s[ZX] * dx + s[ZY] * dy
                    sx = s[SX] + s[AXX] * dx + s[AXY] * dy
                    sy = s[SY] + s[AYX] * dx + s[AYY] * dy
                    if layer[TOTAL] > 0.0:
                        seen = layer[TOTAL] - layer[BODIED]
                        apart = depth - layer[DEEPEST] > gap
                        if not apart and seen > 0.0 and s[PHOTO] > 0.0:
                            ex, ey = sx - layer[SHX] / seen, sy - layer[SHY] / seen
                            apart = ex * ex + ey * ey > texture_gap * texture_gap
                        if apart:
                            _close(
                                layer, r, x, y, view, photo, ratio, texels, shapes, offsets,
                                left, top, rules, sample, value, wx, wy,
                            )  # fmt: skip
                    layer[TOTAL] += kernel * both
                    layer[BODIED] += kernel * s[BODY]
                    layer[GX] -= bell * gx * both
                    layer[GY] -= bell * gy * both
                    layer[BGX] -= bell * gx * s[BODY]
                    layer[BGY] -= bell * gy * s[BODY]
                    layer[DEPTH] += kernel * both * depth
                    layer[DEEPEST] = max(layer[DEEPEST], depth)
                    k = kernel * s[PHOTO]
                    layer[SHX] += k * sx
                    layer[SHY] += k * sy
                    layer[LEVEL] += k * s[LOD]
                    layer[MATTES] += k * s[MATTED]
                    layer[SOLIDS] += k * (1.0 - s[MATTED]) * s[SOLID]
                    layer[SEES] += k * s[SEEN]
                    k = kernel * s[BODY]
                    layer[R] += k * s[RED]
                    layer[G] += k * s[GREEN]
                    layer[B] += k * s[BLUE]
        for y in range(y0, y1):
            for x in range(x0, x1):
                layer, r = sums[y - y0, x - x0], result[y - y0, x - x0]
                if layer[TOTAL] > 0.0 and r[3] <= OPAQUE:
                    _close(
                        layer, r, x, y, view, photo, ratio, texels, shapes, offsets, left, top,
                        rules, sample, value, wx, wy,
                    )  # fmt: skip
                for c in range(8):
                    out[y, x, c] = r[c]


@numba.njit(cache=True, error_model="numpy")
def _close(
    layer, r, x, y, view, photo, ratio, texels, shapes, offsets, left, top,
    rules, sample, value, wx, wy,
):  # fmt: skip
    """Composites a pixel's layer into `r` and empties it: steps 4 and 5 of the reference."""
    total, body = layer[TOTAL], layer[BODIED]
    seen = max(total - body, 0.0)
    matte = 0.0
    is_within = False  # the photo; elsewhere the texture is made up
    sx = sy = 0.0
    if seen > 1e-9 * total:
        sx, sy = layer[SHX] / seen, layer[SHY] / seen
        u = (x + 0.5 - view[1]) * ratio + photo[1] + sx
        v = (y + 0.5 - view[2]) * ratio + photo[2] + sy
        is_within = 0.0 < u < photo[3] and 0.0 < v < photo[4]
        _sample(texels, shapes, offsets, u - left, v - top, layer[LEVEL] / seen, sample,
                value, wx, wy)  # fmt: skip
        matte = (sample[3] * layer[MATTES] + layer[SOLIDS]) / seen
    whole = coverage(total, math.sqrt(layer[GX] ** 2 + layer[GY] ** 2), rules)
    solid = coverage(body, math.sqrt(layer[BGX] ** 2 + layer[BGY] ** 2), rules)
    alpha = matte * whole + (1.0 - matte) * solid
    ex, ey = sx - r[LAST_X], sy - r[LAST_Y]
    if ex * ex + ey * ey < rules.same_point * rules.same_point:
        through = r[LAST_THROUGH] * (1.0 - r[LAST_WHOLE]) * alpha
        r[LAST_WHOLE] = 1.0 - (1.0 - r[LAST_WHOLE]) * (1.0 - whole)
    else:
        r[LAST_THROUGH] = 1.0 - r[3]
        r[LAST_WHOLE] = whole
        through = r[LAST_THROUGH] * alpha
    r[LAST_X], r[LAST_Y] = (sx, sy) if seen > 1e-9 * total else (np.inf, np.inf)
    if alpha > 0.0:
        shown = seen * matte
        scale = through / max(shown + body, 1e-30)
        if r[D_OUT] == np.inf:
            r[D_OUT] = layer[DEPTH] / total
            r[X_OUT], r[Y_OUT] = sx, sy
        for c in range(3):
            r[c] += scale * (shown * sample[c] + layer[R + c])
        if is_within:
            r[PHOTO_OUT] += scale * shown * layer[SEES] / seen
        r[3] += through
    for c in range(SUMS):
        layer[c] = 0.0


@numba.njit(cache=True, error_model="numpy")
def _sample(texels, shapes, offsets, u, v, lod, sample, value, wx, wy):
    """Straight colour and alpha at crop px (u, v), mixed from the two nearest levels."""
    last = len(shapes) - 1
    lod = min(max(lod, 0.0), float(last))
    lower = int(lod)
    mix = lod - lower
    for c in range(4):
        sample[c] = 0.0
    level = lower
    while level <= (lower + 1 if mix > 0.0 else lower):
        share = mix if level > lower else 1.0 - mix
        _add_level(texels, shapes, offsets, level, u, v, share, sample, value, wx, wy)
        level += 1


@numba.njit(cache=True, error_model="numpy")
def _add_level(texels, shapes, offsets, level, u, v, share, sample, value, wx, wy):
    """Adds `share` of one level: bicubic (Catmull-Rom) at full size, bilinear when halved."""
    height, width = shapes[level, 0], shapes[level, 1]
    scale = 1.0 / (1 << level)
    u, v = u * scale - 0.5, v * scale - 0.5
    j, i = int(math.floor(u)), int(math.floor(v))
    for c in range(4):
        wx[c] = wy[c] = value[c] = 0.0
    if level == 0:
        _cubic_weights(u - j, wx)
        _cubic_weights(v - i, wy)
    else:
        wx[1], wx[2], wy[1], wy[2] = 1.0 - (u - j), u - j, 1.0 - (v - i), v - i
    for a in range(4):
        row = i + a - 1
        if wy[a] == 0.0:
            continue
        for b in range(4):
            column = j + b - 1
            w = wy[a] * wx[b]
            if w == 0.0:
                continue
            inside = 0 <= row < height and 0 <= column < width
            at = (
                offsets[level]
                + min(max(row, 0), height - 1) * width
                + min(max(column, 0), width - 1)
            )
            for c in range(3):
                value[c] += w * texels[at, c]
            if inside:
                value[3] += w * texels[at, 3]
    for c in range(4):
        sample[c] += share * (min(max(value[c], 0.0), 1.0) if level == 0 else value[c])


@numba.njit(cache=True)
def _cubic_weights(t, w):
    w[0] = ((-0.5 * t + 1.0) * t - 0.5) * t
    w[1] = (1.5 * t - 2.5) * t * t + 1.0
    w[2] = ((-1.5 * t + 2.0) * t + 0.5) * t
    w[3] = (0.5 * t - 0.5) * t * t
