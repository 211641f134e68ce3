"""Which region of pieces is meant: by a first click, a box or the subject, and by a correction.

Regions grow around the click; the best has strong contrast across its outline, agrees with the
subject map, leaves the photo's frame free, and has the click near its middle. A first click on a
part means the whole; a correction means the part around it that the outline got wrong. What a
correction means may show better from the other side: what grows around a click that says the
contrary may have the clearer outline, and the rest is meant.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask
from ...document.model import Click, Prompt
from ..selection import SelectionError, free_mask, is_bounded
from .pieces import Pieces
from .relabel import islands, touching

CENTRED_WHOLE = 0.3  # exponent: how much a click is in the middle of the whole that it means
CENTRED_PART = 3.0  # the same of a part, and of a correction
MINOR_PART = 0.5  # exponent: how much a part is meant to be smaller than its whole
SMALLEST_PART = 0.01  # x object's area; less is texture
SMALLEST_PIECES = 2  # the same in pieces
MINOR_CORRECTION = 0.4  # how much a correction is meant to leave something
LARGER_CORRECTION = 0.05  # exponent: how much a larger correction is preferred
MINOR_FINE = 0.2  # the same two of a correction in finer pieces: one clicks the largest error,
LARGER_FINE = 0.3  # and there are many small things in a window that stand out
SHARP_WHOLE = 6.0  # exponent: how much more a better region is likely to be meant than another
SHARP_PART = 20.0
SHARP_CORRECTION = 6.0
LIKELY_GONE = 1.0  # exponent: how much what a click takes away is background by its like's vote
LIKELY_ADDED = 0.25  # the same of what a click adds, which may be like nothing selected so far
ALL_OF_IT = 0.05  # contrast, in place of an outline's, of all that a correction can reach
AGREEMENT = 1.5  # exponent: how much an outline should agree with the subject map
LARGER = 0.03  # exponent: how much a larger region is preferred
LARGER_BY_COLOR = 0.15  # the same without tokens: colours part an object's own parts, too
FREE_FRAME = 4.0  # exponent: how much what is not the subject should leave the frame free
SURE_SALIENCE = 0.9
SMALLEST_SUBJECT = 0.1  # x area of the subject's largest piece
LARGER_GROUP = 1.15  # x object's area: what is smaller is still the object
WORTH_A_GROUP = 0.85  # x object's score: a larger outline that stands out less is no group
LIKENESS = 0.95  # share of the object's own pieces that are typical of it
ALIKE = 2.0  # x how far a typical piece is from the object's mean: another is like it
LIKE_AREA = (0.05, 1.5)  # x object's area: less is a coincidence, more is what it stands on
SEEDS_IN_BOX = ((0.5, 0.5), (0.5, 0.3), (0.5, 0.7), (0.3, 0.5), (0.7, 0.5))  # x its size
SMALLEST_IN_BOX = 0.1  # x box's area; a smaller object would have had a smaller box


@dataclass(frozen=True, eq=False)
class PieceRegion:
    """Pieces that may be meant."""

    pieces: Mask  # (n,)
    score: float


@dataclass(frozen=True, eq=False)
class PieceChoice:
    """Pieces that are meant, and what else might have been."""

    pieces: Mask  # (n,)
    others: tuple[PieceRegion, ...]  # the best first

    @property
    def relative(self) -> tuple[PieceRegion, ...]:
        """The others, the best of them with the score 1."""
        best = max(max(region.score for region in self.others), 1e-9)
        return tuple(PieceRegion(region.pieces, region.score / best) for region in self.others)


@dataclass(frozen=True)
class Taste:
    """Exponents of what a part leaves of its whole, and of what it takes."""

    minor: float
    larger: float
    reach: float = 0.0  # px of all that may be meant, where that is more than what is allowed


@dataclass(frozen=True, eq=False)
class PieceGround:
    """A photo to choose from."""

    pieces: Pieces
    salience: F32 | None  # (h, w) subject map at the pieces' size
    is_of_large: bool = False  # of a large photo, or of a tile of one
    tokens: F32 | None = None  # (r, c, d) of the photo

    @property
    def larger(self) -> float:
        """Exponent: how much a larger region is preferred."""
        return LARGER_BY_COLOR if self.tokens is None else LARGER

    def free(self, prompt: Prompt) -> Mask:
        """(h, w) where the prompt lets what is meant be, at the pieces' size."""
        height, width = self.pieces.shape
        fine = free_mask(self.pieces.photo_shape, prompt).astype(np.float32)
        return cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA) > 0.5

    def inside(self, prompt: Prompt) -> Mask:
        """(n,) pieces most of which may be meant, and those of positive clicks."""
        pieces = self.pieces
        if not is_bounded(prompt):
            return np.ones(pieces.count, bool)
        inside = pieces.mean(self.free(prompt)) > 0.5
        for click in prompt.clicks:
            if click.is_foreground:
                inside[pieces.at(click.x, click.y)] = True
        return inside


