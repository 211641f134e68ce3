"""A photo, or a crop of it, as a SAM sees it, and what its last prompts meant.

A prompt is answered click by click: the first leaves the choice among three masks, each further
one is decoded with all clicks and with the answer before it. What was answered is remembered, so
that a click decodes once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np
from PIL import Image

from ...base.arrays import F32, F64, RGB, Mask
from ...document.model import Click, Prompt
from ..matting.edges import enlarge, sharpen_band
from ..pieces.view import steps_of

# The common part of every SAM: a picture encoded once, and masks decoded for each prompt.

OBJECT, GROUND, CORNER, OTHER_CORNER, NOTHING = 1, 0, 2, 3, -1  # labels of SAM's points
MEAN = np.array([0.485, 0.456, 0.406], np.float32)  # ImageNet's, of RGB in [0, 1]
DEVIATION = np.array([0.229, 0.224, 0.225], np.float32)


@dataclass(frozen=True, eq=False)
class Asked:
    """A prompt in px of the network's square; a pixel's centre is at its number + 0.5."""

    points: F64  # (n, 2)
    is_object: Mask  # (n,) else it is what is not the object
    box: F64 | None = None  # (4,) x0, y0, x1, y1
    logits: F32 | None = None  # (low, low) the answer before this, to be refined


@dataclass(frozen=True, eq=False)
class Masks:
    """The candidates for a prompt."""

    logits: F32  # (k, low, low), positive inside
    scores: F32  # (k,) overlap (IoU) with the right mask that the network expects


class SamNetwork(Protocol):
    """A model. Opening it is costly, so that happens at the first picture."""

    side: int  # px of the square that it sees
    low: int  # px of the square of logits
    is_padded: bool

    def encode(self, picture: RGB) -> tuple[F32, ...]:
        """Features of a picture (h, w, 3), at most `side` px each way. Raises ModelError."""
        ...

    def decode(self, features: tuple[F32, ...], asked: Asked, is_several: bool) -> Masks:
        """Three masks, or the one where the prompt leaves no choice. Raises ModelError."""
        ...


def normalized(picture: RGB, side: int, mean: F32 = MEAN, deviation: F32 = DEVIATION) -> F32:
    """(1, 3, side, side) of a picture (h, w, 3); what it leaves empty is 0."""
    pixels = np.zeros((1, 3, side, side), np.float32)
    height, width = picture.shape[:2]
    scaled = (picture.astype(np.float32) / 255 - mean) / deviation
    pixels[0, :, :height, :width] = scaled.transpose(2, 0, 1)
    return pixels


# The place of a photo, or of a crop of it, in the square picture that a SAM sees.
#
# SAM (Kirillov et al. 2023) keeps the proportions and leaves the square's right or bottom empty;
# SAM 2 and 3 (Ravi et al. 2024) stretch. Masks come back as a small square of logits in the same
# frame.

Box = tuple[int, int, int, int]  # left, top, right, bottom px of the photo


@dataclass(frozen=True)
class SamFrame:
    """A box of the photo in a square of `side` px."""

    box: Box
    side: int
    is_padded: bool  # proportions are kept; else it is stretched

    @property
    def size(self) -> tuple[int, int]:
        """Width and height px that the box takes up in the square."""
        width, height = self.box[2] - self.box[0], self.box[3] - self.box[1]
        if not self.is_padded:
            return self.side, self.side
        scale = self.side / max(width, height)
        return max(1, int(width * scale + 0.5)), max(1, int(height * scale + 0.5))

    @property
    def scale(self) -> F64:
        """(2,) px of the square for a px of the photo, across and down."""
        width, height = self.box[2] - self.box[0], self.box[3] - self.box[1]
        return np.array(self.size) / (width, height)

    def picture(self, rgb: RGB) -> RGB:
        """The box of a photo (H, W, 3) at its size in the square, as the SAMs were trained.

        Pillow's triangle filter widens when it shrinks, as cv2's bilinear does not.
        """
        left, top, right, bottom = self.box
        crop = Image.fromarray(np.ascontiguousarray(rgb[top:bottom, left:right]))
        return np.asarray(crop.resize(self.size, Image.Resampling.BILINEAR), np.uint8)

    def points(self, photo: F64) -> F64:
        """(n, 2) px of the photo in px of the square; a pixel's centre is at its number + 0.5."""
        return (np.asarray(photo, np.float64).reshape(-1, 2) - self.box[:2]) * self.scale

    def unfold(self, logits: F32, size: tuple[int, int]) -> F32:
        """(h, w) logits (n, n) of the square as those of the box, at `size` (width, height) px."""
        if self.is_padded:
            square = cv2.resize(logits, (self.side, self.side), interpolation=cv2.INTER_LINEAR)
            logits = np.asarray(square[: self.size[1], : self.size[0]], np.float32)
        return np.asarray(cv2.resize(logits, size, interpolation=cv2.INTER_LINEAR), np.float32)

    def fold(self, logits: F32, size: int) -> F32:
        """(size, size) logits of the square that are `logits` (h, w) in the box; else very low."""
        inner = cv2.resize(logits, self.size, interpolation=cv2.INTER_LINEAR)
        square = np.full((self.side, self.side), EMPTY, np.float32)
        square[: self.size[1], : self.size[0]] = inner
        low = cv2.resize(square, (size, size), interpolation=cv2.INTER_AREA)
        return np.asarray(low, np.float32)


EMPTY = -10.0  # logit of what is surely not the object


REMEMBERED = 16  # answers of a photo
WORK_SIDE = 1536  # px of a photo in which the edge is found; a larger one follows by its own edges
UNSURE = 0.8  # px of logits each side of their outline within which the photo's edge decides


