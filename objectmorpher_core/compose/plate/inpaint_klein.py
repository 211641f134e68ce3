"""Fills holes by FLUX.2-klein with an adapter that removes what a red frame shows.

It runs in the pipeline that the refiner uses, whose weights are in memory once. The adapter is
fal's, trained on pairs of pictures with a red frame around an object, and without either; shadows
and reflections go along. What it changes outside the hole is not taken over: there the photo is
true, and an old shadow is taken away by `shadow.old_shadow`.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np

from ... import models
from ...base.arrays import F32, RGB, Mask, Pixels, unit_pixels
from ...base.progress import Progress
from ...models import ModelError, device, ledger
from ...models.plans import Plan
from .. import InpaintError
from ..refine import RefineError, diffusion
from ..refine.klein import ADAPTERS, KleinRefiner
from ..refine.refinement import measure, warped
from .hole_squares import Filler, fill_squares

RED = 255, 0, 0
LINE = 0.005  # x the side, of the frame


class KleinInpainter(KleinRefiner):
    """Four steps in each square; another seed invents something else."""

    is_random = True
    context = 1024  # px around a hole that it looks at where the photo has them
    doing = "Removing what stood there"
    adapter, strength = "removal", 1.1  # the publishers' own
    instruction = "Remove the highlighted object from the scene"  # that it was trained with

    def missing(self) -> str | None:
        """See `Inpainter`."""
        if (sentence := super().missing()) is not None:
            return sentence
        if models.installed(ADAPTERS[self.adapter]):
            return None
        return "the adapter that removes is not here: `objectmorpher models get klein-remove-lora`"

    def is_slow(self) -> bool:
        """Whether a fill takes minutes here. Imports torch."""
        return not device.has_gpu()

    def inpaint(self, rgb: Pixels, hole: Mask, progress: Progress, seed: int = 0) -> Pixels:
        """See `Inpainter`. The same bytes on one device; raises InpaintError, too, if it fails."""
        progress(0.0, "opening the model")

        def attempt(pipeline: Any, plan: Plan) -> Pixels:
            def fill(picture: F32, inside: Mask, step: Progress, seed: int) -> F32:
                made = self._run(pipeline, plan, [framed(picture, inside)], step, seed)
                found = unit_pixels(made)
                alignment = measure(found, picture)
                return warped(found, alignment) if math.isfinite(alignment.left) else found

            filler = Filler(math.isqrt(diffusion.AREA), fill, sees_all=True)
            return fill_squares(rgb, hole, filler, progress, seed)

        try:
            return ledger.SHARED.run(self._model(), attempt)
        except (ModelError, RefineError) as error:
            raise InpaintError(str(error)) from error


def framed(picture: F32, inside: Mask) -> RGB:
    """The picture (n, n, 3) with a red frame around each part of what is `inside` (n, n)."""
    shown = np.rint(255 * picture).astype(np.uint8)
    line = max(1, round(LINE * len(picture)))
    _, _, boxes, _ = cv2.connectedComponentsWithStats(inside.astype(np.uint8), connectivity=8)
    for x, y, width, height, _ in boxes[1:]:
        corners = (int(x), int(y)), (int(x + width) - 1, int(y + height) - 1)
        cv2.rectangle(shown, *corners, RED, line)
    return shown
