"""Limits on the stretch of a Gaussian."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.deform.jacobians import LEAST_STRETCH, MOST_STRETCH, limit_row, margin
from tests import shapes

F64 = 1e-9


def _with_stretches(stretches: np.ndarray, seed: int = 0) -> np.ndarray:
    """(N, 3, 3) U diag(stretches) V^T with random rotations."""
    u, v = shapes.rotations(len(stretches), seed), shapes.rotations(len(stretches), seed + 1)
    return (u * stretches[:, None, :]) @ v.transpose(0, 2, 1)


def limited(f: np.ndarray, least: float = LEAST_STRETCH, most: float = MOST_STRETCH) -> np.ndarray:
    """Every matrix (N, 3, 3) limited, as skinning does it."""
    result, left, right = f.copy(), np.empty((3, 3)), np.empty((3, 3))
    for row in result:
        if margin(*(tuple(r) for r in row), least, most) <= 0.0:
            limit_row(row, least, most, left, right)
    return result


def slow_limited(f: np.ndarray, least: float, most: float) -> np.ndarray:
    """The twin of `limited`: LAPACK's SVD, the weakest axis flipped in a mirror image."""
    u, s, vt = np.linalg.svd(f)
    is_mirror = np.linalg.det(f) < 0
    s[is_mirror, 2] *= -1
    u[is_mirror, :, 2] *= -1
    return (u * np.clip(s, least, most)[:, None, :]) @ vt


def test_limited_matrices_are_those_of_the_slow_twin():
    """Random ones, of which half are mirror images."""
    f = np.random.default_rng(0).normal(size=(3000, 3, 3)) * np.logspace(-3, 3, 3000)[:, None, None]
    error = np.abs(limited(f) - slow_limited(f, LEAST_STRETCH, MOST_STRETCH)).max((1, 2))
    # where two signed stretches nearly tie a mirror image has several nearest rotations
    assert np.quantile(error, 0.99) < 1e-7
    stretches = np.linalg.svd(limited(f))[1]
    assert stretches.min() > LEAST_STRETCH - F64 and stretches.max() < MOST_STRETCH + F64
    assert np.linalg.det(limited(f)).min() > 0


def test_what_is_inside_the_limits_stays_to_the_last_digit():
    stretches = np.random.default_rng(1).uniform(LEAST_STRETCH, MOST_STRETCH, (2000, 3))
    f = _with_stretches(stretches)
    assert np.array_equal(limited(f), f)


def test_limits_are_arguments():
    f = _with_stretches(np.array([[3.0, 1.0, 0.5]]))
    assert np.linalg.svd(limited(f, 0.8, 2.0)[0])[1] == pytest.approx([2.0, 1.0, 0.8])


def test_the_rotations_on_both_sides_of_the_stretch_stay():
    f = _with_stretches(np.array([[90.0, 2.0, 0.01]]))
    expected = _with_stretches(np.array([[MOST_STRETCH, 2.0, LEAST_STRETCH]]))
    assert np.abs(limited(f) - expected).max() < F64


@pytest.mark.parametrize("stretches", [(0, 0, 0), (3, 0, 0), (9, 2, 0), (1e-300, 0, 0), (7, 7, -7)])
def test_collapsed_matrices_become_proper_ones(stretches):
    f = limited(_with_stretches(np.array([stretches], float)))
    assert np.isfinite(f).all()
    assert np.linalg.det(f[0]) > 0
    s = np.linalg.svd(f[0])[1]
    assert s.min() > LEAST_STRETCH - F64 and s.max() < MOST_STRETCH + F64
