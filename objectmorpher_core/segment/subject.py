"""The photo's salient subject, as the network of `salience` sees it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import F32, RGB, Mask
from ..base.progress import Progress, part, silent
from ..document.model import Prompt
from .matting.edges import cut
from .salience import SubjectNet
from .selection import SelectionError, check_prompt, free_mask


@dataclass(frozen=True, eq=False)
class SubjectMap:
    """The degree to which each place of a photo belongs to its subject."""

    salience: F32  # (320, 320) in [0, 1], the photo stretched to a square


class SubjectSegmenter:
    """Segmenter: the salient subject; clicks and a box restrict and correct it."""

    name = "subject"

    def __init__(self) -> None:
        self._net = SubjectNet()

    def missing(self) -> str | None:
        """Why this backend cannot run here, or None."""
        return self._net.missing()

    def encode(self, rgb: RGB, progress: Progress = silent) -> SubjectMap:
        """The subject map of a photo (H, W, 3)."""
        reason = self.missing()
        if reason is not None:
            raise SelectionError(reason)
        progress(0.0, "looking for the subject")
        salience = self._net.salience(rgb)
        progress(1.0, "found the subject")
        return SubjectMap(salience)

    def segment(
        self,
        rgb: RGB,
        prompt: Prompt,
        embedding: SubjectMap | None = None,
        progress: Progress = silent,
        seed: int = 0,
    ) -> Mask:
        """(H, W) bool: the subject where the prompt points."""
        check_prompt(rgb, prompt)
        if embedding is None:
            embedding = self.encode(rgb, part(progress, 0.0, 0.7))
        progress(0.7, "cutting out the subject")
        mask = cut(rgb, subject_guess(rgb, prompt, embedding.salience), prompt, seed)
        progress(1.0, "cut out the subject")
        return mask

    def confidence(self, rgb: RGB, prompt: Prompt, embedding: SubjectMap | None = None) -> None:
        """None: what stands out most may not be what is meant."""


def subject_guess(rgb: RGB, prompt: Prompt, salience: F32) -> F32:
    """(320, 320) guess: salience inside the box; SelectionError where there is no subject."""
    inside = free_mask(rgb.shape, prompt).astype(np.float32)
    size = (salience.shape[1], salience.shape[0])
    guess = salience * cv2.resize(inside, size, interpolation=cv2.INTER_AREA)
    if guess.max() < 0.5:
        raise SelectionError("no subject stands out there: click the object")
    return guess