@dataclass(frozen=True, eq=False)
class Correction:
    """A click on a wrong place, and what may change by it."""

    click: Click
    allowed: Mask  # (n,) the pieces that may change
    walls: tuple[int, ...] = ()  # the pieces of clicks that say the contrary: none of them changes
    chance: F64 | None = None  # (n,) how likely each piece is what the click says, by its like
    taste: Taste = Taste(MINOR_CORRECTION, LARGER_CORRECTION)
    guess: Mask | None = None  # (n,) what the click may mean, too

    def piece(self, ground: PieceGround) -> int:
        """The one that the click is on."""
        return ground.pieces.at(self.click.x, self.click.y)

    def free(self, ground: PieceGround) -> Mask:
        """(n,) what may change, with the click's own piece."""
        return self.allowed | only(ground.pieces, self.piece(ground))

    def others(self, ground: PieceGround) -> tuple[int, ...]:
        """The walls but the click's own piece."""
        piece = self.piece(ground)
        return tuple(wall for wall in self.walls if wall != piece)


def choose(ground: PieceGround, prompt: Prompt) -> PieceChoice:
    """Choose by the first click, the box or the subject, before further clicks."""
    inside = ground.inside(prompt)
    first = next((c for c in prompt.clicks if c.is_foreground), None)
    if prompt.is_subject:
        return _subjects(ground, inside)
    if first is None:
        return _in_box(ground, inside)
    whole = _around_click(ground, first, inside)
    if prompt.level == "part":
        return _part(ground, first, whole)
    if prompt.level == "group":
        group = _group(ground, first, whole.pieces) & inside
        return PieceChoice(group, (*whole.others, PieceRegion(group, whole.others[0].score)))
    return whole


def correct(ground: PieceGround, ask: Correction) -> PieceChoice:
    """The part of the pieces it may change that a click on a wrong place means."""
    regions = [*_parts(ground, ask), *_left_over(ground, ask)]
    if ask.guess is not None:
        regions.append(_guessed(ground, ask, ask.guess))
    regions = _likeliest(ground.pieces, regions, SHARP_CORRECTION)
    return PieceChoice(regions[0].pieces, tuple(regions))


def _around_click(ground: PieceGround, click: Click, inside: Mask) -> PieceChoice:
    """The whole object that a click is on."""
    pieces, piece = ground.pieces, ground.pieces.at(click.x, click.y)
    growth = pieces.grow(piece) if inside.all() else pieces.grow(piece, inside)
    masks = [pieces.region(growth, k) for k in growth.peaks()]
    subject = _subject_around(ground, piece)
    if subject is not None:
        subject = subject * inside
        masks.append(subject > 0.5)
    regions = [
        PieceRegion(
            mask, _score(ground, mask, subject) * centred(pieces, mask, click) ** CENTRED_WHOLE
        )
        for mask in masks
        if mask[piece] and not mask.all()
    ]
    if not regions:
        raise SelectionError("nothing stands out there: draw a box or add clicks")
    regions = _likeliest(pieces, regions, SHARP_WHOLE)
    chosen = regions[0].pieces
    if subject is not None:
        settled = _settle(pieces, chosen, subject)
        chosen = settled if settled[piece] else chosen
    return PieceChoice(chosen, tuple(regions))


