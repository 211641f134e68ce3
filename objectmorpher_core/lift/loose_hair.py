"""Hair that a cut-out leaves beside it in the photo: whiskers, fur, a curl that stands off.

A hair is a ridge of lightness, one or two pixels wide, whose two sides look alike. Those that begin
at the cut-out and end nearby are the object's, unless the background is full of such lines: grass,
twigs, the grain of wood. What counts as one was chosen by looking at 44 photographs.

The object's shape is made without it, and it goes along, as deep as the outline beside it: it would
be taken for the edge's softness, else.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
from scipy.ndimage import map_coordinates
from scipy.spatial import KDTree

from ..base.arrays import F32, U8, Mask, Pixels, crop, unit_pixels
from ..base.camera import Camera
from ..base.masks import Box, box_of, disc, reduction
from ..base.rotations import quats_along
from ..base.threads import in_threads
from ..document.model import HAIR, Gaussians, LiftedObject, Matte, PhotoTexture
from ..segment.matting.matte import band_width
from ..segment.matting.unmix import coarse_colours
from .relief.strands import appended, hair_of

FARTHEST = 20.0  # x margin: where a line goes on to here, it is the background's
PICTURE, LOOKED = 1.3, 1.1  # x that: how much is seen around; how far away lines are looked for
BESIDE = 1.2  # x margin: so near to the cut-out a hair begins
OUTSIDE = 2.0  # x margin, from which on other lines are the background's
SIDE = 1200.0  # px: longer side of the picture in which hair is looked for
ACROSS, ALONG = 1.0, 3.0  # px: standard deviations of a piece of hair
WIDER, RADIUS = 2.5, 7  # x ACROSS: what is around it; px of the kernel
DIRECTIONS = 12
LEAST = 1.6  # levels of L by which a hair's middle stands out ...
TIMES, AROUND = 3.0, 5.0  # ... and x what is usual within so many margins
GOES_ON, SURE = 0.45, 0.15  # x that level: a hair goes on; share of it that is above
APART, UNLIKE = 3.0, 1.0  # px to both its sides, which differ by less than this x its contrast
SMALLEST = 120.0  # px, root of the area of an object whose hair is thick enough to be seen
SHORTEST, GAP, WIDTH = 9, 2, 1  # px; to both sides of the middle
TUFT = 5  # px: between two hairs so near there may be more
FULL, WITHIN = 0.007, 5.0  # share of other lines within so many margins, at most
RAGGED = 0.05  # mean of that over an outline (`hair_of`), below which nothing beside it is hair
EVIDENCE = 0.25  # x the root of the object's area: that mean times the px of hair, at least


def find_loose_hair(pixels: Pixels, covered: Mask, margin: float) -> Mask:
    """(H, W) True where the photo (H, W, 3) shows hair of what is `covered` (H, W).

    `margin`: a hundredth of the photo's diagonal, px.
    """
    found, reach = np.zeros_like(covered), FARTHEST * margin
    x0, y0, x1, y1 = box_of(covered, int(PICTURE * reach) + 2)
    part, own = pixels[y0:y1, x0:x1], covered[y0:y1, x0:x1]
    scale = min(1.0, SIDE / max(own.shape))
    size = (max(round(own.shape[1] * scale), 1), max(round(own.shape[0] * scale), 1))
    small = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
    rgb = np.divide(small, np.iinfo(pixels.dtype).max, dtype=np.float32)
    hides = cv2.resize(own.view(np.uint8) * np.uint8(255), size, interpolation=cv2.INTER_AREA) > 0
    _, behind = coarse_colours(rgb, hides.astype(np.float32))
    rgb[hides] = behind[hides]  # the object has no edge
    light = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2LAB)[..., 0], np.float32)
    hair = _hair(light, hides, margin * scale)
    large = cv2.resize(hair.astype(np.uint8), own.shape[::-1], interpolation=cv2.INTER_NEAREST)
    found[y0:y1, x0:x1] = (large > 0) & ~own
    return found


def _hair(light: F32, hides: Mask, margin: float) -> Mask:
    """(h, w) hair in a picture's `light` (h, w)."""
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
    hair = cv2.dilate(line.astype(np.uint8), disc(WIDTH))
    return np.asarray(cv2.morphologyEx(hair, cv2.MORPH_CLOSE, disc(TUFT)) > 0)


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


