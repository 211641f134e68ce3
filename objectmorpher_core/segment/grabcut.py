"""Clicks -> object without any learned weights: a walk over colours, then GrabCut."""

from __future__ import annotations

import cv2
import numpy as np

from ..base.arrays import F32, RGB, Mask
from ..base.progress import Progress, silent
from ..document.model import Prompt
from .matting.edges import cut
from .salience import SubjectNet
from .selection import SelectionError, at_level, check_prompt, free_mask
from .walk import Walk, guess

CELLS = 4000  # of a photo
COLOR_STEP = 14.0  # CIELAB units; two colours this far apart are 0.5 apart in the walk
TEMPERATURE = 0.3
STRICT_TEMPERATURE = 0.1
BOX_SIDE = 320  # px, the square in which a box is drawn
SPECK = 0.01  # x photo's area: 40 cells, of which half are not at the outline
UNDECIDED = 0.7  # guess inside a box: colours decide
MEAN_SHIFT = (6, 12)  # cells' px and CIELAB units within which texture is one colour


class GrabCut:
    """Segmenter: colours only; always there."""

    name = "grabcut"

    def __init__(self) -> None:
        self._subject = SubjectNet()
        self._walks: tuple[RGB, Walk, Walk] | None = None  # on the last photo

    def missing(self) -> str | None:
        """None: it needs nothing."""
        return None

    def encode(self, rgb: RGB, progress: Progress = silent) -> None:
        """Return None: there is nothing worth keeping."""
        progress(1.0, "ready")

    def segment(
        self,
        rgb: RGB,
        prompt: Prompt,
        embedding: None = None,
        progress: Progress = silent,
        seed: int = 0,
    ) -> Mask:
        """(H, W) bool: the object that clicks, a box or both mean; the subject needs weights."""
        check_prompt(rgb, prompt)
        salience = None
        if prompt.is_subject:
            reason = self._subject.missing()
            if reason is not None:
                raise SelectionError(f"the subject cannot be found: {reason}")
            salience = self._subject.salience(rgb)
        progress(0.1, "walking from the clicks")
        has_walk = bool(prompt.clicks) or prompt.is_subject
        walks = self._walks_on(rgb, progress) if has_walk else None

        def find(meant: Prompt) -> Mask:
            progress(0.4, "looking for its outline")
            boxed = None if meant.box is None else _box_guess(rgb, meant)
            if walks is None:
                assert boxed is not None, "a prompt without clicks and subject has a box"
                return cut(rgb, boxed, meant, seed)
            try:
                return cut(rgb, guess(walks, rgb, meant, salience, boxed=boxed), meant, seed)
            except SelectionError:
                if not any(click.is_foreground for click in meant.clicks):
                    raise
            # What stands out most there is a speck that its surroundings swallow: what it is on.
            progress(0.6, "looking further around")
            return cut(rgb, guess(walks, rgb, meant, salience, SPECK), meant, seed)

        mask = at_level(prompt, find)
        progress(1.0, "cut out the object")
        return mask

    def confidence(self, rgb: RGB, prompt: Prompt, embedding: None = None) -> None:
        """Return None: colours do not show how sure they are."""

    def _walks_on(self, rgb: RGB, progress: Progress) -> tuple[Walk, Walk]:
        """The walk and the strict walk over a photo: the same for every click on it."""
        if self._walks is None or self._walks[0] is not rgb:
            colors = _colors(rgb)
            progress(0.2, "walking from the clicks")
            walk = Walk(colors, TEMPERATURE)
            progress(0.3, "walking from the clicks")
            self._walks = rgb, walk, Walk(colors, STRICT_TEMPERATURE)
        return self._walks[1:]


def _box_guess(rgb: RGB, prompt: Prompt) -> F32:
    """(BOX_SIDE, BOX_SIDE) guess of a box alone: outside is ground, inside is for GrabCut."""
    inside = free_mask(rgb.shape, prompt).astype(np.float32)
    small = cv2.resize(inside, (BOX_SIDE, BOX_SIDE), interpolation=cv2.INTER_AREA)
    return np.asarray(UNDECIDED * small, np.float32)


def _colors(rgb: RGB) -> F32:
    """(h, w, 3) CIELAB of the photo's cells, texture smoothed away, in units of COLOR_STEP."""
    height, width = rgb.shape[:2]
    scale = min(1.0, (CELLS / (height * width)) ** 0.5)
    size = (max(1, round(width * scale * 2)), max(1, round(height * scale * 2)))
    small = cv2.pyrMeanShiftFiltering(
        cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), *MEAN_SHIFT
    )
    half = cv2.resize(small, ((size[0] + 1) // 2, (size[1] + 1) // 2), interpolation=cv2.INTER_AREA)
    lab = cv2.cvtColor(half.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)
    return np.asarray(lab / COLOR_STEP, np.float32)
