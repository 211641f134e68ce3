"""Soft guess -> the object's clean outline at full resolution.

GrabCut (Rother, Kolmogorov & Blake 2004) on a reduced crop decides where the guess is unsure; a
guided filter (He, Sun & Tang 2010) with the photo as guide carries the outline to full resolution.
"""

from __future__ import annotations

import cv2
import numpy as np

from ...base.arrays import F32, RGB, Mask
from ...base.masks import box_of
from ...document.model import Prompt
from ..selection import box_around, check_mask, fill_small_holes, free_mask, keep_touched
from .closed_form import Expected, solve_alpha

WORK_AREA = 300_000  # px that GrabCut sees at most
SURE = 0.05  # a guess nearer than this to 0 or 1 is not questioned
MARGIN = 0.08  # x crop's size, background kept around the object
PLAIN = 2  # grey levels; where all is one colour, colours decide nothing
ROUNDS = 2  # of GrabCut; more change nothing visible
COLORS = 5  # per colour model, cv2.grabCut's own number
SAMPLES = 4000  # px that a colour model is started from
CLICK_RADIUS = 2  # px of the reduced crop that a click decides
GUIDE_RADIUS = 3  # px of the reduced crop
GUIDE_EPS = 1e-4  # variance of colours in [0, 1] that counts as flat
BAND = 4  # px each side of an outline within which closed-form matting finds the edge
CORE = 0.5  # x depth of the middle of a thin thing: deeper is surely inside
THIN = 4  # x band: a thing that has no more depth within so many px is thin
PRIOR = 1e-3  # weight of the outline as it is, for where colour says nothing
BAND_ROUNDS = 60  # of the solver; more move nothing visible
MOST_UNKNOWN = 40_000  # px solved for; beyond, the guided filter is quicker
TILE = 1024  # px; the guided filter runs only on tiles that an outline crosses


def cut(rgb: RGB, guess: F32, prompt: Prompt, seed: int = 0) -> Mask:
    """The object's mask (H, W) from a guess in [0, 1] of any resolution over the whole photo."""
    height, width = rgb.shape[:2]
    left, top, right, bottom = _crop(guess, (height, width), prompt)
    crop = np.ascontiguousarray(rgb[top:bottom, left:right])
    scale = min(1.0, (WORK_AREA / (crop.shape[0] * crop.shape[1])) ** 0.5)
    size = (max(1, round(crop.shape[1] * scale)), max(1, round(crop.shape[0] * scale)))
    small = np.asarray(cv2.resize(crop, size, interpolation=cv2.INTER_AREA), np.uint8)
    trimap = _trimap(guess, (left, top, right, bottom), (height, width), size)
    inside = free_mask((height, width), prompt)[top:bottom, left:right].astype(np.uint8)
    trimap[cv2.resize(inside, size, interpolation=cv2.INTER_NEAREST) == 0] = cv2.GC_BGD
    for click in prompt.clicks:
        x = int((click.x - left) * size[0] / crop.shape[1])
        y = int((click.y - top) * size[1] / crop.shape[0])
        label = cv2.GC_FGD if click.is_foreground else cv2.GC_BGD
        cv2.circle(trimap, (x, y), CLICK_RADIUS, int(label), -1)
    found = _grabcut(small, trimap, seed)
    mask = np.zeros((height, width), bool)
    mask[top:bottom, left:right] = _sharpen(crop, found)
    mask &= free_mask(mask.shape, prompt)
    for click in prompt.clicks:
        mask[int(click.y), int(click.x)] = click.is_foreground
    return check_mask(fill_small_holes(keep_touched(mask, prompt), prompt))


