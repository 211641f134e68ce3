"""Clicks -> object by a random walk over pieces of the photo and DINOv2's patch tokens there.

Tokens (Oquab et al., arXiv 2304.07193) of one object are alike, so a walk from the click stays on
it; the subject map, where its weights are here, says how far a whole object extends.
"""

from __future__ import annotations

from collections.abc import Callable

from .. import models
from ..base.arrays import F32, RGB, Mask
from ..base.progress import Progress, part, silent
from ..document.model import Prompt
from . import Found
from .dino_tokens import PATCHES, WEIGHT, photo_tokens
from .matting.edges import rehearse
from .pieces.features import main_directions
from .pieces.pieces import Pieces
from .pieces.view import PhotoView, PromptAnswer, Tokens
from .salience import SubjectNet
from .selection import SelectionError, check_prompt, obey

Look = Callable[[PhotoView, Prompt, Progress], PromptAnswer]

TILE_PATCHES = 900  # of a tile of a large photo


class DinoWalk:
    """Segmenter: DINOv2 tokens, a walk, closed-form edges."""

    name = "dino"

    def __init__(self) -> None:
        self._subject = SubjectNet()
        self._view: PhotoView | None = None  # of the last photo

    def missing(self) -> str | None:
        """Why this backend cannot run here, or None."""
        if models.path(WEIGHT) is None:
            return f"the model {WEIGHT} is not here: `objectmorpher models get {WEIGHT}`"
        return None

    def encode(self, rgb: RGB, progress: Progress = silent) -> Tokens:
        """Tokens and subject map of a photo (H, W, 3)."""
        reason = self.missing()
        if reason is not None:
            raise SelectionError(reason)
        progress(0.0, "recognising its parts")
        rehearse()  # before the network is waited for, which others may run just now
        tokens = self._tokens(rgb, PATCHES, part(progress, 0.0, 0.75))
        progress(0.75, "cutting the photo into pieces")
        pieces = Pieces(rgb, tokens)
        pieces.rehearse()
        progress(0.8, "looking for the subject")
        salience = self._subject.salience(rgb) if self._subject.missing() is None else None
        progress(1.0, "read the photo")
        return Tokens(tokens, salience, pieces)

    def segment(
        self,
        rgb: RGB,
        prompt: Prompt,
        embedding: Tokens | None = None,
        progress: Progress = silent,
        seed: int = 0,
    ) -> Mask:
        """(H, W) bool: the object that clicks, box or subject mean. Nothing here is random."""
        return self._found(rgb, prompt, embedding, progress, PhotoView.find)[0]

    def glance(self, rgb: RGB, prompt: Prompt, embedding: Tokens, progress: Progress) -> Found:
        """Segment by what is encoded already; a closer look at a small thing is left out."""
        mask, seen = self._found(rgb, prompt, embedding, progress, PhotoView.glance)
        return Found(mask, self.name, seen.sureness, seen.is_final)

    def confidence(self, rgb: RGB, prompt: Prompt, embedding: Tokens) -> float:
        """The overlap of `segment`'s mask with what is meant that is to be expected, in [0, 1]."""
        return self._view_of(rgb, embedding).find(prompt, silent).sureness

    def _found(
        self, rgb: RGB, prompt: Prompt, embedding: Tokens | None, progress: Progress, look: Look
    ) -> tuple[Mask, PromptAnswer]:
        check_prompt(rgb, prompt)
        if embedding is None:
            embedding = self.encode(rgb, part(progress, 0.0, 0.7))
        if prompt.is_subject and embedding.salience is None:
            raise SelectionError(f"the subject cannot be found: {self._subject.missing()}")
        progress(0.7, "walking from the clicks")
        seen = look(self._view_of(rgb, embedding), prompt, part(progress, 0.7, 1.0))
        progress(1.0, "cut out the object")
        return obey(seen.mask, prompt), seen

    def _view_of(self, rgb: RGB, embedding: Tokens) -> PhotoView:
        """The photo in pieces: the same for every click on it."""
        if self._view is None or self._view.embedding is not embedding:
            self._view = PhotoView(rgb, embedding, self._tile_tokens)
        return self._view

    def _tile_tokens(self, rgb: RGB, progress: Progress) -> F32:
        return self._tokens(rgb, TILE_PATCHES, progress)

    def _tokens(self, rgb: RGB, patches: int, progress: Progress) -> F32:
        """(h, w, 64) for a photo (H, W, 3)."""
        return main_directions(photo_tokens(rgb, patches, progress))
