"""The distance of an outcome from the truth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from objectmorpher_core.base.arrays import F64, RGB
from objectmorpher_core.base.masks import box_of

from ..measures.dino import Dino
from ..measures.fidelity import psnr, ssim
from .cases import EditOutcome, TruthCase

CONTEXT = 14  # px around the region that measures may look at: a patch of DINOv2's
PSNR_CAP = 60.0  # dB, of what is equal to the last bit, so that means exist
FIGURES = ("psnr", "ssim", "dinov2", "iou", "reach", "outside", "changed")


@dataclass(frozen=True)
class TruthScore:
    """The scores of one outcome."""

    psnr: float  # dB, inside the region
    ssim: float  # inside
    dinov2: float  # dinov2-perceptual, inside; nan where the network is not here
    iou: float  # of the thing's coverages
    reach: float  # px, mean distance of the guidance's points from where they must be
    outside: float  # dB outside; nan where the truth does not tell
    changed: float  # share of the pixels outside that differ from the photo


def score(case: TruthCase, outcome: EditOutcome, network: Dino | None) -> TruthScore:
    """Return all figures."""
    window = _window(case.region)
    inside, outer = case.region[window], case.region < 0.5
    a, b = outcome.pixels[window], _cut(case)
    without = psnr(outcome.pixels, case.truth, (outer.astype(np.float64),))[0]
    smaller = np.minimum(outcome.alpha, case.shown).sum()
    larger = np.maximum(outcome.alpha, case.shown).sum()
    seen = network.perceptual(a, b, (inside,))[0] if network is not None else float("nan")
    differs = (outcome.pixels != case.photo).any(-1) & outer
    return TruthScore(
        min(psnr(a, b, (inside,))[0], PSNR_CAP), ssim(a, b, (inside,))[0], seen,
        float(smaller / larger),
        float(np.linalg.norm(outcome.reached - case.guidance.to, axis=1).mean()),
        min(without, PSNR_CAP) if case.has_outside else float("nan"),
        float(differs.sum() / max(outer.sum(), 1)) if case.has_outside else float("nan"),
    )  # fmt: skip


@lru_cache(maxsize=2)
def _cut(case: TruthCase) -> RGB:
    """The truth about the region; the same array each time, whose features are then known."""
    return case.truth[_window(case.region)]


def _window(region: F64) -> tuple[slice, slice]:
    """The box of a region and a little more."""
    x0, y0, x1, y1 = box_of(region, CONTEXT)
    return slice(y0, y1), slice(x0, x1)
