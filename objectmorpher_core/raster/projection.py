"""Gaussians onto the screen: the motion, EWA projection and the map into the photo, in one pass.

64 Gaussians at a time: what the skinning has computed is projected while it is still in the
processor's cache, and never written out.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..base.arrays import F32, frozen
from ..base.camera import Camera
from ..base.kernel_files import numba
from ..base.threads import FAST, in_threads
from ..deform import skinning
from ..deform.binding import LANES
from ..deform.skinning import LINEAR, SHIFT, Skin, SkinArrays, Skinned, skin_block
from . import rules as p
from .posed import (
    COLOUR,
    COSINE,
    COVARIANCE,
    NORMAL,
    OPACITY,
    PICTURE,
    REST_ROWS,
    SIDE_ROWS,
    SIDE_U0,
    SIDE_ZOOM,
    SOLIDITY,
    U0,
    VISIBILITY,
    ZOOM,
    PosedSplats,
    view_limits,
)
from .rules import ASIDE, PLAIN_SPAN, RULES, SPAN, SX, Z, facing_weight, ramp

# EWA projection (Zwicker et al. 2001) of 64 Gaussians at a time: steps 1 and 2 of `reference`.
#
# The loops over them are straight, so that they become vector code. All is done in the object's
# frame, by the screen's derivatives J1 W F with W the placed object's linear part.

# Rows of the kernel's working memory, a column a Gaussian: first those of `skinning`,
OUT = skinning.ROWS  # then the columns of the results,
VOLUME = OUT + p.SPAN  # |det F|,
FACING = VOLUME + 1  # cosine of the normal,
SMALLEST = VOLUME + 2  # and the smaller magnification
ROWS = VOLUME + 3
ENDLESS = 1e30


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def screen_of(frame, drift, kind):
    """The numbers of `projection.project`'s frame, as the loops take them."""
    linear = (
        (frame[0], frame[1], frame[2]), (frame[3], frame[4], frame[5]),
        (frame[6], frame[7], frame[8]),
    )  # fmt: skip
    offset, lens = (frame[9], frame[10], frame[11]), (frame[14], frame[15], frame[16])
    limits = (ENDLESS, ENDLESS) if kind.is_surface else (frame[20], frame[21])
    shared = drift[0], drift[1], drift[2]
    photo = frame[17] / frame[14], frame[18], frame[19]
    return linear, offset, frame[13], lens, limits, shared, photo


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def project_plain(s, rest, base, screen, rules, kind):
    """Place and shape of 64 Gaussians that begin at `base` of `rest`."""
    for k in range(LANES):
        _put_shape(
            s,
            k,
            rest[base + OPACITY * LANES + k],
            screen,
            kind,
            _shape(s, rest, base, k, screen, rules),
        )


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def project_textured(s, rest, base, sides, aside, screen, rules, kind):
    """The same, and what they show of the photo, or of an invented picture.

    Of those, what begins at `aside` of `sides` is of the same Gaussians; -1: there are none.
    """
    w, _, _, _, _, _, (ratio, photo_cx, photo_cy) = screen
    for k in range(LANES):
        shape = _shape(s, rest, base, k, screen, rules)
        _put_shape(s, k, rest[base + OPACITY * LANES + k], screen, kind, shape)
        place, j, f, a, b, _, (ixx, ixy, iyy), _ = shape
        r, u = base + k, base + k + U0 * LANES
        # normals turn with the cofactors of F; W turns them and the way to the camera alike
        k0, k1, k2 = _cross(f[1], f[2]), _cross(f[2], f[0]), _cross(f[0], f[1])
        determinant = _dot(f[0], k0)
        sign = 1.0 if determinant >= 0 else -1.0
        n = _three(rest, r + NORMAL * LANES)
        n = _dot(k0, n), _dot(k1, n), _dot(k2, n)
        v = _times(place, w)
        cosine = -sign * _dot(n, v) / max(math.sqrt(_dot(n, n) * _dot(v, v)), 1e-30)
        # A = J0 Sigma (J1 F)^T (...)^-1
        upper = _three(rest, r + PICTURE * LANES)
        lower = _three(rest, r + (PICTURE + 3) * LANES)
        ux, uy, zoom, is_aside = rest[u], rest[u + LANES], rest[r + ZOOM * LANES], 0.0
        if aside >= 0:
            q = aside + k
            across, down = _three(sides, q), _three(sides, q + 3 * LANES)
            sx, sy = sides[q + SIDE_U0 * LANES], sides[q + (SIDE_U0 + 1) * LANES]
            own = sides[q + SIDE_ZOOM * LANES]
            least = rules.fringe_aside if own < 0.0 else rules.look_aside
            is_less = rest[r + COSINE * LANES] < least * cosine
            is_aside = (1.0 if is_less else 0.0) * (1.0 if own != 0.0 else 0.0)
            upper, lower = _chosen(is_aside, across, upper), _chosen(is_aside, down, lower)
            (ux, uy, zoom) = _chosen(is_aside, (sx, sy, abs(own)), (ux, uy, zoom))
        c00, c01, c10, c11 = _dot(upper, a), _dot(upper, b), _dot(lower, a), _dot(lower, b)
        axx, axy = c00 * ixx + c01 * ixy, c00 * ixy + c01 * iyy
        ayx, ayy = c10 * ixx + c11 * ixy, c10 * ixy + c11 * iyy
        # its singular values
        total = axx * axx + axy * axy + ayx * ayx + ayy * ayy
        area = abs(axx * ayy - axy * ayx)
        spread = math.sqrt(max(total * total - 4 * area * area, 0.0))
        largest = math.sqrt(max(0.5 * (total + spread), 1e-30))
        o = OUT * LANES + k
        s[o + p.SX * LANES] = ux - (j * place[0] * ratio + photo_cx)
        s[o + p.SY * LANES] = uy - (j * place[1] * ratio + photo_cy)
        s[o + p.AXX * LANES], s[o + p.AXY * LANES] = axx - ratio, axy
        s[o + p.AYX * LANES], s[o + p.AYY * LANES] = ayx, ayy - ratio
        s[o + p.MAGNIFIED * LANES] = largest
        s[VOLUME * LANES + k] = abs(determinant)
        s[FACING * LANES + k] = cosine
        s[SMALLEST * LANES + k] = area / largest * j / zoom
        s[o + p.ASIDE * LANES] = is_aside


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST, forceinline=True)
def _shape(s, rest, base, k, screen, rules):
    """Where Gaussian k is in the world, the derivatives there, and its covariance on the screen."""
    w, (t0, t1, t2), _, (focal, _, _), (limit_x, limit_y), drift, _ = screen
    r, linear = base + k, LINEAR * LANES + k
    mean, shift = _three(rest, r), _three(s, SHIFT * LANES + k)
    o = (
        mean[0] + (drift[0] + shift[0]), mean[1] + (drift[1] + shift[1]),
        mean[2] + (drift[2] + shift[2]),
    )  # fmt: skip
    x, y, z = _dot(w[0], o) + t0, _dot(w[1], o) + t1, _dot(w[2], o) + t2
    f = _three(s, linear), _three(s, linear + 3 * LANES), _three(s, linear + 6 * LANES)
    # J1 = [[j, 0, jx], [0, j, jy]]; a and b, the rows of J1 W F: a screen px in terms of the
    # object at rest; and c, of the depth
    j = focal / z
    jx = -j * min(max(x / z, -limit_x), limit_x)
    jy = -j * min(max(y / z, -limit_y), limit_y)
    a, b, c = (
        _times(_sum(j, w[0], jx, w[2]), f),
        _times(_sum(j, w[1], jy, w[2]), f),
        _times(w[2], f),
    )
    # Sigma times these rows
    at = r + COVARIANCE * LANES
    xx, xy, xz = _three(rest, at)
    yy, yz, zz = _three(rest, at + 3 * LANES)
    sigma = (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)
    by_a, by_b = _times(a, sigma), _times(b, sigma)
    sxx, sxy, syy = _dot(a, by_a), _dot(a, by_b), _dot(b, by_b)
    szx, szy = _dot(c, by_a), _dot(c, by_b)  # depth against the screen
    ridge = rules.ridge * (sxx + syy) + 1e-12
    det = (sxx + ridge) * (syy + ridge) - sxy * sxy
    inverse = (syy + ridge) / det, -sxy / det, (sxx + ridge) / det
    return (x, y, z), j, f, a, b, (sxx, sxy, syy), inverse, (szx, szy)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST, forceinline=True)