# How much of a pixel a hair covers cannot be seen, only that times how unlike the background it is.
# It is taken to be little, so that nothing of the background comes along.

MARGIN = 2.5  # x the matte's band: a hundredth of the photo's diagonal
CONTEXT = 8  # x margin, seen around it
BEHIND = (0.5, 1.2, 2.5)  # x margin: so far around, what is behind is averaged
LEAST_BARE = 1e-3  # share of what is around that must be seen bare
MORE = 1.25  # x the least that it can cover
FAINTEST = 0.02  # alpha that is kept
TILE = 1536  # px: what is worked on at a time of a large picture, at 60 bytes a px


def with_loose_hair(pixels: Pixels, matte: Matte) -> Matte:
    """A `matte` of the photo (H, W, 3) and the hair beside it; the same one where there is none."""
    hair = hair_of(matte.alpha)
    if hair is None or hair.mean < RAGGED:
        return matte
    height, width = pixels.shape[:2]
    frame, margin = (0, 0, width, height), MARGIN * band_width(width, height)
    covered = crop(matte.alpha, matte.box, frame) > 0
    loose = find_loose_hair(pixels, covered, margin)
    # As in a smaller picture of what is large: a line is wider there, too.
    times = reduction(pixels.shape)
    if hair.mean * np.count_nonzero(loose) < EVIDENCE * hair.root * times:
        return matte  # of a smooth thing even a long line is likely to be none
    own = box_of(loose)
    (x0, y0, x1, y1), (left, top, right, bottom) = matte.box, own
    box = min(x0, left - 1), min(y0, top - 1), max(x1, right + 1), max(y1, bottom + 1)
    pads = [(y0 - box[1], box[3] - y1), (x0 - box[0], box[2] - x1)]
    alpha = np.pad(matte.alpha, pads)
    foreground = np.pad(matte.foreground, [*pads, (0, 0)], mode="edge")
    for tile in _tiles(own):
        left, top, right, bottom = tile
        if loose[top:bottom, left:right].any():
            window = np.s_[top - box[1] : bottom - box[1], left - box[0] : right - box[0]]
            context = CONTEXT * margin if tile == own else BEHIND[-1] * margin + 2
            share, colours = _unmixed(pixels, loose, covered, tile, (margin, context))
            is_hair = share > 0
            alpha[window][is_hair] = share[is_hair]
            foreground[window][is_hair] = colours[is_hair]
    return replace(matte, left=box[0], top=box[1], alpha=alpha, foreground=foreground)


def _tiles(box: Box) -> list[Box]:
    """The parts of a box that are worked on at a time: all of it, where it is not large."""
    x0, y0, x1, y1 = box
    side = max(x1 - x0, y1 - y0) if (x1 - x0) * (y1 - y0) <= 2 * TILE**2 else TILE
    return [
        (left, top, min(left + side, x1), min(top + side, y1))
        for top in range(y0, y1, side) for left in range(x0, x1, side)
    ]  # fmt: skip