def _crop(guess: F32, shape: tuple[int, int], prompt: Prompt) -> tuple[int, int, int, int]:
    """left, top, right, bottom px of the photo: all that may be object, with a margin."""
    height, width = shape
    rows, columns = np.nonzero(guess > SURE)
    ky, kx = height / guess.shape[0], width / guess.shape[1]
    xs = [c.x for c in prompt.clicks] + [columns.min() * kx, (columns.max() + 1) * kx]
    ys = [c.y for c in prompt.clicks] + [rows.min() * ky, (rows.max() + 1) * ky]
    margin = MARGIN * max(max(xs) - min(xs), max(ys) - min(ys)) + 2 * max(kx, ky) + 8
    return (
        int(max(min(xs) - margin, 0)),
        int(max(min(ys) - margin, 0)),
        int(min(max(xs) + margin + 1, width)),
        int(min(max(ys) + margin + 1, height)),
    )


def _trimap(
    guess: F32, crop: tuple[int, int, int, int], shape: tuple[int, int], size: tuple[int, int]
) -> np.ndarray:
    """(h, w) u8 of GrabCut's labels, for the crop at `size` (width, height)."""
    left, top, right, bottom = crop
    xs = (left + (np.arange(size[0]) + 0.5) * (right - left) / size[0]) * guess.shape[1] / shape[1]
    ys = (top + (np.arange(size[1]) + 0.5) * (bottom - top) / size[1]) * guess.shape[0] / shape[0]
    x, y = np.meshgrid((xs - 0.5).astype(np.float32), (ys - 0.5).astype(np.float32))
    soft = cv2.remap(
        guess.astype(np.float32), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    trimap = np.where(soft > 0.5, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    trimap[soft > 1 - SURE] = cv2.GC_FGD
    trimap[soft < SURE] = cv2.GC_BGD
    return trimap


def _grabcut(rgb: RGB, trimap: np.ndarray, seed: int) -> F32:
    """(h, w) 1 where the object is."""
    is_object = (trimap == cv2.GC_FGD) | (trimap == cv2.GC_PR_FGD)
    is_plain = int(rgb.max()) - int(rgb.min()) <= PLAIN
    if is_plain or is_object.all() or not is_object.any():
        return is_object.astype(np.float32)
    background = _color_model(rgb[~is_object], seed)
    foreground = _color_model(rgb[is_object], seed)
    cv2.setRNGSeed(seed)
    labels = trimap.copy()
    cv2.grabCut(rgb, labels, (0, 0, 0, 0), background, foreground, ROUNDS, cv2.GC_EVAL)
    return ((labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD)).astype(np.float32)


def _color_model(colors: np.ndarray, seed: int) -> np.ndarray:
    """(1, 65) f64 mixture of COLORS Gaussians, laid out as cv2.grabCut keeps it.

    From few samples: grabCut's own start clusters every pixel and takes most of its time.
    """
    picked = colors[np.linspace(0, len(colors) - 1, min(SAMPLES, len(colors))).astype(int)]
    picked = picked.astype(np.float32)
    count = min(COLORS, len(picked))
    cv2.setRNGSeed(seed)
    stop = (cv2.TERM_CRITERIA_MAX_ITER, 10, 0.0)
    _, labels, _ = cv2.kmeans(picked, count, None, stop, 1, cv2.KMEANS_PP_CENTERS)  # type: ignore[call-overload]
    weights, means = np.zeros(COLORS), np.zeros((COLORS, 3))
    covariances = np.tile(np.eye(3), (COLORS, 1, 1))
    for k in range(count):
        own = picked[labels[:, 0] == k].astype(np.float64)
        if len(own) == 0:
            continue
        weights[k] = len(own) / len(picked)
        means[k] = own.mean(0)
        centred = own - means[k]
        covariances[k] = centred.T @ centred / len(own) + np.eye(3)  # 1 grey level of noise
    return np.concatenate([weights, means.ravel(), covariances.ravel()])[None]


def _sharpen(rgb: RGB, found: F32) -> Mask:
    """(H, W) `found` (h, w) carried to the photo's resolution along the photo's own edges."""
    height, width = rgb.shape[:2]
    scale = width / found.shape[1]
    radius = round(GUIDE_RADIUS * scale)
    coarse = cv2.resize(found, (width, height), interpolation=cv2.INTER_LINEAR)
    coarse = cv2.GaussianBlur(coarse, (0, 0), 0.7 * scale)
    mask = coarse > 0.5
    pad = 2 * radius + 2
    for top in range(0, height, TILE):
        for left in range(0, width, TILE):
            tile = np.s_[top : top + TILE, left : left + TILE]
            if coarse[tile].min() > 0.99 or coarse[tile].max() < 0.01:
                continue
            y, x = max(top - pad, 0), max(left - pad, 0)
            wide = np.s_[y : top + TILE + pad, x : left + TILE + pad]
            fine = cv2.ximgproc.guidedFilter(
                rgb[wide].astype(np.float32) / 255, coarse[wide], radius, GUIDE_EPS
            )
            fine = cv2.GaussianBlur(fine, (0, 0), 0.8)
            rows, columns = mask[tile].shape
            mask[tile] = fine[top - y : top - y + rows, left - x : left - x + columns] > 0.5
    return mask


def sharpen_band(rgb: RGB, mask: Mask, near: Mask | None = None, band: int = BAND) -> Mask:
    """A mask (H, W) whose outline is moved by up to `band` px to the edge in the picture.

    Where the matte (Levin et al. 2008) that its inside and outside leave open is half. With
    `near` (H, W), only there.
    """
    around = box_around(_outline(mask), (THIN + 1) * band + 2)
    if around is None:
        return mask
    own = mask[around]
    inner, outer = core(own, band), core(~own, band)
    if near is not None:
        inner, outer = inner | (own & ~near[around]), outer | (~own & ~near[around])
    unknown = ~(inner | outer)
    if not unknown.any():
        return mask
    x0, y0, x1, y1 = box_of(unknown, 2)
    crop = np.s_[y0:y1, x0:x1]
    picture = np.asarray(rgb[around][crop], np.float32) / np.float32(255)
    start = own[crop].astype(np.float32)
    expected = Expected(start, np.full(start.shape, PRIOR, np.float32))
    alpha = solve_alpha(picture, unknown[crop], expected, start, BAND_ROUNDS)
    sharp = mask.copy()
    sharp[around][crop] = alpha > 0.5
    return sharp


def _outline(mask: Mask) -> Mask:
    """(H, W) the pixels of a mask that differ from the one above or to the left."""
    outline = np.zeros_like(mask)
    outline[1:] = mask[1:] != mask[:-1]
    outline[:, 1:] |= mask[:, 1:] != mask[:, :-1]
    return outline


def rehearse() -> None:
    """Loads what is compiled for `sharpen_band`, so that no click waits for that."""
    mask = np.zeros((8, 8), bool)
    mask[2:6, 2:6] = True
    sharpen_band(np.zeros((8, 8, 3), np.uint8), mask)


def core(mask: Mask, band: float, limb: float = CORE) -> Mask:
    """(H, W) what is surely inside: deeper than `band` px, or than `limb` of what is thin.

    That is a share of the depth of a thin thing's middle.
    """
    depth = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 3)
    size = THIN * int(band) + 1
    thickness = cv2.dilate(depth, np.ones((size, size), np.uint8))
    return mask & (depth > np.minimum(band, limb * thickness))


def enlarge(rgb: RGB, mask: Mask) -> Mask:
    """A mask (h, w) of the photo (H, W, 3) made smaller, at the photo's own size and edges."""
    height, width = rgb.shape[:2]
    if mask.shape == (height, width):
        return mask
    scale = width / mask.shape[1]
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 0.7)
    large = cv2.resize(smooth, (width, height), interpolation=cv2.INTER_LINEAR) > 0.5
    band = round(1.5 * scale) + 1
    outline = np.count_nonzero(large[:, 1:] != large[:, :-1])
    outline += np.count_nonzero(large[1:] != large[:-1])
    if 2 * band * outline <= MOST_UNKNOWN:
        return sharpen_band(rgb, large, band=band)
    return _sharpen(rgb, mask.astype(np.float32))
