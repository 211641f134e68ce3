"""The registration of a refined picture to its input.

Image editing networks shift and scale what they are given by some pixels. The two pictures are
compared by the lengths of their gradients, normalised by those around, which light and colour
hardly change. Scales are tried by phase correlation (Kuglin & Hines 1975), the best is made exact
by Gauss-Newton steps on shift and scale (Lucas & Kanade 1981). What remains is then measured in
windows all over the picture: a warp that is no shift and scale shows there.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64
from . import RefineError

MOST_LEFT = 0.5  # px that may remain after the correction
SCALES = np.linspace(0.94, 1.06, 25)  # that are tried
SMALL = 384  # px, longer side of the pictures on which they are tried
STEPS = 30  # of Gauss-Newton at most
SETTLED = 1e-4  # px
LONGEST = 2.0  # px, of a step
BLUR = 4  # px, reach of the blurs
WINDOW = 64  # px, in which what remains is measured
SURE = 0.4  # correlation of a window from which on it counts
NEARBY = 12.0  # px, over which gradients are normalised
FLOOR = 4 / 255  # gradient of noise, which is not made as strong as an edge
OUTLYING = 0.9  # quantile of the windows' distances that has to be small


@dataclass(frozen=True)
class Alignment:
    """The place in the refined picture of what is at p px of its input.

    That is centre + scale (p - centre) + shift.
    """

    shift: tuple[float, float]  # px
    scale: float
    left: float  # px that remain when shift and scale are corrected

    def matrix(self, width: int, height: int) -> F64:
        """(2, 3) from a pixel of the input to the refined picture's."""
        cx, cy = (width - 1) / 2, (height - 1) / 2
        s, (x, y) = self.scale, self.shift
        return np.array([[s, 0, cx - s * cx + x], [0, s, cy - s * cy + y]])


def align(refined: F32, coarse: F32) -> tuple[F32, Alignment]:
    """`refined` (h, w, 3) in [0, 1] put where `coarse` (h, w, 3) lies.

    Raises RefineError, one sentence, where more than half a pixel remains.
    """
    found = measure(refined, coarse)
    if found.left > MOST_LEFT:
        told = "no longer shows the same" if np.isinf(found.left) else f"is {found.left:.1f} px off"
        raise RefineError(f"the refined picture {told}, and is not used: try another seed, or none")
    return warped(refined, found), found


def warped(refined: F32, alignment: Alignment) -> F32:
    """`refined` (h, w, ...) with its shift and scale undone."""
    height, width = refined.shape[:2]
    flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    matrix = alignment.matrix(width, height)
    result = cv2.warpAffine(
        refined, matrix, (width, height), flags=flags, borderMode=cv2.BORDER_REPLICATE
    )
    return np.clip(result, 0, 1).astype(np.float32)


