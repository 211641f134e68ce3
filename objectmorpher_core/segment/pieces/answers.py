"""A prompt's clicks one after the other: each changes the mask around it, and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import RGB, Mask
from ...document.model import Click, Prompt
from ..matting.edges import BAND, sharpen_band
from ..matting.straying import settle_outline
from ..selection import fill_small_holes, is_bounded, keep_touched, nest
from .choice import (
    LARGER_CORRECTION,
    LARGER_FINE,
    MINOR_CORRECTION,
    MINOR_FINE,
    Correction,
    PieceChoice,
    PieceGround,
    PieceRegion,
    Taste,
    correct,
    depth,
)
from .features import crop_tokens
from .pieces import PIECES, WORK_AREA, Pieces
from .relabel import relabel, touching, votes

OFF_EDGE = 0.4  # x side of a piece: how far its border may be off the picture's edge
NEARBY = 6  # px of the reduced photo beyond what a click changes where the edge is found anew
SHARPNESS = 3.0  # exponent: how much more a better region is likely to be meant than another
BLUR = 1.0  # px of the reduced photo, how far the outline found may be from the one meant
SURE = (-4.3, 0.5, 5.6)  # log odds of the IoU: alone, x those expected, x agreement; fitted
ISLAND = 0.2  # x area of what clicks touch; smaller islands that a click cuts off go
DIAGONAL = 0.79  # pi / 4: px of an outline for each step of its staircase, all directions alike


# Corrections by a click on a wrong place of a mask: the piece there changes, and no more.
#
# Pieces of the photo say it where the click is deep in what it may mean. Where it lies less than
# two pieces deep in that, it is decided anew in finer pieces of a window around, in which a walk
# goes as far as before: what the coarser pieces say is then one of the things that may be meant.
# Less than one deep, a thing there is as narrow as the pieces, which hold some of what was right
# too, and are not asked. A window that cuts off what is found in it is widened. What a click may
# mean is weighed by the votes of like pieces elsewhere: a click into the gap between two legs does
# not take the legs, which are like the rest of the object, and takes the grass, which is like the
# grass around.

DEEP = 2.0  # x side of a piece: a click that is less deep in what it means needs finer pieces
NARROW = 1.0  # the same: less deep, the coarser pieces are not heard
FINER = 2  # x the reduced photo: the scale of the window that is cut into finer pieces
FINE_SIDE = 5.0  # px of that scale, of a finer piece
MARGIN = 0.5  # x larger side of what the coarse pieces say: the window reaches so far beyond it
LEAST_MARGIN = 16  # px of the reduced photo
RIM = 4  # px of the reduced photo: what comes so near to a window's side is cut off by it


@dataclass(frozen=True, eq=False)
class Wrong:
    """The fault of a mask that a click points out."""

    mask: Mask  # (h, w)
    others: tuple[PieceRegion, ...] = ()  # what the object would be by the other things it may mean


@dataclass(frozen=True)
class _Window:
    """A part of the reduced photo, in its px."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def inside(self) -> tuple[slice, slice]:
        return np.s_[self.top : self.bottom, self.left : self.right]

    @property
    def is_small(self) -> bool:
        """Whether there is time to cut it into finer pieces: a tenth of a second."""
        area = (self.right - self.left) * (self.bottom - self.top)
        return area * FINER**2 <= WORK_AREA / 2


def wrong(ground: PieceGround, image: RGB, before: Mask, prompt: Prompt) -> Wrong:
    """Return the fault of a mask (h, w) that the prompt's last click points out.

    `image` (h, w, 3): the reduced photo. The click contradicts the mask.
    """
    pieces, click = ground.pieces, prompt.clicks[-1]
    column, row = pieces.pixel(click.x, click.y)
    differs = before != click.is_foreground
    piece = pieces.at(click.x, click.y)
    if pieces.mean(differs)[piece] <= 0.5:  # a sliver of a piece
        _, labels = cv2.connectedComponents((differs & (pieces.labels == piece)).astype(np.uint8))
        rough = labels == labels[row, column]
        window = _around(rough)
        return Wrong(_finer(ground, image, before, prompt, window) if window.is_small else rough)
    choice = _meant(ground, before, prompt)
    had = pieces.mean(before) > 0.5
    others = tuple(
        PieceRegion(had | r.pieces if click.is_foreground else had & ~r.pieces, r.score)
        for r in choice.relative
    )
    rough = pieces.paint(choice.pieces)
    deep, window = depth(rough)[row, column] / pieces.side, _around(rough & differs)
    if deep < NARROW and window.is_small:
        return Wrong(_finer(ground, image, before, prompt, window), others)
    if deep < DEEP and window.is_small:
        return Wrong(_finer(ground, image, before, prompt, window, rough & differs), others)
    changed = choice.pieces
    if not ground.is_of_large:  # votes made it worse there: IoU 0.79 to 0.63 of the distant tower
        changed = _voted(ground, before, prompt, choice)
    return Wrong(pieces.paint(changed) & differs, others)


