"""Rims lie on the outline."""

import numpy as np
import shapes

from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.lift.relief.spreading import rim_lines


def test_a_line_runs_on_the_outline_whichever_way_it_goes_round():
    lines = rim_lines(ReliefSilhouette.of(shapes.mask("ring", 320, 240)).inside)
    assert len(lines) == 2
    for line in lines:
        middle = line.xy.mean(0)
        radius = np.linalg.norm(line.xy - middle, axis=1)
        assert radius.std() < 0.12  # cells, of a circle
        outwards = ((line.xy - middle) * line.inward).sum(1)
        assert len({bool(side) for side in outwards > 0}) == 1


def test_a_corner_stays_one():
    inside = np.zeros((80, 100), bool)
    inside[20:60, 20:80] = True
    (line,) = rim_lines(inside)
    for corner in ([19.5, 19.5], [79.5, 59.5]):
        assert np.linalg.norm(line.xy - corner, axis=1).min() < 1.2  # cells
