"""A photo that is asked about: what its last prompts meant, and closer looks at small things."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from ...base.arrays import F32, RGB, Mask, frozen
from ...base.progress import Progress, part
from ...document.model import Click, Prompt
from ..matting.edges import enlarge
from ..selection import cropped, nest
from .answers import PieceAnswer, add_click, begin, confidence, expected_overlap, vote
from .choice import PieceChoice, PieceGround, PieceRegion, choose
from .features import crop_tokens
from .pieces import PIECES, Pieces, reduced

REMEMBERED = 8  # answers of a photo
MASKS = 3  # of its own size
LOOK_AGAIN = 0.8  # expected overlap: a small whole less sure is recognised anew, in a second or so
DETAILS = 4  # closer looks that are kept
DETAIL_PIECES = 6000  # a narrow thing has few of a closer look's
SMALL = 0.03  # x photo's area: such a thing is looked at more closely
SMALL_BOX = 0.3  # the same of a box: it says where, and is larger than what it is around
AS_GOOD = 0.7  # x best score: a small region as likely as that is worth a closer look
MARGIN = 0.5  # x larger side of a thing: what is looked at around it
LEAST_MARGIN = 0.1  # x larger side of the photo
LARGE = 3_000_000  # px; the tokens of a larger photo are too coarse for what is small in it
TILE = 0.25  # x side of a large photo: a tile, of which each half overlaps the next
FITS = 0.8  # x side of a tile: a thing that is no larger is looked at in it
CUT = 0.04  # of the frame of a closer look: a thing that touches more of it is not small

Box = tuple[int, int, int, int]  # left, top, right, bottom px
Encode = Callable[[RGB, Progress], F32]  # picture -> (h, w, d) tokens


@dataclass(frozen=True, eq=False)
class Tokens:
    """Tokens of a photo, patch by patch and piece by piece."""

    tokens: F32 | None  # (h, w, 64) unit length; None where colours are all there is
    salience: F32 | None  # (320, 320) in [0, 1]; None without the subject network's weights
    pieces: Pieces


class PieceView:
    """A photo (H, W, 3), or a closer look at a crop of one, and what its last prompts meant."""

    def __init__(
        self, rgb: RGB, embedding: Tokens, is_close: bool = False, is_of_large: bool = False
    ) -> None:
        self.rgb, self.embedding, self._is_close = rgb, embedding, is_close
        pieces, salience = embedding.pieces, embedding.salience
        if salience is not None:
            size = (pieces.shape[1], pieces.shape[0])
            salience = np.asarray(cv2.resize(salience, size), np.float32)
        self.ground = PieceGround(pieces, salience, is_of_large, embedding.tokens)
        self._image = reduced(rgb)
        self._known: dict[tuple[Prompt, int | None], PieceAnswer] = {}  # by whole, too
        self._choices: dict[Prompt, PieceChoice] = {}

    def answer(self, prompt: Prompt, whole: Mask | None, progress: Progress) -> PieceAnswer:
        """Answer a prompt; one that was answered before its last click is only improved.

        `whole` (H, W): what its first click means at the level "object", where it has another.
        """
        small = None if whole is None else self._reduced(whole)
        within = None if small is None else hash(small.tobytes())
        steps = steps_of(prompt)
        keys = [(step, within) for step in steps]
        known = next((k for k in range(len(steps) - 1, -1, -1) if keys[k] in self._known), -1)
        answer = self._known[keys[known]] if known >= 0 else None
        for k in range(known + 1, len(steps)):
            progress(k / len(steps), "looking for its outline")
            if answer is None:
                choice = self.choice(steps[k])
                answer = begin(self.ground, self._image, steps[k], choice, small)
            else:
                answer = add_click(self.ground, self._image, answer, steps[k])
            _remember(self._known, keys[k], answer, REMEMBERED)
        assert answer is not None, "a prompt has at least one step"
        return answer

    def choice(self, prompt: Prompt) -> PieceChoice:
        """Answer a prompt that has one positive click at most."""
        if prompt not in self._choices:
            choice = choose(self.ground, prompt)
            if self._is_close and prompt.level == "object":  # few tokens: colours must tell
                choice = vote(self.ground, prompt, choice)
            _remember(self._choices, prompt, choice, REMEMBERED)
        return self._choices[prompt]

    def adopt(self, mask: Mask, steps: list[Prompt]) -> PieceAnswer:
        """The answer to further steps after one whose mask (H, W) was found elsewhere."""
        answer = PieceAnswer(self._reduced(mask), ())
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

    def mask(self, answer: PieceAnswer) -> Mask:
        """(H, W) an answer at the photo's size."""
        return enlarge(self.rgb, answer.mask)

    def expected_overlap(self, prompt: Prompt, answer: PieceAnswer) -> float:
        """See `answers.expected_overlap`."""
        return expected_overlap(self.ground, answer, prompt.clicks)

    def confidence(self, prompt: Prompt, answer: PieceAnswer) -> float:
        """See `answers.confidence`."""
        return confidence(self.ground, answer, prompt.clicks)


