"""The colours of what the photo did not show: the back, the walls, and what was hidden.

Seen from the side, most things look the same from behind: their back is the mirror image of their
front. Of what looks the same left and right, a face, the mirror image is not what is behind it:
there the rim goes on, with its texture.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask, frozen
from ...base.kernel_files import numba
from .canvas import ReliefCanvas, bilinear
from .mirror import MirrorAxis
from .silhouette import ReliefSilhouette, inwardness

FINENESS = 3.0  # px to a mean spacing: more of the photo plain colours need not see
BLUR = 1.2  # x mean spacing: plain colours, so that neighbours agree
RIM_BLUR = 0.5  # x mean spacing, of the rim's texture
RIM = (0.08, 0.28)  # x local radius from the outline: where the rim's own texture ends
BACK_SIDE = 200  # px, longer side of the picture in which the rim's texture is grown
HIDDEN_SIDE = 400  # px, likewise for what was hidden
EVEN = 0.015  # x the root of the area, over which what replaces a fringe is evened
SURE = 0.95  # alpha from which a pixel is the object's


@dataclass(frozen=True, eq=False)
class Colouring:
    """Colour fields over the canvas, on pixels of their own."""

    corner: F64  # (2,) px in the photo
    step: F64  # (2,) px of the photo per px of the fields
    front: F32  # (h, w, 3) what the photo shows, continued where it shows nothing
    back: F32  # (h, w, 3)

    def sample(self, xy: F64, is_back: Mask) -> F32:
        """(N, 3) at photo px (N, 2), of the back where `is_back` (N,)."""
        at = (xy - self.corner) / self.step - 0.5
        colours = np.where(is_back[:, None], bilinear(self.back, at), bilinear(self.front, at))
        return np.clip(colours, 0, 1).astype(np.float32)


def colouring(
    canvas: ReliefCanvas, silhouette: ReliefSilhouette, spacing: float, is_mirrored: bool,
    axis: MirrorAxis | None,
) -> Colouring:  # fmt: skip
    """`spacing`: of the Gaussians, px. `axis`: of an object that looks the same left and right."""
    height, width = canvas.alpha.shape
    scale = min(1.0, FINENESS * canvas.step / spacing)
    size = max(1, round(scale * width)), max(1, round(scale * height))
    step = canvas.step * np.array([width, height]) / size
    corner = canvas.corner
    shown = (_resized(canvas.alpha, size) > SURE).astype(np.float32)
    cells = np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), -1)
    xy = (cells + 0.5) * step + corner
    depth = _depth(silhouette, xy)
    front = _continued(_resized(canvas.foreground, size), shown, depth, xy, axis)
    front = _without_fringe(front, _resized(inwardness(canvas.whole, canvas.foreground), size))
    spacing = spacing / float(step.mean())
    blurred = _blurred(front, BLUR * spacing)
    if is_mirrored:
        return Colouring(corner, step, blurred, blurred)
    rim = _grown(front, (depth > 0) & (depth < RIM[1]), depth >= RIM[1], BACK_SIDE)
    rim = _blurred(rim, RIM_BLUR * spacing)
    t = np.clip((depth - RIM[0]) / (RIM[1] - RIM[0]), 0, 1)[..., None]
    back = blurred + (t * t * (3 - 2 * t)) * (rim - blurred)
    return Colouring(corner, step, blurred, back.astype(np.float32))


def _without_fringe(front: F32, inward: F32) -> F32:
    """`front` (h, w, 3) with its fringe (`inward` (h, w) below 1) as what is farther in."""
    is_inner = inward >= 1
    if not is_inner.any():
        return front
    even = EVEN * float(np.sqrt(np.count_nonzero(is_inner)))
    weight = cv2.GaussianBlur(is_inner.astype(np.float32), (0, 0), even)
    own = cv2.GaussianBlur(front * is_inner[..., None], (0, 0), even)
    own /= np.maximum(weight, 1e-6)[..., None]
    own = fill_in(np.asarray(own, np.float32), is_inner)
    share = (inward * inward * (3 - 2 * inward))[..., None]
    return np.where(is_inner[..., None], front, own + share * (front - own)).astype(np.float32)


def _resized(image: F32, size: tuple[int, int], how: int = cv2.INTER_AREA) -> F32:
    return np.asarray(cv2.resize(image, size, interpolation=how), np.float32)


def _blurred(image: F32, sigma: float) -> F32:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), max(sigma, 0.5)), np.float32)


def _depth(silhouette: ReliefSilhouette, xy: F64) -> F64:
    """(h, w) how deep photo px (h, w, 2) are inside: 0 at the outline, 1 amid a limb or body."""
    fields = np.stack([silhouette.depth, silhouette.radius], -1)
    depth, radius = bilinear(fields, silhouette.grid_xy(xy.reshape(-1, 2))).T
    return (depth / np.maximum(radius, silhouette.cell)).reshape(xy.shape[:2])


def _grown(colours: F32, source: Mask, hole: Mask, side: int) -> F32:
    """`colours` (h, w, 3) with texture from `source` (h, w) in `hole` (h, w).

    It is grown in a picture of `side` px.
    """
    height, width = hole.shape
    scale = min(1.0, side / max(height, width))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    known = _resized(source.astype(np.float32), size) > 0.5
    unknown = (_resized(hole.astype(np.float32), size) > 0) & ~known
    whole = grown(fill_in(_resized(colours, size), known), known, unknown)
    larger = _resized(whole, (width, height), cv2.INTER_LINEAR)
    return np.where(hole[..., None], larger, colours)


def _continued(foreground: F32, shown: F32, depth: F64, xy: F64, axis: MirrorAxis | None) -> F32:
    """The object's colours (h, w, 3), also where it was hidden: mirrored, else from beside."""
    hidden = (shown < 0.5) & (depth > 0)
    if not hidden.any():
        return foreground
    known = cv2.erode(shown, np.ones((3, 3), np.uint8)) > 0.5
    result = _grown(foreground, known, hidden, HIDDEN_SIDE)
    if axis is not None:
        height, width = shown.shape
        step = (xy[-1, -1] - xy[0, 0]) / np.maximum([width - 1, height - 1], 1)
        image = (axis.mirrored(xy[hidden]) - xy[0, 0]) / np.maximum(step, 1e-9)
        inside = (image >= 0).all(1) & (image <= [width - 1, height - 1]).all(1)
        is_shown = inside & (bilinear(known.astype(np.float32), image) > 0.99)
        colours = result[hidden]
        colours[is_shown] = bilinear(foreground, image[is_shown])
        result[hidden] = colours
    return result.astype(np.float32)


