"""How far a cut-out is from the truth, over the band where either of them is soft."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from truth import Case

from objectmorpher_core.base.arrays import F32, Mask

AROUND = 9  # px added to where alpha is soft, in truth or in the given mask
LEVELS = 255


@dataclass(frozen=True)
class Score:
    sad: float  # sum of |a - truth|, px
    mse: float  # x 1000, over the band
    gradient: float  # x 1000, mean squared difference of the gradients, over the band
    colour: float  # 8-bit levels, RMS over the band where the truth has a share above 0.1
    halo: float  # 8-bit levels, RMS over the band and over the new backgrounds

    def __add__(self, other: Score) -> Score:
        return Score(*(a + b for a, b in zip(_figures(self), _figures(other), strict=True)))

    def __truediv__(self, count: float) -> Score:
        return Score(*(a / count for a in _figures(self)))


def _figures(score: Score) -> tuple[float, ...]:
    return score.sad, score.mse, score.gradient, score.colour, score.halo


def band(case: Case) -> Mask:
    """(H, W) where a method has something to decide."""
    hard = case.given.astype(bool).astype(np.uint8)
    edge = cv2.morphologyEx(hard, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)) > 0
    unsure = (edge | ((case.alpha > 0.01) & (case.alpha < 0.99))).astype(np.uint8)
    return cv2.dilate(unsure, np.ones((2 * AROUND + 1,) * 2, np.uint8)) > 0


def score(case: Case, alpha: F32, foreground: F32) -> Score:
    """Of a cut-out (H, W), (H, W, 3) on the whole photo."""
    where, difference = band(case), alpha - case.alpha
    slopes = [cv2.GaussianBlur(image, (0, 0), 1.4) for image in (alpha, case.alpha)]
    steps = [np.gradient(image) for image in slopes]
    gradient = sum((a - b) ** 2 for a, b in zip(*steps, strict=True))
    seen = where & (case.alpha > 0.1)
    missed = (foreground - case.foreground)[seen]
    return Score(
        float(np.abs(difference).sum()),
        1000 * float((difference**2)[where].mean()),
        1000 * float(gradient[where].mean()),
        LEVELS * float(np.sqrt((missed**2).mean())),
        LEVELS * float(np.sqrt(np.mean([_squares(case, alpha, foreground, b)[where].mean()
                                        for b in case.others()]))),
    )  # fmt: skip


def _squares(case: Case, alpha: F32, foreground: F32, background: F32) -> F32:
    found, truth = (
        over(alpha, foreground, background),
        over(case.alpha, case.foreground, background),
    )
    return (found - truth) ** 2


def over(alpha: F32, foreground: F32, background: F32) -> F32:
    """(H, W, 3) the cut-out on a background."""
    return alpha[..., None] * foreground + (1 - alpha[..., None]) * background
