"""Clicks -> object without any learned weights: pieces of the photo by their colours, and GrabCut.

Clicks and the subject choose pieces as they do where there are tokens; what a box holds is
GrabCut's to find, and clicks then correct that.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ..base.arrays import F32, RGB, Mask
from ..base.progress import Progress, part, silent
from ..document.model import Prompt
from .matting.edges import cut
from .pieces.pieces import PIECES, WORK_AREA, Pieces, reduced
from .pieces.view import PieceView, Tokens, steps_of
from .salience import SubjectNet
from .selection import SelectionError, check_prompt, free_mask, nest, obey

BOX_SIDE = 320  # px, the square in which a box is drawn
UNDECIDED = 0.7  # guess inside a box: colours decide
PIECE_AREA = WORK_AREA / PIECES  # px: smaller photos have fewer pieces, as noise has a size in px
MEAN_SHIFT = (6, 12)  # reduced photo's px and CIELAB units within which texture is one colour


class GrabCut:
    """Segmenter: colours only; always there."""

    name = "grabcut"

    def __init__(self) -> None:
        self._subject = SubjectNet()
        self._view: PieceView | None = None  # of the last photo, without its subject

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
        progress(0.1, "cutting the photo into pieces")
        view = self._view_of(rgb, prompt.is_subject)
        rest = part(progress, 0.4, 1.0)
        rest(0.0, "looking for its outline")
        if prompt.box is not None and not prompt.is_subject:
            mask = _boxed(view, prompt, seed, rest)
        else:
            mask = _clicked(view, prompt, rest)
        mask = obey(mask, prompt)
        progress(1.0, "cut out the object")
        return mask

    def confidence(self, rgb: RGB, prompt: Prompt, embedding: None = None) -> None:
        """Return None: colours do not show how sure they are."""

    def _view_of(self, rgb: RGB, has_subject: bool) -> PieceView:
        """The photo in pieces: the same for every click on it."""
        salience = None
        if has_subject:
            reason = self._subject.missing()
            if reason is not None:
                raise SelectionError(f"the subject cannot be found: {reason}")
            salience = self._subject.salience(rgb)
        if self._view is None or self._view.rgb is not rgb:
            plain = np.asarray(cv2.pyrMeanShiftFiltering(reduced(rgb), *MEAN_SHIFT), np.uint8)
            count = max(1, round(plain.shape[0] * plain.shape[1] / PIECE_AREA))
            pieces = Pieces(plain, None, count, photo_shape=rgb.shape[:2])
            self._view = PieceView(rgb, Tokens(None, None, pieces))
        if salience is None:
            return self._view
        return PieceView(rgb, replace(self._view.embedding, salience=salience))


def _clicked(view: PieceView, prompt: Prompt, progress: Progress) -> Mask:
    """(H, W) the object of clicks, or the subject, at the prompt's level."""
    steps = steps_of(prompt)
    if prompt.level == "object" or not steps[0].clicks:
        return view.mask(view.answer(prompt, None, progress))
    whole = view.mask(view.answer(replace(steps[0], level="object"), None, progress))
    mask = view.mask(view.answer(prompt, whole, progress))
    return nest(mask, whole, prompt.level) if len(steps) == 1 else mask


def _boxed(view: PieceView, prompt: Prompt, seed: int, progress: Progress) -> Mask:
    """(H, W) the object in a box, corrected by clicks; the box has no level.

    Pieces tell what is in a box in which GrabCut finds nothing.
    """
    box, *clicked = steps_of(prompt)
    try:
        mask = cut(view.rgb, _box_guess(view.rgb, box), box, seed)
    except SelectionError:
        return view.mask(view.answer(prompt, None, progress))
    return view.mask(view.adopt(mask, clicked)) if clicked else mask


def _box_guess(rgb: RGB, prompt: Prompt) -> F32:
    """(BOX_SIDE, BOX_SIDE) guess of a box alone: outside is ground, inside is for GrabCut."""
    inside = free_mask(rgb.shape, prompt).astype(np.float32)
    small = cv2.resize(inside, (BOX_SIDE, BOX_SIDE), interpolation=cv2.INTER_AREA)
    return np.asarray(UNDECIDED * small, np.float32)