def _put_shape(s, k, opacity, screen, kind, shape):
    """The columns CX to WEIGHT, but for CUT; EX and EY hold the variances that make up the box."""
    _, _, near, (_, cx, cy), _, _, _ = screen
    (x, y, z), j, _, _, _, (sxx, sxy, syy), (ixx, ixy, iyy), (szx, szy) = shape
    fxx, fyy = sxx + kind.filter, syy + kind.filter
    fdet = fxx * fyy - sxy * sxy
    compensation = math.sqrt(max(sxx * syy - sxy * sxy, 0.0) / fdet)
    o = OUT * LANES + k
    s[o + p.CX * LANES], s[o + p.CY * LANES] = j * x + cx, j * y + cy
    s[o + p.QXX * LANES], s[o + p.TILT * LANES] = fyy / fdet, -sxy / fyy
    s[o + p.RYY * LANES] = 1.0 / fyy
    s[o + p.EX * LANES], s[o + p.EY * LANES] = fxx, fyy
    s[o + p.Z * LANES] = z if z > near else 0.0
    s[o + p.ZX * LANES], s[o + p.ZY * LANES] = szx * ixx + szy * ixy, szx * ixy + szy * iyy
    s[o + p.WEIGHT * LANES] = opacity * (compensation if kind.is_compensated else 1.0)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def weigh_textured(s, rest, base, scale, rules, kind):
    """The rules that decide weights and shares: the columns from PHOTO on, but for FRONT."""
    whole = max(rules.streak_start, rules.matte_start)  # stretch from which nothing fades
    for k in range(LANES):
        r, o = base + k, OUT * LANES + k
        seen, solidity = rest[r + VISIBILITY * LANES], rest[r + SOLIDITY * LANES]
        cosine, volume = s[FACING * LANES + k], s[VOLUME * LANES + k]
        turned = cosine - rest[r + COSINE * LANES]
        if kind.is_edged and seen == 0.0:
            cosine = min(cosine, turned)
        s[o + p.WEIGHT * LANES] *= facing_weight(
            cosine, seen, solidity, rules, kind.is_surface, kind.is_edged
        )
        photo = matted = 1.0
        stretch = s[SMALLEST * LANES + k] * scale
        if stretch * stretch * stretch * volume < whole * whole * whole:
            stretch *= volume ** (1.0 / 3.0)
            photo = ramp(stretch, rules.streak_end, rules.streak_start)
            matted = ramp(stretch, rules.matte_end, rules.matte_start)
        if kind.is_edged:
            kept = ramp(turned, rules.closing_end, rules.closing_start)
            matted *= seen * (solidity + (1.0 - solidity) * kept)
        else:
            matted *= ramp(turned, rules.turned_end, rules.turned_start)
        if s[o + p.ASIDE * LANES] > 0.0:
            matted = seen = 0.0
        elif kind.has_colors:
            photo *= seen
            seen = 1.0
        body = (1.0 - photo) * solidity
        s[o + p.PHOTO * LANES], s[o + p.BODY * LANES] = photo, body
        s[o + p.SEEN * LANES], s[o + p.SOLID * LANES] = seen, solidity
        s[o + p.MATTED * LANES] = matted


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def limit(s, kind):
    """Fills CUT, EX and EY; CUT is 0 where nothing is to be seen."""
    for k in range(LANES):
        o = OUT * LANES + k
        weight = s[o + p.WEIGHT * LANES]
        is_finite = math.isfinite(weight + s[o + p.CX * LANES] + s[o + p.CY * LANES])
        ends = kind.tail + kind.least / max(weight, 1e-30)
        is_there = is_finite and s[o + p.Z * LANES] > 0.0 and weight > 0.0 and ends < 1.0
        s[o + p.CUT * LANES] = -2.0 * math.log(ends) if is_there else 0.0
    for k in range(LANES):
        o = OUT * LANES + k
        cut = s[o + p.CUT * LANES]
        s[o + p.EX * LANES] = math.sqrt(cut * s[o + p.EX * LANES])
        s[o + p.EY * LANES] = math.sqrt(cut * s[o + p.EY * LANES])


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def limit_front(s, rules, kind):
    """Fills FRONT; CUT becomes 0 of what shows neither the photo nor itself."""
    for k in range(LANES):
        o = OUT * LANES + k
        weight = s[o + p.WEIGHT * LANES]
        both = weight * (s[o + p.PHOTO * LANES] + s[o + p.BODY * LANES])
        if not (s[o + p.CUT * LANES] > 0.0 and both > 0.0):
            s[o + p.CUT * LANES] = 0.0
            continue
        ends = kind.tail + max(rules.least_front / both, kind.least / weight)
        s[o + p.FRONT * LANES] = -2.0 * math.log(ends) if ends < 1.0 else -1.0


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def write(s, rest, base, start, count, columns, out):
    """So many columns of the rows start.. of `out` for `count` Gaussians: 0 of what is not seen."""
    for lane in range(np.uint64(count)):
        k, row = OUT * LANES + int(lane), out[np.uint64(start) + lane]
        if s[k + p.CUT * LANES] > 0.0:
            for c in range(columns):
                row[c] = s[k + c * LANES]
            for c in range(3):
                row[p.RED + c] = rest[base + (COLOUR + c) * LANES + int(lane)]
        else:
            row[:columns] = 0.0
        row[columns:] = 0.0


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _three(a, at):
    """Three rows of memory in which a row has LANES numbers."""
    return a[at], a[at + LANES], a[at + 2 * LANES]


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _chosen(share, a, b):
    """`a` where `share` is 1, `b` where it is 0; without a branch, for vector instructions."""
    rest = 1.0 - share
    return (
        share * a[0] + rest * b[0], share * a[1] + rest * b[1], share * a[2] + rest * b[2],
    )  # fmt: skip


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _times(a, rows):
    """a^T M with the three rows of M."""
    u, v, w = rows
    return (
        a[0] * u[0] + a[1] * v[0] + a[2] * w[0],
        a[0] * u[1] + a[1] * v[1] + a[2] * w[1],
        a[0] * u[2] + a[1] * v[2] + a[2] * w[2],
    )


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _sum(x, a, y, b):
    """x a + y b."""
    return x * a[0] + y * b[0], x * a[1] + y * b[1], x * a[2] + y * b[2]


