"""Alpha at the edge of a hard mask, found from coarse to fine.

How wide the edge is nobody knows beforehand: a sharp one is two pixels, hair may be a hundred. So
the band is as wide as hair, and the farther a pixel is from the mask's edge, the more the picture
must say before it leaves its side, and the more yet where the colours on both sides are alike. That
is solved where the photo is small; at each larger size only what was found soft is looked at again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, Mask, Pixels, Selection
from ...base.threads import in_threads
from ..mask_edit import FULL, is_selected
from .closed_form import Expected, affine, applied, solve_alpha
from .halving import doubled, halved, halved_pixels, unit

COARSEST = 2.0  # px of band from which on it is not halved any more
WHOLE = 4.0  # px of band up to which all of it is solved for
ASTRAY = 0.7  # x band: how far a mask's edge may be from the true one
TUNED = 2.9  # px of band at which the weights below hold
BESIDE = 1e-3  # weight of the mask within ASTRAY of its edge
FAR = 0.3  # and at the band's end
CLEAR = 20.0  # variances that colours are apart: then the mask counts half as much
WINDOW = 3.0  # px, deviation of the window they are gathered in, at the size that takes
LEAST_SPREAD = 1e-4  # a variance of sRGB: a hundredth is never distinguished
RIDGE = 1.75  # px: half-width from which on the middle of a limb is certain
TAIL = 0.02  # alpha that is as good as none
POLISHED = 12.0  # px of band up to which the larger picture is solved for once more
HAZE = 0.5  # alpha that may be chance where the mask is clear about a pixel
PURE = 200.0  # variances that colours are apart: then half as much may
PLAIN = 0.3  # alpha on the mask's other side that is no chance
BEYOND = 1.0  # x band: from which on it is the other side
NEARBY = 2.0  # x band: how far such a pixel vouches for those around it
KEPT = 0.01  # weight of what the smaller picture gave
THIN = 5  # px: narrower parts may have been lost in the smaller picture
ROUNDS = (120, 60, 4)  # of conjugate gradients: coarsest size, whole band, fine sizes
TILE = 256  # px
OVERLAP = 12  # px, even, that a tile sees around itself
MARGIN = 8  # px, even, around that, in which it is found out what is open

Window = tuple[slice, slice]
WHOLE_PICTURE = (slice(None), slice(None))


@dataclass(frozen=True, eq=False)
class CropSize:
    """A crop at one of its sizes, and what is known of it."""

    pixels: np.ndarray  # (h, w, 3) the photo's own, or in [0, 1]
    band: float  # px: how far the mask's edge may be off, about
    mask: Mask  # (h, w)
    drawn: Mask  # (h, w) where alpha is the artist's
    coverage: np.ndarray  # (h, w) that alpha, u8 or in [0, 1]

    @staticmethod
    def of(pixels: Pixels, selection: Selection, drawn: Mask, band: float) -> CropSize:
        """A crop (h, w, 3) at its full size."""
        coverage = selection if drawn.any() else np.zeros(drawn.shape, np.uint8)
        return CropSize(pixels, band, is_selected(selection), drawn, coverage)

    def rgb(self, window: Window) -> F32:
        """A part of it, in [0, 1]."""
        return unit(self.pixels[window])

    def drawn_alpha(self, window: Window) -> F32:
        part = self.coverage[window]
        return part if part.dtype == np.float32 else part * np.float32(1 / FULL)

    def half(self) -> CropSize:
        pixels = halved_pixels(self.pixels)
        # What is thin stays, however small the picture.
        share, thin = (halved(m.view(np.uint8)) for m in (self.mask, _thin(self.mask, 3)))
        mask = (share >= 0.5) | (thin >= 0.25)
        if not self.drawn.any():
            nothing = np.zeros_like(mask)
            return CropSize(pixels, self.band / 2, mask, nothing, nothing.astype(np.float32))
        drawn = halved(self.drawn.view(np.uint8)) >= 0.5
        return CropSize(pixels, self.band / 2, mask, drawn, halved(self.drawn_alpha(WHOLE_PICTURE)))


def find_alpha(
    pixels: Pixels,
    selection: Selection,
    drawn: Mask,
    band: float,
    reach: float,
    trust: float = 1.0,
) -> F32:
    """Alpha (h, w) of what is selected in a crop (h, w, 3).

    `band` px is what the mask's edge may be off, about; within `reach` px of it alpha may be soft.
    Where it is `drawn` (h, w), alpha is the selection's own. `trust`: how much the mask counts.
    """
    sizes = [CropSize.of(pixels, selection, drawn, band)]
    while sizes[-1].band > COARSEST and min(drawn.shape) >> len(sizes) > 2 * THIN:
        sizes.append(sizes[-1].half())
    alpha: F32 | None = None
    small: CropSize | None = None
    for k in reversed(range(len(sizes))):
        size = sizes.pop()
        if alpha is None or small is None or size.band <= WHOLE:
            alpha = whole_band(size, reach * 0.5**k, alpha, trust)
        else:
            alpha = _sharper(size, alpha, small)
        small = size
    assert alpha is not None, "there is at least one size"
    return alpha


def whole_band(size: CropSize, reach: float, before: F32 | None, trust: float = 1.0) -> F32:
    """Alpha (h, w) of a small picture; `before` is that of half its size."""
    band = size.band
    distance = signed_distance(size.mask)
    ridge = distance >= cv2.dilate(distance, np.ones((3, 3), np.uint8)) - 0.25
    away = np.abs(distance)
    unknown = (away < reach) & ~(ridge & (distance > RIDGE)) & ~size.drawn
    astray = ASTRAY * band
    clearness = clearness_of(size.rgb(WHOLE_PICTURE), distance, reach)
    doubt = 1 / (1 + (clearness / CLEAR) ** 2)
    weight = BESIDE + FAR * doubt * np.clip((away - astray) / max(reach - astray, 0.5), 0, 1)
    weight *= trust * (TUNED / band) ** 2  # the same influence, over more pixels
    likely = np.clip(0.5 + distance / (2 * astray), 0, 1)
    alpha = np.where(unknown, likely, size.mask).astype(np.float32)
    alpha[size.drawn] = size.drawn_alpha(WHOLE_PICTURE)[size.drawn]
    start = alpha if before is None else doubled(before, alpha.shape)
    rounds = ROUNDS[0] if before is None else ROUNDS[1]
    expected = Expected(alpha, weight.astype(np.float32))
    solved = solve_alpha(size.rgb(WHOLE_PICTURE), unknown, expected, start, rounds)
    chance = HAZE / (1 + (clearness / PURE) ** 2)
    clear = _cleared(solved, distance, (astray, band), chance)
    return _cleaned(np.where(unknown, clear, solved), unknown)


def clearness_of(rgb: F32, distance: F32, reach: float) -> F32:
    """(h, w) how far apart the colours of object and background are nearby.

    In their variances, along the line between their means. Hair differs from a plain sky,
    whatever the mask says; from a shelf it does not.
    """
    height, width = distance.shape
    scale = min(WINDOW / reach, 1.0)
    size = (max(round(width * scale), 1), max(round(height * scale), 1))
    means, spreads = [], []
    for there in (distance > 0.5 * reach, distance < -reach):
        share = np.maximum(_near(there.astype(np.float32), size), 1e-9)[..., None]
        mean = _near(rgb * there[..., None], size) / share
        square = _near(rgb * rgb * there[..., None], size) / share
        means.append(mean)
        spreads.append(np.maximum(square - mean * mean, 0))
    apart = (means[0] - means[1]) ** 2
    length = apart.sum(2)
    spread = (apart * (spreads[0] + spreads[1])).sum(2) / np.maximum(length, 1e-9)
    clearness = length / (spread + LEAST_SPREAD)
    return np.asarray(cv2.resize(clearness, (width, height)), np.float32)


def _near(image: F32, size: tuple[int, int]) -> F32:
    """Mean of the surroundings, at a smaller `size`; where there is nothing, of what is farther."""
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    near, far = (cv2.GaussianBlur(small, (0, 0), k * WINDOW) for k in (1, 4))
    return np.asarray(near + 1e-6 * far, np.float32)


def _cleared(alpha: F32, distance: F32, widths: tuple[float, float], chance: F32) -> F32:
    """`alpha` (h, w) without the haze that chance likenesses leave beside a sharp edge.

    Where hair stands, or a wide blur, something nearby is surely on the mask's other side; haze is
    faint all over. So is a narrow blur's: but where the colours on both sides are far apart no
    likeness is. `chance` (h, w) is the alpha that may be one, `distance` (h, w) px the mask's,
    `widths` px what its edge may be off, and the band.
    """
    astray, band = widths
    away = np.abs(distance)
    strayed = np.where(away > BEYOND * band, np.abs(alpha - (distance > 0)), 0).astype(np.float32)
    square = np.ones((2 * round(NEARBY * band) + 1,) * 2, np.uint8)
    strongest = cv2.blur(cv2.dilate(strayed, square), square.shape)
    is_haze = np.clip(2 * (1 - strongest / PLAIN), 0, 1)
    haze = chance * is_haze * np.clip((away - astray) / band, 0, 1)
    cleared = np.where(distance < 0, alpha - haze, alpha) / (1 - haze)
    return np.asarray(np.clip(cleared, 0, 1), np.float32)


def _sharper(size: CropSize, before: F32, small: CropSize) -> F32:
    """Alpha (h, w), from that of half the size, `small`."""
    alpha = np.empty(size.mask.shape, np.float32)
    tiles = list(_tiles(alpha.shape))

    def solve(first: int, last: int) -> None:
        for tile in tiles[first:last]:
            alpha[tile] = _sharper_tile(size, small, before, tile)

    in_threads(solve, len(tiles), parts=4)
    return alpha


def _sharper_tile(size: CropSize, small: CropSize, before: F32, tile: Window) -> F32:
    """One tile of `_sharper`."""
    around = _wider(tile, OVERLAP, size.mask.shape)
    inner = _within(tile, around)
    alpha, is_open = _enlarged(size, before, around)
    if not is_open[inner].any():
        return alpha[inner]
    coarse = _halved_window(around)
    functions = affine(small.rgb(coarse), before[coarse])
    rgb = size.rgb(around)
    start = applied(functions, rgb, is_open, alpha)
    if size.band <= POLISHED:
        expected = Expected(alpha, np.full(start.shape, KEPT, np.float32))
        start = solve_alpha(rgb, is_open, expected, start, ROUNDS[2])
    return _cleaned(start, is_open)[inner]


def _enlarged(size: CropSize, before: F32, window: Window) -> tuple[F32, Mask]:
    """Alpha in a part (h, w) as half the size has it, and where that is open."""
    wide = _wider(window, MARGIN, size.mask.shape)
    coarse, mask, drawn = before[_halved_window(wide)], size.mask[wide], size.drawn[wide]
    inner = _within(window, wide)
    shape, value = mask.shape, coarse[0, 0]
    is_plain = value in (0, 1) and bool((coarse == value).all()) and mask.all() == mask.any()
    if is_plain and not drawn.any():
        nowhere = np.zeros(shape, np.bool_)[inner]
        return np.full(nowhere.shape, value, np.float32), nowhere
    square = np.ones((3, 3), np.uint8)
    soft = cv2.dilate(((coarse > 0) & (coarse < 1)).view(np.uint8), square)
    thin = cv2.dilate(_thin(mask, THIN).view(np.uint8), square) > 0
    unknown = np.repeat(np.repeat(soft, 2, 0), 2, 1)[: shape[0], : shape[1]] > 0
    unknown = (unknown | thin) & ~drawn
    alpha = doubled(coarse, shape)
    alpha = np.where(thin, mask, alpha)
    alpha = np.where(unknown, alpha, alpha >= 0.5).astype(np.float32)
    if drawn.any():
        alpha[drawn] = size.drawn_alpha(wide)[drawn]
    return np.ascontiguousarray(alpha[inner]), np.ascontiguousarray(unknown[inner])


def _cleaned(alpha: F32, unknown: Mask) -> F32:
    """`alpha` (h, w) without traces: what is next to nothing is nothing."""
    clean = np.clip((alpha - TAIL) / (1 - 2 * TAIL), 0, 1)
    return np.where(unknown, clean, alpha).astype(np.float32)


def _thin(mask: Mask, px: int) -> Mask:
    """(h, w) the parts of a mask that are narrower than `px`."""
    square = np.ones((px, px), np.uint8)
    return mask & ~cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_OPEN, square).view(np.bool_)


def _tiles(shape: tuple[int, ...]) -> Iterator[Window]:
    for y in range(0, shape[0], TILE):
        for x in range(0, shape[1], TILE):
            yield slice(y, min(y + TILE, shape[0])), slice(x, min(x + TILE, shape[1]))


def _wider(window: Window, px: int, shape: tuple[int, ...]) -> Window:
    """`window` and `px` around it, as far as a picture (h, w) goes."""
    rows, columns = (
        slice(max(s.start - px, 0), min(s.stop + px, n)) for s, n in zip(window, shape, strict=True)
    )
    return rows, columns


def _within(window: Window, around: Window) -> Window:
    """`window` as a part of one `around` it."""
    rows, columns = (
        slice(s.start - a.start, s.stop - a.start) for s, a in zip(window, around, strict=True)
    )
    return rows, columns


def _halved_window(window: Window) -> Window:
    """Of a window that begins at even px, what it is at half the size."""
    rows, columns = (slice(s.start // 2, (s.stop + 1) // 2) for s in window)
    return rows, columns


def signed_distance(mask: Mask) -> F32:
    """Distance in px (H, W) to the mask's edge, positive inside; the photo's frame is no edge."""
    padded = np.pad(mask, 1, mode="edge").astype(np.uint8)
    inside = cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1]
    outside = cv2.distanceTransform(1 - padded, cv2.DIST_L2, 5)[1:-1, 1:-1]
    return np.where(mask, inside - 0.5, 0.5 - outside).astype(np.float32)
