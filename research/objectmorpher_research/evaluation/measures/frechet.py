"""Fréchet distance of two Gaussians (Dowson & Landau 1982), which FID and SIFID are.

d^2 = |m1 - m2|^2 + tr(S1 + S2 - 2 (S1 S2)^(1/2))   (Heusel et al., arXiv 1706.08500, eq. 6)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objectmorpher_core.arrays import F64

from ..error import EvaluationError


@dataclass(frozen=True)
class Gaussian:
    """A normal distribution in d dimensions."""

    mean: F64  # (d,)
    covariance: F64  # (d, d), symmetric, no negative eigenvalue


def fitted(samples: F64) -> Gaussian:
    """The Gaussian of samples (n, d), n - 1 below the covariance. Raises EvaluationError."""
    if len(samples) < 2:
        raise EvaluationError(f"a spread needs two samples, there is {len(samples)}")
    samples = np.asarray(samples, np.float64)
    covariance = np.atleast_2d(np.cov(samples, rowvar=False))
    return Gaussian(samples.mean(0), covariance)


def frechet_distance(a: Gaussian, b: Gaussian) -> float:
    """The squared distance d^2, as FID and SIFID report it.

    tr (S1 S2)^(1/2) is that of the symmetric S1^(1/2) S2 S1^(1/2), whose eigenvalues are real and
    not negative: no complex square root, and nothing has to be added to a singular covariance.
    """
    values, vectors = np.linalg.eigh(a.covariance)
    root = (vectors * np.sqrt(np.maximum(values, 0))) @ vectors.T
    common = np.linalg.eigvalsh(root @ b.covariance @ root)
    spread = np.sqrt(np.maximum(common, 0)).sum()
    apart = float(((a.mean - b.mean) ** 2).sum())
    distance = apart + np.trace(a.covariance) + np.trace(b.covariance) - 2 * spread
    return max(0.0, float(distance))


def frechet_of_samples(x: F64, y: F64) -> float:
    """`frechet_distance` of the Gaussians of samples (n, d) and (m, d), for fewer samples than d.

    With centred X / sqrt(n - 1) as a root of S1, tr (S1 S2)^(1/2) is the sum of the singular
    values of X Y^T, of n x m numbers only.
    """
    if min(len(x), len(y)) < 2:
        raise EvaluationError(f"a spread needs two samples, there is {min(len(x), len(y))}")
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    u = (x - x.mean(0)) / np.sqrt(len(x) - 1)
    v = (y - y.mean(0)) / np.sqrt(len(y) - 1)
    spread = np.linalg.svd(u @ v.T, compute_uv=False).sum()
    apart = float(((x.mean(0) - y.mean(0)) ** 2).sum())
    return max(0.0, float(apart + (u**2).sum() + (v**2).sum() - 2 * spread))
