"""The fast twin of `reference`: numba, tile by tile, all cores.

The picture is cut into tiles of 16 x 16 pixels. Each tile gets the list of the Gaussians that
touch it, front to back, and walks through them once with its pixels' layer sums in cache.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from ..arrays import F64, frozen
from ..camera import Camera
from . import rules
from .posed import PosedSplats, TextureLevels
from .reference import Picture3D

TILE = 16  # px
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
    _draw(
        projected, frozen(starts), frozen(members), across, down, width, height, view, photo,
        float(splats.gap), float(splats.texture_gap), frozen(flat), frozen(shapes),
        frozen(offsets), float(texture.left), float(texture.top), out,
    )  # fmt: skip
    return Picture3D(out[..., :3], out[..., 3], out[..., 4], out[..., 5], out[..., 6:8])


def project(splats: PosedSplats, camera: Camera, photo_camera: Camera) -> F64:
    """Gaussians on the screen (N, SPAN), columns as named above; unseen ones are all 0.

    Steps 1 and 2 of the reference, and what the GPU draws from.
    """
    fields = (
        splats.means, splats.linear, splats.rest_covariances, splats.rest_pictures,
        splats.normals, splats.u0, splats.visibility, splats.solidity, splats.colors,
        splats.opacities, splats.rest_zoom,
    )  # fmt: skip
    near = float(rules.NEAR * splats.gap)
    inputs = [frozen(a) for a in (*fields, _intrinsics(camera), _intrinsics(photo_camera))]
    return _project(*inputs, near)


def _intrinsics(camera: Camera) -> F64:
    return frozen(np.array([camera.focal, camera.cx, camera.cy]))


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
    return keep, np.argsort(projected[keep, Z], kind="stable")


@numba.njit(cache=True, parallel=True, error_model="numpy")
def _project(
    means, linear, rest, pictures, normals, u0, visibility, solidity, colors, opacities,
    rest_zoom, view, photo, near,
):  # fmt: skip
    n = len(means)
    out = np.zeros((n, SPAN))
    f = view[0]
    ratio = photo[0] / f
    for i in numba.prange(n):
        x, y, z = means[i]
        if not (z > near and math.isfinite(x + y + z)):
            continue
        m = linear[i]
        jx, jy = f / z, f / z
        jxz, jyz = -f * x / (z * z), -f * y / (z * z)
        # P = Sigma F^T (3, 3), W = F P, then their columns on the screen
        p = np.zeros((3, 3))
        for a in range(3):
            for b in range(3):
                p[a, b] = (
                    rest[i, a, 0] * m[b, 0] + rest[i, a, 1] * m[b, 1] + rest[i, a, 2] * m[b, 2]
                )
        ws = np.zeros((3, 2))  # world covariance against the screen
        for a in range(3):
            w0 = m[a, 0] * p[0, 0] + m[a, 1] * p[1, 0] + m[a, 2] * p[2, 0]
            w1 = m[a, 0] * p[0, 1] + m[a, 1] * p[1, 1] + m[a, 2] * p[2, 1]
            w2 = m[a, 0] * p[0, 2] + m[a, 1] * p[1, 2] + m[a, 2] * p[2, 2]
            ws[a, 0] = w0 * jx + w2 * jxz
            ws[a, 1] = w1 * jy + w2 * jyz
        sxx = jx * ws[0, 0] + jxz * ws[2, 0]
        sxy = jx * ws[0, 1] + jxz * ws[2, 1]
        syy = jy * ws[1, 1] + jyz * ws[2, 1]
        ridge = rules.RIDGE * (sxx + syy) + 1e-12
        det = (sxx + ridge) * (syy + ridge) - sxy * sxy
        ixx, ixy, iyy = (syy + ridge) / det, -sxy / det, (sxx + ridge) / det
        # C = J0 Sigma F^T J1^T
        c = np.zeros((2, 2))
        for a in range(2):
            t0 = (
                pictures[i, a, 0] * m[0, 0]
                + pictures[i, a, 1] * m[0, 1]
                + pictures[i, a, 2] * m[0, 2]
            )
            t1 = (
                pictures[i, a, 0] * m[1, 0]
                + pictures[i, a, 1] * m[1, 1]
                + pictures[i, a, 2] * m[1, 2]
            )
            t2 = (
                pictures[i, a, 0] * m[2, 0]
                + pictures[i, a, 1] * m[2, 1]
                + pictures[i, a, 2] * m[2, 2]
            )
            c[a, 0] = t0 * jx + t2 * jxz
            c[a, 1] = t1 * jy + t2 * jyz
        axx, axy = c[0, 0] * ixx + c[0, 1] * ixy, c[0, 0] * ixy + c[0, 1] * iyy
        ayx, ayy = c[1, 0] * ixx + c[1, 1] * ixy, c[1, 0] * ixy + c[1, 1] * iyy
        # singular values of A
        total = axx * axx + axy * axy + ayx * ayx + ayy * ayy
        area = abs(axx * ayy - axy * ayx)
        spread = math.sqrt(max(total * total - 4 * area * area, 0.0))
        largest = math.sqrt(max(0.5 * (total + spread), 1e-30))
        smallest = area / largest
        cof = np.empty((3, 3))
        for a in range(3):
            b, d = (a + 1) % 3, (a + 2) % 3
            for e in range(3):
                g, h = (e + 1) % 3, (e + 2) % 3
                cof[a, e] = m[b, g] * m[d, h] - m[b, h] * m[d, g]
        determinant = m[0, 0] * cof[0, 0] + m[0, 1] * cof[0, 1] + m[0, 2] * cof[0, 2]
        volume = abs(determinant) ** (1.0 / 3.0)
        stretch = smallest * volume * f / z / rest_zoom[i]
        sign = 1.0 if determinant >= 0 else -1.0
        nx = sign * (
            cof[0, 0] * normals[i, 0] + cof[0, 1] * normals[i, 1] + cof[0, 2] * normals[i, 2]
        )
        ny = sign * (
            cof[1, 0] * normals[i, 0] + cof[1, 1] * normals[i, 1] + cof[1, 2] * normals[i, 2]
        )
        nz = sign * (
            cof[2, 0] * normals[i, 0] + cof[2, 1] * normals[i, 1] + cof[2, 2] * normals[i, 2]
        )
        lengths = math.sqrt((nx * nx + ny * ny + nz * nz) * (x * x + y * y + z * z))
        cosine = -(nx * x + ny * y + nz * z) / max(lengths, 1e-30)
        fxx, fyy = sxx + rules.FILTER, syy + rules.FILTER
        fdet = fxx * fyy - sxy * sxy
        weight = opacities[i] * rules.facing_weight(cosine, visibility[i], solidity[i])
        weight *= math.sqrt(max(sxx * syy - sxy * sxy, 0.0) / fdet)
        carried = rules.ramp(stretch, rules.STREAK_END, rules.STREAK_START)
        row = out[i]
        row[CX], row[CY] = x / z * f + view[1], y / z * f + view[2]
        row[QXX], row[QXY], row[QYY] = fyy / fdet, -sxy / fdet, fxx / fdet
        row[EX], row[EY] = math.sqrt(rules.CUTOFF * fxx), math.sqrt(rules.CUTOFF * fyy)
        row[Z] = z
        row[ZX] = ws[2, 0] * ixx + ws[2, 1] * ixy
        row[ZY] = ws[2, 0] * ixy + ws[2, 1] * iyy
        row[SX] = u0[i, 0] - ((row[CX] - view[1]) * ratio + photo[1])
        row[SY] = u0[i, 1] - ((row[CY] - view[2]) * ratio + photo[2])
        row[AXX], row[AXY], row[AYX], row[AYY] = axx - ratio, axy, ayx, ayy - ratio
        row[LOD] = math.log2(max(largest, 1.0))
        row[PHOTO] = weight * carried
        row[BODY] = weight * (1.0 - carried) * solidity[i]
        row[MATTED] = rules.ramp(stretch, rules.MATTE_END, rules.MATTE_START)
        row[SOLID] = solidity[i]
        row[SEEN] = visibility[i]
        row[RED], row[GREEN], row[BLUE] = colors[i]
    return out


@numba.njit(cache=True)
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
    starts = np.cumsum(counts)
    fill = starts[:-1].copy()
    members = np.empty(starts[-1], np.int64)
    for k in range(len(order)):
        for ty in range(boxes[k, 2], boxes[k, 3] + 1):
            for tx in range(boxes[k, 0], boxes[k, 1] + 1):
                tile = ty * across + tx
                members[fill[tile]] = order[k]
                fill[tile] += 1
    return starts, members


@numba.njit(cache=True, parallel=True, error_model="numpy")
def _draw(
    projected, starts, members, across, down, width, height, view, photo,
    gap, texture_gap, texels, shapes, offsets, left, top, out,
):  # fmt: skip
    ratio = photo[0] / view[0]
    for tile in numba.prange(across * down):
        x0, y0 = (tile % across) * TILE, (tile // across) * TILE
        x1, y1 = min(x0 + TILE, width), min(y0 + TILE, height)
        sums = np.zeros((TILE, TILE, SUMS))
        result = np.zeros((TILE, TILE, RESULTS))
        result[:, :, D_OUT] = np.inf
        result[:, :, LAST_X] = np.inf
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
                    if q >= rules.CUTOFF:
                        continue
                    r = result[y - y0, x - x0]
                    if r[3] > OPAQUE:
                        continue
                    layer = sums[y - y0, x - x0]
                    bell = math.exp(-0.5 * q)
                    kernel = bell - rules.TAIL
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
                                layer,
                                r,
                                x,
                                y,
                                view,
                                photo,
                                ratio,
                                texels,
                                shapes,
                                offsets,
                                left,
                                top,
                            )
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
                    _close(layer, r, x, y, view, photo, ratio, texels, shapes, offsets, left, top)
                for c in range(8):
                    out[y, x, c] = r[c]


@numba.njit(cache=True, error_model="numpy")
def _close(layer, r, x, y, view, photo, ratio, texels, shapes, offsets, left, top):
    """Composites a pixel's layer into `r` and empties it: steps 4 and 5 of the reference."""
    total, body = layer[TOTAL], layer[BODIED]
    seen = max(total - body, 0.0)
    matte = 0.0
    sample = np.zeros(4)
    sx = sy = 0.0
    if seen > 1e-9 * total:
        sx, sy = layer[SHX] / seen, layer[SHY] / seen
        u = (x + 0.5 - view[1]) * ratio + photo[1] + sx
        v = (y + 0.5 - view[2]) * ratio + photo[2] + sy
        _sample(texels, shapes, offsets, u - left, v - top, layer[LEVEL] / seen, sample)
        matte = (sample[3] * layer[MATTES] + layer[SOLIDS]) / seen
    whole = rules.coverage(total, math.sqrt(layer[GX] ** 2 + layer[GY] ** 2))
    solid = rules.coverage(body, math.sqrt(layer[BGX] ** 2 + layer[BGY] ** 2))
    alpha = matte * whole + (1.0 - matte) * solid
    ex, ey = sx - r[LAST_X], sy - r[LAST_Y]
    if ex * ex + ey * ey < rules.SAME_POINT * rules.SAME_POINT:
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
        if seen > 0.0:
            r[PHOTO_OUT] += scale * shown * layer[SEES] / seen
        r[3] += through
    layer[:] = 0.0


