"""The colours of an object from elsewhere, brought into the light of the photo it stands in.

One exposure for each channel is fitted where the photo shows the object. What is left of the
difference there continues over what the photo does not show, and fades with the distance: the two
meet without a seam.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import KDTree

from ...base.arrays import F32, F64, Mask
from ...base.camera import Camera
from ...base.threads import LEAST_ROWS, in_threads
from ...document.model import LiftedObject, Matte
from ..relief.bilinear import bilinear
from ..relief.colours import BLUR

SURE = 0.5  # visibility of a Gaussian that tells something about the light
OPAQUE = 0.95  # alpha of the matte, likewise
LEAST = 12  # such Gaussians
GAINS = 0.4, 2.5  # a larger change of exposure is no light but another colour
OFFSET_PRIOR = 0.3  # x the evidence, for no veil
TOGETHER = 0.05  # x the evidence, for an exposure that is the same in all channels
ROUNDS, UNBELIEVED = 4, 0.12  # of the fit; sRGB beyond which a difference is not one of light
GLANCE = 4.0  # what is seen at a glance only has the photo's colour all the same
CARRIED = 0.10  # object units: how far what is left of the difference is carried on
REACH = 0.28  # object units, beyond which less than 1/2000 of it is left: nothing is looked for
TELLING = 20_000  # Gaussians that are asked at most: the difference is smooth
NEAREST = 12  # Gaussians that it is the mean of
GRID = 8  # cells in REACH
MOST_CELLS = 128  # along what is known: fewer are in REACH where that is far apart
PIECE = 1 << 16  # Gaussians that are looked up at once: some 40 MB


def recolored(lifted: LiftedObject, seen: F32, matte: Matte, camera: Camera) -> F32:
    """(N, 3) colours: the photo's where it is `seen` (N,), else the object's in its light."""
    spacing_px = lifted.spacing * lifted.scale * camera.focal / float(lifted.centre[2])
    at = lifted.texture.u0.astype(np.float64) - [matte.left + 0.5, matte.top + 0.5]
    blurred = cv2.GaussianBlur(matte.foreground, (0, 0), max(BLUR * spacing_px, 0.5))
    photo = bilinear(blurred, at)
    alpha = bilinear(cv2.erode(matte.alpha, np.ones((3, 3), np.uint8)), at)
    inside = ((at > 0) & (at < [matte.alpha.shape[1] - 1, matte.alpha.shape[0] - 1])).all(1)
    sure = (seen > SURE) & (alpha > OPAQUE) & inside
    own = lifted.gaussians.colors.astype(np.float64)
    if sure.sum() < LEAST:
        return lifted.gaussians.colors
    lit = _in_light(own, own[sure], photo[sure])
    points = lifted.gaussians.means.astype(np.float64)
    share = np.where(inside & (alpha > OPAQUE), np.minimum(GLANCE * seen, 1), 0.0)
    own_part = np.flatnonzero(share < 1)  # the rest is the photo's, whatever its light
    lit[own_part] += _carried_on(points[own_part], points[sure], (photo - lit)[sure])
    return np.clip(lit + share[:, None] * (photo - lit), 0, 1).astype(np.float32)


def _in_light(colors: F64, own: F64, photo: F64) -> F64:
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


def _carried_on(points: F64, known: F64, rest: F64) -> F64:
    """(N, 3) `rest` (n, 3) at the `known` points (n, 3), continued to `points` (N, 3).

    Neighbours are looked for within REACH only. From the far side of an object all that is known
    is about equally far: a tree would look at nearly all of it for each point.
    """
    step = len(known) // TELLING + 1
    known, rest = known[::step], rest[::step]
    tree, count = KDTree(known), min(NEAREST, len(known))
    rest = np.vstack([rest, np.zeros(3)])  # the last one: of neighbours that are not there
    carried, reached = np.zeros_like(points), np.flatnonzero(_may_reach(points, known))

    def run(first: int, last: int) -> None:
        for start in range(first, last, PIECE):
            piece = reached[start : min(start + PIECE, last)]
            distance, near = tree.query(points[piece], k=count, distance_upper_bound=REACH)
            distance = distance.reshape(-1, count)
            width = np.clip(distance[:, -1:], 1e-9, REACH)
            weight = np.maximum(1 - (distance / (1.01 * width)) ** 2, 0)
            total = np.maximum(weight.sum(1, keepdims=True), 1e-300)
            mean = (rest[near.reshape(-1, count)] * weight[..., None]).sum(1) / total
            carried[piece] = mean * np.exp(-((distance[:, :1] / CARRIED) ** 2))

    in_threads(run, len(reached), least=LEAST_ROWS)
    return carried


def _may_reach(points: F64, known: F64) -> Mask:
    """(N,) False where no `known` point (n, 3) is within REACH, by a grid."""
    cell = max(REACH / GRID, float(np.ptp(known, axis=0).max()) / MOST_CELLS)
    low = known.min(0) - 2 * REACH
    marked = np.zeros(((np.ptp(known, axis=0) + 4 * REACH) / cell).astype(int) + 1, bool)
    marked[tuple(((known - low) / cell).astype(int).T)] = True
    apart = np.asarray(distance_transform_edt(~marked))  # between the cells' centres, in cells
    own = ((points - low) / cell).clip(0, np.array(marked.shape) - 1).astype(int)
    return np.asarray(apart[tuple(own.T)] <= REACH / cell + np.sqrt(3))
