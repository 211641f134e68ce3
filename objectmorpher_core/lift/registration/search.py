"""The coarse search of a registration: every rotation is tried, a few are kept.

Rotations are spread evenly over SO(3) by a spiral (Alexa, CVPR 2022). For each of them, and each
focal length that comes into question, the object is put where the boxes of the two silhouettes
agree, drawn as a few hundred surfels on some forty pixels, and scored.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...base.arrays import F64, frozen
from ...base.camera import Camera
from ...base.kernel_files import numba
from ...base.progress import Progress
from ...base.rotations import matrices_from_quats
from ...base.threads import FAST, core_count, in_threads
from .sketch import CHANNELS, COLOR, NEAR, Surfels, draw
from .view import RegistrationView, Stance, Target, window_of

ROTATIONS = 3600  # about 15 degrees apart
PSI = 1.533751168755204288118041413  # the root of psi^4 = psi + 4, of the spiral
ALIGNED = 2  # times that the boxes are made to agree: perspective changes a little each time
APART = math.radians(22.0)  # rotations that are nearer to one another are one proposal
WORTH, MOST = 0.25, 60  # x the best score; peaks that are kept
BATCH = 256  # rotations between two looks at whether to stop


def spread_rotations(count: int) -> F64:
    """(count, 3, 3) rotations, evenly spread: super-Fibonacci spirals."""
    s = np.arange(count) + 0.5
    t = s / count
    r, big = np.sqrt(t), np.sqrt(1 - t)
    alpha, beta = 2 * np.pi * s / math.sqrt(2), 2 * np.pi * s / PSI
    quats = np.stack([r * np.sin(alpha), r * np.cos(alpha), big * np.sin(beta), big * np.cos(beta)])
    return matrices_from_quats(quats.T)


@dataclass(frozen=True, eq=False)
class FoundStance:
    """A stance that the search has kept, and how well it agrees with the photo."""

    stance: Stance
    score: float


def search(
    surfels: Surfels,
    view: RegistrationView,
    target: Target,
    focals: tuple[float, ...],
    progress: Progress,
) -> list[FoundStance]:
    """The best stance near every rotation that is better than those around it, best first.

    `focals` in photo px.
    """
    turns, photo = frozen(spread_rotations(ROTATIONS)), target.camera
    zoom = view.camera.focal / photo.focal
    corner = np.array([photo.cx, photo.cy]) - np.array([view.camera.cx, view.camera.cy]) / zoom
    guesses = [(focal, np.array(box)) for focal in focals for box in target.boxes]
    tables = []
    for k, (focal, box) in enumerate(guesses):
        window = window_of(view.camera, photo, focal)
        own = frozen((box - np.tile(corner, 2)) * zoom)
        table = np.zeros((len(turns), 4))
        for start in range(0, len(turns), BATCH * core_count()):
            progress((k + start / len(turns)) / len(guesses), "Trying every way it can stand")
            part = turns[start : start + BATCH * core_count()]
            _try_all(surfels, view, window, own, part, table[start : start + len(part)])
        tables.append(table)
    scores = np.stack([table[:, 0] for table in tables])
    best = scores.argmax(0)
    kept: list[FoundStance] = []
    for i in _peaks(turns, scores.max(0)):
        k = int(best[i])
        x, y, size = tables[k][i, 1:]
        stance = Stance(turns[i], np.array([x, y]) / zoom + corner, size / zoom, guesses[k][0])
        kept.append(FoundStance(stance, float(scores[k, i])))
    return kept


def angles(turn: F64, turns: F64) -> F64:
    """(n,) radians between a rotation (3, 3) and others (n, 3, 3)."""
    cosine = (turns.reshape(-1, 9) @ turn.reshape(9) - 1) / 2
    return np.arccos(cosine.clip(-1, 1))


def _peaks(turns: F64, scores: F64) -> list[int]:
    """Indices of rotations that are best within APART of them, best first."""
    left, peaks = scores.copy(), []
    while left.max() > WORTH * scores.max() and len(peaks) < MOST:
        i = int(left.argmax())
        peaks.append(i)
        left[angles(turns[i], turns) < APART] = -np.inf
    return peaks


def _try_all(
    surfels: Surfels, view: RegistrationView, window: Camera, box: F64, turns: F64, out: F64
) -> None:  # fmt: skip
    """Fills `out` (n, 4): score, and where it is put: x, y, size in px of the window."""
    shape = surfels.points, surfels.normals, surfels.colors, surfels.spacing
    intrinsics = frozen(np.array([window.focal, window.cx, window.cy]))
    look = view.mask, view.pixels, view.within, box
    in_threads(lambda a, b: _try(a, b, *shape, frozen(turns), intrinsics, *look, out), len(turns))


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _try(
    first, last, points, normals, colors, spacing, turns, intrinsics, mask, pixels, within, box, out
):  # fmt: skip
    height, width = mask.shape
    picture = np.empty((height, width, CHANNELS), np.float32)
    pose = np.zeros((4, 4))
    focal = intrinsics[0]
    wide, tall = box[2] - box[0], box[3] - box[1]
    for i in range(first, last):
        x, y, size = 0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3]), max(wide, tall)
        for _ in range(ALIGNED):
            _stand(turns[i], x, y, size, intrinsics, pose)
            x0, y0, x1, y1 = _box_of(points, pose, intrinsics)
            size *= math.sqrt(wide * tall / max((x1 - x0) * (y1 - y0), 1e-6))
            x += 0.5 * (box[0] + box[2]) - 0.5 * (x0 + x1)
            y += 0.5 * (box[1] + box[3]) - 0.5 * (y0 + y1)
            size = min(size, focal / 0.9)  # the camera stays outside the object
        _stand(turns[i], x, y, size, intrinsics, pose)
        draw(points, normals, colors, spacing, pose, intrinsics, picture)
        out[i, 0] = _score(picture, mask, pixels, within)
        out[i, 1], out[i, 2], out[i, 3] = x, y, size


@numba.njit(nogil=True, error_model="numpy")
def _stand(turn, x, y, size, intrinsics, pose):
    """Fills `pose` as `Stance.matrix` does."""
    focal, cx, cy = intrinsics
    rx, ry = (x - cx) / focal, (y - cy) / focal
    length = math.sqrt(rx * rx + ry * ry + 1.0)
    a, b, c = rx / length, ry / length, 1.0 / length
    k = 1.0 / (1.0 + c)
    for j in range(3):
        u, v, w = turn[0, j], turn[1, j], turn[2, j]
        pose[0, j] = (1.0 - k * a * a) * u - k * a * b * v + a * w
        pose[1, j] = -k * a * b * u + (1.0 - k * b * b) * v + b * w
        pose[2, j] = -a * u - b * v + c * w
    depth = focal / size
    pose[0, 3], pose[1, 3], pose[2, 3] = rx * depth, ry * depth, depth


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _box_of(points, pose, intrinsics):
    focal, cx, cy = intrinsics
    x0, y0, x1, y1 = 1e9, 1e9, -1e9, -1e9
    for i in range(len(points)):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        z = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz + pose[2, 3]
        z = max(z, NEAR)
        x = focal * (pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz + pose[0, 3]) / z + cx
        y = focal * (pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz + pose[1, 3]) / z + cy
        x0, y0, x1, y1 = min(x0, x), min(y0, y), max(x1, x), max(y1, y)
    return x0, y0, x1, y1


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _score(picture, mask, pixels, within):
    """IoU less the colour error, the photo's exposure and veil of each channel taken out."""
    height, width = mask.shape
    sums = np.zeros((3, 6))
    inside = union = 0.0
    for row in range(height):
        for column in range(width):
            o, m = picture[row, column], mask[row, column]
            coverage = o[0] * within[row, column]
            w = min(coverage, m)
            inside += w
            union += max(coverage, m)
            if w > 0.0:
                for c in range(3):
                    own, seen = o[COLOR + c], pixels[row, column, c]
                    sums[c, 0] += w * own
                    sums[c, 1] += w * seen
                    sums[c, 2] += w * own * own
                    sums[c, 3] += w * own * seen
                    sums[c, 4] += w * seen * seen
    if inside <= 0.0:
        return 0.0
    error = 0.0
    for c in range(3):
        a, b = sums[c, 0] / inside, sums[c, 1] / inside
        own = max(sums[c, 2] / inside - a * a, 0.0)
        both = sums[c, 3] / inside - a * b
        seen = max(sums[c, 4] / inside - b * b, 0.0)
        gain = min(max(both / (own + 1e-3), 0.0), 2.0)
        error += max(seen - 2.0 * gain * both + gain * gain * own, 0.0)
    return inside / union - math.sqrt(error / 3.0)
