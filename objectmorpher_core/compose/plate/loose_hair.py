"""Hair that a cut-out leaves beside it in the photo: whiskers, fur, a curl that stands off.

A hair is a ridge of lightness, one or two pixels wide, whose two sides look alike. Those that begin
at the cut-out and end nearby are the object's, unless the background is full of such lines: grass,
twigs, the grain of wood. What counts as one was chosen by looking at 44 photographs.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from ...base.arrays import F32, U8, Mask, Pixels
from ...base.masks import box_of, disc
from ...base.threads import in_threads
from .completion import smooth

FARTHEST = 20.0  # x hole margin: where a line goes on to here, it is the background's
PICTURE, LOOKED = 1.3, 1.1  # x that: how much is seen around; how far away lines are looked for
BESIDE = 1.2  # x hole margin: so near to the cut-out a hair begins
OUTSIDE = 2.0  # x hole margin, from which on other lines are the background's
SIDE = 1200.0  # px: longer side of the picture in which hair is looked for
ACROSS, ALONG = 1.0, 3.0  # px: standard deviations of a piece of hair
WIDER, RADIUS = 2.5, 7  # x ACROSS: what is around it; px of the kernel
DIRECTIONS = 12
LEAST = 1.6  # levels of L by which a hair's middle stands out ...
TIMES, AROUND = 3.0, 5.0  # ... and x what is usual within so many hole margins
GOES_ON, SURE = 0.45, 0.15  # x that level: a hair goes on; share of it that is above
APART, UNLIKE = 3.0, 1.0  # px to both its sides, which differ by less than this x its contrast
SMALLEST = 120.0  # px, root of the area of an object whose hair is thick enough to be seen
SHORTEST, GAP, JOINED = 9, 2, 4  # px; what is found may have wider gaps
FULL, WITHIN = 0.007, 5.0  # share of other lines within so many hole margins, at most


def find_loose_hair(pixels: Pixels, covered: Mask, margin: float) -> Mask:
    """(H, W) True where the photo (H, W, 3) shows hair of what is `covered` (H, W).

    `margin` is the photo's `hole_margin`, px.
    """
    found, reach = np.zeros_like(covered), FARTHEST * margin
    x0, y0, x1, y1 = box_of(covered, int(PICTURE * reach) + 2)
    part, own = pixels[y0:y1, x0:x1], covered[y0:y1, x0:x1]
    scale = min(1.0, SIDE / max(own.shape))
    size = (max(round(own.shape[1] * scale), 1), max(round(own.shape[0] * scale), 1))
    small = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
    rgb = np.divide(small, np.iinfo(pixels.dtype).max, dtype=np.float32)
    hides = cv2.resize(own.view(np.uint8) * np.uint8(255), size, interpolation=cv2.INTER_AREA) > 0
    light = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2LAB)[..., 0], np.float32)
    light = smooth(light[..., None], (~hides).astype(np.float32))[..., 0]  # the object has no edge
    hair = _hair(light, hides, margin * scale)
    large = cv2.resize(hair.astype(np.uint8), own.shape[::-1], interpolation=cv2.INTER_NEAREST)
    found[y0:y1, x0:x1] = (large > 0) & ~own
    return found


def _hair(light: F32, hides: Mask, margin: float) -> Mask:
    """(h, w) hair in a picture's `light` (h, w), and one px around it."""
    away, nearest = cv2.distanceTransformWithLabels(
        (~hides).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_CCOMP
    )
    nearest = np.asarray(nearest, np.int32)
    areas = np.bincount(nearest[hides], minlength=int(nearest.max()) + 1)
    near = (away > 0) & (away < LOOKED * FARTHEST * margin)
    line, is_strong = _lines(light, near, away > margin, AROUND * margin)
    closed = cv2.morphologyEx(line.astype(np.uint8), cv2.MORPH_CLOSE, disc(GAP))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(closed, connectivity=8)
    labels = np.asarray(labels, np.int32)
    begins, goes_on = np.zeros(count, bool), np.zeros(count, bool)
    begins[np.unique(labels[(away > 0) & (away <= BESIDE * margin + 1)])] = True
    goes_on[np.unique(labels[away > FARTHEST * margin])] = True
    may_be = begins & ~goes_on
    others = line & (away > OUTSIDE * margin) & ~may_be[labels]
    share = _around(others, WITHIN * margin)
    length = np.bincount(labels[line], minlength=count)
    strong = np.bincount(labels[is_strong & line], minlength=count)
    full = np.bincount(labels[line], share[line], count) / np.maximum(length, 1)
    extent = np.hypot(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT])
    keeps = may_be & (full < FULL) & (strong >= SURE * length)
    keeps &= (length >= SHORTEST) & (extent >= SHORTEST)
    keeps[0] = False
    line &= keeps[labels] & (areas[nearest] > SMALLEST**2)
    hair = cv2.morphologyEx(line.astype(np.uint8), cv2.MORPH_CLOSE, disc(JOINED))
    return np.asarray(cv2.dilate(hair, disc(1)) > 0)


