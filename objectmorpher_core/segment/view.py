"""A photo that is asked about: what its last prompts meant, and closer looks at small things."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from ..arrays import F32, RGB, Mask, frozen
from ..document import Click, Prompt
from ..progress import Progress, part
from .answers import Answer, add_click, begin, confidence, vote
from .edges import enlarge
from .piece_choice import Choice, Ground, Region, choose
from .piece_features import crop_tokens
from .pieces import PIECES, Pieces, reduced

REMEMBERED = 8  # answers of a photo
LOOK_AGAIN = 0.8  # confidence: a small whole less sure is recognised anew, in a second or so
DETAILS = 4  # closer looks that are kept
DETAIL_PIECES = 6000  # a narrow thing has few of a closer look's
SMALL = 0.03  # x photo's area: such a thing is looked at more closely
AS_GOOD = 0.7  # x best score: a small region as likely as that is worth a closer look
MARGIN = 0.5  # x larger side of a thing: what is looked at around it
LEAST_MARGIN = 0.1  # x larger side of the photo
LARGE = 3_000_000  # px; the tokens of a larger photo are too coarse for what is small in it
TILE = 0.25  # x side of a large photo: a tile, of which each half overlaps the next
FITS = 0.8  # x side of a tile: a thing that is no larger is looked at in it
CUT = 0.04  # of the frame of a closer look: a thing that touches more of it is not small

Box = tuple[int, int, int, int]  # left, top, right, bottom px
Encode = Callable[[RGB], F32]  # picture -> (h, w, d) tokens


@dataclass(frozen=True, eq=False)
class Tokens:
    """What a photo is made of, patch by patch and piece by piece."""

    tokens: F32  # (h, w, 64) unit length
    salience: F32 | None  # (320, 320) in [0, 1]; None without the subject network's weights
    pieces: Pieces


class View:
    """A photo (H, W, 3), or a closer look at a crop of one, and what its last prompts meant."""

    def __init__(
        self, rgb: RGB, embedding: Tokens, is_close: bool = False, is_of_large: bool = False
    ) -> None:
        self.rgb, self.embedding, self._is_close = rgb, embedding, is_close
        pieces, salience = embedding.pieces, embedding.salience
        if salience is not None:
            size = (pieces.shape[1], pieces.shape[0])
            salience = np.asarray(cv2.resize(salience, size), np.float32)
        self.ground = Ground(pieces, salience, is_of_large, embedding.tokens)
        self._image = reduced(rgb)
        self._known: dict[Prompt, Answer] = {}
        self._choices: dict[Prompt, Choice] = {}

    def answer(self, prompt: Prompt, whole: Mask | None, progress: Progress) -> Answer:
        """To a prompt; one that was answered before its last click is only told better.

        `whole` (H, W): what its first click means at the level "object", where it has another.
        """
        steps = steps_of(prompt)
        known = next((k for k in range(len(steps) - 1, -1, -1) if steps[k] in self._known), -1)
        answer = self._known[steps[known]] if known >= 0 else None
        for k in range(known + 1, len(steps)):
            progress(k / len(steps), "looking for its outline")
            if answer is None:
                small = None if whole is None else self._reduced(whole)
                choice = self.choice(steps[k])
                answer = begin(self.ground, self._image, steps[k], choice, small)
            else:
                answer = add_click(self.ground, self._image, answer, steps[k])
            _remember(self._known, steps[k], answer, REMEMBERED)
        assert answer is not None, "a prompt has at least one step"
        return answer

    def choice(self, prompt: Prompt) -> Choice:
        """What a prompt means that has one positive click at most."""
        if prompt not in self._choices:
            choice = choose(self.ground, prompt)
            if self._is_close and prompt.level == "object":  # few tokens: colours must tell
                choice = vote(self.ground, prompt, choice)
            _remember(self._choices, prompt, choice, REMEMBERED)
        return self._choices[prompt]

    def adopt(self, mask: Mask, steps: list[Prompt]) -> Answer:
        """The answer to further steps after one whose mask (H, W) was found elsewhere."""
        answer = Answer(self._reduced(mask), ())
        for step in steps:
            answer = add_click(self.ground, self._image, answer, step)
        return answer

    def _reduced(self, mask: Mask) -> Mask:
        """(h, w) a mask (H, W) at the size of the reduced photo."""
        height, width = self._image.shape[:2]
        if mask.shape == (height, width):
            return mask
        small = cv2.resize(mask.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
        return small > 0.5

    def mask(self, answer: Answer) -> Mask:
        """(H, W) an answer at the photo's size."""
        return enlarge(self.rgb, answer.mask)

    def confidence(self, prompt: Prompt, answer: Answer) -> float:
        """See `answers.confidence`."""
        return confidence(self.ground, answer, prompt.clicks)