def said(pieces: Pieces, prompt: Prompt, is_foreground: bool) -> tuple[int, ...]:
    """The pieces that clicks say are in the object, or are not."""
    clicks = (c for c in prompt.clicks if c.is_foreground == is_foreground)
    return tuple(pieces.at(c.x, c.y) for c in clicks)


def _flippable(ground: PieceGround, before: Mask, prompt: Prompt) -> Mask:
    """(n,) the pieces that a click on a wrong place may change."""
    differs = before != prompt.clicks[-1].is_foreground
    return (ground.pieces.mean(differs) > 0.5) & ground.inside(prompt)


def _meant(
    ground: PieceGround,
    before: Mask,
    prompt: Prompt,
    reach: float = 0.0,
    guess: Mask | None = None,
) -> PieceChoice:
    """The pieces that the last click means of those that it may change.

    `guess` (h, w): what coarser pieces say, which is heard as one thing more that may be meant.
    """
    click = prompt.clicks[-1]
    pieces = ground.pieces
    walls = said(pieces, prompt, not click.is_foreground)
    guessed = None if guess is None else pieces.mean(guess) > 0.5
    had = pieces.mean(before) > 0.5
    had[pieces.at(click.x, click.y)] = click.is_foreground
    chance = None
    if had.any() and not had.all():
        chance = votes(pieces, had, pieces.at(click.x, click.y))
        chance = chance if click.is_foreground else 1 - chance
    taste = (
        Taste(MINOR_FINE, LARGER_FINE, reach)
        if reach
        else Taste(MINOR_CORRECTION, LARGER_CORRECTION)
    )
    allowed = _flippable(ground, before, prompt)
    return correct(ground, Correction(click, allowed, walls, chance, taste, guessed))


def _voted(ground: PieceGround, before: Mask, prompt: Prompt, choice: PieceChoice) -> Mask:
    """(n,) the choice, with what hangs together with it and is like it by the vote of all."""
    pieces, click = ground.pieces, prompt.clicks[-1]
    had = pieces.mean(before) > 0.5
    found = had | choice.pieces if click.is_foreground else had & ~choice.pieces
    known = said(pieces, prompt, True), said(pieces, prompt, False)
    is_object = relabel(pieces, found, *known, pieces.at(click.x, click.y))
    is_like = (is_object == click.is_foreground) | choice.pieces
    return touching(pieces, is_like & _flippable(ground, before, prompt), choice.pieces)


def _finer(
    ground: PieceGround,
    image: RGB,
    before: Mask,
    prompt: Prompt,
    window: _Window,
    guess: Mask | None = None,
) -> Mask:
    """(h, w) what the last click says is wrong about a mask, by finer pieces of a window.

    The window is widened, once, where it cuts off what is found. `guess` (h, w): see `_meant`.
    """
    found = _within(ground, image, before, prompt, window, guess)
    wider = _widened(window, found)
    if wider == window or not wider.is_small:
        return found
    return _within(ground, image, before, prompt, wider, guess)