@dataclass(frozen=True, eq=False)
class Encoded:
    """A SAM's encoding of a photo or of a crop."""

    model: str  # its id
    frame: SamFrame
    features: tuple[F32, ...]


@dataclass(frozen=True, eq=False)
class SamAnswer:
    """The answer to a prompt."""

    logits: F32  # (low, low)
    score: float  # overlap (IoU) with what is meant that the network expects


class SamView:
    """One encoding, and the prompts on it."""

    def __init__(self, network: SamNetwork, encoded: Encoded) -> None:
        self._network, self.encoded = network, encoded
        self._known: dict[Prompt, SamAnswer] = {}

    @property
    def frame(self) -> SamFrame:
        return self.encoded.frame

    def answer(self, prompt: Prompt, before: F32 | None = None) -> SamAnswer:
        """Answer a prompt with clicks or a box, in px of the photo.

        `before` (low, low): logits of what is meant, where another look has found it already.
        """
        steps = steps_of(prompt) if before is None else [prompt]
        known = next((k for k in range(len(steps) - 1, -1, -1) if steps[k] in self._known), -1)
        answer = self._known[steps[known]] if known >= 0 and before is None else None
        first = known + 1 if answer is not None else 0
        for step in steps[first:]:
            logits = before if answer is None else answer.logits
            answer = self._decode(step, logits)
            if before is None:
                self._known[step] = answer
                if len(self._known) > REMEMBERED:
                    self._known.pop(next(iter(self._known)))
        assert answer is not None, "a prompt has at least one step"
        return answer

    def _decode(self, prompt: Prompt, logits: F32 | None) -> SamAnswer:
        points = np.array([(c.x, c.y) for c in prompt.clicks], np.float64).reshape(-1, 2)
        is_object = np.array([c.is_foreground for c in prompt.clicks], np.bool_)
        box = None
        if prompt.box is not None:
            box = self.frame.points(np.array(prompt.box)).ravel()
        asked = Asked(self.frame.points(points), is_object, box, logits)
        is_several = logits is None and box is None and len(points) == 1
        found = self._network.decode(self.encoded.features, asked, is_several)
        k = at_level(found, prompt.level if is_several else "object")
        return SamAnswer(found.logits[k], float(found.scores[k]))

    def mask(self, rgb: RGB, answer: SamAnswer) -> Mask:
        """(h, w) of the frame's box: an answer at the photo's resolution, along its edges."""
        left, top, right, bottom = self.frame.box
        crop = rgb[top:bottom, left:right]
        height, width = crop.shape[:2]
        scale = min(1.0, WORK_SIDE / max(width, height))
        size = (max(1, round(width * scale)), max(1, round(height * scale)))
        mask = self.frame.unfold(answer.logits, size) > 0
        band = round(UNSURE * max(size) / answer.logits.shape[0])
        if band > 0:
            small = cv2.resize(crop, size, interpolation=cv2.INTER_AREA) if scale < 1 else crop
            mask = sharpen_band(np.asarray(small, np.uint8), mask, band=band)
        return enlarge(crop, mask)

    def logits_of(self, mask: Mask, box: Box) -> F32:
        """(low, low) what a mask (h, w) of another box is in this frame, as logits."""
        left, top, right, bottom = self.frame.box
        whole = np.zeros((bottom - top, right - left), np.float32)
        x0, y0 = max(box[0], left), max(box[1], top)
        x1, y1 = min(box[2], right), min(box[3], bottom)
        whole[y0 - top : y1 - top, x0 - left : x1 - left] = mask[
            y0 - box[1] : y1 - box[1], x0 - box[0] : x1 - box[0]
        ]
        soft = cv2.GaussianBlur(whole, (0, 0), max(1.0, 0.5 * max(whole.shape) / self.frame.side))
        return self.frame.fold(np.asarray((2 * soft - 1) * SURE, np.float32), self._network.low)


SURE = 6.0  # logit of what an earlier look has found


def inside_box(prompt: Prompt, box: Box) -> Prompt:
    """The prompt with only the clicks that are in a box of the photo."""
    left, top, right, bottom = box
    clicks: tuple[Click, ...] = tuple(
        c for c in prompt.clicks if left <= c.x < right and top <= c.y < bottom
    )
    return replace(prompt, clicks=clicks)


# Which of SAM's three masks a click means: they are a part, an object and a group, unordered.

CLEARLY = 0.85  # x area: a mask smaller than so much of another is a part of it
NESTED = 0.7  # share of a part that must lie in its whole
DOUBTFUL = 0.6  # x best score: worse masks are no alternatives


def at_level(masks: Masks, level: str) -> int:
    """Index of the mask that a click means at a level: "part", "object" or "group"."""
    inside = masks.logits > 0
    areas = inside.sum((1, 2))
    whole = int(np.argmax(np.where(areas > 0, masks.scores, -np.inf)))
    if level == "object" or not areas[whole]:
        return whole
    is_fair = masks.scores >= DOUBTFUL * masks.scores[whole]
    if level == "part":
        nested = (inside & inside[whole]).sum((1, 2)) >= NESTED * areas
        fits = is_fair & nested & (areas > 0) & (areas < CLEARLY * areas[whole])
        return int(np.argmax(np.where(fits, areas, -1))) if fits.any() else whole
    nested = (inside & inside[whole]).sum((1, 2)) >= NESTED * areas[whole]
    fits = is_fair & nested & (CLEARLY * areas > areas[whole]) & ~inside.all((1, 2))
    smallest = np.where(fits, -areas, -np.inf)
    return int(np.argmax(smallest)) if fits.any() else whole
