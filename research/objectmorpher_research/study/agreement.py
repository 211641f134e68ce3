"""Agreement of people: Krippendorff's alpha for ordered categories.

    alpha = 1 - D_o / D_e,  of coincidences o_ck = sum over units of (pairs c, k in it) / (m_u - 1)
    delta^2_ck = (sum of n_g for g = c..k - (n_c + n_k) / 2)^2

(Krippendorff, Computing Krippendorff's Alpha-Reliability, 2011; n_g: how often g was given in units
that two or more have rated). 1: all agree; 0: no better than chance.
"""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..evaluation.bootstrap import Estimate

RESAMPLES = 2_000


def coincidences(ratings: F64, values: int) -> F64:
    """(units, values, values) of (raters, units) ratings 1..values, nan where there is none.

    Units that fewer than two have rated hold zeros: nothing can be compared there.
    """
    given = np.stack([(ratings == v + 1).sum(0) for v in range(values)], 1).astype(np.float64)
    m = given.sum(1)
    pairs = given[:, :, None] * given[:, None, :] - np.eye(values) * given[:, None, :]
    return np.where((m > 1)[:, None, None], pairs / np.maximum(m - 1, 1)[:, None, None], 0.0)


def ordinal_alpha(ratings: F64, values: int = 5, seed: int = 0) -> Estimate:
    """Alpha of (raters, units), with the bootstrap's interval over units.

    nan where nobody differs because only one value was ever given, or nothing can be compared.
    """
    units = coincidences(ratings, values)
    alpha = float(_alphas(units.sum(0)[None])[0])
    if np.isnan(alpha) or len(units) < 2:
        return Estimate(alpha)
    random = np.random.default_rng(seed)
    weights = random.multinomial(len(units), np.full(len(units), 1 / len(units)), RESAMPLES)
    drawn = _alphas(np.tensordot(weights.astype(np.float64), units, 1))
    drawn = drawn[np.isfinite(drawn)]
    if not len(drawn):
        return Estimate(alpha)
    low, high = np.quantile(drawn, (0.025, 0.975))
    return Estimate(alpha, float(low), float(high))


def _alphas(o: F64) -> F64:
    """Alpha of each of (k, values, values) coincidences."""
    n = o.sum(2)  # (k, values)
    total = n.sum(1)
    up_to = np.cumsum(n, 1)
    between = np.abs(up_to[:, None, :] - up_to[:, :, None])  # of n_g for c < g <= k
    # from c to k with both ends, less half of each end: half of the lower end is not in `between`
    apart = between + (n[:, :, None] - n[:, None, :]) / 2 * np.sign(_order(n.shape[1]))
    squared = apart**2
    observed = (o * squared).sum((1, 2)) / np.maximum(total, 1)
    expected = (n[:, :, None] * n[:, None, :] * squared).sum((1, 2))
    expected /= np.maximum(total * (total - 1), 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(expected > 0, 1 - observed / expected, np.nan)


def _order(values: int) -> F64:
    k = np.arange(values, dtype=np.float64)
    return k[None, :] - k[:, None]  # [c, k]: above zero where k is the higher one
