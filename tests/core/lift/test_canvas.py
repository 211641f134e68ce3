"""The reduced cut-out: the same picture, in the same place."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.document.model import Matte
from objectmorpher_core.lift.relief.canvas import LEAST_SIDE, ReliefCanvas, carried_on

F32 = 1e-5
HEIGHT, WIDTH = 3 * LEAST_SIDE + 1, 5 * LEAST_SIDE // 2
RNG = np.random.default_rng(0)
MATTE = Matte(
    20, -30,
    RNG.random((HEIGHT, WIDTH), np.float32), RNG.random((HEIGHT, WIDTH, 3), np.float32),
)  # fmt: skip


def test_what_is_fine_enough_stays_as_it_is():
    canvas = ReliefCanvas.of(MATTE, None, 1.9)
    assert canvas.step == 1
    assert canvas.foreground is MATTE.foreground and canvas.alpha is MATTE.alpha


@pytest.mark.parametrize("step", [2, 3])
def test_a_pixel_is_the_mean_of_its_block(step):
    canvas = ReliefCanvas.of(MATTE, None, step + 0.5)
    assert canvas.step == step and tuple(canvas.corner) == (20, -30)
    block = np.s_[7 * step : 8 * step, 5 * step : 6 * step]
    assert canvas.alpha[7, 5] == pytest.approx(MATTE.alpha[block].mean(), abs=F32)
    assert canvas.foreground[7, 5] == pytest.approx(MATTE.foreground[block].mean((0, 1)), abs=F32)


def test_a_small_picture_is_not_made_smaller():
    assert max(ReliefCanvas.of(MATTE, None, 1000.0).alpha.shape) >= LEAST_SIDE


def test_it_holds_what_is_hidden_beside_the_matte():
    hidden = np.zeros((2000, 1500), bool)
    hidden[1300:1400, 900:1100] = True
    canvas = ReliefCanvas.of(MATTE, hidden, 2.0)
    x, y = (np.array([1000, 1350]) - canvas.corner) / canvas.step
    assert canvas.alpha[int(y), int(x)] == 0 and canvas.whole[int(y), int(x)] == 1
    x, y = (np.array([100, 100]) - canvas.corner) / canvas.step
    assert canvas.whole[int(y), int(x)] == canvas.alpha[int(y), int(x)] > 0


def test_a_slope_goes_on_beyond_a_slanted_end_without_its_steps():
    y, x = np.mgrid[:40, :60].astype(np.float64)
    beyond = x + 0.1 * y - 30  # cells, of an end with a step every ten rows
    slope, known = 3 + 2.0 * beyond, beyond < 0
    whole = carried_on(slope, known, 3.0)
    assert np.array_equal(whole[known], slope[known])
    beside = (beyond > 0) & (beyond < 2) & (np.abs(y - 20) < 10)
    line = np.polynomial.Polynomial.fit(beyond[beside], whole[beside], 1)
    assert 1 < line.convert().coef[1] < 2  # a little held back
    assert (whole[beside] - line(beyond[beside])).std() < 0.1
