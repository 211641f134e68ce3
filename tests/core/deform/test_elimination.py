"""Small systems solved without LAPACK."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.deform.anderson import FEW, solve_small

F64 = 1e-9


@pytest.mark.parametrize("count", [1, 2, 15, FEW, FEW + 1])
def test_a_small_system_is_solved_as_lapack_solves_it(count):
    rng = np.random.default_rng(count)
    matrix, right = rng.normal(size=(count, count)), rng.normal(size=count)
    matrix[0, 0] = 0.0 if count > 1 else 1.0  # no pivot without an exchange of rows
    before = matrix.copy(), right.copy()
    x = solve_small(matrix, right)
    assert np.allclose(x, np.linalg.solve(matrix, right), atol=F64)
    assert np.array_equal(matrix, before[0])
    assert np.array_equal(right, before[1])