def _unmixed(
    pixels: Pixels, loose: Mask, covered: Mask, own: Box, reaches: tuple[float, float]
) -> tuple[F32, F32]:
    """Alpha (h, w) and colours (h, w, 3) of the hair that is `loose` (H, W), in a box `own`.

    `reaches`: the margin, and how far around the box is looked, px.
    """
    (margin, context), (height, width) = reaches, loose.shape
    reach = int(np.ceil(context))
    x0, y0 = max(own[0] - reach, 0), max(own[1] - reach, 0)
    x1, y1 = min(own[2] + reach, width), min(own[3] + reach, height)
    part = np.s_[y0:y1, x0:x1]
    rgb, there = unit_pixels(pixels[part]), loose[part]
    is_bare = ~covered[part] & (cv2.dilate(there.astype(np.uint8), disc(2)) == 0)
    bare, shown = is_bare.astype(np.float32), rgb * is_bare[..., None]
    seen = rgb[there]
    around, share = seen.copy(), np.full(len(seen), np.inf, np.float32)
    for size in BEHIND:
        side = 2 * int(np.ceil(size * margin)) + 1
        count = cv2.blur(bare, (side, side))[there]
        mean = cv2.blur(shown, (side, side))[there] / np.maximum(count, 1e-9)[:, None]
        cover = np.where(count > LEAST_BARE, _least_cover(seen, mean), np.inf)
        around = np.where((cover < share)[:, None], mean, around)
        share = np.minimum(share, cover)
    share = np.where(np.isfinite(share), np.minimum(MORE * share, 1), 0)
    share = np.where(share >= FAINTEST, share, 0).astype(np.float32)
    change = seen - around
    alpha, colours = np.zeros(there.shape, np.float32), np.zeros_like(rgb)
    alpha[there] = share
    colours[there] = (around + change / np.maximum(share, FAINTEST)[:, None]).clip(0, 1)
    left, top, right, bottom = own
    inner = np.s_[top - y0 : bottom - y0, left - x0 : right - x0]
    return alpha[inner], colours[inner]


def _least_cover(seen: F32, behind: F32) -> F32:
    """(N,) the least share that any colour must have to make of `behind` what is `seen` (N, 3)."""
    change = seen - behind
    room = np.maximum(np.where(change > 0, 1 - behind, behind), 1e-3)
    return np.asarray((np.abs(change) / room).max(-1), np.float32)


UNEVEN = 0.3  # x what is usual between two Gaussians, by which these are off a grid
FLAT = 0.1  # x their width


def with_hair_along(
    lifted: LiftedObject, matte: Matte, whole: Matte, camera: Camera, seed: int = 0
) -> LiftedObject:
    """What was `lifted` from a `matte`, with the loose hair of the `whole` one.

    The hair faces the camera, as deep as the soft edge beside it. Only a relief has such an edge:
    what was lifted in another way is returned as it is.
    """
    edge = np.flatnonzero(lifted.texture.solidity < 0.5)
    if whole is matte or not len(edge) or not lifted.splatting.startswith("edged"):
        return lifted
    pitch = lifted.spacing * lifted.scale * camera.focal / float(lifted.centre[2])
    is_new = (whole.alpha > 0) & (crop(matte.alpha, matte.box, whole.box) <= 0)
    wide = 2 * int(np.ceil(pitch)) + 1
    near = cv2.dilate(is_new.astype(np.uint8), np.ones((wide, wide), np.uint8))
    height, width = near.shape
    rows, columns = np.mgrid[0:height:pitch, 0:width:pitch].reshape(2, -1)
    xy = np.column_stack([columns, rows])
    xy += pitch * np.random.default_rng(seed).uniform(0, UNEVEN, xy.shape)
    x, y = np.minimum(xy.astype(int), [width - 1, height - 1]).T
    xy = xy[near[y, x] > 0] + [whole.left, whole.top]
    like = edge[KDTree(lifted.texture.u0[edge]).query(xy)[1]]
    depth = lifted.world_points(lifted.gaussians.means[like])[:, 2]
    world = camera.unproject(xy, depth)
    axes = lifted.world_from_object[:3, :3] / lifted.scale
    facing = -world @ axes / np.linalg.norm(world, axis=1, keepdims=True)
    own = lifted.gaussians
    hair = Gaussians(
        lifted.object_points(world).astype(np.float32), quats_along(facing).astype(np.float32),
        own.scales[like] * np.array([1, 1, FLAT], np.float32),
        np.full(len(xy), HAIR, np.float32), own.colors[like],
    )  # fmt: skip
    seen = np.ones(len(xy), np.float32)
    return appended(lifted, hair, PhotoTexture(np.asarray(xy, np.float32), seen, seen), like)