def project(
    splats: PosedSplats, camera: Camera, photo_camera: Camera, depths: F32 | None = None
) -> F32:
    """Gaussians on the screen (N, SPAN), columns as in `columns`; unseen ones are all 0.

    (N, PLAIN_SPAN) where nothing of the photo is shown. `depths` (N,) gets the column Z: to sort
    them one has to read them only, and not a line of memory for each.
    """
    rest = splats.rest
    out = np.empty((len(rest), SPAN if splats.is_layered else PLAIN_SPAN), np.float32)
    linear, offset = splats.world_from_object[:3, :3], splats.world_from_object[:3, 3]
    frame = np.concatenate(
        [
            linear.ravel(), offset, [splats.scale, RULES.near * splats.gap],
            [camera.focal, camera.cx, camera.cy],
            [photo_camera.focal, photo_camera.cx, photo_camera.cy],
            view_limits(photo_camera),
        ]
    )  # fmt: skip
    inputs: tuple[Any, ...] = (
        *_motion(splats), rest.blocks.reshape(-1), rest.side_blocks.reshape(-1), frozen(frame),
        RULES, rest.splatting,
        splats.is_layered, out, _NO_DEPTHS if depths is None else depths,
    )  # fmt: skip
    in_threads(lambda first, last: _project(first, last, *inputs), len(rest.blocks), 2)
    return out