def _within(
    ground: PieceGround,
    image: RGB,
    before: Mask,
    prompt: Prompt,
    window: _Window,
    guess: Mask | None,
) -> Mask:
    """(h, w) the same, as far as the window reaches."""
    click = prompt.clicks[-1]
    fine = _look_closer(ground, image, window)
    moved = _moved(ground.pieces, prompt, window)
    own = _enlarged(before[window.inside])
    reach = float(np.count_nonzero(before != click.is_foreground)) * FINER**2
    coarse = None if guess is None else _enlarged(guess[window.inside])
    choice = _meant(fine, own, moved, reach, coarse)
    changed = fine.pieces.paint(_voted(fine, own, moved, choice)) & (own != click.is_foreground)
    share = changed.reshape(own.shape[0] // FINER, FINER, -1, FINER).mean((1, 3))
    found = np.zeros_like(before)
    found[window.inside] = share > 0.5
    column, row = ground.pieces.pixel(click.x, click.y)
    found[row, column] = True
    return found


def _widened(window: _Window, found: Mask) -> _Window:
    """The window, half its side larger wherever it cuts off what was found (h, w)."""
    height, width = found.shape
    inside = found[window.inside]
    down, across = (window.bottom - window.top) // 2, (window.right - window.left) // 2
    return _Window(
        max(window.left - across, 0) if inside[:, :RIM].any() else window.left,
        max(window.top - down, 0) if inside[:RIM].any() else window.top,
        min(window.right + across, width) if inside[:, -RIM:].any() else window.right,
        min(window.bottom + down, height) if inside[-RIM:].any() else window.bottom,
    )


def _around(mask: Mask) -> _Window:
    """The window to look at around what a mask (h, w) holds."""
    (height, width), (rows, columns) = mask.shape, np.nonzero(mask)
    top, bottom = int(rows.min()), int(rows.max()) + 1
    left, right = int(columns.min()), int(columns.max()) + 1
    margin = int(max(MARGIN * max(bottom - top, right - left), LEAST_MARGIN))
    return _Window(
        max(left - margin, 0),
        max(top - margin, 0),
        min(right + margin, width),
        min(bottom + margin, height),
    )


def _look_closer(ground: PieceGround, image: RGB, window: _Window) -> PieceGround:
    """The window of the reduced photo (h, w, 3) in finer pieces; tokens as the photo has them."""
    crop = np.ascontiguousarray(image[window.inside])
    size = (crop.shape[1] * FINER, crop.shape[0] * FINER)
    large = np.asarray(cv2.resize(crop, size, interpolation=cv2.INTER_CUBIC), np.uint8)
    tokens = ground.tokens
    if tokens is not None:
        box = window.left, window.top, window.right, window.bottom
        tokens = crop_tokens(tokens, ground.pieces.shape, box)
    count = min(round(size[0] * size[1] / FINE_SIDE**2), PIECES)
    return PieceGround(Pieces(large, tokens, count, FINER * ground.pieces.side), None)


def _moved(pieces: Pieces, prompt: Prompt, window: _Window) -> Prompt:
    """The prompt in px of the window, enlarged; clicks outside are left out."""
    down = FINER * pieces.shape[0] / pieces.photo_shape[0]
    across = FINER * pieces.shape[1] / pieces.photo_shape[1]
    left, top = FINER * window.left, FINER * window.top
    right, bottom = FINER * window.right - left, FINER * window.bottom - top
    moved = (replace(c, x=c.x * across - left, y=c.y * down - top) for c in prompt.clicks)
    clicks = tuple(c for c in moved if 0 <= c.x < right and 0 <= c.y < bottom)
    prompt = Prompt(
        clicks, prompt.box, prompt.is_subject, prompt.level
    )  # `wrong` minds what is taken
    if prompt.box is None:
        return prompt
    x0, y0, x1, y1 = prompt.box
    xs = np.clip([x0 * across - left, x1 * across - left], 0, right)
    ys = np.clip([y0 * down - top, y1 * down - top], 0, bottom)
    return replace(prompt, box=(xs[0], ys[0], xs[1], ys[1]))


def _enlarged(mask: Mask) -> Mask:
    """A mask (h, w) of the reduced photo at the window's scale."""
    return np.repeat(np.repeat(mask, FINER, 0), FINER, 1)


@dataclass(frozen=True, eq=False)
class PieceAnswer:
    """The answer to a prompt, at the size of the reduced photo."""

    mask: Mask  # (h, w)
    others: tuple[PieceRegion, ...]  # what else might be meant; the best has the score 1


def begin(
    ground: PieceGround, image: RGB, prompt: Prompt, choice: PieceChoice, whole: Mask | None = None
) -> PieceAnswer:
    """The answer to a prompt's first positive click, or to its box or subject without any.

    `image` (h, w, 3): the reduced photo; `choice`: what the prompt means. `whole` (h, w): what it
    means at the level "object": a part lies in its object, and the object in its group.
    """
    pieces = ground.pieces
    mask = sharpen_band(image, pieces.paint(choice.pieces), band=_band(pieces))
    small = _reduced(pieces, prompt)
    mask = _tidy(mask, small)
    settled = settle_outline(image, mask, _clicked(small, mask.shape))
    mask = _tidy(settled & ground.free(prompt) if is_bounded(prompt) else settled, small)
    if whole is not None:
        mask = nest(mask, whole, prompt.level)
    return PieceAnswer(mask, choice.relative)


def add_click(ground: PieceGround, image: RGB, answer: PieceAnswer, prompt: Prompt) -> PieceAnswer:
    """The answer to a prompt whose last click is new."""
    pieces, click = ground.pieces, prompt.clicks[-1]
    column, row = pieces.pixel(click.x, click.y)
    before = answer.mask
    if before[row, column] == click.is_foreground:
        return answer
    changed = before.copy()
    found = wrong(ground, image, before, prompt)
    wrong_there = found.mask & ground.free(prompt) if is_bounded(prompt) else found.mask
    changed[wrong_there] = click.is_foreground
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * NEARBY + 1, 2 * NEARBY + 1))
    near = cv2.dilate(found.mask.astype(np.uint8), kernel) > 0
    mask = sharpen_band(image, changed, near, _band(pieces))
    return PieceAnswer(_tidy(mask, _reduced(pieces, prompt), near), (*answer.others, *found.others))