@dataclass(frozen=True, eq=False)
class PromptAnswer:
    """The meaning that was found for a prompt."""

    mask: Mask  # (H, W)
    sureness: float  # in [0, 1]
    is_final: bool = True  # otherwise a closer look may tell better


class PhotoView:
    """A whole photo, and closer looks at what is small in it; `encode` looks at a tile of it."""

    def __init__(self, rgb: RGB, embedding: Tokens, encode: Encode) -> None:
        self.embedding = embedding
        self._rgb, self._encode = rgb, encode
        self._whole = PieceView(rgb, embedding, is_of_large=self._is_large)
        self._details: dict[tuple[Box, bool], PieceView] = {}
        self._found: dict[Prompt, PromptAnswer] = {}

    def find(self, prompt: Prompt, progress: Progress) -> PromptAnswer:
        """Answer a prompt; an answer that was found before returns at once."""
        return self._seen(prompt, False, progress)

    def glance(self, prompt: Prompt, progress: Progress) -> PromptAnswer:
        """Answer a prompt as far as encoded tokens allow, in a fraction of a second."""
        return self._seen(prompt, True, progress)

    def _seen(self, prompt: Prompt, at_once: bool, progress: Progress) -> PromptAnswer:
        known = self._found.pop(prompt, None)
        if known is None or not (known.is_final or at_once):
            known = self._look(prompt, at_once, progress)
            known = replace(known, mask=frozen(known.mask))
        _remember(self._found, prompt, known, MASKS)
        return known

    def _look(self, prompt: Prompt, at_once: bool, progress: Progress) -> PromptAnswer:
        steps = steps_of(prompt)
        if prompt.level == "object" or not steps[0].clicks:
            return self._look_within(steps, None, at_once, progress)
        around = replace(steps[0], level="object")
        whole = self._seen(around, at_once, part(progress, 0.0, 0.3))
        seen = self._look_within(steps, whole.mask, at_once, part(progress, 0.3, 1.0))
        mask = seen.mask
        if len(steps) == 1:  # at the photo's size, too
            mask = nest(mask, whole.mask, prompt.level)
        return PromptAnswer(mask, seen.sureness, seen.is_final and whole.is_final)

    def _look_within(
        self, steps: list[Prompt], whole: Mask | None, at_once: bool, progress: Progress
    ) -> PromptAnswer:
        prompt = steps[-1]
        choice = self._whole.choice(steps[0])
        box = self._closer(choice, steps[0])
        seen, count = None, 0
        if box is not None:
            seen, count = self._look_closer(box, steps, whole, at_once, progress)
        if seen is None:
            answer = self._whole.answer(prompt, whole, progress)
        elif count == len(steps):
            return seen
        else:  # a click elsewhere says that the thing is larger
            answer = self._whole.adopt(seen.mask, steps[count:])
        sureness = self._whole.confidence(prompt, answer)
        return PromptAnswer(self._whole.mask(answer), sureness, seen is None or seen.is_final)

    def _look_closer(
        self, box: Box, steps: list[Prompt], whole: Mask | None, at_once: bool, progress: Progress
    ) -> tuple[PromptAnswer | None, int]:
        """The answer in a box, and to how many steps; None if it is cut."""
        progress(0.1, "looking closer")
        inside = None if whole is None else whole[box[1] : box[3], box[0] : box[2]]
        moved = [_moved(step, box) for step in steps]
        is_final, rest = True, part(progress, 0.3, 0.6)
        if self._is_large or steps[0].box is not None:
            is_final = not at_once or (box, True) in self._details
            if not is_final:
                return self._owed(steps, whole, progress), len(steps)
            detail = self._detail(box, True, progress)
            first = detail.answer(moved[0], inside, rest)
        else:
            detail = self._detail(box, False, progress)
            first = detail.answer(moved[0], inside, rest)
            is_unsure = detail.expected_overlap(moved[0], first) < LOOK_AGAIN
            if is_unsure and steps[0].level == "object":
                is_final = not at_once or (box, True) in self._details
                if is_final:
                    detail = self._detail(box, True, progress)
                    first = detail.answer(moved[0], inside, rest)
        if _frame_share(first.mask) > CUT:
            return (None, 0) if is_final else (self._owed(steps, whole, progress), len(steps))
        beyond = [any(c.is_foreground and not _is_in(box, c) for c in s.clicks) for s in steps]
        count = beyond.index(True) if any(beyond) else len(steps)
        last = moved[count - 1]
        answer = detail.answer(last, inside, part(progress, 0.6, 1.0))
        mask = np.zeros(self._rgb.shape[:2], bool)
        mask[box[1] : box[3], box[0] : box[2]] = detail.mask(answer)
        return PromptAnswer(mask, detail.confidence(last, answer), is_final), count

    def _owed(self, steps: list[Prompt], whole: Mask | None, progress: Progress) -> PromptAnswer:
        """What the whole photo says of what a closer look may tell better."""
        answer = self._whole.answer(steps[-1], whole, progress)
        sureness = self._whole.confidence(steps[-1], answer)
        return PromptAnswer(self._whole.mask(answer), sureness, is_final=False)

    def _closer(self, choice: PieceChoice, prompt: Prompt) -> Box | None:
        """Where to look closer at what a prompt's first click may mean; None where it is large."""
        pieces = self.embedding.pieces
        if prompt.is_subject:
            return None
        if prompt.box is not None:
            return self._around_box(prompt.box)
        if prompt.level == "group":
            return None
        regions = choice.others
        best = max(region.score for region in regions)
        good = [region for region in regions if region.score >= AS_GOOD * best]
        likely = [region for region in good if pieces.share(region.pieces) < SMALL]
        if not likely:
            return None
        chosen = max(likely, key=lambda region: region.score)
        return self._around(chosen)

    def _around(self, region: PieceRegion) -> Box | None:
        """The crop of the photo to look at around pieces; None where they do not fit a tile."""
        pieces = self.embedding.pieces
        (height, width), (tall, wide) = pieces.shape, pieces.photo_shape
        painted = pieces.paint(region.pieces)
        rows, columns = np.flatnonzero(painted.any(1)), np.flatnonzero(painted.any(0))
        left, right = columns[0] * wide / width, (columns[-1] + 1) * wide / width
        top, bottom = rows[0] * tall / height, (rows[-1] + 1) * tall / height
        return self._crop_around(left, top, right, bottom)

    def _around_box(self, box: tuple[float, float, float, float]) -> Box | None:
        """The crop to look at around a box that the user drew; None where it is large."""
        tall, wide = self._rgb.shape[:2]
        left, right = np.clip([box[0], box[2]], 0, wide)
        top, bottom = np.clip([box[1], box[3]], 0, tall)
        if (right - left) * (bottom - top) >= SMALL_BOX * tall * wide:
            return None
        return self._crop_around(float(left), float(top), float(right), float(bottom))

    def _crop_around(self, left: float, top: float, right: float, bottom: float) -> Box | None:
        """The crop to look at around a thing in these px; None where it does not fit a tile."""
        tall, wide = self._rgb.shape[:2]
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

    def _detail(self, box: Box, is_anew: bool, progress: Progress) -> PieceView:
        """What a box shows, recognised anew at its size, or by how the whole photo shows it."""
        if (box, is_anew) not in self._details:
            left, top, right, bottom = box
            crop = np.ascontiguousarray(self._rgb[top:bottom, left:right])
            photo, salience = self._rgb.shape[:2], self.embedding.salience
            if is_anew:
                tokens = self._encode(crop, part(progress, 0.1, 0.3))
            else:
                assert self.embedding.tokens is not None, "a closer look is by tokens"
                tokens = crop_tokens(self.embedding.tokens, photo, box)
            if salience is not None:
                salience = _crop_map(salience, photo, box)
            is_finer = is_anew and not self._is_large
            pieces = Pieces(crop, tokens, DETAIL_PIECES if is_finer else PIECES)
            # A large photo's tile has tokens enough.
            known = Tokens(tokens, salience, pieces)
            view = PieceView(crop, known, not self._is_large, self._is_large)
            _remember(self._details, (box, is_anew), view, DETAILS)
        return self._details[box, is_anew]


