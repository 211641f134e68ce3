"""Random walk with restart over a grid of features, where its spread stops, and what is meant.

r = (D - a A)^-1 e: how often a walk that starts at the click visits each cell before it tires
(Grady 2006; Pan et al. 2004), with A_ij = exp(-d_ij / T), d_ij = |f_i - f_j|^2 / 2 between near
cells. log r falls slowly inside an object and drops at its border.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from ..base.arrays import F32, F64, RGB, Mask
from ..document.model import Click, Prompt
from .selection import SelectionError, free_mask

REACH = 2  # cells, Chebyshev: how far a step goes; beyond 1, so that a thin line is no wall
STAMINA = 0.999  # a: the chance that a walk goes on
LEVELS = 120  # outlines tried between the click's cell and all cells, growing by equal factors


@dataclass(frozen=True, eq=False)
class Region:
    """An outline around a click."""

    mask: Mask  # (h, w) cells
    contrast: float  # mean d across its outline; the photo's border does not count


class Walk:
    """Precomputed for a grid of features; `spread` and `regions` are then cheap."""

    def __init__(self, features: F32, temperature: float) -> None:
        height, width, _ = features.shape
        self.shape = (height, width)
        self.features = features
        cells = np.arange(height * width).reshape(height, width)
        rows, columns, weights = [], [], []
        for dy in range(REACH + 1):
            for dx in range(-REACH, REACH + 1):
                if (dy, dx) <= (0, 0):
                    continue
                a, b = _pairs(dy, dx)
                gap = _gap(features[a], features[b])
                rows.append(cells[a].ravel())
                columns.append(cells[b].ravel())
                weights.append(np.exp(-gap.ravel() / temperature) + 1e-9)
        triplet = (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns)))
        half = sparse.csr_matrix(triplet, shape=(cells.size, cells.size))
        links = half + half.T
        degrees = sparse.diags(np.asarray(links.sum(1)).ravel() + 1e-9)
        self._laplacian = (degrees - links).tocsc()
        self._solver = splu((degrees - STAMINA * links).tocsc())
        self._gap_x = _gaps_along_x(features)  # (h, w - 1)
        self._gap_y = _gaps_along_x(features.transpose(1, 0, 2)).T  # (h - 1, w)

    def only(self, cell: tuple[int, int]) -> F64:
        """(h, w) 1 at `cell` (row, column), 0 elsewhere."""
        alone = np.zeros(self.shape)
        alone[cell] = 1
        return alone

    def spread(self, sources: F64) -> F64:
        """(h, w) log of how much of `sources` (h, w) visits each cell."""
        visits = self._solver.solve(sources.ravel())
        return np.log(np.maximum(visits, 1e-30)).reshape(self.shape)

    def settle(self, is_object: Mask, is_ground: Mask) -> F64:
        """(h, w) chance that a walk from a cell meets the object before the ground, both (h, w)."""
        known = 1e6 * (is_object | is_ground).astype(np.float64).ravel() + 1e-9
        system = (self._laplacian + sparse.diags(known)).tocsc()
        target = np.where(is_object, 1.0, np.where(is_ground, 0.0, 0.5)).ravel()
        return splu(system).solve(known * target).reshape(self.shape)

    def contrast(self, mask: Mask, within: Mask | None = None) -> float:
        """Mean gap between the neighbours (h, w) that the outline of `mask` parts.

        With `within`, of the outline's stretches inside that mask only; 0 where there are none.
        """
        across_x, across_y = mask[:, 1:] != mask[:, :-1], mask[1:] != mask[:-1]
        if within is not None:
            across_x &= within[:, 1:] & within[:, :-1]
            across_y &= within[1:] & within[:-1]
        count = across_x.sum() + across_y.sum()
        total = self._gap_x[across_x].sum() + self._gap_y[across_y].sum()
        return float(total / max(count, 1))

    def regions(self, spread: F64, cell: tuple[int, int]) -> list[Region]:
        """The connected pieces around `cell` (row, column), from small to large."""
        found: list[Region] = []
        size = 0
        falling = np.sort(spread, axis=None)[::-1]
        ranks = np.unique(np.geomspace(1, falling.size, LEVELS).astype(int)) - 1
        for level in falling[ranks]:
            if level > spread[cell]:
                continue
            _, labels = cv2.connectedComponents((spread >= level).astype(np.uint8), connectivity=4)
            mask = labels == labels[cell]
            if mask.sum() > size and not mask.all():
                size = int(mask.sum())
                found.append(Region(mask, self.contrast(mask)))
        return found


def _gaps_along_x(features: F32) -> F64:
    """(h, w - 1) d across each border between neighbours, tolerant of a border one cell off.

    Half is d of the two neighbours, half the largest d of pairs up to three cells apart.
    """
    width = features.shape[1]
    near = _gap(features[:, 1:], features[:, :-1])
    far = near.copy()
    for before, after in ((1, 0), (0, 1), (1, 1)):
        left = np.maximum(np.arange(width - 1) - before, 0)
        right = np.minimum(np.arange(1, width) + after, width - 1)
        far = np.maximum(far, _gap(features[:, left], features[:, right]))
    return 0.5 * (near + far)


def _gap(a: F32, b: F32) -> F64:
    return 0.5 * np.square(a - b).sum(-1, dtype=np.float64)


def _pairs(dy: int, dx: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The two slices of a grid whose cells lie (dy >= 0, dx) apart."""
    near = slice(None, -dy or None)
    far = slice(dy, None)
    if dx >= 0:
        return (near, slice(None, -dx or None)), (far, slice(dx, None))
    return (near, slice(-dx, None)), (far, slice(None, dx))