_NO_SKIN = SkinArrays(
    frozen(np.zeros((0, 3))), frozen(np.zeros((0, 4), np.uint32)), frozen(np.zeros((0, 0))),
    frozen(np.zeros((0, 8))), frozen(np.zeros((2, 3))),
)  # fmt: skip
_NO_DEPTHS = np.zeros(0, np.float32)
_NO_POINTS = (frozen(np.zeros((0, 3))), frozen(np.zeros((0, 3, 3))))


def _motion(splats: PosedSplats) -> tuple[Any, ...]:
    """What moves the Gaussians, as the kernel takes it: one of three, the others empty."""
    motion = splats.motion
    if isinstance(motion, Skin):
        return motion.arrays(), *_NO_POINTS
    if isinstance(motion, Skinned):
        points, linear = frozen(motion.points, np.float64), frozen(motion.linear, np.float64)
        return _NO_SKIN, points, linear
    return _NO_SKIN, *_NO_POINTS


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _project(
    first, last, skin, points, linear, rest, sides, frame, rules, kind, is_textured, out, depths
):  # fmt: skip
    """Fills the rows of `out` that belong to the blocks first..last."""
    s = np.ones(ROWS * LANES)
    left, right, one = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    drift = np.zeros(3)
    if len(skin.points) > 0:
        for a in range(3):
            drift[a] = skin.frame[1, a]
    else:
        for row in range(SHIFT, SHIFT + 3):
            s[row * LANES : (row + 1) * LANES] = 0.0
        for row in range(9):
            at = (LINEAR + row) * LANES
            s[at : at + LANES] = 1.0 if row % 4 == 0 else 0.0
    screen = screen_of(frame, drift, kind)
    for block in range(first, last):
        start = block * LANES
        count = min(LANES, len(out) - start)
        base = block * REST_ROWS * LANES
        if len(skin.points) > 0:
            skin_block(block, count, skin, s, left, right, one)
        elif len(points) > 0:
            for k in range(count):
                for a in range(3):
                    s[(SHIFT + a) * LANES + k] = points[start + k, a] - rest[base + a * LANES + k]
                    for b in range(3):
                        s[(LINEAR + 3 * a + b) * LANES + k] = linear[start + k, a, b]
        if is_textured:
            at = block * SIDE_ROWS * LANES if len(sides) > 0 else -1
            project_textured(s, rest, base, sides, at, screen, rules, kind)
            weigh_textured(s, rest, base, frame[12], rules, kind)
            limit(s, kind)
            limit_front(s, rules, kind)
            write(s, rest, base, start, count, ASIDE + 1, out)
        else:
            project_plain(s, rest, base, screen, rules, kind)
            limit(s, kind)
            write(s, rest, base, start, count, SX, out)
        for i in range(start, min(start + count, len(depths))):
            depths[i] = out[i, Z]
