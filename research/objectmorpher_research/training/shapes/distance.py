"""Signed distances to a made-up object: the kernels that everything about its shape comes from.

An object is a table of primitives (Quilez, "distance functions"), some of which are joined softly
and some cut away, in parts. Distances are lower bounds inside and outside, so that a ray that
advances by them never passes a surface (sphere tracing, Hart 1996).
"""

from __future__ import annotations

import math

import numpy as np

from objectmorpher_core.base.kernel_files import numba
from objectmorpher_core.base.threads import FAST

# Kinds of primitives, and what their numbers mean; all lie about their own origin.
ELLIPSOID = 0  # half sizes x, y, z
BOX = 1  # half sizes x, y, z, roundness
ROUND_CONE = 2  # from the origin up y: radius below, radius above, height
CYLINDER = 3  # radius, half height, roundness
TORUS = 4  # large radius, small radius, about y; half the angle that is there, pi: all of it
LATHE = 5  # first row and rows of the outline (radius, y), about y, a closed polygon
PRISM = 6  # first row and rows of the outline (x, y), half depth along z, roundness
SUPERQUADRIC = 7  # half sizes x, y, z, exponents of the sides and of the outline from above
SHEET = 8  # half sizes x and y, half thickness; waves: height, per x, per y, phase; bend about y
SIZE = 8  # numbers of a primitive

# How a primitive is joined to those of its part before it.
JOIN, CUT, KEEP = 0, 1, 2  # union, difference, intersection