# Which of the walk's outlines is the object: clicks, box and subject map -> one soft guess.
#
# Each positive click proposes outlines (`Walk.regions`), and the subject it stands on. The best has
# strong contrast across its outline, agrees with the subject map and leaves the photo's border
# free; so a click on a part chooses the whole. A negative click takes away the part that it is on.
# At the level "part" a click means just that part, at the level "group" what goes with the whole.

SIDE = 320  # px, the guess is a square over the whole photo, as the subject map is
UNSURE = 0.75  # cells, how far an outline of cells may be from the true one (standard deviation)
SURE_SALIENCE = 0.9
SMALLEST_PART = 0.02  # x object's area
MINOR = 1.5  # exponent: how much a negative click means a minor part
SMALLEST_SUBJECT = 0.1  # x area of the subject's largest piece
LARGER = 0.03  # exponent: how much a larger region is preferred
AGREEMENT = 1.5  # exponent: how much an outline should agree with the subject map
LARGER_GROUP = 1.15  # x object's area: what is smaller is still the object
WORTH_A_GROUP = 0.85  # x object's score: a larger outline that stands out less is no group
LIKENESS = 0.95  # share of the object's own cells that are as like it as another must be
LIKE_AREA = (0.05, 1.5)  # x object's area: less is a coincidence, more is what it stands on
SEEDS_IN_BOX = ((0.5, 0.5), (0.5, 0.3), (0.5, 0.7), (0.3, 0.5), (0.7, 0.5))  # x its size
SMALLEST_IN_BOX = 0.1  # x box's area; a smaller object would have had a smaller box


@dataclass(frozen=True, eq=False)
class ChoiceGround:
    """The ground of a choice."""

    walk: Walk  # crosses from part to part of an object
    inside: Mask  # (h, w) cells in the box
    salience: F32 | None  # (SIDE, SIDE) subject map
    least: float = 0.0  # x photo's area: what is around a click is larger


@dataclass(frozen=True, eq=False)
class Choice:
    """An object: cells (h, w), and the piece of the subject map (SIDE, SIDE) it is on, if any."""

    cells: Mask
    subject: F32 | None


