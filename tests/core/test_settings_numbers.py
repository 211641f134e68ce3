"""Numbers of `document/settings.py`: what they mean, and which are refused."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from objectmorpher_core.document.bounds import (
    MOST_BLUR,
    MOST_EXPOSURE,
    MOST_SATURATION,
    MOST_SHARPNESS,
)
from objectmorpher_core.document.settings import GAMMA, WARMTH, Finish, Hint

PX = st.floats(-500, 500)
BOUNDS = {
    "opacity": (0, 1), "exposure": (-MOST_EXPOSURE, MOST_EXPOSURE), "warmth": (-1, 1),
    "saturation": (0, MOST_SATURATION), "sharpness": (0, MOST_SHARPNESS), "blur": (0, MOST_BLUR),
}  # fmt: skip


@given(PX, PX, PX, PX, st.floats(0.5, 90), st.floats(0.25, 4), st.floats(0.25, 4))
def test_a_hint_moves_and_scales_with_its_picture(x, y, dx, dy, radius, wide, high):
    hint = Hint((x, y), (y, x), radius)
    assert hint.moved(dx, dy) == Hint((x + dx, y + dy), (y + dx, x + dy), radius)
    scaled = hint.moved(dx, dy, (wide, high))
    assert scaled.source == ((x + dx) * wide, (y + dy) * high)
    assert scaled.to == ((y + dx) * wide, (x + dy) * high)
    assert scaled.radius == radius * min(wide, high)
    for none in (0.0, -radius, float("nan")):
        with pytest.raises(ValueError, match="radius"):
            Hint((x, y), (y, x), none)


@given(st.floats(-3, 3), st.floats(-1, 1))
def test_a_stop_doubles_the_light(exposure, warmth):
    """Of decoded red, green and blue, of which warmth raises the first and lowers the last."""
    light = [gain**GAMMA for gain in Finish(exposure=exposure, warmth=warmth).gain]
    stops = exposure + WARMTH * warmth, exposure, exposure - WARMTH * warmth
    assert light == pytest.approx([2.0**stop for stop in stops], rel=1e-9)


@pytest.mark.parametrize("name", BOUNDS)
def test_a_finish_is_refused_just_beyond_its_bounds_alone(name):
    low, high = BOUNDS[name]
    for value in (low, high):
        Finish(**{name: value}).check()
    for value in (low - 0.01, high + 0.01):
        with pytest.raises(ValueError, match=name):
            Finish(**{name: value}).check()
