"""The compiled loops over a graph of pieces say what scipy, and plain loops, say."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.csgraph import connected_components

from objectmorpher_core.base.arrays import Sparse
from objectmorpher_core.segment.pieces import pieces as piece_graph
from objectmorpher_core.segment.pieces.features import (
    DISTRUST,
    LIKE_COLOR,
    REACH,
    Likeness,
    sample_tokens,
)

COUNT = 80  # pieces
F64 = 1e-12
F32 = 1e-5


def made_links(seed: int) -> Sparse:
    """A random symmetric graph of several connected sets."""
    random = np.random.default_rng(seed)
    half = sparse.triu(sparse.random(COUNT, COUNT, 0.02, rng=random), 1)
    return (half + half.T).tocsr()


def test_what_is_reached_hangs_together_with_a_start():
    for seed in range(5):
        random, links = np.random.default_rng(seed), made_links(seed)
        allowed, start = random.random(COUNT) < 0.8, random.random(COUNT) < 0.05
        inner = sparse.diags(allowed * 1.0) @ links @ sparse.diags(allowed * 1.0)
        _, labels = connected_components(inner, directed=False)
        wanted = allowed & np.isin(labels, labels[start & allowed])
        np.testing.assert_array_equal(piece_graph.reached(links, allowed, start), wanted)


def test_the_highest_of_a_window_is_its_largest_value():
    random = np.random.default_rng(0)
    values, size = random.random(COUNT), np.sort(random.random(COUNT))
    low = np.searchsorted(size, size - 0.1)
    high = np.searchsorted(size, size + 0.1, side="right")
    wanted = [values[a:b].max() for a, b in zip(low, high, strict=True)]
    np.testing.assert_array_equal(piece_graph.highest(values, low, high), wanted)


def test_a_walks_system_is_what_scipy_makes_of_the_formula():
    for seed in range(5):
        random, links = np.random.default_rng(seed), made_links(seed)
        allowed = random.random(COUNT) < 0.7
        free = allowed & (random.random(COUNT) < 0.9)
        chosen = np.flatnonzero(allowed)
        inner = links[chosen][:, chosen]
        whole = sparse.diags(np.asarray(inner.sum(1)).ravel() + 1e-9) - 0.9 * inner
        wanted = whole.toarray()[free[chosen]][:, free[chosen]]
        system = piece_graph.restarting(links, allowed, free, 0.9)
        assert system.has_canonical_format
        np.testing.assert_allclose(system.toarray(), wanted, atol=F64)


def test_systems_differ_on_their_diagonals_only():
    links, diagonal = made_links(0), np.random.default_rng(1).random(COUNT)
    systems = piece_graph.Diagonals(links)
    for scale in (1.0, 3.0):
        wanted = np.diag(scale * diagonal) - links.toarray()
        np.testing.assert_array_equal(systems.system(scale * diagonal).toarray(), wanted)


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
