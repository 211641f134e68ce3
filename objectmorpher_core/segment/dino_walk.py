"""Clicks -> object by a random walk over DINOv2's patch tokens (Oquab et al., arXiv 2304.07193).

Tokens of one object are alike, so a walk from the click stays on it; the subject map, where its
weights are here, says how far a whole object extends.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from .. import models
from ..arrays import F32, RGB, Mask
from ..document import Prompt
from ..progress import Progress, part, silent
from .choice import guess
from .edges import cut
from .level import at_level
from .selection import SelectionError, check_prompt
from .subject import DEVIATION, MEAN, SubjectNet
from .walk import Walk

WEIGHT = "dinov2-vits14"
IMAGES = "input_image"
TOKENS = "/backbone/layernorm/Add_1_output_0"  # (1, 1 + patches, 384), the class token first
PATCH = 14  # px
PATCHES = 1850  # of a photo: about 700 x 520 px, any aspect
SMALLEST_PATCH = 4  # px of the photo; finer ones would only see the enlargement's blur
TEMPERATURE = 0.15  # of 1 - cosine; crosses from part to part of an object
STRICT_TEMPERATURE = 0.03  # stops at the borders of parts too


@dataclass(frozen=True, eq=False)
class Tokens:
    """What a photo is made of, patch by patch."""

    tokens: F32  # (h, w, 384) unit length, the photo's mean token removed
    salience: F32 | None  # (320, 320) in [0, 1]; None without the subject network's weights


class DinoWalk:
    """Segmenter: DINOv2 tokens, a walk, GrabCut."""

    name = "dino"

    def __init__(self) -> None:
        self._session: Any = None
        self._subject = SubjectNet()
        self._walks: tuple[Tokens, Walk, Walk] | None = None  # on the last photo

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
        tokens = self._tokens(rgb)
        progress(0.75, "looking for the subject")
        salience = self._subject.salience(rgb) if self._subject.missing() is None else None
        progress(1.0, "read the photo")
        return Tokens(tokens, salience)

    def segment(
        self,
        rgb: RGB,
        prompt: Prompt,
        embedding: Tokens | None = None,
        progress: Progress = silent,
        seed: int = 0,
    ) -> Mask:
        """(H, W) bool: the object that clicks, box or subject mean."""
        check_prompt(rgb, prompt)
        if embedding is None:
            embedding = self.encode(rgb, part(progress, 0.0, 0.7))
        if prompt.is_subject and embedding.salience is None:
            raise SelectionError(f"the subject cannot be found: {self._subject.missing()}")
        progress(0.7, "walking from the clicks")
        walks, salience = self._walks_on(embedding, progress), embedding.salience

        def find(meant: Prompt) -> Mask:
            progress(0.8, "looking for its outline")
            soft = guess(*walks, rgb, meant, salience)
            progress(0.9, "cutting out the object")
            return cut(rgb, soft, meant, seed)

        mask = at_level(prompt, find)
        progress(1.0, "cut out the object")
        return mask

    def _walks_on(self, embedding: Tokens, progress: Progress) -> tuple[Walk, Walk]:
        """The walk and the strict walk over a photo: the same for every click on it."""
        if self._walks is None or self._walks[0] is not embedding:
            walk = Walk(embedding.tokens, TEMPERATURE)
            progress(0.75, "walking from the clicks")
            self._walks = embedding, walk, Walk(embedding.tokens, STRICT_TEMPERATURE)
        return self._walks[1:]

    def _tokens(self, rgb: RGB) -> F32:
        """(h, w, 384) for a photo (H, W, 3)."""
        height, width = rgb.shape[:2]
        scale = min((PATCHES / (height * width)) ** 0.5, 1 / SMALLEST_PATCH)
        h, w = max(1, round(height * scale)), max(1, round(width * scale))
        shrinks = h * PATCH < height
        small = cv2.resize(
            rgb,
            (w * PATCH, h * PATCH),
            interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC,
        )
        pixels = ((small.astype(np.float32) / 255 - MEAN) / DEVIATION).transpose(2, 0, 1)[None]
        tokens = self._open().run([TOKENS], {IMAGES: pixels})[0][0, 1:].reshape(h, w, -1)
        tokens = tokens - tokens.mean((0, 1))
        lengths = np.linalg.norm(tokens, axis=2, keepdims=True)
        return np.ascontiguousarray(tokens / np.maximum(lengths, 1e-6), np.float32)

    def _open(self) -> Any:
        """The network, opened so that it gives its patch tokens and takes any size."""
        if self._session is None:
            import onnxruntime

            from ..models.onnx_graph import with_interface

            path = models.path(WEIGHT)
            assert path is not None, "encode() asks missing() first"
            graph = with_interface(path.read_bytes(), IMAGES, TOKENS)
            self._session = onnxruntime.InferenceSession(graph, providers=["CPUExecutionProvider"])
        return self._session
