"""The refined edit: a crop around it, the refiner, the checks, and the pixels that are kept.

What the refiner gives back is put where its input lay or refused; the colours that it changed
outside the footprint, where nothing was to change, tell its drift, which is taken out.

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

from ...base.arrays import F32, F64, RGB, U8, Pixels, pixels_from_unit, unit_pixels
from ...base.masks import box_of
from ...base.progress import Progress, part
from ...document.settings import Refined
from ...document.transparency import continued
from ...pictures.image import Picture, to_u8
from ..blend import Box
from ..composite import Composite
from . import RefineError, Refiner

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


CONTEXT = 0.35  # x the size of the edit, of the photo around it that the refiner sees
LEAST_CONTEXT = 32  # px
LEAST_SIDE = 64  # px of the crop
LEAST_STILL = 400  # px outside the footprint from which a drift can be measured
MOST_GAIN = 1.5  # a drift is no larger, else it is no drift
OUTLIERS = 0.2  # share of the pixels that differ most, which do not count


@dataclass(frozen=True)
class Drift:
    """The colour drift of places that were to stay: found = gain x meant + offset."""

    gain: tuple[float, float, float]
    offset: tuple[float, float, float]  # of [0, 1]

    @property
    def size(self) -> float:
        """Largest change of a mid grey, of [0, 1]."""
        return max(abs(0.5 * g + o - 0.5) for g, o in zip(self.gain, self.offset, strict=True))


NO_DRIFT = Drift((1.0, 1.0, 1.0), (0.0, 0.0, 0.0))


@dataclass(frozen=True, eq=False)
class CoarseEdit:
    """The part of an edit that a refiner sees: a crop around it, with context."""

    left: int  # px, crop's corner in the photo
    top: int
    pixels: Pixels  # (h, w, 3) the photo there, of its own depth
    coarse: RGB  # (h, w, 3) the edit as it was put together
    alpha: F32  # (h, w) in [0, 1], how much of the edit is seen

    @property
    def shown(self) -> U8:
        """(h, w) the same in eight bits, as a refinement keeps it."""
        return np.round(self.alpha * 255).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class Checked:
    """A refiner's answer that passed."""

    pixels: F32  # (h, w, 3) in [0, 1], lying as its input
    alignment: Alignment
    drift: Drift  # that was taken out


def cut_edit(photo: Picture, result: Composite) -> CoarseEdit:
    """Return the part of `result` that is refined: a composite of `photo`, unrefined.

    Colours under clear ground are not shown to a refiner: those of what is seen go on there.
    Raises RefineError where nothing was edited.
    """
    weights = result.weights
    if result.box is None or weights is None or not (weights > 0).any():
        raise RefineError("nothing was edited, there is nothing to refine")
    height, width = photo.pixels.shape[:2]
    x0, y0, x1, y1 = crop_box(result.box, weights, (width, height))
    alpha = np.zeros((height, width), np.float32)
    left, top, right, bottom = result.box
    alpha[top:bottom, left:right] = weights
    inner = np.s_[y0:y1, x0:x1]
    was, now = _seen_part(photo, inner), _seen_part(result.picture(photo), inner)
    return CoarseEdit(x0, y0, was, to_u8(now), alpha[inner])


def _seen_part(picture: Picture, inner: tuple[slice, slice]) -> Pixels:
    """A part (h, w, 3) of a picture, in which the colours of what is seen go on."""
    alpha = None if picture.alpha is None else picture.alpha[inner]
    shown = Picture(picture.pixels[inner], alpha)
    return continued(shown, np.zeros(shown.pixels.shape[:2], bool))


def refine(
    edit: CoarseEdit, refiner: Refiner, progress: Progress, seed: int = 0, strength: float = 1.0
) -> Refined:
    """Refine an edit with `refiner`. Raises RefineError: one sentence."""
    original, rest = to_u8(edit.pixels), part(progress, 0.0, 0.95)
    made = refiner.refine(original, edit.coarse, edit.alpha, rest, seed)
    progress(0.95, "Checking that nothing has moved")
    # Checked against eight bits, shown with the photo's own depth.
    checked = check(made, edit.coarse, edit.alpha)
    assert checked.pixels.shape == edit.pixels.shape, "a refiner keeps the size"
    pixels = pixels_from_unit(checked.pixels, edit.pixels.dtype)
    return Refined(edit.left, edit.top, pixels, edit.shown, refiner.name, seed, strength)


def crop_box(box: Box, weights: F32, size: tuple[int, int]) -> Box:
    """Around what is shown of the edit, with context, inside the photo of `size`."""
    shown, ends = box_of(weights), []
    for first, last, start, most in zip(shown[:2], shown[2:], box[:2], size, strict=True):
        length = last - first
        margin = max(int(CONTEXT * length), LEAST_CONTEXT, (LEAST_SIDE - length + 1) // 2)
        ends.append((max(start + first - margin, 0), min(start + last + margin, most)))
    (x0, x1), (y0, y1) = ends
    return x0, y0, x1, y1


def check(made: RGB, coarse: RGB, alpha: F32) -> Checked:
    """`made` (h, w, 3) u8 put where `coarse` lies, and in its colours where `alpha` is 0.

    Raises RefineError.
    """
    if made.shape != coarse.shape:
        raise RefineError(f"the refiner gave {made.shape} back for {coarse.shape}")
    meant = unit_pixels(coarse)
    lying, alignment = align(unit_pixels(made), meant)
    drift = measure_drift(lying, meant, alpha)
    return Checked(without_drift(lying, drift), alignment, drift)


def measure_drift(found: F32, meant: F32, alpha: F32) -> Drift:
    """Measure how the colours of `found` (h, w, 3) drift from `meant` where `alpha` is 0."""
    is_still = alpha <= 0
    if is_still.sum() < LEAST_STILL:
        return NO_DRIFT
    gains, offsets = [], []
    for c in range(3):
        x, y = meant[..., c][is_still], found[..., c][is_still]
        gain, offset = 1.0, float(np.median(y - x))
        for _ in range(3):
            away = np.abs(y - gain * x - offset)
            kept = away <= np.quantile(away, 1 - OUTLIERS)
            u, v = x[kept].astype(np.float64), y[kept].astype(np.float64)
            spread = float(u.var())
            if spread < 1e-4:  # one flat colour shows no gain
                gain, offset = 1.0, float((v - u).mean())
                continue
            gain = float(((u - u.mean()) * (v - v.mean())).mean()) / spread
            gain = float(np.clip(gain, 1 / MOST_GAIN, MOST_GAIN))
            offset = float(v.mean() - gain * u.mean())
        gains.append(gain)
        offsets.append(offset)
    return Drift((gains[0], gains[1], gains[2]), (offsets[0], offsets[1], offsets[2]))


def without_drift(found: F32, drift: Drift) -> F32:
    """`found` (h, w, 3) in the colours that were meant."""
    gain, offset = (np.array(v, np.float32) for v in (drift.gain, drift.offset))
    return np.clip((found - offset) / gain, 0, 1).astype(np.float32)