def _lines(light: F32, where: Mask, usual: Mask, sigma: float) -> tuple[Mask, Mask]:
    """(h, w) the ridges of a picture's `light` (h, w) in `where` (h, w); (h, w) the strong ones.

    How much stands out is measured where it is `usual` (h, w), over `sigma` px.
    """
    response, direction = _responses(light)
    level = _around(np.sqrt(response) * usual, sigma)
    level = LEAST + TIMES * (level / np.maximum(_around(usual, sigma), 1e-3)) ** 2
    rows, columns = np.nonzero(where & (response > GOES_ON * level))
    angle = np.pi * direction[rows, columns] / DIRECTIONS

    def beside(image: F32, px: float) -> F32:
        at = rows + px * np.cos(angle), columns - px * np.sin(angle)
        return np.asarray(map_coordinates(image, at, order=1, mode="nearest"), np.float32)

    here = response[rows, columns]
    is_ridge = (here >= beside(response, -1)) & (here >= beside(response, 1))
    middle, left, right = light[rows, columns], beside(light, -APART), beside(light, APART)
    least = np.minimum(np.abs(middle - left), np.abs(middle - right))
    least *= (middle > left) == (middle > right)
    is_ridge &= np.abs(left - right) < UNLIKE * least + 1
    lines = np.zeros(light.shape, bool)
    lines[rows[is_ridge], columns[is_ridge]] = True
    return lines, lines & (response > level)


def _responses(light: F32) -> tuple[F32, U8]:
    """(h, w) how much a short line about each px stands out, and in which direction most."""
    best, direction = np.zeros_like(light), np.zeros(light.shape, np.uint8)

    def run(first: int, last: int) -> None:
        top, below = max(first - RADIUS, 0), min(last + RADIUS, len(light))
        own = np.s_[first - top : last - top]
        for k, kernel in enumerate(_kernels()):
            stands_out = cv2.filter2D(
                light[top:below], cv2.CV_32F, kernel, borderType=cv2.BORDER_REPLICATE
            )
            stands_out = np.abs(stands_out[own])
            direction[first:last][stands_out > best[first:last]] = k
            np.maximum(best[first:last], stands_out, out=best[first:last])

    in_threads(run, len(light), 2, RADIUS)
    return best, direction


@cache
def _kernels() -> tuple[F32, ...]:
    """Second derivatives of an elongated Gaussian in each direction; their sum is 0."""
    y, x = np.mgrid[-RADIUS : RADIUS + 1, -RADIUS : RADIUS + 1].astype(np.float64)
    kernels = []
    for k in range(DIRECTIONS):
        cos, sin = np.cos(np.pi * k / DIRECTIONS), np.sin(np.pi * k / DIRECTIONS)
        u, v = (x * cos + y * sin) / ALONG, (y * cos - x * sin) / ACROSS
        ridge = (1 - v * v) * np.exp(-0.5 * (u * u + v * v))
        wide = np.exp(-0.5 * (u * u + (v / WIDER) ** 2))
        ridge -= wide * (ridge.sum() / wide.sum())
        kernels.append(np.asarray(2 * ridge / np.abs(ridge).sum(), np.float32))
    return tuple(kernels)


def _around(image: np.ndarray, sigma: float) -> F32:
    """Gaussian means of `image` (h, w), of a coarser picture where they are wide."""
    image = image.astype(np.float32)
    step = max(int(sigma // 4), 1)
    size = max(image.shape[1] // step, 1), max(image.shape[0] // step, 1)
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    mean = cv2.GaussianBlur(small, (0, 0), sigma / step)
    return np.asarray(cv2.resize(mean, image.shape[::-1]), np.float32)