def _part(ground: PieceGround, click: Click, whole: PieceChoice) -> PieceChoice:
    """The part of a whole that a click is on; the whole where it has none."""
    pieces = ground.pieces
    least = max(SMALLEST_PART * pieces.share(whole.pieces), SMALLEST_PIECES / pieces.count)
    regions = _parts(ground, Correction(click, whole.pieces, taste=Taste(MINOR_PART, 0.0)))
    regions = [region for region in regions if pieces.share(region.pieces) > least]
    if not regions:
        return whole
    regions = _likeliest(pieces, regions, SHARP_PART)
    return PieceChoice(regions[0].pieces, tuple(regions))


def _parts(ground: PieceGround, ask: Correction) -> list[PieceRegion]:
    """The parts of what is allowed around a click."""
    pieces, piece = ground.pieces, ask.piece(ground)
    growth = pieces.grow(piece, ask.free(ground), ask.others(ground))
    return [_rated(ground, ask, pieces.region(growth, k)) for k in growth.peaks()]


def _left_over(ground: PieceGround, ask: Correction) -> list[PieceRegion]:
    """What is left around a click of what is allowed by each part of it around one of `walls`."""
    pieces, piece = ground.pieces, ask.piece(ground)
    alone, free, others = only(pieces, piece), ask.free(ground), ask.others(ground)
    regions = []
    for wall in others:
        if not free[wall]:
            continue
        growth = pieces.grow(wall, free, (piece,))
        for k in growth.peaks():
            rest = touching(pieces, free & ~pieces.region(growth, k), alone)
            if not rest[list(others)].any():
                regions.append(_rated(ground, ask, rest))
    return regions


def _guessed(ground: PieceGround, ask: Correction, guess: Mask) -> PieceRegion:
    """What of a guess (n,) hangs together with a click and is allowed."""
    pieces = ground.pieces
    alone = only(pieces, ask.piece(ground))
    free = guess & ask.allowed
    free[list(ask.walls)] = False
    return _rated(ground, ask, touching(pieces, free | alone, alone))


def _rated(ground: PieceGround, ask: Correction, mask: Mask) -> PieceRegion:
    """Pieces (n,), and how much a click on a place within what is allowed means just them."""
    pieces, allowed, taste = ground.pieces, ask.free(ground), ask.taste
    cut = (mask[pieces.left] != mask[pieces.right]) & allowed[pieces.left] & allowed[pieces.right]
    share = pieces.area[mask].sum() / max(pieces.area[allowed].sum(), taste.reach)
    contrast, left = ALL_OF_IT, 1.0
    if cut.any():
        contrast = (pieces.gap * pieces.length)[cut].sum() / pieces.length[cut].sum()
        left = max(1 - share, 1e-3)
    score = contrast * centred(pieces, mask, ask.click) ** CENTRED_PART
    score *= share**taste.larger * left**taste.minor
    if ask.chance is not None:
        likely = LIKELY_ADDED if ask.click.is_foreground else LIKELY_GONE
        score *= np.average(ask.chance[mask], weights=pieces.area[mask]) ** likely
    return PieceRegion(mask, float(score))


def _likeliest(pieces: Pieces, regions: list[PieceRegion], sharpness: float) -> list[PieceRegion]:
    """The regions, those first whose overlap (IoU) with what is meant is expected to be largest.

    Each may be meant, the more the better its score: a region like several good ones is a safer
    answer than the best one that none is like.
    """
    masks = np.array([region.pieces for region in regions], np.float64)
    weights = np.array([region.score for region in regions]) + 1e-12
    weights = (weights / weights.max()) ** sharpness
    both = (masks * pieces.area) @ masks.T
    areas = np.diag(both)
    overlaps = both / np.maximum(areas[:, None] + areas - both, 1e-9)
    expected = overlaps @ weights
    return [regions[k] for k in np.argsort(-expected, kind="stable")]