@numba.njit(cache=True, error_model="numpy")
def _sample(texels, shapes, offsets, u, v, lod, sample):
    """Straight colour and alpha at crop px (u, v), mixed from the two nearest levels."""
    last = len(shapes) - 1
    lod = min(max(lod, 0.0), float(last))
    lower = int(lod)
    mix = lod - lower
    sample[:] = 0.0
    _add_level(texels, shapes, offsets, lower, u, v, 1.0 - mix, sample)
    if mix > 0.0:
        _add_level(texels, shapes, offsets, lower + 1, u, v, mix, sample)


@numba.njit(cache=True, error_model="numpy")
def _add_level(texels, shapes, offsets, level, u, v, share, sample):
    """Adds `share` of one level: bicubic (Catmull-Rom) at full size, bilinear when halved."""
    height, width = shapes[level]
    scale = 1.0 / (1 << level)
    u, v = u * scale - 0.5, v * scale - 0.5
    j, i = int(math.floor(u)), int(math.floor(v))
    wx, wy = np.zeros(4), np.zeros(4)
    if level == 0:
        _cubic_weights(u - j, wx)
        _cubic_weights(v - i, wy)
    else:
        wx[1], wx[2], wy[1], wy[2] = 1.0 - (u - j), u - j, 1.0 - (v - i), v - i
    value = np.zeros(4)
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