FAR = 1e9
STEPS = 192  # of a ray
CLOSE = 6e-4  # from a surface, at which it is met
ALMOST = 4e-3  # from it, where a ray along a surface has used up its steps
GRAZING = 0.02  # along a ray that touches a surface without getting in
LEAST_STEP = 3e-3  # within the object
HALVINGS = 4  # of a step in which a ray leaves it
SLOW = 0.8  # of a step, where distances are only nearly bounds


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _polygon(x, y, outlines, first, count, axis):
    """Distance to a closed polygon, negative inside; sides with x <= axis are no surface."""
    best, sign = FAR, 1.0
    j = first + count - 1
    for i in range(first, first + count):
        ex, ey = outlines[j, 0] - outlines[i, 0], outlines[j, 1] - outlines[i, 1]
        wx, wy = x - outlines[i, 0], y - outlines[i, 1]
        t = min(max((wx * ex + wy * ey) / max(ex * ex + ey * ey, 1e-12), 0.0), 1.0)
        bx, by = wx - ex * t, wy - ey * t
        if outlines[i, 0] > axis or outlines[j, 0] > axis:
            best = min(best, bx * bx + by * by)
        above, below = y >= outlines[i, 1], y < outlines[j, 1]
        left = ex * wy > ey * wx
        if (above and below and left) or (not above and not below and not left):
            sign = -sign
        j = i
    return sign * math.sqrt(best)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _ellipsoid(x, y, z, a):
    """As below; inside, where that may be far too much, no more than along the shortest axis."""
    px, py, pz = (x / a[0]) ** 2, (y / a[1]) ** 2, (z / a[2]) ** 2
    square = px + py + pz
    norm = math.sqrt(square)
    slope = math.sqrt(px / a[0] ** 2 + py / a[1] ** 2 + pz / a[2] ** 2)
    first = norm * (norm - 1.0) / max(slope, 1e-9)
    if square >= 1.0:
        return first
    short = min(a[0], min(a[1], a[2]))
    own = px if a[0] == short else (py if a[1] == short else pz)
    depth = short * (math.sqrt(max(1.0 - square + own, 0.0)) - math.sqrt(own))
    return max(first, -depth) if norm > 1e-6 else -short


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _superquadric(x, y, z, a):
    """(f - 1) / |its slope| of the norm f whose unit ball it is: a bound, as f is convex."""
    size = max(max(x, max(y, z)), 1e-6)
    x, y, z = max(x / size, 1e-4), max(y / size, 1e-4), max(z / size, 1e-4)
    side, above = a[3], a[4]
    px, py, pz = x ** (2 / above), y ** (2 / side), z ** (2 / above)
    level = (px + pz) ** (above / side)
    total = level + py
    norm = total ** (side / 2)
    around = norm / total * level / (px + pz)
    gx, gz, gy = around * px / (x * a[0]), around * pz / (z * a[2]), norm / total * py / (y * a[1])
    slope = math.sqrt(gx * gx + gy * gy + gz * gz)
    return max((size * norm - 1.0) / max(slope, 1e-9), -min(a[0], min(a[1], a[2])))


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _primitive(kind, x, y, z, a, outlines):
    """Distance from a place in the primitive's own frame; `a`: its numbers."""
    if kind == ELLIPSOID:
        return _ellipsoid(abs(x), abs(y), abs(z), a)
    if kind == BOX:
        qx, qy, qz = abs(x) - a[0] + a[3], abs(y) - a[1] + a[3], abs(z) - a[2] + a[3]
        out = math.sqrt(max(qx, 0.0) ** 2 + max(qy, 0.0) ** 2 + max(qz, 0.0) ** 2)
        return out + min(max(qx, max(qy, qz)), 0.0) - a[3]
    if kind == ROUND_CONE:
        q = math.sqrt(x * x + z * z)
        b = (a[0] - a[1]) / max(a[2], 1e-9)
        c = math.sqrt(max(1.0 - b * b, 0.0))
        k = c * y - b * q  # along the side
        if k < 0.0:
            return math.sqrt(q * q + y * y) - a[0]
        if k > c * a[2]:
            return math.sqrt(q * q + (y - a[2]) ** 2) - a[1]
        return q * c + y * b - a[0]
    if kind == CYLINDER:
        q, h = math.sqrt(x * x + z * z) - a[0] + a[2], abs(y) - a[1] + a[2]
        return min(max(q, h), 0.0) + math.sqrt(max(q, 0.0) ** 2 + max(h, 0.0) ** 2) - a[2]
    if kind == TORUS:
        sx, cx, x = math.sin(a[2]), math.cos(a[2]), abs(x)
        along = x * sx + z * cx if cx * x > sx * z else math.sqrt(x * x + z * z)
        return math.sqrt(max(x * x + y * y + z * z + a[0] ** 2 - 2 * a[0] * along, 0.0)) - a[1]
    if kind == LATHE:
        return _polygon(math.sqrt(x * x + z * z), y, outlines, int(a[0]), int(a[1]), 1e-6)
    if kind == PRISM:
        d, h = _polygon(x, y, outlines, int(a[0]), int(a[1]), -FAR) + a[3], abs(z) - a[2] + a[3]
        return min(max(d, h), 0.0) + math.sqrt(max(d, 0.0) ** 2 + max(h, 0.0) ** 2) - a[3]
    if kind == SUPERQUADRIC:
        return _superquadric(abs(x / a[0]), abs(y / a[1]), abs(z / a[2]), a)
    # A sheet, bent about y and waved
    bend, near = a[7], 1.0
    if abs(bend) > 1e-4:
        radius = 1.0 / bend
        angle = math.atan2(x, radius - z) if bend > 0 else math.atan2(x, z - radius)
        away = math.sqrt(x * x + (radius - z) ** 2)
        near = min(away * abs(bend), 1.0)  # lengths along it are shorter inside the bend
        x, z = angle * abs(radius), (radius - away) if bend > 0 else (away + radius)
    z -= a[3] * math.sin(a[4] * x + a[6]) * math.cos(a[5] * y + 0.5 * a[6])
    steep = 1.0 + abs(a[3]) * max(abs(a[4]), abs(a[5]))
    edge = math.sqrt((x / a[0]) ** 4 + (y / a[1]) ** 4) ** 0.5
    side = (edge - 1.0) * min(a[0], a[1]) * near
    return max(side, abs(z) - a[2]) / steep


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _joined(a, b, soft):
    """The lower of two distances, rounded where they are less than `soft` apart."""
    if soft <= 0.0:
        return min(a, b)
    h = max(soft - abs(a - b), 0.0) / soft
    return min(a, b) - h * h * soft * 0.25


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def distance(px, py, pz, solid, is_filled):
    """Return the distance to the object, and the nearest part; `is_filled` keeps cavities uncut."""
    kinds, frames, numbers, joins, softness, cavities, balls, parts, bounds, outlines, warp = solid
    x, y, z = px, py, pz
    slow = 1.0
    if warp[0] != 0.0:  # twisted about y
        s, c = math.sin(warp[0] * y), math.cos(warp[0] * y)
        x, z = c * x - s * z, s * x + c * z
        slow = 0.7
    if warp[1] != 0.0:  # bent sideways
        s, c = math.sin(warp[1] * y), math.cos(warp[1] * y)
        x, y = c * x - s * y, s * x + c * y
        slow = 0.7
    best, nearest = FAR, -1
    for part in range(len(parts)):
        b = bounds[part]
        least = math.sqrt((x - b[0]) ** 2 + (y - b[1]) ** 2 + (z - b[2]) ** 2) - b[3]
        if least > best:
            continue
        if least > 0.25:  # far away, its ball will do
            if least + 0.05 < best:
                best, nearest = least + 0.05, part
            continue
        own = FAR
        for k in range(parts[part, 0], parts[part, 1]):
            if is_filled and cavities[k]:
                continue
            b = balls[k]
            least = math.sqrt((x - b[0]) ** 2 + (y - b[1]) ** 2 + (z - b[2]) ** 2) - b[3]
            if joins[k] == JOIN and least > own + softness[k]:
                continue  # too far away to matter
            if joins[k] == CUT and least > softness[k] - own:
                continue
            f = frames[k]
            qx = f[0, 0] * x + f[0, 1] * y + f[0, 2] * z + f[0, 3]
            qy = f[1, 0] * x + f[1, 1] * y + f[1, 2] * z + f[1, 3]
            qz = f[2, 0] * x + f[2, 1] * y + f[2, 2] * z + f[2, 3]
            d = _primitive(kinds[k], qx, qy, qz, numbers[k], outlines)
            if joins[k] == JOIN:
                own = _joined(own, d, softness[k])
            elif joins[k] == CUT:
                own = -_joined(-own, d, softness[k])
            else:
                own = -_joined(-own, -d, softness[k])
        if own < best:
            best, nearest = own, part
    return best * slow, nearest


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _towards(o, d, start, end, solid, is_filled):
    """Distance along a ray at which the object is met, and its part; -1 where it is not."""
    t, s, part = start, FAR, -1
    for _ in range(STEPS):
        s, part = distance(o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2], solid, is_filled)
        if s < CLOSE:
            return t, part
        t += SLOW * s
        if t > end:
            return -1.0, -1
    return (t, part) if s < ALMOST else (-1.0, -1)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _out_of(o, d, start, end, solid):
    """Distance along a ray that begins within at which the filled object is left."""
    t, before, last = start, 0.0, start
    for _ in range(STEPS):
        s, _ = distance(o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2], solid, True)
        if s >= 0.0 and before < 0.0:  # the surface is between the last two places
            for _ in range(HALVINGS):
                middle = 0.5 * (last + t)
                x, y, z = o[0] + middle * d[0], o[1] + middle * d[1], o[2] + middle * d[2]
                s, _ = distance(x, y, z, solid, True)
                last, t = (middle, t) if s < 0.0 else (last, middle)
            return 0.5 * (last + t)
        if s >= 0.0 and t > start + GRAZING:
            return t
        before, last = s, t
        t += max(SLOW * abs(s), LEAST_STEP)
        if t > end:
            break
    return min(t, end)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _normal(x, y, z, solid):
    e = 1.5e-3
    a, _ = distance(x + e, y - e, z - e, solid, False)
    b, _ = distance(x - e, y - e, z + e, solid, False)
    c, _ = distance(x - e, y + e, z - e, solid, False)
    f, _ = distance(x + e, y + e, z + e, solid, False)
    nx, ny, nz = a - b - c + f, -a - b + c + f, -a + b - c + f
    size = max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
    return nx / size, ny / size, nz / size


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _facing(n, d):
    """A normal that a ray `d` can see: at edges the slopes of both sides are mixed."""
    away = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
    if away <= 0.0:
        return n
    x, y, z = n[0] - away * d[0], n[1] - away * d[1], n[2] - away * d[2]
    size = math.sqrt(x * x + y * y + z * z)
    return (x / size, y / size, z / size) if size > 1e-3 else (-d[0], -d[1], -d[2])


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def shade(x, y, z, way, solid, steps, sharp):
    """Return the share of a lamp in the direction `way` that reaches a place, in [0, 1]."""
    light, t = 1.0, 0.02
    for _ in range(steps):
        s, _ = distance(x + t * way[0], y + t * way[1], z + t * way[2], solid, False)
        if s < 1e-3:
            return 0.0
        light = min(light, sharp * s / t)
        t += max(0.9 * s, 0.02)
        if t > 3.0:
            break
    return light


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _openness(x, y, z, n, solid):
    """How free the space before a surface is, in [0, 1]."""
    opened = 0.0
    for step in (0.05, 0.15, 0.3):
        s, _ = distance(x + step * n[0], y + step * n[1], z + step * n[2], solid, False)
        opened += min(max(s, 0.0) / step, 1.0) / 3.0
    return opened


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def trace(rays, eye, solid, lamps, ground, first, last, out):
    """Fills rows first..last of `out` (n, 16) for unit rays (n, 3) from `eye` (3,), object frame.

    Columns: 0 front, 1 where its part is left, 2 back of all (distances along the ray; front is
    -1 where nothing is met), 3 part, 4-6 normal, 7 openness to the sky, 8-10 light of each of the
    `lamps` (3, 3) that is not hidden, 11 light on the ground, 12 openness of it, 13 its distance.
    `ground`: height of the ground's plane, below -50 without one.
    """
    for k in range(first, last):
        d = rays[k]
        row = out[k]
        row[:] = 0.0
        row[0], row[13] = -1.0, -1.0
        # The object lies in the ball of radius 1 about the origin.
        b = eye[0] * d[0] + eye[1] * d[1] + eye[2] * d[2]
        c = eye[0] ** 2 + eye[1] ** 2 + eye[2] ** 2 - 1.02
        root = b * b - c
        if root > 0.0:
            start, end = max(-b - math.sqrt(root), 1e-3), -b + math.sqrt(root)
            t, part = _towards(eye, d, start, end, solid, False)
            if t > 0.0:
                x, y, z = eye[0] + t * d[0], eye[1] + t * d[1], eye[2] + t * d[2]
                n = _facing(_normal(x, y, z, solid), d)
                row[0], row[3] = t, part
                row[4], row[5], row[6] = n
                row[1] = _out_of(eye, d, t, end, solid)
                far = (eye[0] + end * d[0], eye[1] + end * d[1], eye[2] + end * d[2])
                back, _ = _towards(far, (-d[0], -d[1], -d[2]), 0.0, end - t, solid, True)
                row[2] = end - back if back >= 0.0 else t
                row[2] = max(row[2], row[1])
                row[7] = _openness(x, y, z, n, solid)
                for lamp in range(len(lamps)):
                    way = lamps[lamp]
                    facing = way[0] * n[0] + way[1] * n[1] + way[2] * n[2]
                    if facing > 0.0:
                        e = 4e-3
                        row[8 + lamp] = shade(
                            x + e * n[0], y + e * n[1], z + e * n[2], way, solid, 24, 10.0
                        )
                continue
        if ground > -50.0 and d[1] < -1e-3:
            t = (ground - eye[1]) / d[1]
            x, z = eye[0] + t * d[0], eye[2] + t * d[2]
            if t > 0.0 and x * x + z * z < 9.0:
                row[13] = t
                row[11] = shade(x, ground + 2e-3, z, lamps[0], solid, 24, 6.0)
                s, _ = distance(x, ground + 0.15, z, solid, False)
                row[12] = min(max(s, 0.0) / 0.15, 1.0)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def lowest(solid, columns):
    """The least y of the object, by rays upwards, so many across; never too low by half a gap."""
    best, gap = 1.0, 2.0 / columns
    for i in range(columns):
        for j in range(columns):
            x, z = -1.0 + gap * (i + 0.5), -1.0 + gap * (j + 0.5)
            if x * x + z * z > 1.0:
                continue
            y = -1.02
            while y < best:
                s, _ = distance(x, y, z, solid, True)
                if s < 0.5 * gap:
                    best = y
                    break
                y += SLOW * s
    return best


def ball_of(points: np.ndarray) -> np.ndarray:
    """(4,) the centre and radius of a ball that holds points (n, 3)."""
    centre = 0.5 * (points.min(0) + points.max(0))
    return np.append(centre, np.linalg.norm(points - centre, axis=1).max())