def measure(refined: F32, coarse: F32) -> Alignment:
    """Shift and scale of `refined` against `coarse`, and what they leave; infinite if unalike."""
    there, here = _features(refined), _features(coarse)
    shift, scale = _exact(there, here, *_rough(there, here))
    found = Alignment(shift, scale, 0.0)
    # Where the correction reaches beyond the refined picture there is nothing to compare.
    off = abs(scale - 1) * max(here.shape) / 2 + max(abs(shift[0]), abs(shift[1]))
    edge = min(int(np.ceil(off)) + BLUR, min(here.shape) // 4)
    inner = np.s_[edge : here.shape[0] - edge, edge : here.shape[1] - edge]
    left = _remaining(warped(there, found)[inner], here[inner])
    return Alignment(shift, scale, left)


def _features(picture: F32) -> F32:
    """(h, w) lengths of gradients, about 1 at the edges of each neighbourhood."""
    grey = cv2.cvtColor(np.ascontiguousarray(picture, np.float32), cv2.COLOR_RGB2GRAY)
    grey = cv2.GaussianBlur(grey, (0, 0), 1.0)
    x, y = cv2.Scharr(grey, cv2.CV_32F, 1, 0) / 32, cv2.Scharr(grey, cv2.CV_32F, 0, 1) / 32
    length = np.sqrt(x * x + y * y)
    around = np.sqrt(cv2.GaussianBlur(length * length, (0, 0), NEARBY)) + FLOOR
    return np.clip(length / around / 3, 0, 1).astype(np.float32)


def _rough(there: F32, here: F32) -> tuple[tuple[float, float], float]:
    """Of all scales the one at which the phases agree best, and its shift."""
    height, width = here.shape
    factor = min(1.0, SMALL / max(height, width))
    size = (max(round(width * factor), 8), max(round(height * factor), 8))
    small, other = (_f32(cv2.resize(f, size, interpolation=cv2.INTER_AREA)) for f in (here, there))
    window = cv2.createHanningWindow(size, cv2.CV_32F)
    best, shift, scale = -1.0, (0.0, 0.0), 1.0
    for s in SCALES:
        undone = warped(other, Alignment((0.0, 0.0), float(s), 0.0))
        (x, y), response = cv2.phaseCorrelate(small, undone, window)
        if response > best:
            ratio = width / size[0], height / size[1]
            best, scale = response, float(s)
            shift = (x * s * ratio[0], y * s * ratio[1])
    return shift, scale


def _exact(
    there: F32, here: F32, shift: tuple[float, float], scale: float
) -> tuple[tuple[float, float], float]:
    """Gauss-Newton on shift and scale; the reach of the blur shrinks as they settle."""
    height, width = here.shape
    y, x = np.mgrid[:height, :width].astype(np.float32)
    x, y = x - (width - 1) / 2, y - (height - 1) / 2
    half = max(width, height) / 2  # so that all three unknowns are px
    values = np.array([*shift, (scale - 1) * half])
    for blur in (3.0, 1.0):
        near, far = (_f32(cv2.GaussianBlur(f, (0, 0), blur)) for f in (here, there))
        dx, dy = cv2.Scharr(near, cv2.CV_32F, 1, 0) / 32, cv2.Scharr(near, cv2.CV_32F, 0, 1) / 32
        slopes = np.stack([dx, dy, (dx * x + dy * y) / half])
        for _ in range(STEPS):
            now = Alignment((values[0], values[1]), 1 + values[2] / half, 0.0)
            step = _newton_step(slopes, warped(far, now) - near)
            values = values - step
            if np.abs(step).max() < SETTLED:
                break
    return (float(values[0]), float(values[1])), float(1 + values[2] / half)


def _newton_step(slopes: np.ndarray, error: F32) -> F64:
    """(n,) by which unknowns are off whose `slopes` are (n, h, w), of an `error` (h, w); px.

    Huber's weights: where the network changed something is no evidence of a shift.
    """
    size, count = np.abs(error), len(slopes)
    weight = np.minimum(1, 1.5 * (np.median(size) + 1e-3) / np.maximum(size, 1e-6))
    weighted = (slopes * weight).reshape(count, -1)
    normal = weighted @ slopes.reshape(count, -1).T + 1e-9 * np.eye(count)
    step = np.linalg.solve(normal, weighted @ error.ravel())
    return step * min(1.0, LONGEST / max(float(np.linalg.norm(step)), 1e-9))


def _remaining(there: F32, here: F32) -> float:
    """Px by which nine tenths of the windows that can tell are off at most; infinite: none can."""
    height, width = here.shape
    side = min(WINDOW, height, width)
    distances, asked = [], 0
    textured = max(0.02, float(here.std()) * 0.5)
    for top in range(0, height - side + 1, max(side // 2, 1)):
        for left in range(0, width - side + 1, max(side // 2, 1)):
            part = np.s_[top : top + side, left : left + side]
            if here[part].std() < textured:
                continue
            asked += 1
            distance, likeness = _window_distance(there[part], here[part])
            if likeness >= SURE:
                distances.append(distance)
    if asked == 0:
        return 0.0  # nothing that could be off
    if len(distances) < 0.3 * asked:
        return float("inf")
    return float(np.quantile(distances, OUTLYING))


def _window_distance(there: F32, here: F32) -> tuple[float, float]:
    """Px by which a window is off, and how alike (correlation) the two are once it is put right."""
    near, far = (_f32(cv2.GaussianBlur(f, (0, 0), 1.5)) for f in (here, there))
    dx, dy = cv2.Scharr(near, cv2.CV_32F, 1, 0) / 32, cv2.Scharr(near, cv2.CV_32F, 0, 1) / 32
    slopes, values, put = np.stack([dx, dy]), np.zeros(2), far
    for _ in range(STEPS // 2):
        step = _newton_step(slopes, put - near)
        values = values - step
        put = warped(far, Alignment((float(values[0]), float(values[1])), 1.0, 0.0))
        if np.abs(step).max() < 0.01:
            break
    likeness = float(np.corrcoef(put.ravel(), near.ravel())[0, 1])
    return float(np.hypot(values[0], values[1])), likeness


def _f32(picture: np.ndarray) -> F32:
    return np.asarray(picture, np.float32)
