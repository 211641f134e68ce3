"""Closed-form matting (Levin, Lischinski & Weiss 2008) on the unknown band of a trimap.

Within a window of 3 x 3 pixels alpha is assumed to be an affine function of colour; summed over
all windows that leaves one sparse linear system for the unknown pixels. Own code because only the
windows that touch the band are needed: some thousand, which takes some ten milliseconds.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, eye_array
from scipy.sparse.linalg import spsolve

from ..arrays import F32, Mask

SMOOTHNESS = 1e-6  # colour variance (of sRGB in [0, 1]) below which a window says nothing
PRIOR = 1e-3  # weight of the mask's own edge, for where colour says nothing
LARGEST = 40_000  # unknown px solved for at once; more are solved at half the size
WINDOW = 9  # px


def solve_alpha(rgb: F32, inner: Mask, outer: Mask, prior: np.ndarray) -> F32:
    """Alpha (h, w) in [0, 1] of a picture (h, w, 3): 1 in `inner`, 0 in `outer`.

    `prior` (h, w) is where the edge is expected.
    """
    unknown = ~(inner | outer)
    count = int(unknown.sum())
    if count == 0:
        return inner.astype(np.float32)
    if count > LARGEST:
        return _solved_small(rgb, inner, outer, prior)
    laplacian = _laplacian(rgb, unknown)
    index = np.flatnonzero(unknown)
    own = laplacian[index]
    known = inner.ravel().astype(np.float64)  # 0 in the unknown pixels too
    matrix = own[:, index] + PRIOR * eye_array(count)
    right = PRIOR * prior.ravel()[index] - own @ known
    alpha = known.astype(np.float32)
    solved = np.asarray(spsolve(csc_array(matrix), right, permc_spec="MMD_AT_PLUS_A"))
    alpha[index] = np.clip(solved, 0, 1)
    return alpha.reshape(inner.shape)


def _laplacian(rgb: F32, unknown: Mask) -> csr_array:
    """The matting Laplacian (h w, h w) of the windows that hold an unknown pixel."""
    height, width = unknown.shape
    touched = cv2.dilate(unknown.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    touched[[0, -1]] = False
    touched[:, [0, -1]] = False
    centre = np.flatnonzero(touched)
    step = np.array([dy * width + dx for dy in (-1, 0, 1) for dx in (-1, 0, 1)])
    members = centre[:, None] + step  # (n, 9)
    colours = rgb.reshape(-1, 3)[members].astype(np.float64)
    colours -= colours.mean(1, keepdims=True)
    covariance = np.einsum("nki,nkj->nij", colours, colours) / WINDOW
    covariance += SMOOTHNESS / WINDOW * np.eye(3)
    whitened = colours @ np.linalg.inv(covariance)
    affinity = (1 + np.einsum("nki,nli->nkl", whitened, colours)) / WINDOW
    values = np.eye(WINDOW) - affinity
    rows = np.broadcast_to(members[:, :, None], values.shape)
    columns = np.broadcast_to(members[:, None, :], values.shape)
    entries = (values.ravel(), (rows.ravel(), columns.ravel()))
    return coo_array(entries, shape=(height * width, height * width)).tocsr()


def _solved_small(rgb: F32, inner: Mask, outer: Mask, prior: np.ndarray) -> F32:
    """Alpha found at half the size, brought up along the picture's own edges."""
    height, width = inner.shape
    size = (max(width // 2, 1), max(height // 2, 1))

    def halved(image: np.ndarray) -> np.ndarray:
        return cv2.resize(image.astype(np.float32), size, interpolation=cv2.INTER_AREA)

    small = solve_alpha(halved(rgb), halved(inner) > 0.99, halved(outer) > 0.99, halved(prior))
    alpha = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
    alpha = cv2.ximgproc.guidedFilter(rgb, alpha, 3, 1e-5)
    alpha[inner], alpha[outer] = 1.0, 0.0
    return np.clip(alpha, 0, 1).astype(np.float32)
