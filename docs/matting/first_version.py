"""The matte as it was first: one band of a fixed width, solved at once, colours gathered nearby.

It is here to be compared with. Nothing else uses it.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, eye_array
from scipy.sparse.linalg import spsolve

from objectmorpher_core.base.arrays import F32, Mask, Pixels, Selection, unit_pixels
from objectmorpher_core.segment.mask_edit import FULL, grow, is_selected, is_soft
from objectmorpher_core.segment.matting.matte import band_width, signed_distance

REACH = 2.5  # x band: how far the colours of object and background are gathered
TRUST = 0.2  # sRGB: how far an unmixed colour may be from the object's colour beside it
SMOOTHNESS = 1e-6  # colour variance below which a window says nothing
PRIOR = 1e-3  # weight of the mask's own edge
LARGEST = 40_000  # unknown px solved for at once; more are solved at half the size


def cut_out(pixels: Pixels, selection: Selection) -> tuple[F32, F32]:
    """Alpha (H, W) and foreground (H, W, 3)."""
    rgb, mask = unit_pixels(pixels), is_selected(selection)
    band = band_width(mask.shape[1], mask.shape[0])
    distance = signed_distance(mask)
    ridge = mask & (distance >= cv2.dilate(distance, np.ones((3, 3))) - 0.25)
    inner, outer = (distance > band) | (ridge & (distance > 0.75)), distance < -band
    drawn = np.zeros_like(mask) if selection.dtype == np.bool_ else grow(is_soft(selection), band)
    prior = np.clip(0.5 + distance / band, 0, 1)
    alpha = _solved(rgb, inner | (drawn & mask), outer | (drawn & ~mask), prior)
    alpha = np.where(drawn, selection / np.float32(FULL), alpha).astype(np.float32)
    sure = inner & (alpha > 0.98)
    inside = _gathered(rgb, (sure if sure.any() else mask).astype(np.float32), REACH * band)
    outside = _gathered(rgb, (outer & (alpha < 0.02)).astype(np.float32), REACH * band)
    share = alpha[..., None]
    unmixed = (rgb - (1 - share) * outside) / np.maximum(share, 1e-3)
    room = TRUST * share**2
    foreground = np.where(share < 1.0, np.clip(unmixed, inside - room, inside + room), rgb)
    own = drawn[..., None] * np.clip(2 * share - 1, 0, 1)
    foreground = foreground + own * (rgb - foreground)
    return alpha, np.clip(foreground, 0, 1).astype(np.float32)


def _solved(rgb: F32, inner: Mask, outer: Mask, prior: np.ndarray) -> F32:
    unknown = ~(inner | outer)
    count = int(unknown.sum())
    if count == 0:
        return inner.astype(np.float32)
    if count > LARGEST:
        return _solved_small(rgb, inner, outer, prior)
    index = np.flatnonzero(unknown)
    own, known = _laplacian(rgb, unknown)[index], inner.ravel().astype(np.float64)
    matrix = own[:, index] + PRIOR * eye_array(count)
    right = PRIOR * prior.ravel()[index] - own @ known
    alpha = known.astype(np.float32)
    solved = np.asarray(spsolve(csc_array(matrix), right, permc_spec="MMD_AT_PLUS_A"))
    alpha[index] = np.clip(solved, 0, 1)
    return alpha.reshape(inner.shape)


def _laplacian(rgb: F32, unknown: Mask) -> csr_array:
    height, width = unknown.shape
    touched = cv2.dilate(unknown.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    touched[[0, -1]] = False
    touched[:, [0, -1]] = False
    centre = np.flatnonzero(touched)
    step = np.array([dy * width + dx for dy in (-1, 0, 1) for dx in (-1, 0, 1)])
    members = centre[:, None] + step
    colours = rgb.reshape(-1, 3)[members].astype(np.float64)
    colours -= colours.mean(1, keepdims=True)
    covariance = np.einsum("nki,nkj->nij", colours, colours) / 9 + SMOOTHNESS / 9 * np.eye(3)
    affinity = (1 + np.einsum("nki,nli->nkl", colours @ np.linalg.inv(covariance), colours)) / 9
    values = np.eye(9) - affinity
    rows = np.broadcast_to(members[:, :, None], values.shape)
    columns = np.broadcast_to(members[:, None, :], values.shape)
    entries = (values.ravel(), (rows.ravel(), columns.ravel()))
    return coo_array(entries, shape=(height * width, height * width)).tocsr()


def _solved_small(rgb: F32, inner: Mask, outer: Mask, prior: np.ndarray) -> F32:
    height, width = inner.shape
    size = (max(width // 2, 1), max(height // 2, 1))

    def halved(image: np.ndarray) -> np.ndarray:
        return cv2.resize(image.astype(np.float32), size, interpolation=cv2.INTER_AREA)

    small = _solved(halved(rgb), halved(inner) > 0.99, halved(outer) > 0.99, halved(prior))
    alpha = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
    alpha = cv2.ximgproc.guidedFilter(rgb, alpha, 3, 1e-5)
    alpha[inner], alpha[outer] = 1.0, 0.0
    return np.clip(alpha, 0, 1).astype(np.float32)


def _gathered(rgb: F32, weights: F32, reach: float) -> F32:
    """Mean colour of the weighted pixels nearby: the narrowest window that saw any decides."""
    colour, known = np.zeros_like(rgb), np.zeros(rgb.shape[:2], np.float32)
    premultiplied = rgb * weights[..., None]
    sigma, largest = max(reach / 2, 1.0), float(max(rgb.shape[:2]))
    while True:
        total = _blurred(weights, sigma)
        mean = _blurred(premultiplied, sigma) / np.maximum(total, 1e-12)[..., None]
        share = np.clip(total / 0.02, 0, 1) * (1 - known)
        colour += mean * share[..., None]
        known += share
        if known.min() > 0.999 or sigma > largest:
            return (colour / np.maximum(known, 1e-6)[..., None]).astype(np.float32)
        sigma *= 2.5


def _blurred(image: np.ndarray, sigma: float) -> np.ndarray:
    if sigma <= 6:
        return cv2.GaussianBlur(image, (0, 0), sigma)
    factor = 2 ** int(np.floor(np.log2(sigma / 3)))
    height, width = image.shape[:2]
    size = (max(1, width // factor), max(1, height // factor))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), sigma / factor)
    return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