def steps_of(prompt: Prompt) -> list[Prompt]:
    """The prompt as it was built up: what the first answer needs, then click by click.

    A box and the subject need no click: clicks correct what they mean.
    """
    clicks = list(prompt.clicks)
    begun: list[Click] = []
    if not prompt.is_subject and prompt.box is None:
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
    """Where the tile begins, of those that begin every half side, whose middle is nearest.

    Elsewhere, where that would cut what reaches from `low` to `high`.
    """
    begin = round(((low + high) / 2 - side / 2) / (side / 2)) * side / 2
    begin = min(max(begin, high - side), low)
    return min(max(begin, 0.0), length - side)


def _is_in(box: Box, click: Click) -> bool:
    return box[0] <= click.x < box[2] and box[1] <= click.y < box[3]


def _moved(prompt: Prompt, box: Box) -> Prompt:
    """The prompt in px of a box; clicks outside are left out."""
    prompt = cropped(prompt, box)
    left, top = box[:2]
    clicks = tuple(replace(c, x=c.x - left, y=c.y - top) for c in prompt.clicks if _is_in(box, c))
    if prompt.box is None:
        return replace(prompt, clicks=clicks)
    x0, y0, x1, y1 = prompt.box
    return replace(prompt, clicks=clicks, box=(x0 - left, y0 - top, x1 - left, y1 - top))


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
