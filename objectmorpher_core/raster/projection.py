"""Gaussians onto the screen: the motion, EWA projection and the map into the photo, in one pass.

Steps 1 and 2 of `reference`, for 64 Gaussians at a time: what the skinning has computed is
projected while it is still in the processor's cache, and never written out. All is done in the
object's frame, by the screen's derivatives J1 W F with W the placed object's linear part.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from ..arrays import F32, frozen
from ..camera import Camera
from ..deform import skinning
from ..deform.binding import LANES
from ..deform.skinning import LINEAR, SHIFT, Skin, Skinned, skin_block
from ..threads import FAST, in_threads
from . import posed
from .posed import (
    COLOUR,
    COSINE,
    COVARIANCE,
    NORMAL,
    OPACITY,
    PICTURE,
    REST_ROWS,
    SOLIDITY,
    U0,
    VISIBILITY,
    ZOOM,
    PosedSplats,
)
from .rules import RULES, facing_weight, ramp

# Columns of a projected Gaussian: its place and shape, ...
CX, CY = 0, 1  # view px
QXX = 2  # of the inverse of the filtered screen covariance C; q = QXX e^2 + RYY dy^2
TILT = 3  # e = dx + TILT dy: so written, q keeps its digits however thin the Gaussian
RYY = 4  # 1 / Cyy
CUT = 5  # q beyond which alpha is 0
EX, EY = 6, 7  # view px, half-size of the box that holds what is left
Z, ZX, ZY = 8, 9, 10  # depth, and its slope per px
WEIGHT = 11  # of alpha
RED, GREEN, BLUE = 12, 13, 14
# ... and what it shows of the photo.
SX, SY = 15, 16  # photo px, from the pixel to where it looks
AXX, AXY, AYX, AYY = 17, 18, 19, 20  # slope of that
MAGNIFIED = 21  # photo px per view px, the larger
PHOTO, BODY = 22, 23  # shares of alpha that show the photo, and its own colour
SEEN, MATTED, SOLID = 24, 25, 26
FRONT = 27  # q up to which it can be a layer's front
SPAN = 32  # numbers of a row: two lines of the processor's cache
PLAIN_SPAN = 16  # of one that has no photo: one line

OUT = skinning.ROWS  # first row of the results in the kernel's working memory
VOLUME = SPAN  # further rows of the results: |det F|,
FACING = SPAN + 1  # cosine of the normal,
SMALLEST = SPAN + 2  # and the smaller magnification
ROWS = OUT + SPAN + 3


def project(splats: PosedSplats, camera: Camera, photo_camera: Camera) -> F32:
    """Gaussians on the screen (N, SPAN), columns as named above; unseen ones are all 0.

    (N, PLAIN_SPAN) where nothing of the photo is shown.
    """
    rest = splats.rest
    out = np.zeros((len(rest), SPAN if splats.is_layered else PLAIN_SPAN), np.float32)
    linear, offset = splats.world_from_object[:3, :3], splats.world_from_object[:3, 3]
    frame = np.concatenate(
        [
            linear.ravel(), offset, [splats.scale, RULES.near * splats.gap],
            [camera.focal, camera.cx, camera.cy],
            [photo_camera.focal, photo_camera.cx, photo_camera.cy],
            posed.view_limits(photo_camera), [splats.is_layered],
        ]
    )  # fmt: skip
    inputs: tuple[Any, ...] = (
        *_motion(splats), rest.blocks.reshape(-1), frozen(frame), RULES, rest.splatting, out,
    )  # fmt: skip
    in_threads(lambda first, last: _project(first, last, *inputs), len(rest.blocks), 2)
    return out


_NO_SKIN = (
    frozen(np.zeros((0, 3))), frozen(np.zeros((0, 4), np.uint32)), frozen(np.zeros((0, 0))),
    frozen(np.zeros((0, 8))), frozen(np.zeros((2, 3))),
)  # fmt: skip
_NO_POINTS = (frozen(np.zeros((0, 3))), frozen(np.zeros((0, 3, 3))))


def _motion(splats: PosedSplats) -> tuple[Any, ...]:
    """What moves the Gaussians, as the kernel takes it: one of three, the others empty."""
    motion = splats.motion
    if isinstance(motion, Skin):
        return (*motion.inputs(), *_NO_POINTS)
    if isinstance(motion, Skinned):
        points, linear = frozen(motion.points, np.float64), frozen(motion.linear, np.float64)
        return (*_NO_SKIN, points, linear)
    return (*_NO_SKIN, *_NO_POINTS)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _project(
    first, last, x, control_points, shares, nodes, centre, points, linear,
    rest, frame, rules, kind, out,
):  # fmt: skip
    """Fills the rows of `out` that belong to the blocks first..last."""
    s = np.ones(ROWS * LANES)
    left, right, one = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    drift = np.zeros(3)
    if len(x) > 0:
        for a in range(3):
            drift[a] = centre[1, a]
    else:
        for row in range(SHIFT, SHIFT + 3):
            s[row * LANES : (row + 1) * LANES] = 0.0
        for row in range(9):
            at = (LINEAR + row) * LANES
            s[at : at + LANES] = 1.0 if row % 4 == 0 else 0.0
    for block in range(first, last):
        start = block * LANES
        count = min(LANES, len(out) - start)
        base = block * REST_ROWS * LANES
        if len(x) > 0:
            skin_block(block, count, x, control_points, shares, nodes, centre, s, left, right, one)
        elif len(points) > 0:
            for k in range(count):
                for a in range(3):
                    s[(SHIFT + a) * LANES + k] = points[start + k, a] - rest[base + a * LANES + k]
                    for b in range(3):
                        s[(LINEAR + 3 * a + b) * LANES + k] = linear[start + k, a, b]
        _project_block(s, rest, base, frame, drift, rules, kind)
        _finish_block(s, rest, base, start, count, frame, rules, kind, out)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _project_block(s, rest, base, frame, drift, rules, kind):
    """The geometry of 64 Gaussians; the loop is straight, so that it becomes vector code."""
    w00, w01, w02, w10, w11, w12, w20, w21, w22 = (
        frame[0], frame[1], frame[2], frame[3], frame[4], frame[5], frame[6], frame[7], frame[8],
    )  # fmt: skip
    t0, t1, t2, near = frame[9], frame[10], frame[11], frame[13]
    focal, cx, cy = frame[14], frame[15], frame[16]
    photo_focal, photo_cx, photo_cy = frame[17], frame[18], frame[19]
    limit_x, limit_y = frame[20], frame[21]
    if kind.is_surface:
        limit_x = limit_y = 1e30
    ratio = photo_focal / focal
    d0, d1, d2 = drift[0], drift[1], drift[2]
    for k in range(LANES):
        r = base + k
        # where it is now, object frame and world
        o0 = rest[r] + (d0 + s[SHIFT * LANES + k])
        o1 = rest[r + LANES] + (d1 + s[(SHIFT + 1) * LANES + k])
        o2 = rest[r + 2 * LANES] + (d2 + s[(SHIFT + 2) * LANES + k])
        x = w00 * o0 + w01 * o1 + w02 * o2 + t0
        y = w10 * o0 + w11 * o1 + w12 * o2 + t1
        z = w20 * o0 + w21 * o1 + w22 * o2 + t2
        f00, f01, f02 = (
            s[LINEAR * LANES + k], s[(LINEAR + 1) * LANES + k], s[(LINEAR + 2) * LANES + k],
        )  # fmt: skip
        f10, f11, f12 = (
            s[(LINEAR + 3) * LANES + k], s[(LINEAR + 4) * LANES + k], s[(LINEAR + 5) * LANES + k],
        )  # fmt: skip
        f20, f21, f22 = (
            s[(LINEAR + 6) * LANES + k], s[(LINEAR + 7) * LANES + k], s[(LINEAR + 8) * LANES + k],
        )  # fmt: skip
        # J1 = [[j, 0, jx], [0, j, jy]]; the rows of J1 W
        j = focal / z
        jx = -j * min(max(x / z, -limit_x), limit_x)
        jy = -j * min(max(y / z, -limit_y), limit_y)
        g0, g1, g2 = j * w00 + jx * w20, j * w01 + jx * w21, j * w02 + jx * w22
        h0, h1, h2 = j * w10 + jy * w20, j * w11 + jy * w21, j * w12 + jy * w22
        # of J1 W F: a screen px in terms of the object at rest; and of the depth
        a0, a1, a2 = (
            g0 * f00 + g1 * f10 + g2 * f20,
            g0 * f01 + g1 * f11 + g2 * f21,
            g0 * f02 + g1 * f12 + g2 * f22,
        )
        b0, b1, b2 = (
            h0 * f00 + h1 * f10 + h2 * f20,
            h0 * f01 + h1 * f11 + h2 * f21,
            h0 * f02 + h1 * f12 + h2 * f22,
        )
        m0, m1, m2 = (
            w20 * f00 + w21 * f10 + w22 * f20,
            w20 * f01 + w21 * f11 + w22 * f21,
            w20 * f02 + w21 * f12 + w22 * f22,
        )
        # Sigma times these rows
        c = r + COVARIANCE * LANES
        r00, r01, r02 = rest[c], rest[c + LANES], rest[c + 2 * LANES]
        r11, r12, r22 = rest[c + 3 * LANES], rest[c + 4 * LANES], rest[c + 5 * LANES]
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
        szx = m0 * p0 + m1 * p1 + m2 * p2  # depth against the screen
        szy = m0 * q0 + m1 * q1 + m2 * q2
        ridge = rules.ridge * (sxx + syy) + 1e-12
        det = (sxx + ridge) * (syy + ridge) - sxy * sxy
        ixx, ixy, iyy = (syy + ridge) / det, -sxy / det, (sxx + ridge) / det
        # A = J0 Sigma (J1 F)^T (...)^-1
        n = r + PICTURE * LANES
        c00 = rest[n] * a0 + rest[n + LANES] * a1 + rest[n + 2 * LANES] * a2
        c01 = rest[n] * b0 + rest[n + LANES] * b1 + rest[n + 2 * LANES] * b2
        c10 = rest[n + 3 * LANES] * a0 + rest[n + 4 * LANES] * a1 + rest[n + 5 * LANES] * a2
        c11 = rest[n + 3 * LANES] * b0 + rest[n + 4 * LANES] * b1 + rest[n + 5 * LANES] * b2
        axx, axy = c00 * ixx + c01 * ixy, c00 * ixy + c01 * iyy
        ayx, ayy = c10 * ixx + c11 * ixy, c10 * ixy + c11 * iyy
        # its singular values
        total = axx * axx + axy * axy + ayx * ayx + ayy * ayy
        area = abs(axx * ayy - axy * ayx)
        spread = math.sqrt(max(total * total - 4 * area * area, 0.0))
        largest = math.sqrt(max(0.5 * (total + spread), 1e-30))
        # normals turn with the cofactors of F; W turns them and the way to the camera alike
        k00, k01, k02 = f11 * f22 - f12 * f21, f12 * f20 - f10 * f22, f10 * f21 - f11 * f20
        k10, k11, k12 = f02 * f21 - f01 * f22, f00 * f22 - f02 * f20, f01 * f20 - f00 * f21
        k20, k21, k22 = f01 * f12 - f02 * f11, f02 * f10 - f00 * f12, f00 * f11 - f01 * f10
        determinant = f00 * k00 + f01 * k01 + f02 * k02
        sign = 1.0 if determinant >= 0 else -1.0
        n = r + NORMAL * LANES
        n0, n1, n2 = rest[n], rest[n + LANES], rest[n + 2 * LANES]
        nx = k00 * n0 + k01 * n1 + k02 * n2
        ny = k10 * n0 + k11 * n1 + k12 * n2
        nz = k20 * n0 + k21 * n1 + k22 * n2
        vx, vy, vz = (
            w00 * x + w10 * y + w20 * z,
            w01 * x + w11 * y + w21 * z,
            w02 * x + w12 * y + w22 * z,
        )
        lengths = math.sqrt((nx * nx + ny * ny + nz * nz) * (vx * vx + vy * vy + vz * vz))
        cosine = -sign * (nx * vx + ny * vy + nz * vz) / max(lengths, 1e-30)
        fxx, fyy = sxx + kind.filter, syy + kind.filter
        fdet = fxx * fyy - sxy * sxy
        compensation = math.sqrt(max(sxx * syy - sxy * sxy, 0.0) / fdet)
        weight = compensation if kind.is_compensated else 1.0
        px, py = j * x, j * y
        o = OUT * LANES + k
        s[o + CX * LANES], s[o + CY * LANES] = px + cx, py + cy
        s[o + QXX * LANES], s[o + TILT * LANES] = fyy / fdet, -sxy / fyy
        s[o + RYY * LANES] = 1.0 / fyy
        s[o + EX * LANES], s[o + EY * LANES] = fxx, fyy  # of these `_finish_block` makes the box
        s[o + Z * LANES] = z if z > near else 0.0
        s[o + ZX * LANES], s[o + ZY * LANES] = szx * ixx + szy * ixy, szx * ixy + szy * iyy
        s[o + WEIGHT * LANES] = weight * rest[r + OPACITY * LANES]
        u = r + U0 * LANES
        s[o + SX * LANES] = rest[u] - (px * ratio + photo_cx)
        s[o + SY * LANES] = rest[u + LANES] - (py * ratio + photo_cy)
        s[o + AXX * LANES], s[o + AXY * LANES] = axx - ratio, axy
        s[o + AYX * LANES], s[o + AYY * LANES] = ayx, ayy - ratio
        s[o + MAGNIFIED * LANES] = largest
        s[o + VOLUME * LANES] = abs(determinant)
        s[o + FACING * LANES] = cosine
        s[o + SMALLEST * LANES] = area / largest * j / rest[r + ZOOM * LANES]


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _finish_block(s, rest, base, start, count, frame, rules, kind, out):
    """The rules that decide weights and shares, and the rows of `out`, start and following."""
    scale, is_plain = frame[12], frame[22] == 0.0
    whole = -2.0 * math.log(kind.tail) if kind.tail > 0.0 else 0.0
    for k in range(count):
        o, r = OUT * LANES + k, base + k
        z, weight = s[o + Z * LANES], s[o + WEIGHT * LANES]
        if not (z > 0.0 and math.isfinite(weight + s[o + CX * LANES] + s[o + CY * LANES])):
            continue
        seen, solidity = rest[r + VISIBILITY * LANES], rest[r + SOLIDITY * LANES]
        cosine, volume = s[o + FACING * LANES], s[o + VOLUME * LANES]
        if kind.is_surface:
            weight *= facing_weight(cosine, seen, solidity, rules)
        if abs(volume - 1.0) > 1e-9:
            volume = volume ** (1.0 / 3.0)
        stretch = s[o + SMALLEST * LANES] * volume * scale
        photo = ramp(stretch, rules.streak_end, rules.streak_start)
        body = (1.0 - photo) * solidity
        if not kind.is_surface:
            photo *= seen
            body = 1.0 - photo
            seen = solidity = 1.0
        ends = kind.tail + kind.least / max(weight, 1e-30)
        if not (weight * (photo + body) > 0.0 and ends < 1.0):
            continue
        i = start + k
        for c in range(SX if is_plain else FRONT):
            out[i, c] = s[o + c * LANES]
        cut = -2.0 * math.log(ends) if kind.least > 0.0 else whole
        out[i, CUT], out[i, WEIGHT] = cut, weight
        out[i, EX] = math.sqrt(cut * s[o + EX * LANES])
        out[i, EY] = math.sqrt(cut * s[o + EY * LANES])
        for c in range(3):
            out[i, RED + c] = rest[r + (COLOUR + c) * LANES]
        if is_plain:
            continue
        out[i, PHOTO], out[i, BODY], out[i, SEEN], out[i, SOLID] = photo, body, seen, solidity
        turned = cosine - rest[r + COSINE * LANES]
        out[i, MATTED] = ramp(stretch, rules.matte_end, rules.matte_start) * ramp(
            turned, rules.turned_end, rules.turned_start
        )
        least = max(rules.least_front / (weight * (photo + body)), kind.least / weight)
        out[i, FRONT] = -2.0 * math.log(kind.tail + least) if kind.tail + least < 1.0 else -1.0
