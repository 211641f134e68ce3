"""Strain: nothing for rigid motions, the true factors for known stretches."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.deform.deformer import measure_strain
from objectmorpher_core.deform.graph import build_graph
from objectmorpher_core.document.model import Pose
from tests import shapes

EXACT = 1e-9
SHEET = shapes.sheet(20, 12)
WEIGHTS = build_graph(SHEET).weights


def _still(points: F64) -> F64:
    return np.tile(np.eye(3), (len(points), 1, 1))


def test_a_rigid_motion_strains_nothing():
    r = shapes.rotation(2)
    pose = Pose(SHEET @ r.T + [1.0, 2.0, 3.0], np.tile(r, (len(SHEET), 1, 1)))
    strain = measure_strain(SHEET, WEIGHTS, pose)
    assert strain.energy.max() < EXACT
    assert np.abs(strain.most - 1).max() < EXACT
    assert np.abs(strain.least - 1).max() < EXACT


def test_a_stretched_sheet_is_stretched_by_that_much_everywhere():
    strain = measure_strain(SHEET, WEIGHTS, Pose(SHEET * [2.0, 0.5, 1.0], _still(SHEET)))
    assert np.abs(strain.most - 2.0).max() < EXACT
    assert np.abs(strain.least - 0.5).max() < EXACT
    assert (strain.energy > 0.1).all()


def test_only_the_part_that_is_pulled_shows_it():
    half = SHEET[:, 0] > 0
    moved = SHEET.copy()
    moved[half, 0] *= 1.5
    strain = measure_strain(SHEET, WEIGHTS, Pose(moved, _still(SHEET)))
    assert np.abs(strain.most[SHEET[:, 0] < -0.35] - 1).max() < EXACT
    assert np.abs(strain.most[SHEET[:, 0] > 0.35] - 1.5).max() < EXACT


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_size_does_not_matter(scale):
    moved = SHEET * [1.3, 0.9, 1.0]
    one = measure_strain(SHEET, WEIGHTS, Pose(moved, _still(SHEET)))
    other = measure_strain(scale * SHEET, WEIGHTS, Pose(scale * moved, _still(SHEET)))
    assert np.abs(one.energy - other.energy).max() < EXACT
    assert np.abs(one.most - other.most).max() < EXACT


def test_points_in_a_line_have_one_stretch():
    line = np.column_stack([np.linspace(0, 1, 30), np.zeros(30), np.zeros(30)])
    weights = build_graph(line).weights
    strain = measure_strain(line, weights, Pose(1.5 * line, _still(line)))
    assert np.abs(strain.most - 1.5).max() < 1e-6
    assert np.isfinite(strain.energy).all()
