"""The membrane over a mask, against the closed forms of -laplace u = 1."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.lift.membrane import solve_membrane

CLOSED = (False, False, False, False)
GRID = 0.04  # of the highest value: a staircase edge, half a cell off in a radius of 24


def _disc(radius: float) -> np.ndarray:
    side = int(2 * radius) + 5
    y, x = np.mgrid[:side, :side] - (side - 1) / 2
    return np.hypot(x, y) < radius


def test_a_disc_is_a_paraboloid():
    inside = _disc(24.0)
    u = solve_membrane(inside, CLOSED)
    y, x = np.mgrid[: len(u), : len(u)] - (len(u) - 1) / 2
    expected = (24.0**2 - x**2 - y**2) / 4
    assert u.max() == pytest.approx(24.0**2 / 4, rel=GRID)
    assert np.abs(u - expected)[inside].max() < GRID * u.max()


def test_a_long_strip_is_a_parabola():
    inside = np.zeros((24, 202), bool)
    inside[2:22, 1:201] = True
    u = solve_membrane(inside, CLOSED)
    y = np.arange(24) - 11.5
    middle = u[:, 100]
    assert np.abs(middle - np.maximum((10**2 - y**2) / 2, 0)).max() < GRID * middle.max()


def test_it_solves_its_equation_away_from_the_edge():
    inside = _disc(15.0)
    u = solve_membrane(inside, CLOSED)
    laplacian = u[2:, 1:-1] + u[:-2, 1:-1] + u[1:-1, 2:] + u[1:-1, :-2] - 4 * u[1:-1, 1:-1]
    deep = _disc(12.0)
    deep = np.pad(deep, (len(u) - len(deep)) // 2)[1:-1, 1:-1]
    assert np.abs(laplacian[deep] + 1).max() < 1e-9


def test_it_is_positive_inside_and_nothing_outside():
    inside = _disc(9.0)
    u = solve_membrane(inside, CLOSED)
    assert (u[inside] > 0).all()
    assert not u[~inside].any()


def test_parts_do_not_know_of_each_other():
    part = _disc(9.0)
    both = np.concatenate([part, part], axis=1)
    u = solve_membrane(both, CLOSED)
    assert np.abs(u[:, : len(part)] - solve_membrane(part, CLOSED)).max() < 1e-9


def test_it_is_symmetric_where_the_mask_is():
    u = solve_membrane(_disc(11.5), CLOSED)
    assert np.abs(u - u[::-1]).max() < 1e-9
    assert np.abs(u - u.T).max() < 1e-9


@pytest.mark.parametrize("side", range(4))
def test_beyond_an_open_frame_it_goes_on(side):
    """It is higher at an open side than at a held one, and still bounded."""
    inside = np.zeros((34, 34), bool)
    inside[1:33, 1:33] = True
    open_sides = tuple(k == side for k in range(4))
    u, held = solve_membrane(inside, open_sides), solve_membrane(inside, CLOSED)
    border = {0: u[1], 1: u[32], 2: u[:, 1], 3: u[:, 32]}[side][17]
    assert border > 3 * held[1, 17]
    assert u.max() < 2 * held.max()


def test_open_on_all_sides_is_still_a_shape():
    inside = np.zeros((22, 22), bool)
    inside[1:21, 1:21] = True
    u = solve_membrane(inside, (True, True, True, True))
    assert np.isfinite(u).all()
    assert u[11, 11] > u[1, 1] > 0


def test_one_cell_is_a_mask_too():
    inside = np.zeros((3, 3), bool)
    inside[1, 1] = True
    assert solve_membrane(inside, CLOSED)[1, 1] == pytest.approx(1 / 8)  # four sides, weight 2


def test_a_mask_that_touches_the_arrays_border_is_our_mistake():
    with pytest.raises(AssertionError):
        solve_membrane(np.ones((4, 4), bool), CLOSED)
