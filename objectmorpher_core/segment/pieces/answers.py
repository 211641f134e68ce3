"""A prompt's clicks one after the other: each changes the mask around it, and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import RGB, Mask
from ...document.model import Click, Prompt
from ..matting.edges import BAND, sharpen_band
from ..selection import SMALLEST, fill_small_holes, is_bounded, keep_touched
from .choice import PieceChoice, PieceGround, PieceRegion
from .correcting import said, wrong
from .pieces import Pieces
from .relabel import relabel, votes

OFF_EDGE = 0.4  # x side of a piece: how far its border may be off the picture's edge
NEARBY = 6  # px of the reduced photo beyond what a click changes where the edge is found anew
SHARPNESS = 3.0  # exponent: how much more a better region is likely to be meant than another
BLUR = 1.0  # px of the reduced photo, how far the outline found may be from the one meant
SURE = (-4.3, 0.5, 5.6)  # log odds of the IoU: alone, x those expected, x agreement; fitted
ISLAND = 0.2  # x area of what clicks touch; smaller islands that a click cuts off go
DIAGONAL = 0.79  # pi / 4: px of an outline for each step of its staircase, all directions alike


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
    mask = _tidy(mask, _reduced(pieces, prompt))
    if whole is not None:
        nested = mask & whole if prompt.level == "part" else mask | whole
        mask = whole if nested.all() or nested.sum() < SMALLEST else nested
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


def _reduced(pieces: Pieces, prompt: Prompt) -> Prompt:
    """The prompt with its clicks in px of the reduced photo."""
    clicks = tuple(Click(*pieces.pixel(c.x, c.y), c.is_foreground) for c in prompt.clicks)
    return replace(prompt, clicks=clicks)