class PhotoView:
    """A whole photo, and closer looks at what is small in it; `encode` looks at a tile of it."""

    def __init__(self, rgb: RGB, embedding: Tokens, encode: Encode) -> None:
        self.embedding = embedding
        self._rgb, self._encode = rgb, encode
        self._whole = View(rgb, embedding, is_of_large=self._is_large)
        self._details: dict[tuple[Box, bool], View] = {}
        self._last: tuple[Prompt, Mask, float] | None = None  # found, and how sure it was

    def find(self, prompt: Prompt, progress: Progress) -> tuple[Mask, float]:
        """(H, W) what a prompt means, and how sure that is, in [0, 1]; the last one at once."""
        if self._last is None or self._last[0] != prompt:
            mask, sureness = self._find(prompt, progress)
            self._last = prompt, frozen(mask), sureness
        return self._last[1:]

    def _find(self, prompt: Prompt, progress: Progress) -> tuple[Mask, float]:
        steps = steps_of(prompt)
        whole = None
        if prompt.level != "object" and any(c.is_foreground for c in prompt.clicks):
            whole, _ = self._find(replace(steps[0], level="object"), part(progress, 0.0, 0.3))
        mask, sureness = self._find_within(steps, whole, part(progress, 0.3, 1.0))
        if whole is not None and len(steps) == 1:  # at the photo's size, too
            nested = mask & whole if prompt.level == "part" else mask | whole
            mask = nested if nested.any() and not nested.all() else whole
        return mask, sureness

    def _find_within(
        self, steps: list[Prompt], whole: Mask | None, progress: Progress
    ) -> tuple[Mask, float]:
        prompt = steps[-1]
        choice = self._whole.choice(steps[0])
        box = self._closer(choice, steps[0])
        looked = None if box is None else self._look_closer(box, steps, whole, progress)
        if looked is None:
            answer = self._whole.answer(prompt, whole, progress)
            return self._whole.mask(answer), self._whole.confidence(prompt, answer)
        mask, sureness, count = looked
        if count == len(steps):
            return mask, sureness
        # A click elsewhere says that the thing is larger.
        answer = self._whole.adopt(mask, steps[count:])
        return self._whole.mask(answer), self._whole.confidence(prompt, answer)

    def _look_closer(
        self, box: Box, steps: list[Prompt], whole: Mask | None, progress: Progress
    ) -> tuple[Mask, float, int] | None:
        """(H, W) the answer in a box, how sure it is, and to how many steps; None if it is cut."""
        progress(0.1, "looking closer")
        inside = None if whole is None else whole[box[1] : box[3], box[0] : box[2]]
        moved = [_moved(step, box) for step in steps]
        detail = self._detail(box, self._is_large)
        first = detail.answer(moved[0], inside, part(progress, 0.3, 0.6))
        is_unsure = detail.confidence(moved[0], first) < LOOK_AGAIN
        if is_unsure and steps[0].level == "object" and not self._is_large:
            detail = self._detail(box, is_anew=True)
            first = detail.answer(moved[0], inside, part(progress, 0.3, 0.6))
        if _frame_share(first.mask) > CUT:
            return None
        beyond = [any(c.is_foreground and not _is_in(box, c) for c in s.clicks) for s in steps]
        count = beyond.index(True) if any(beyond) else len(steps)
        last = moved[count - 1]
        answer = detail.answer(last, inside, part(progress, 0.6, 1.0))
        mask = np.zeros(self._rgb.shape[:2], bool)
        mask[box[1] : box[3], box[0] : box[2]] = detail.mask(answer)
        return mask, detail.confidence(last, answer), count

    def _closer(self, choice: Choice, prompt: Prompt) -> Box | None:
        """Where to look closer at what a prompt's first click may mean; None where it is large."""
        pieces = self.embedding.pieces
        if prompt.is_subject or prompt.box is not None or prompt.level == "group":
            return None
        regions = choice.others
        best = max(region.score for region in regions)
        good = [region for region in regions if region.score >= AS_GOOD * best]
        likely = [region for region in good if pieces.share(region.pieces) < SMALL]
        if not likely:
            return None
        chosen = max(likely, key=lambda region: region.score)
        return self._around(chosen)

    def _around(self, region: Region) -> Box | None:
        """The crop of the photo to look at around pieces; None where they do not fit a tile."""
        pieces = self.embedding.pieces
        (height, width), (tall, wide) = pieces.shape, pieces.photo_shape
        painted = pieces.paint(region.pieces)
        rows, columns = np.flatnonzero(painted.any(1)), np.flatnonzero(painted.any(0))
        left, right = columns[0] * wide / width, (columns[-1] + 1) * wide / width
        top, bottom = rows[0] * tall / height, (rows[-1] + 1) * tall / height
        if tall * wide > LARGE:
            side = TILE * wide, TILE * tall
            if right - left > FITS * side[0] or bottom - top > FITS * side[1]:
                return None
            x, y = _tile(left, right, side[0], wide), _tile(top, bottom, side[1], tall)
            return (round(x), round(y), round(x + side[0]), round(y + side[1]))
        margin = max(MARGIN * max(right - left, bottom - top), LEAST_MARGIN * max(tall, wide))
        return (
            int(max(left - margin, 0)),
            int(max(top - margin, 0)),
            int(min(right + margin, wide)),
            int(min(bottom + margin, tall)),
        )

    @property
    def _is_large(self) -> bool:
        return self._rgb.shape[0] * self._rgb.shape[1] > LARGE

    def _detail(self, box: Box, is_anew: bool) -> View:
        """What a box shows, recognised anew at its size, or by how the whole photo shows it."""
        if (box, is_anew) not in self._details:
            left, top, right, bottom = box
            crop = np.ascontiguousarray(self._rgb[top:bottom, left:right])
            photo, salience = self._rgb.shape[:2], self.embedding.salience
            if is_anew:
                tokens = self._encode(crop)
            else:
                tokens = crop_tokens(self.embedding.tokens, photo, box)
            if salience is not None:
                salience = _crop_map(salience, photo, box)
            is_finer = is_anew and not self._is_large
            pieces = Pieces(crop, tokens, DETAIL_PIECES if is_finer else PIECES)
            # A large photo's tile has tokens enough.
            known = Tokens(tokens, salience, pieces)
            view = View(crop, known, not self._is_large, self._is_large)
            _remember(self._details, (box, is_anew), view, DETAILS)
        return self._details[box, is_anew]


