"""Where the light on an object comes from, told from the photo without any weights.

What the photo shows of an object is its own colour times the light on it. The logarithm of the
light (of encoded values) is taken to be linear in the normal n, b . n: a lamp with some light from
everywhere, to first order, which never turns negative.

One photo does not tell a dark colour from a dim light. So b is a Bayesian estimate: of the object's
own colours nothing is known but that they vary by patches, as a Gaussian process whose covariance
falls with the distance (generalised least squares; Rasmussen and Williams 2006, 2.7), and before
anything is seen of it the light comes from above. Where the colours vary much, or the normals
little, b stays near that; where the brightness follows the normals, it is believed.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ...base.arrays import F32, F64
from ...document.model import LiftedObject, Matte

CELLS = 22  # along the longer side of an object: what the light is estimated from
LOOKED = 8  # px of the photo for each of them are enough
FULL = 0.4  # of a cell, from which it is asked
LEAST_CELLS = 12
DARK = 0.02  # encoded luminance: below it nothing is told
LUMA = np.array([0.299, 0.587, 0.114], np.float32)  # of encoded values
PATCH = 0.3  # x the object's longer side, over which its colours are alike
GRAIN = 0.4  # share of their variance that is a cell's own
COLOURS = 0.3  # standard deviation of them that is expected, logarithm
BELIEF = 40.0  # cells that it would take to change that expectation's mind by half
ABOVE = np.array([0.0, -0.1, -0.05])  # b before anything is seen: from above and from the viewer
SPREAD = 0.13  # standard deviation of that, each coordinate
ROUNDS = 3


def estimate_light(lifted: LiftedObject, matte: Matte) -> F64:
    """b (3,) world, how the logarithm of an object's encoded colours follows its normals.

    Of an object of which too little is seen it is what is expected of any.
    """
    found = _cells(lifted, matte)
    if found is None:
        return ABOVE
    places, normals, brightness = found
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    alike = (1 - GRAIN) * np.exp(-apart / PATCH) + GRAIN * np.eye(len(places))
    factor = cho_factor(alike + 1e4)  # its mean is not known at all
    by_normals, by_one = cho_solve(factor, normals), cho_solve(factor, brightness)
    precision, seen = normals.T @ by_normals, normals.T @ by_one
    variance, light = COLOURS**2, ABOVE
    for _ in range(ROUNDS):
        light = np.linalg.solve(
            precision / variance + np.eye(3) / SPREAD**2, seen / variance + ABOVE / SPREAD**2
        )
        rest = brightness - normals @ light
        own = float(rest @ cho_solve(factor, rest))
        variance = (own + BELIEF * COLOURS**2) / (len(places) + BELIEF)
    return np.asarray(light, np.float64)


def _cells(lifted: LiftedObject, matte: Matte) -> tuple[F64, F64, F64] | None:
    """Places (n, 2) in object sizes, normals (n, 3) world, log brightness (n,) of what is seen."""
    height, width = matte.alpha.shape
    pitch = max(height, width) / CELLS
    shape = (max(round(height / pitch), 1), max(round(width / pitch), 1))
    brightness, inside = _brightness(matte, shape)
    texture = lifted.texture
    turn = lifted.world_from_object[:3, :3] / lifted.scale
    seen = (texture.visibility > 0.5) & (texture.solidity > 0.5)
    at = (texture.u0[seen] - (matte.left, matte.top)) / (width, height) * shape[::-1]
    column, row = at.astype(np.int64).T
    is_there = (at >= 0).all(1) & (column < shape[1]) & (row < shape[0])
    normals = (lifted.gaussians.normals[seen] @ turn.T)[is_there]
    index = row[is_there] * shape[1] + column[is_there]
    size = shape[0] * shape[1]
    count = np.bincount(index, minlength=size)
    sums = [np.bincount(index, normals[:, a], size) for a in range(3)]
    mean = np.stack(sums, 1) / np.maximum(count, 1)[:, None]
    use = np.flatnonzero((count > 0) & (inside.ravel() > FULL))
    if len(use) < LEAST_CELLS:
        return None
    places = np.column_stack([use % shape[1], use // shape[1]]) / max(shape)
    return places, mean[use], brightness.ravel()[use].astype(np.float64)


def _brightness(matte: Matte, shape: tuple[int, int]) -> tuple[F32, F32]:
    """(h, w) mean logarithm of the luminance in each cell, and the share of it that is opaque."""
    step = max(min(matte.alpha.shape[0] // shape[0], matte.alpha.shape[1] // shape[1]) // LOOKED, 1)
    luminance = matte.foreground[::step, ::step] @ LUMA
    solid = (matte.alpha[::step, ::step] > 0.95).astype(np.float32)
    logarithm = np.log(np.maximum(luminance, DARK)) * solid
    share = cv2.resize(solid, shape[::-1], interpolation=cv2.INTER_AREA)
    summed = cv2.resize(logarithm, shape[::-1], interpolation=cv2.INTER_AREA)
    return np.asarray(summed / np.maximum(share, 1e-6), np.float32), np.asarray(share, np.float32)