def fill_in(colours: F32, known: Mask) -> F32:
    """`colours` (h, w, 3) where `known` (h, w), and everywhere else a smooth continuation.

    Push and pull over halved copies (Gortler et al. 1996): near a known place its colour decides,
    far away the mean of all.
    """
    weight = known.astype(np.float32)
    if not known.any():
        return colours
    if min(weight.shape) <= 2:
        mean = (colours * weight[..., None]).sum((0, 1)) / weight.sum()
        return np.where(known[..., None], colours, mean).astype(np.float32)
    size = ((weight.shape[1] + 1) // 2, (weight.shape[0] + 1) // 2)
    fewer = _resized(weight, size)
    summed = _resized(colours * weight[..., None], size)
    mean = (summed / np.maximum(fewer, 1e-6)[..., None]).astype(np.float32)
    coarse = fill_in(mean, fewer > 1e-6)
    smooth = _resized(coarse, (weight.shape[1], weight.shape[0]), cv2.INTER_LINEAR)
    return np.where(known[..., None], colours, smooth).astype(np.float32)


# A texture grown over a place from what is around it: pixels copied so that neighbours fit.

COARSEST = 24  # px, longer side of the picture in which it begins
LEAST = 60  # px of the source there
MOSTLY = 0.7  # share of a coarser pixel that is the source's
PASSES = 4  # over the picture, at each size
FIRST_TRIES = 40  # places by chance for each pixel at the first size
TRIES = 4  # places by chance for each pixel, beside its neighbours', at the others
SMOOTH = 2.5  # px, of the local means that are to agree, too
GUIDE = 1.0  # weight of their difference beside that of the patches
REACH = 2  # px: a patch is 2 REACH + 1 wide


def grown(rgb: F32, source: Mask, hole: Mask) -> F32:
    """`rgb` (h, w, 3) with `hole` (h, w) filled from `source` (h, w).

    What `rgb` is in the hole is what it grows from. All else stays. The hole stays as it is where
    there is no source.
    """
    if not (hole.any() and source.any()):
        return rgb
    levels = [(rgb, source, hole)]
    while max(source.shape) > COARSEST:
        smaller = _halved(*levels[-1])
        if smaller[1].sum() < LEAST:
            break
        levels.append(smaller)
        source = smaller[1]
    rng = np.random.default_rng(0)
    rows, columns = np.nonzero(source)
    chosen = rng.integers(0, len(rows), source.shape)
    places = np.stack([rows[chosen], columns[chosen]], -1)
    picture, settled, tries = levels[-1][0], source, FIRST_TRIES
    for image, known, unknown in reversed(levels):
        if known.shape != settled.shape:
            places = _doubled(places, *known.shape)
            picture, settled = _copied(image, known, unknown, places), known | unknown
        rows, columns = np.nonzero(known)
        offered = rng.integers(0, len(rows), (PASSES, *known.shape, tries), dtype=np.int32)
        choice = np.stack([rows, columns], -1).astype(np.int32)
        guide = _smooth(image, known | unknown)
        inputs = [frozen(a) for a in (image, guide, known, unknown, offered, choice)]
        picture = np.ascontiguousarray(picture, np.float32).copy()
        _correct(picture, places, settled.copy(), *inputs)
        tries = TRIES
    return picture


def _copied(image: F32, source: Mask, hole: Mask, places: np.ndarray) -> F32:
    """`image` (h, w, 3) with the hole copied from places (h, w, 2) that are in the source."""
    row, column = np.clip(places, 0, np.array(hole.shape) - 1)[hole].T
    found = np.where(source[row, column, None], image[row, column], image[hole])
    result = image.copy()
    result[hole] = found
    return result


def _smooth(rgb: F32, where: Mask) -> F32:
    """Local means of `rgb` (h, w, 3) over `where` (h, w)."""
    weight = where.astype(np.float32)
    total = cv2.GaussianBlur(rgb * weight[..., None], (0, 0), SMOOTH)
    share = cv2.GaussianBlur(weight, (0, 0), SMOOTH)
    return np.asarray(total / np.maximum(share, 1e-6)[..., None], np.float32)


def _halved(rgb: F32, source: Mask, hole: Mask) -> tuple[F32, Mask, Mask]:
    """At half the size; a source there holds nothing else."""
    size = ((rgb.shape[1] + 1) // 2, (rgb.shape[0] + 1) // 2)
    share = cv2.resize(source.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    unknown = cv2.resize(hole.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32), share > MOSTLY, unknown > 0


def _doubled(places: np.ndarray, height: int, width: int) -> np.ndarray:
    """Places (h, w, 2) of a picture twice as large."""
    row, column = np.indices((height, width))
    coarse = places[
        np.minimum(row // 2, len(places) - 1), np.minimum(column // 2, places.shape[1] - 1)
    ]
    return 2 * coarse + np.stack([row % 2, column % 2], -1)


@numba.njit(cache=True, nogil=True)
def _correct(picture, places, settled, image, guide, source, hole, offered, choice):
    """Each pixel of the hole copied from the best place found.

    `picture`, `places` and `settled`, which pixels of it say something, change. `offered` are
    numbers of `choice` (n, 2).
    """
    height, width = hole.shape
    for p in range(len(offered)):
        for step in range(height * width):
            at = step if p % 2 == 0 else height * width - 1 - step
            i, j = at // width, at % width
            if not hole[i, j]:
                continue
            best, bi, bj = np.inf, -1, -1
            for n in range(9 + offered.shape[3]):
                if n < 9:  # a neighbour's place, moved along; its own is among them
                    a, b = i + n // 3 - 1, j + n % 3 - 1
                    if a < 0 or b < 0 or a >= height or b >= width or not hole[a, b]:
                        continue
                    si, sj = places[a, b, 0] + i - a, places[a, b, 1] + j - b
                else:
                    si, sj = choice[offered[p, i, j, n - 9]]
                if si < 0 or sj < 0 or si >= height or sj >= width or not source[si, sj]:
                    continue
                if si == bi and sj == bj:
                    continue  # neighbours mostly agree
                apart = 0.0
                for c in range(3):
                    apart += GUIDE * (guide[i, j, c] - guide[si, sj, c]) ** 2
                if apart >= best:
                    continue
                gap = apart + _gap(picture, settled, image, source, i, j, si, sj, best - apart)
                if gap < best:
                    best, bi, bj = gap, si, sj
            if bi >= 0:
                places[i, j, 0], places[i, j, 1] = bi, bj
                settled[i, j] = True
                for c in range(3):
                    picture[i, j, c] = image[bi, bj, c]


@numba.njit(cache=True, nogil=True)
def _gap(picture, settled, image, source, i, j, si, sj, enough):
    """Mean squared difference of two patches, where both are of the object.

    At least that, if it is more than `enough`.
    """
    total, count = 0.0, 0
    height, width = source.shape
    most = enough * (2 * REACH + 1) ** 2
    for di in range(max(-REACH, -i, -si), min(REACH, height - 1 - max(i, si)) + 1):
        for dj in range(max(-REACH, -j, -sj), min(REACH, width - 1 - max(j, sj)) + 1):
            a, b, s, t = i + di, j + dj, si + di, sj + dj
            if not source[s, t] or not settled[a, b]:
                continue
            for c in range(3):
                d = picture[a, b, c] - image[s, t, c]
                total += d * d
            count += 1
        if total > most:
            return np.inf
    return total / count if count > 0 else 0.0


# The light of one picture, in which the colours of another are seen.

GAINS = 0.4, 2.5  # a larger change of exposure is no light but another colour
OFFSET_PRIOR = 0.3  # x the evidence, for no veil
TOGETHER = 0.05  # x the evidence, for an exposure that is the same in all channels
ROUNDS, UNBELIEVED = 4, 0.12  # of the fit; sRGB beyond which a difference is not one of light


def in_light(colors: F64, own: F64, photo: F64) -> F64:
    """`colors` (N, 3) under the exposures that make `own` (n, 3) most like `photo` (n, 3).

    A channel that the object hardly has says nothing about the light: it follows the others.
    """
    result = np.empty_like(colors)
    usual = float(np.clip((own * photo).sum() / max((own * own).sum(), 1e-9), *GAINS))
    level = TOGETHER * float((own * own).mean()) + 1e-4
    for c in range(3):
        weight = np.ones(len(own))
        gain, offset = 1.0, 0.0
        for _ in range(ROUNDS):
            total, x, y = weight.sum(), own[:, c], photo[:, c]
            square = float((weight * x * x).sum()) + level * total
            a = np.array([[square, (weight * x).sum()], [(weight * x).sum(), total]])
            a[1, 1] += OFFSET_PRIOR * total
            b = np.array([(weight * x * y).sum() + level * total * usual, (weight * y).sum()])
            gain, offset = np.linalg.solve(a, b)
            if not GAINS[0] <= gain <= GAINS[1]:
                gain = float(np.clip(gain, *GAINS))
                offset = float((weight * (y - gain * x)).sum() / ((1 + OFFSET_PRIOR) * total))
            weight = 1 / (1 + ((gain * x + offset - y) / UNBELIEVED) ** 2)
        result[:, c] = gain * colors[:, c] + offset
    return np.clip(result, 0, 1)
