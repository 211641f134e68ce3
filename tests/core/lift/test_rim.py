"""Rims are smooth along their length, keep their corners, and lie on the outline."""

import numpy as np
import shapes

from objectmorpher_core.lift.relief.rim import rim_lines, smoothed
from objectmorpher_core.lift.relief.silhouette import Silhouette

LENGTH = np.arange(401.0)  # cells, of a closed line of 400 places


def test_short_waves_go_and_sharp_corners_stay():
    at = LENGTH[:-1]
    tent = 3.0 * np.abs(at - 200)
    found = smoothed(tent + 0.6 * np.sin(2 * np.pi * at / 20), LENGTH, 60.0)
    rest = np.abs(np.diff(found, 2))
    away = np.abs(at[1:-1] - 200) > 25
    away[:25] = away[-25:] = False  # the other corner, where the line closes
    assert rest[away].max() < 0.2 * 0.6 * (2 * np.pi / 20) ** 2  # of the waves' own bend
    assert rest[195:202].max() > 100 * rest[away].max()


def test_a_line_runs_on_the_outline_whichever_way_it_goes_round():
    lines = rim_lines(Silhouette.of(shapes.mask("ring", 320, 240)).inside)
    assert len(lines) == 2
    for line in lines:
        middle = line.xy.mean(0)
        radius = np.linalg.norm(line.xy - middle, axis=1)
        assert radius.std() < 0.15  # cells, of a circle
        outwards = ((line.xy - middle) * line.inward).sum(1)
        assert len({bool(side) for side in outwards > 0}) == 1
