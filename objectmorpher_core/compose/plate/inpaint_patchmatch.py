"""Fills a hole with patches of its surroundings (PatchMatch, Barnes et al. 2009; no weights).

The search runs on a small picture of the hole and its surroundings, which keeps any photo's time
bounded (`completion`); the detail is the photo's own (`patch_detail`). What it is guided by:
straight edges that go on behind the hole, the regions beside it, what its surroundings are like,
and the user's hints.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ...base.arrays import F32, Mask, Pixels
from ...base.progress import Progress, part
from ...document.settings import Hint
from .. import InpaintError
from .completion import Completion, complete, shrunk, smooth
from .patch_detail import with_detail
from .sources import Guide, Regions, unlikely
from .structure_lines import find_lines

SEARCH_PIXELS = 100_000  # of the small picture
MARGIN = 0.6  # x the hole's longer side, the surroundings that are copied from
MIN_MARGIN = 32  # px
DOUBT = 0.3  # of the way from what was found to the smooth mean of what is around
COARSE = 6.0  # px of the small picture, standard deviation: what is finer is not in doubt


class PatchMatchInpainter:
    """The default inpainter: textures and straight edges go on, nothing is understood."""

    name = "patchmatch"
    is_random = True

    def missing(self) -> str | None:
        """Why this backend cannot run here: it always can."""
        return None

    def inpaint(self, rgb: Pixels, hole: Mask, progress: Progress, seed: int = 0) -> Pixels:
        """`rgb` (h, w, 3) with its hole filled; the same bytes outside. Raises InpaintError."""
        return self.inpaint_from(rgb, hole, (), progress, seed)

    def inpaint_from(
        self,
        rgb: Pixels,
        hole: Mask,
        hints: tuple[Hint, ...],
        progress: Progress,
        seed: int = 0,
    ) -> Pixels:
        """Fill like `inpaint`, from the sources that the user chose, in px of `rgb`."""
        if hole.all():
            raise InpaintError("the hole covers everything: there is nothing to fill it from")
        filled = rgb.copy()
        if not hole.any():
            return filled
        progress(0.0, "Filling in the background")
        rows, columns = window = _window(hole, hints)
        crop, hole = rgb[window], hole[window]
        hints = tuple(hint.moved(-columns.start, -rows.start) for hint in hints)
        completion = _completed(crop, hole, hints, seed, part(progress, 0.0, 0.8))
        progress(0.8, "Copying the details")
        filled[window] = with_detail(crop, hole, completion.colors, completion.sources)
        progress(1.0, "Filled the background")
        return filled


def _window(hole: Mask, hints: tuple[Hint, ...]) -> tuple[slice, slice]:
    """Rows and columns of the hole and the surroundings that it is filled from."""
    rows, columns = np.flatnonzero(hole.any(1)), np.flatnonzero(hole.any(0))
    longer = max(np.ptp(rows), np.ptp(columns)) + 1
    margin = max(MIN_MARGIN, round(MARGIN * longer))
    height, width = hole.shape
    return (
        _reach(rows, margin, [(hint.source[1], hint.radius) for hint in hints], height),
        _reach(columns, margin, [(hint.source[0], hint.radius) for hint in hints], width),
    )


def _reach(own: np.ndarray, margin: int, discs: list[tuple[float, float]], size: int) -> slice:
    """From the first to the last of a hole's `own` px and of discs (middle, radius), in 0..size."""
    first = min([own[0] - margin, *(int(middle - radius) for middle, radius in discs)])
    last = max([own[-1] + margin, *(int(middle + radius) for middle, radius in discs)])
    return slice(max(int(first), 0), min(int(last) + 1, size))


def _completed(
    crop: Pixels, hole: Mask, hints: tuple[Hint, ...], seed: int, progress: Progress
) -> Completion:
    """The small picture of a crop (h, w, 3), filled."""
    height, width = hole.shape
    shrink = min(1.0, (SEARCH_PIXELS / hole.size) ** 0.5)
    size = max(1, round(width * shrink)), max(1, round(height * shrink))
    known, unit = (~hole).astype(np.float32), np.iinfo(crop.dtype).max / 255
    small, known = shrunk(crop, known, size, unit)
    scale = size[0] / width, size[1] / height
    guide = _guide(small, known, tuple(hint.moved(0, 0, scale) for hint in hints))
    completion = complete(small, known, guide, seed, progress)
    hole = completion.hole
    guess = smooth(small, (~hole).astype(np.float32))
    return replace(completion, colors=_drawn_to(completion.colors, guess, hole))


