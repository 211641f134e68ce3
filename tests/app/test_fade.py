"""Fading: a share that rises and falls with time, and a window that sleeps again."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher.gui.widgets.panes import FADE, Fades

CAT, DOG = object(), object()
EXACT = 1e-9


def follow(fades: Fades, thing: object | None, start: float, *after: float) -> list[float]:
    """The shares in frames at `start` and so many s after it."""
    shares = []
    for seconds in (0.0, *after):
        fades.begin(start + seconds, is_on=True)
        shares.append(fades.shown("it", thing)[1])
    return shares


def test_a_thing_comes_within_the_time_and_goes_within_it() -> None:
    fades, times = Fades(), (0.25 * FADE, 0.5 * FADE, 0.99 * FADE, 1.01 * FADE, 9.0)
    coming = follow(fades, CAT, 100.0, *times)
    np.testing.assert_allclose(coming, [0, 0.25, 0.5, 0.99, 1, 1], atol=EXACT)
    going = follow(fades, None, 200.0, *times)  # the window has slept meanwhile
    np.testing.assert_allclose(going, [1, 0.75, 0.5, 0.01, 0, 0], atol=EXACT)


def test_what_goes_is_still_drawn_and_then_forgotten() -> None:
    fades = Fades()
    follow(fades, CAT, 0.0, FADE)
    fades.begin(1.0, is_on=True)
    assert fades.shown("it", None) == (CAT, 1.0)
    fades.begin(1.0 + FADE, is_on=True)
    assert fades.shown("it", None) == (None, 0.0)


def test_it_turns_around_where_it_is_and_another_begins_anew() -> None:
    fades = Fades()
    follow(fades, CAT, 0.0, FADE / 2)
    assert follow(fades, None, FADE / 2, 0.25 * FADE)[-1] == pytest.approx(0.25)
    assert follow(fades, CAT, 0.75 * FADE, 0.25 * FADE)[-1] == pytest.approx(0.5)
    assert follow(fades, DOG, FADE, 0.25 * FADE)[-1] == pytest.approx(0.25)


def test_the_window_is_awake_only_while_something_moves() -> None:
    fades, awake = Fades(), []
    for thing in (CAT, None):
        for seconds in (0.0, 0.5 * FADE, FADE, 2 * FADE):
            fades.begin((thing is None) + seconds, is_on=True)
            fades.shown("it", thing)
            awake.append(fades.is_moving)
    assert awake == [True, True, False, False] * 2
    fades.begin(5.0, is_on=True)
    assert not fades.is_moving, "what is not drawn keeps nobody awake"


def test_without_motion_the_end_is_there_at_once() -> None:
    fades = Fades()
    for thing, share in ((CAT, 1.0), (DOG, 1.0), (None, 0.0)):
        fades.begin(0.0, is_on=False)
        assert fades.shown("it", thing) == (thing, share)
        assert not fades.is_moving


def test_what_was_out_of_sight_does_not_flash_up_when_it_has_gone() -> None:
    fades = Fades()
    follow(fades, CAT, 0.0, FADE)
    for now in (1.0, 2.0):
        fades.begin(now, is_on=True)
    assert fades.shown("it", None) == (None, 0.0)
    assert not fades.is_moving