def expected_overlap(ground: PieceGround, answer: PieceAnswer, clicks: tuple[Click, ...]) -> float:
    """The overlap (IoU) of the answer with all that may be meant, in [0, 1].

    Every region that could have been chosen and that no click contradicts may be what is meant,
    and the outline of what is may lie a pixel beside the one found: much, where a thing is thin.
    """
    pieces = ground.pieces
    said = [(pieces.at(c.x, c.y), c.is_foreground) for c in clicks]
    found = pieces.mean(answer.mask)
    total, expected = 1.0, 1.0  # the answer itself
    for region in answer.others:
        if all(region.pieces[piece] == is_object for piece, is_object in said):
            weight = region.score**SHARPNESS
            both = (np.minimum(region.pieces, found) * pieces.area).sum()
            either = (np.maximum(region.pieces, found) * pieces.area).sum()
            total += weight
            expected += weight * both / max(either, 1e-9)
    across = np.count_nonzero(answer.mask[:, 1:] != answer.mask[:, :-1])
    down = np.count_nonzero(answer.mask[1:] != answer.mask[:-1])
    outline = DIAGONAL * (across + down) / max(int(answer.mask.sum()), 1)
    return float(expected / total / (1 + BLUR * outline))


def confidence(ground: PieceGround, answer: PieceAnswer, clicks: tuple[Click, ...]) -> float:
    """The overlap (IoU) of the answer with what is meant that is to be expected, in [0, 1].

    What else may be meant says one half of it, and the other how well the pieces along the outline
    agree with the vote of their like: a wedge of sky is like the sky beside it. The weights are
    fitted to the answers of docs/selection.md, on the half of the things that was seen.
    """
    pieces = ground.pieces
    chance = np.clip(expected_overlap(ground, answer, clicks), 0.02, 0.98)
    agreement = _agreement(pieces, pieces.mean(answer.mask) > 0.5)
    odds = SURE[0] + SURE[1] * np.log(chance / (1 - chance))
    return float(1 / (1 + np.exp(-odds - SURE[2] * agreement)))


def _agreement(pieces: Pieces, mask: Mask) -> float:
    """How well pieces (n,) along their outline agree with the votes of their like, in [0, 1]."""
    cut = mask[pieces.left] != mask[pieces.right]
    if not cut.any():
        return 0.5
    edge = np.unique(np.concatenate([pieces.left[cut], pieces.right[cut]]))
    chance = votes(pieces, mask)[edge]
    return float(np.where(mask[edge], chance, 1 - chance).mean())


def vote(ground: PieceGround, prompt: Prompt, choice: PieceChoice) -> PieceChoice:
    """Answer a first click by votes: its pieces are decided anew by similar ones."""
    known = said(ground.pieces, prompt, True)
    voted = relabel(ground.pieces, choice.pieces, known) & ground.inside(prompt)
    return replace(choice, pieces=voted)


def _band(pieces: Pieces) -> int:
    """px within which the edge is looked for around that of pieces."""
    return int(np.clip(round(OFF_EDGE * pieces.side), 2, BAND))


def _tidy(mask: Mask, small: Prompt, near: Mask | None = None) -> Mask:
    """Without specks, with its clicks; `small`: the prompt in px of the reduced photo.

    Islands that no click touches go; after a click that changes what is in `near` (h, w) those
    stay that are elsewhere, or large.
    """
    mask = mask.copy()
    for click in small.clicks:
        mask[int(click.y), int(click.x)] = click.is_foreground
    kept = keep_touched(mask, small)
    if near is not None:
        _, labels, stats, _ = cv2.connectedComponentsWithStats((mask & ~kept).astype(np.uint8))
        stays = stats[:, cv2.CC_STAT_AREA] >= ISLAND * kept.sum()
        stays |= ~np.isin(np.arange(len(stats)), labels[near])
        stays[0] = False
        kept = kept | stays[labels]
    return fill_small_holes(kept, small)


def _clicked(small: Prompt, shape: tuple[int, ...]) -> Mask:
    """(h, w) the px of clicks, of a prompt in px of the reduced photo."""
    clicked = np.zeros(shape[:2], bool)
    for click in small.clicks:
        clicked[int(click.y), int(click.x)] = True
    return clicked


def _reduced(pieces: Pieces, prompt: Prompt) -> Prompt:
    """The prompt with its clicks in px of the reduced photo."""
    clicks = tuple(Click(*pieces.pixel(c.x, c.y), c.is_foreground) for c in prompt.clicks)
    return replace(prompt, clicks=clicks)