def _drawn_to(colors: F32, guess: F32, hole: Mask) -> F32:
    """Colours (h, w, 3) of a filled hole (h, w), their lowest frequencies nearer to a `guess`.

    What patches say of large areas is one of many answers. Between it and the smooth mean of what
    is around lies, on average, less of an error than at either; detail and edges stay.
    """
    depth = cv2.distanceTransform(hole.astype(np.uint8), cv2.DIST_L2, 5)
    share = np.float32(DOUBT) * np.clip(depth / np.float32(COARSE), 0, 1)[..., None]
    gap = cv2.GaussianBlur(guess - colors, (0, 0), COARSE)
    return np.asarray(np.clip(colors + share * gap, 0, 255), np.float32)


def _guide(small: F32, known: F32, hints: tuple[Hint, ...]) -> Guide:
    """What guides the filling of a picture (h, w, 3) that is `known` (h, w) in [0, 1]."""
    hole = known < min(0.5, float(known.max()))
    guess = smooth(small, (~hole).astype(np.float32))
    lines = find_lines(guess, hole)
    return Guide(unlikely(guess, hole), lines, hints, regions=find_regions(small, hole))


# The regions beside a hole go on behind it: ground under ground, house behind house.

REGIONS = 12
LOOK = 5.0  # px, standard deviation, over which a place's colour is taken; its roughness over twice
ROUGH = 1.5  # x a colour channel's weight, of the roughness
PLACE = 0.5  # x the spread of the looks: what the root of the hole's area weighs beside it
SAMPLES, ROUNDS = 8_000, 30  # places that are parted into regions, and in how many steps
ACROSS = 3.0  # x so near is what lies beside: most of a photo lies in layers
UNLIKE = 20.0  # levels of CIE Lab between regions that are hardly of one kind
REGION_COST = 4000.0  # squared levels of 255 that a source of wholly another kind costs


def find_regions(rgb: F32, hole: Mask) -> Regions:
    """The regions of a picture (h, w, 3) of levels up to 255, continued behind its hole (h, w).

    A place in the hole is of all the regions around it, of the nearer ones the more.
    """
    known = (~hole).astype(np.float32)
    looks = _looks(rgb, known)
    rows, columns = np.mgrid[: hole.shape[0], : hole.shape[1]].astype(np.float32)
    places = np.dstack([rows, columns]) / np.sqrt(max(hole.sum(), 1))
    spread = np.linalg.norm(looks[~hole].std(0))
    features = np.dstack([looks, PLACE * spread * places])
    samples = np.ascontiguousarray(features[~hole][:: (~hole).sum() // SAMPLES + 1], np.float32)
    cv2.setRNGSeed(0)
    stop = (cv2.TERM_CRITERIA_MAX_ITER, ROUNDS, 0.0)
    count, way = min(REGIONS, len(samples)), cv2.KMEANS_PP_CENTERS
    _, _, centers = cv2.kmeans(samples, count, None, stop, 1, way)  # type: ignore[call-overload]
    number = np.stack([((features - c) ** 2).sum(-1) for c in centers]).argmin(0)
    own = np.asarray(number[..., None] == np.arange(count), np.float32)
    height, width = hole.shape
    small, share = shrunk(own, known, (max(round(width / ACROSS), 1), height))
    wide = [
        cv2.resize(each, (width, height))
        for each in cv2.split(smooth(small, (share > 0.5 * share.max()).astype(np.float32)))
    ]
    kinds = np.linalg.norm(centers[:, None, :4] - centers[None, :, :4], axis=-1) / UNLIKE
    cost = np.where(hole[..., None], np.dstack(wide), own) @ (1 - np.exp(-(kinds**2)))
    cost -= cost.min(-1, keepdims=True)
    return Regions(number.astype(np.float32), np.asarray(REGION_COST * cost, np.float32))


def _looks(rgb: F32, known: F32) -> F32:
    """(h, w, 4) the colour of what is `known` (h, w) around each place, and how rough it is."""
    lab = cv2.cvtColor(np.clip(rgb, 0, 255).astype(np.float32) / 255, cv2.COLOR_RGB2LAB)
    colour = _mean(np.asarray(lab, np.float32), known, LOOK)
    steps = np.abs(lab[..., :1] - colour[..., :1])
    return np.dstack([colour, ROUGH * _mean(steps, known, 2 * LOOK)])


def _mean(values: F32, known: F32, sigma: float) -> F32:
    """(h, w, C) of values (h, w, C) around each place."""
    share = np.maximum(cv2.GaussianBlur(known, (0, 0), sigma), np.float32(1e-3))
    means = [cv2.GaussianBlur(v * known, (0, 0), sigma) / share for v in cv2.split(values)]
    return np.asarray(np.dstack(means), np.float32)
