"""What a stroke of the brush covers."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.brush import Brush, Stroke


@pytest.mark.parametrize("radius", [0.5, 3.0, 12.5])
@pytest.mark.parametrize("hardness", [0.0, 0.5, 1.0])
def test_a_dab_is_full_in_the_middle_and_nothing_beyond(radius: float, hardness: float) -> None:
    stroke = Stroke((64, 48), Brush(radius, hardness))
    stroke.move_to(30.5, 20.5)
    y, x = np.mgrid[0:48, 0:64] + 0.5
    gap = np.hypot(x - 30.5, y - 20.5)
    assert stroke.coverage[20, 30] > 0.99
    assert (stroke.coverage[gap > radius + 0.5] == 0).all()
    assert (stroke.coverage[gap < hardness * radius - 0.5] == 1).all()


def test_the_hardest_brush_covers_the_area_of_its_disc() -> None:
    stroke = Stroke((100, 100), Brush(30.0, 1.0))
    stroke.move_to(50.2, 49.7)
    assert stroke.coverage.sum() == pytest.approx(np.pi * 30.0**2, rel=1e-3)


def test_a_stroke_is_the_same_in_many_steps_as_in_one() -> None:
    brush = Brush(7.0, 0.3)
    one, many = Stroke((120, 80), brush), Stroke((120, 80), brush)
    one.move_to(10.0, 12.0)
    one.move_to(100.0, 60.0)
    for share in np.linspace(0, 1, 41):
        many.move_to(10 + 90 * share, 12 + 48 * share)
    np.testing.assert_allclose(one.coverage, many.coverage, atol=1e-4)  # f32 of the segments
    assert one.box == many.box


def test_nothing_outside_the_returned_boxes_changes() -> None:
    stroke = Stroke((60, 40), Brush(5.0, 0.5))
    before = stroke.coverage.copy()
    for x, y in ((-3.0, 4.0), (20.0, 10.0), (70.0, 50.0)):
        x0, y0, x1, y1 = stroke.move_to(x, y)
        changed = stroke.coverage != before
        changed[y0:y1, x0:x1] = False
        assert not changed.any()
        before = stroke.coverage.copy()