def _group(ground: PieceGround, click: Click, whole: Mask) -> Mask:
    """(n,) `whole` with what it stands with, and with what is like it elsewhere in the photo."""
    pieces = ground.pieces
    growth = pieces.grow(pieces.at(click.x, click.y))
    larger = [pieces.region(growth, k) | whole for k in growth.peaks()]
    larger = [m for m in larger if pieces.share(m) > LARGER_GROUP * pieces.share(whole)]
    plain = replace(ground, salience=None)
    scored = [(_score(plain, mask, None), k) for k, mask in enumerate(larger) if not mask.all()]
    best, k = max(scored, default=(0.0, -1))
    group = larger[k] if best > WORTH_A_GROUP * _score(plain, whole, None) else whole
    gap = np.square(pieces.features - pieces.features[whole].mean(0)).sum(-1)
    like = (gap <= ALIKE * np.quantile(gap[whole], LIKENESS)) & ~whole
    for island in islands(pieces, like):
        if LIKE_AREA[0] < pieces.share(island) / pieces.share(whole) < LIKE_AREA[1]:
            group = group | island
    return group


def _subjects(ground: PieceGround, inside: Mask) -> PieceChoice:
    """The photo's subject: what hangs together with the inmost place of each of its pieces."""
    if ground.salience is None or ground.salience.max() <= 0.5:
        raise SelectionError("no subject stands out in this photo: click the object")
    salient = (ground.salience > 0.5) & ground.pieces.paint(inside)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(salient.astype(np.uint8))
    if count == 1:
        raise SelectionError("no subject stands out in the box: click the object")
    largest = stats[1:, cv2.CC_STAT_AREA].max()
    (height, width), (tall, wide) = ground.pieces.shape, ground.pieces.photo_shape
    choices = []
    for k in range(1, count):
        if stats[k, cv2.CC_STAT_AREA] >= SMALLEST_SUBJECT * largest:
            inmost = depth(labels == k)
            row, column = np.unravel_index(int(inmost.argmax()), inmost.shape)
            place = (float(column) + 0.5) * wide / width, (float(row) + 0.5) * tall / height
            choices.append(_around_click(ground, Click(*place), inside))
    together = np.any([choice.pieces for choice in choices], axis=0)
    others = choices[0].others if len(choices) == 1 else (PieceRegion(together, 1.0),)
    return PieceChoice(together, others)


def _in_box(ground: PieceGround, inside: Mask) -> PieceChoice:
    """The object that a box encloses: it reaches the box's sides and does not go beyond them."""
    pieces = ground.pieces
    if not inside.any():
        raise SelectionError("the box is too small to hold an object: draw a larger one")
    box = extent(pieces, inside)
    subject = None if ground.salience is None else pieces.mean(ground.salience) * inside
    candidates: list[tuple[float, Mask]] = []  # leak, pieces
    smallest = SMALLEST_IN_BOX * pieces.share(inside)
    if subject is not None and pieces.share(subject > 0.5) > smallest:
        candidates.append((0.0, subject > 0.5))
    else:
        subject = None
    for across, down in SEEDS_IN_BOX:
        place = box[0] + across * (box[2] - box[0]), box[1] + down * (box[3] - box[1])
        seed = int(pieces.labels[int(place[1]), int(place[0])])
        for growth in (pieces.grow(seed), pieces.grow(seed, inside | only(pieces, seed))):
            for k in growth.peaks():
                region = pieces.region(growth, k)
                within = region & inside
                if pieces.share(within) > smallest and not within.all():
                    leak = 1 - pieces.share(within) / pieces.share(region)
                    candidates.append((leak, within))

    def score(leak: float, mask: Mask) -> float:
        left, top, right, bottom = extent(pieces, mask)
        reach = (right - left) * (bottom - top) / ((box[2] - box[0]) * (box[3] - box[1]))
        return (1 - leak) * reach**0.5 * _score(ground, mask, subject, is_boxed=True)

    regions = [PieceRegion(mask, score(leak, mask)) for leak, mask in candidates]
    if not regions:
        return PieceChoice(inside, (PieceRegion(inside, 1.0),))
    regions.sort(key=lambda region: -region.score)
    chosen = regions[0].pieces
    if subject is not None:
        chosen = _settle(pieces, chosen, subject)
    return PieceChoice(chosen, tuple(regions))


