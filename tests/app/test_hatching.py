"""Hatch lines of discs join to one pattern."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher.gui.overlay.pose import hatch


@pytest.mark.parametrize("angle", [0.0, 45.0, -60.0])
def test_lines_stay_inside_and_none_is_drawn_twice(angle: float) -> None:
    centres = np.random.default_rng(3).uniform(0, 100, (30, 2))
    lines = hatch(centres, 12.0, angle, 7.0)
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    ends = lines.reshape(-1, 2)
    gaps = np.linalg.norm(ends[:, None] - centres[None], axis=2).min(1)
    np.testing.assert_allclose(gaps, 12.0, atol=1e-6)
    rows = np.round(lines[:, 0] @ [-along[1], along[0]] / 7.0)
    for row in np.unique(rows):
        own = np.sort((lines[rows == row] @ along), axis=1)
        own = own[np.argsort(own[:, 0])]
        assert (own[1:, 0] > own[:-1, 1]).all()


def test_nothing_is_hatched_without_discs() -> None:
    assert len(hatch(np.empty((0, 2)), 5.0, 45.0, 7.0)) == 0
