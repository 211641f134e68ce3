"""The Euler steps, against closed forms."""

# ruff: noqa: E402 (nothing that needs torch can be imported before the skip)
from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="TRELLIS needs torch")

from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.lift.trellis.configs import Sampling
from objectmorpher_core.lift.trellis.generator import sample, times

F32 = 1e-5
NOISE = torch.linspace(-1, 1, 12).reshape(2, 6)


def test_a_straight_flow_arrives_in_any_number_of_steps():
    """x_t = (1 - t) x_0 + t noise has the velocity noise - x_0 at every time."""
    end = torch.arange(12.0).reshape(2, 6)
    for steps, rescale in ((1, 1.0), (7, 1.0), (12, 3.0)):
        how = Sampling(steps=steps, guidance=0.0, rescale_t=rescale)
        found = sample(lambda x, t, shown: NOISE - end, NOISE, how, silent, "")
        assert torch.allclose(found, end, atol=F32)


def test_a_linear_flow_is_the_product_of_its_steps():
    """v = a x: each step multiplies by 1 - a (t - t')."""
    how = Sampling(steps=9, guidance=0.0, rescale_t=3.0)
    gaps = -np.diff(times(how))
    found = sample(lambda x, t, shown: 0.7 * x, NOISE, how, silent, "")
    assert torch.allclose(found, NOISE * float(np.prod(1 - 0.7 * gaps)), atol=F32)
    assert gaps.sum() == pytest.approx(1)


def test_guidance_counts_inside_its_interval_only():
    how = Sampling(steps=10, guidance=4.0, interval=(0.5, 1.0))
    asked = []

    def velocity(x, time, is_shown):
        asked.append((round(float(time[0])), is_shown))
        return torch.full_like(x, 1.0 if is_shown else 0.5)

    found = sample(velocity, NOISE, how, silent, "")
    guided = (1 + 4) * 1.0 - 4 * 0.5
    assert torch.allclose(found, NOISE - (0.6 * guided + 0.4 * 1.0), atol=F32)
    assert [t for t, shown in asked if not shown] == [1000, 900, 800, 700, 600, 500]
    assert len(asked) == 10 + 6


def test_progress_is_told_before_each_step_and_can_cancel():
    told = []

    def progress(fraction, note):
        told.append(fraction)
        if len(told) == 3:
            raise Cancelled

    calls = []
    how = Sampling(steps=5, guidance=0.0)
    with pytest.raises(Cancelled):
        sample(lambda x, t, s: calls.append(1) or x, NOISE, how, progress, "")
    assert told == [0.0, 0.2, 0.4] and len(calls) == 2