def steps_of(prompt: Prompt) -> list[Prompt]:
    """The prompt as it was built up: what the first answer needs, then click by click."""
    clicks = list(prompt.clicks)
    begun: list[Click] = []
    if not prompt.is_subject:
        first = next((c for c in clicks if c.is_foreground), None)
        if first is not None:
            clicks.remove(first)
            begun = [first]
    counts = range(len(clicks) + 1)
    return [replace(prompt, clicks=(*begun, *clicks[:count])) for count in counts]


def _remember(kept: dict[Any, Any], key: object, value: object, count: int) -> None:
    """Keeps the value, and forgets the oldest beyond so many."""
    kept[key] = value
    if len(kept) > count:
        kept.pop(next(iter(kept)))


def _tile(low: float, high: float, side: float, length: int) -> float:
    """Where the tile begins, of those that begin every half side, whose middle is nearest."""
    begin = round(((low + high) / 2 - side / 2) / (side / 2)) * side / 2
    return min(max(begin, 0.0), length - side)


def _is_in(box: Box, click: Click) -> bool:
    return box[0] <= click.x < box[2] and box[1] <= click.y < box[3]


def _moved(prompt: Prompt, box: Box) -> Prompt:
    """The prompt, its clicks in px of a box; those outside are left out."""
    clicks = [replace(c, x=c.x - box[0], y=c.y - box[1]) for c in prompt.clicks if _is_in(box, c)]
    return replace(prompt, clicks=tuple(clicks))


def _frame_share(mask: Mask) -> float:
    """How much of its frame a mask (h, w) touches."""
    return float(np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]]).mean())


def _crop_map(image: F32, photo: tuple[int, int], box: Box) -> F32:
    """(320, 320) the part of a map of the whole photo that is in a box."""
    height, width = image.shape
    columns = (box[0] + (np.arange(width) + 0.5) * (box[2] - box[0]) / width) * width / photo[1]
    rows = (box[1] + (np.arange(height) + 0.5) * (box[3] - box[1]) / height) * height / photo[0]
    x, y = np.meshgrid((columns - 0.5).astype(np.float32), (rows - 0.5).astype(np.float32))
    cropped = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(cropped, np.float32)
