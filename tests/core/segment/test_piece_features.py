"""The compiled mix of tokens around a place says what a plain loop says."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.segment.pieces.features import (
    DISTRUST,
    LIKE_COLOR,
    REACH,
    Likeness,
    sample_tokens,
)

F32 = 1e-5


def test_tokens_of_a_place_are_its_cells_weighted_by_distance_and_colour():
    random = np.random.default_rng(2)
    tokens = random.normal(size=(5, 7, 6)).astype(np.float32)
    x, y = random.uniform(0, 70, 30), random.uniform(0, 50, 30)
    like = Likeness(
        random.uniform(0, 60, (30, 3)), random.uniform(0, 60, (5, 7, 3)).astype(np.float32)
    )
    for trust in (None, like):
        found = sample_tokens(tokens, (50, 70), (x, y), trust)
        for n in range(30):
            column, row = np.clip(x[n] / 10 - 0.5, 0, 6), np.clip(y[n] / 10 - 0.5, 0, 4)
            total = np.zeros(6)
            for i in range(5):
                for j in range(7):
                    if -1 <= i - np.floor(row) <= 2 and -1 <= j - np.floor(column) <= 2:
                        near = np.exp(-((i - row) ** 2 + (j - column) ** 2) / (2 * REACH**2))
                        if trust is not None:
                            apart = np.square(trust.colors[n] - trust.cells[i, j]).sum()
                            near *= np.exp(-apart / (2 * LIKE_COLOR**2)) + DISTRUST
                        total += near * tokens[i, j]
            np.testing.assert_allclose(found[n], total / np.linalg.norm(total), atol=F32)