def guess(
    walks: tuple[Walk, Walk],
    rgb: RGB,
    prompt: Prompt,
    salience: F32 | None,
    least: float = 0.0,
    boxed: F32 | None = None,
) -> F32:
    """(SIDE, SIDE) guess in [0, 1] that a place of the photo (H, W, 3) belongs to the object.

    The first of `walks` crosses from part to part of an object, the second stops at the borders of
    parts too. What a click is on covers more than `least` of the photo. `boxed` (SIDE, SIDE): the
    guess of a box without clicks, which they add to and take from.
    """
    walk, strict = walks
    inside = _to_cells(free_mask(rgb.shape, prompt).astype(np.float32), walk.shape) > 0.5
    wanted = [_cell(c, rgb, walk) for c in prompt.clicks if c.is_foreground]
    unwanted = [_cell(c, rgb, walk) for c in prompt.clicks if not c.is_foreground]
    for cell in wanted:
        inside[cell] = True
    ground = ChoiceGround(walk, inside, salience, least)
    choices = [_around_click(ground, cell) for cell in wanted]
    if prompt.is_subject:
        choices += _subjects(ground)
    elif boxed is None and not wanted:
        choices.append(_in_box(ground, strict))
    wholes = [_settle(strict, choice) for choice in choices]
    if prompt.level == "group":
        levelled = [_group(walk, *each) for each in zip(wanted, wholes, strict=False)]
    elif prompt.level == "part":
        levelled = [_clicked_part(strict, *each) for each in zip(wanted, wholes, strict=False)]
    else:
        levelled = wholes[: len(wanted)]
    nothing = np.zeros(walk.shape, bool)
    cells = np.any([nothing, *levelled, *wholes[len(wanted) :]], axis=0)
    is_finer = prompt.level != "part" or not wanted  # the subject map knows wholes, not parts
    subjects = [choice.subject for choice in choices if choice.subject is not None and is_finer]
    soft = _sharpen(cells, np.max(subjects, axis=0) if subjects else None)
    if boxed is not None:
        soft = np.maximum(soft, boxed)
        cells = cells | inside
    kept = inside.copy()
    for cell in unwanted:
        kept &= ~_part(strict, cell, wanted, cells)
    soft = np.minimum(soft, _soften(kept))
    for row, column in unwanted:
        centre = int((column + 0.5) * SIDE / walk.shape[1]), int((row + 0.5) * SIDE / walk.shape[0])
        cv2.circle(soft, centre, SIDE // max(walk.shape), (0.0,), -1)
    return soft


def _part(strict: Walk, cell: tuple[int, int], others: list[tuple[int, int]], whole: Mask) -> Mask:
    """(h, w) the part of `whole` that `cell` (row, column) is on, and none of the `others`.

    The one whose outline has the strongest contrast inside `whole`: the border that the user sees.
    """
    best = Region(strict.only(cell) > 0, 0.0)
    for region in strict.regions(strict.spread(strict.only(cell)), cell):
        share = (region.mask & whole).sum() / whole.sum()
        if share == 1 or any(region.mask[other] for other in others):
            break
        # Who corrects takes away a minor part, yet not a speck.
        contrast = strict.contrast(region.mask, whole) * (1 - share) ** MINOR
        if contrast > best.contrast and share > SMALLEST_PART:
            best = Region(region.mask, contrast)
    return best.mask


def _clicked_part(strict: Walk, cell: tuple[int, int], whole: Mask) -> Mask:
    """(h, w) the part of `whole` that `cell` (row, column) is on; all of it where it has none."""
    part = _part(strict, cell, [], whole) & whole
    return part if part.sum() > max(SMALLEST_PART * whole.sum(), 1) else whole


def _group(walk: Walk, cell: tuple[int, int], whole: Mask) -> Mask:
    """(h, w) `whole` with what it stands with, and with what is like it elsewhere in the photo."""
    larger = [
        region.mask | whole
        for region in walk.regions(walk.spread(walk.only(cell)), cell)
        if (region.mask | whole).sum() > LARGER_GROUP * whole.sum()
    ]
    scored = [(_score(Region(m, walk.contrast(m)), None, None), k) for k, m in enumerate(larger)]
    alone = _score(Region(whole, walk.contrast(whole)), None, None)
    best, k = max(scored, default=(0.0, -1))
    group = larger[k] if best > WORTH_A_GROUP * alone else whole
    gap = np.square(walk.features - walk.features[whole].mean(0)).sum(-1)
    like = (gap <= np.quantile(gap[whole], LIKENESS)) & ~whole
    count, labels, stats, _ = cv2.connectedComponentsWithStats(like.astype(np.uint8))
    for k in range(1, count):
        if LIKE_AREA[0] < stats[k, cv2.CC_STAT_AREA] / whole.sum() < LIKE_AREA[1]:
            group = group | (labels == k)
    return group


def _subjects(ground: ChoiceGround) -> list[Choice]:
    """The photo's subject: what hangs together with the inmost cell of each of its pieces."""
    if ground.salience is None or ground.salience.max() <= 0.5:
        raise SelectionError("no subject stands out in this photo: click the object")
    salient = (ground.salience > 0.5) & (_enlarge(ground.inside.astype(np.float32)) > 0.5)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(salient.astype(np.uint8))
    if count == 1:
        raise SelectionError("no subject stands out in the box: click the object")
    largest = stats[1:, cv2.CC_STAT_AREA].max()
    choices = []
    for k in range(1, count):
        if stats[k, cv2.CC_STAT_AREA] < SMALLEST_SUBJECT * largest:
            continue
        depth = cv2.distanceTransform((labels == k).astype(np.uint8), cv2.DIST_L2, 3)
        y, x = np.unravel_index(int(depth.argmax()), depth.shape)
        height, width = ground.walk.shape
        choices.append(_around_click(ground, (int(y * height / SIDE), int(x * width / SIDE))))
    return choices


def _around_click(ground: ChoiceGround, cell: tuple[int, int]) -> Choice:
    """The whole object that `cell` (row, column) is a part of."""
    walk, inside = ground.walk, ground.inside
    masks = [r.mask & inside for r in walk.regions(walk.spread(walk.only(cell)), cell)]
    subject = other = cells = None
    if ground.salience is not None:
        subject = _subject_piece(ground.salience, cell, walk.shape)
        if subject is None:
            other = _to_cells(ground.salience, walk.shape)
        else:
            subject = subject * _enlarge(inside.astype(np.float32))
            cells = _to_cells(subject, walk.shape)
            masks.append(cells > 0.5)
    regions = [Region(mask, walk.contrast(mask)) for mask in masks if mask.mean() > ground.least]
    if not regions:
        raise SelectionError("nothing stands out there: draw a box or add clicks")
    best = max(regions, key=lambda region: _score(region, cells, other))
    return Choice(best.mask, subject)


def _in_box(ground: ChoiceGround, strict: Walk) -> Choice:
    """The object that a box encloses: it reaches the box's sides and does not go beyond them."""
    inside = ground.inside
    if not inside.any():
        raise SelectionError("the box is too small to hold an object: draw a larger one")
    box = _extent(inside)
    subject = cells = None
    regions: list[tuple[float, Mask]] = []  # leak, mask
    if ground.salience is not None:
        subject = ground.salience * _enlarge(inside.astype(np.float32))
        cells = _to_cells(subject, inside.shape)
        if (cells > 0.5).sum() > SMALLEST_IN_BOX * inside.sum():
            regions.append((0.0, cells > 0.5))
        else:
            cells = subject = None
    for across, down in SEEDS_IN_BOX:
        cell = int(box[1] + down * (box[3] - box[1])), int(box[0] + across * (box[2] - box[0]))
        for walk in (ground.walk, strict):
            for region in walk.regions(walk.spread(walk.only(cell)), cell):
                within = region.mask & inside
                if within.sum() > SMALLEST_IN_BOX * inside.sum():
                    regions.append((1 - within.sum() / region.mask.sum(), within))

    def score(leak: float, mask: Mask) -> float:
        left, top, right, bottom = _extent(mask)
        reach = (right - left) * (bottom - top) / ((box[2] - box[0]) * (box[3] - box[1]))
        whole = _score(Region(mask, ground.walk.contrast(mask)), cells, None)
        return (1 - leak) * reach**0.5 * whole

    if not regions:
        return Choice(inside, None)
    return Choice(max(regions, key=lambda region: score(*region))[1], subject)


def _extent(mask: Mask) -> tuple[int, int, int, int]:
    """left, top, right, bottom cells of what is True in `mask` (h, w)."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    return columns[0], rows[0], columns[-1] + 1, rows[-1] + 1


def _score(region: Region, subject: F32 | None, other: F32 | None) -> float:
    """How much a region is one whole object. `subject`: clicked; `other`: not clicked; (h, w)."""
    mask = region.mask
    if subject is not None:
        both, either = np.minimum(mask, subject).sum(), np.maximum(mask, subject).sum()
        return float(region.contrast * (both / max(either, 1e-6)) ** AGREEMENT)
    border = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]]).mean()
    score = region.contrast * (1 - border**2) * (1 - mask.mean() ** 2)
    if other is not None:
        score *= 1 - (other * mask).sum() / max(other.sum(), 1.0)
    return float(score * mask.mean() ** LARGER)


def _subject_piece(salience: F32, cell: tuple[int, int], shape: tuple[int, int]) -> F32 | None:
    """The subject map without what does not hang together with the click; None off the subject."""
    y = int((cell[0] + 0.5) * SIDE / shape[0])
    x = int((cell[1] + 0.5) * SIDE / shape[1])
    if salience[y, x] <= 0.5:
        return None
    _, labels = cv2.connectedComponents((salience > 0.5).astype(np.uint8))
    piece = (labels == labels[y, x]).astype(np.uint8)
    fringe = cv2.dilate(piece, np.ones((9, 9), np.uint8))
    other = (labels > 0) & (piece == 0)
    return np.where((fringe == 1) & ~other, salience, np.where(other, 0, salience * 0.5))


def _settle(strict: Walk, choice: Choice) -> Mask:
    """(h, w) the chosen cells, decided anew where the subject map does not agree.

    Walks from there meet either what both agree is the object, or what both agree is not.
    """
    if choice.subject is None:
        return choice.cells
    salience, soft = _to_cells(choice.subject, choice.cells.shape), _blur(choice.cells)
    is_object = (soft > 0.9) & (salience > SURE_SALIENCE)
    is_ground = (soft < 0.1) & (salience < 1 - SURE_SALIENCE)
    if not (is_object.any() and is_ground.any()):
        return choice.cells
    return strict.settle(is_object, is_ground) > 0.5


def _sharpen(cells: Mask, subject: F32 | None) -> F32:
    """(SIDE, SIDE) guess from cells (h, w): the finer subject map draws the outline."""
    soft = _soften(cells)
    if subject is None:
        return soft
    # Where it contradicts whole cells it knows nothing, and does not draw their outline either.
    wrong = np.abs(_to_cells(subject, cells.shape) - cells) > 0.6
    wrong &= (_blur(cells) > 0.9) | (_blur(cells) < 0.1)
    around = cv2.dilate(wrong.astype(np.uint8), np.ones((5, 5), np.uint8))
    trust = 1 - _soften(around > 0)
    unsure = np.clip(soft + 0.5 * trust * (subject - soft), 0.1, 0.9)
    sure = trust > 0.5
    is_object = (soft > 0.97) | (sure & (soft > 0.5) & (subject > SURE_SALIENCE))
    is_ground = (soft < 0.03) | (sure & (soft < 0.5) & (subject < 1 - SURE_SALIENCE))
    return np.where(is_object, 1, np.where(is_ground, 0, unsure)).astype(np.float32)


def _blur(mask: Mask) -> F32:
    """(h, w) mask of cells with an outline as unsure as the cells are coarse."""
    image = mask.astype(np.float32)
    soft = cv2.GaussianBlur(image, (0, 0), UNSURE, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(soft, np.float32)


def _soften(mask: Mask) -> F32:
    """`_blur` of the cells (h, w) at (SIDE, SIDE)."""
    return np.clip(_enlarge(_blur(mask)), 0, 1)


def _enlarge(cells: F32) -> F32:
    return np.asarray(cv2.resize(cells, (SIDE, SIDE), interpolation=cv2.INTER_LINEAR), np.float32)


def _to_cells(image: F32, shape: tuple[int, int]) -> F32:
    size = (shape[1], shape[0])
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.float32)


def _cell(click: Click, rgb: RGB, walk: Walk) -> tuple[int, int]:
    """(row, column) of the cell under a click."""
    height, width = rgb.shape[:2]
    return int(click.y * walk.shape[0] / height), int(click.x * walk.shape[1] / width)