def _score(ground: PieceGround, mask: Mask, subject: F64 | None, is_boxed: bool = False) -> float:
    """How much pieces (n,) are one whole object. `subject` (n,): the one that was clicked."""
    pieces = ground.pieces
    contrast = pieces.contrast(mask)
    if subject is not None:
        both = (np.minimum(mask, subject) * pieces.area).sum()
        either = (np.maximum(mask, subject) * pieces.area).sum()
        return float(contrast * (both / max(either, 1e-6)) ** AGREEMENT)
    share, frame = pieces.share(mask), pieces.frame[mask].sum()
    score = contrast * (1 - frame) ** FREE_FRAME * (1 - share**2) * share**ground.larger
    if ground.salience is not None and not is_boxed:  # another subject is not meant
        other = pieces.mean(ground.salience) * pieces.area
        score *= 1 - other[mask].sum() / max(other.sum(), 1.0)
    return float(score)


def _settle(pieces: Pieces, chosen: Mask, subject: F64) -> Mask:
    """(n,) the chosen pieces, decided anew where the subject map (n,) does not agree."""
    is_object = chosen & (subject > SURE_SALIENCE)
    is_ground = ~chosen & (subject < 1 - SURE_SALIENCE)
    if not (is_object.any() and is_ground.any()):
        return chosen
    return pieces.settle(is_object, is_ground) > 0.5


def _subject_around(ground: PieceGround, piece: int) -> F64 | None:
    """(n,) the subject map without what does not hang together with a piece; None off it."""
    pieces, salience = ground.pieces, ground.salience
    here = pieces.labels == piece
    if salience is None or salience[here].mean() <= 0.5:
        return None
    _, labels = cv2.connectedComponents((salience > 0.5).astype(np.uint8))
    found = np.bincount(labels[here & (labels > 0)])
    if not found.size:
        return None
    own = (labels == found.argmax()).astype(np.uint8)
    fringe = cv2.dilate(own, np.ones((9, 9), np.uint8)) > 0
    other = (labels > 0) & (own == 0)
    return pieces.mean(np.where(fringe & ~other, salience, np.where(other, 0, salience * 0.5)))


# Where pieces lie: how far they reach, and how deep in them a place is.

OFF_CENTRE = 0.05  # least that counts for being in the middle


def centred(pieces: Pieces, mask: Mask, click: Click) -> float:
    """Return how central a click is in pieces (n,): its depth in them over the greatest depth."""
    deep = depth(pieces.paint_sparsely(mask))
    column, row = (c // 2 for c in pieces.pixel(click.x, click.y))
    near = deep[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
    here = near.max() if near.size else 0.0
    return max(float(here / max(deep.max(), 1e-6)), OFF_CENTRE)


def depth(mask: Mask) -> F32:
    """(h, w) px to the edge of a mask; the frame is one."""
    framed = cv2.copyMakeBorder(mask.view(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    return np.asarray(cv2.distanceTransform(framed, cv2.DIST_L2, 3)[1:-1, 1:-1], np.float32)


def only(pieces: Pieces, piece: int) -> Mask:
    alone = np.zeros(pieces.count, bool)
    alone[piece] = True
    return alone


def extent(pieces: Pieces, mask: Mask) -> tuple[int, int, int, int]:
    """left, top, right, bottom px of the reduced photo that pieces (n,) reach."""
    painted = pieces.paint(mask)
    rows, columns = np.flatnonzero(painted.any(1)), np.flatnonzero(painted.any(0))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
