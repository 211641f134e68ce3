"""The refined edit: a crop around it, the refiner, the checks, and the pixels that are kept.

What the refiner gives back is put where its input lay or refused (`alignment`); the colours that it
changed outside the footprint, where nothing was to change, tell its drift, which is taken out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arrays import F32, RGB, U8, Pixels
from ...base.pixels import pixels_from_unit, unit_pixels
from ...base.progress import Progress, part
from ...document.settings import Refined
from ...pictures.image import to_u8
from ..blend import Box
from ..composite import Composite
from . import RefineError, Refiner
from .alignment import Alignment, align

CONTEXT = 0.35  # x the size of the edit, of the photo around it that the refiner sees
LEAST_CONTEXT = 32  # px
LEAST_SIDE = 64  # px of the crop
LEAST_STILL = 400  # px outside the footprint from which a drift can be told
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


def cut_edit(photo: Pixels, result: Composite) -> CoarseEdit:
    """Return the part of `result` that is refined: a composite of `photo` (H, W, 3), unrefined.

    Raises RefineError where nothing was edited.
    """
    weights = result.weights
    if result.box is None or weights is None or not (weights > 0).any():
        raise RefineError("nothing was edited, there is nothing to refine")
    height, width = photo.shape[:2]
    x0, y0, x1, y1 = crop_box(result.box, weights, (width, height))
    alpha = np.zeros((height, width), np.float32)
    left, top, right, bottom = result.box
    alpha[top:bottom, left:right] = weights
    coarse = to_u8(result.pixels[y0:y1, x0:x1])
    return CoarseEdit(x0, y0, photo[y0:y1, x0:x1], coarse, alpha[y0:y1, x0:x1])


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
    rows, columns = np.flatnonzero(weights.any(1)), np.flatnonzero(weights.any(0))
    ends = []
    for first, last, start, most in (
        (columns[0], columns[-1] + 1, box[0], size[0]),
        (rows[0], rows[-1] + 1, box[1], size[1]),
    ):
        length = int(last - first)
        margin = max(int(CONTEXT * length), LEAST_CONTEXT, (LEAST_SIDE - length + 1) // 2)
        ends.append((max(start + int(first) - margin, 0), min(start + int(last) + margin, most)))
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
            if spread < 1e-4:  # one flat colour tells no gain
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
