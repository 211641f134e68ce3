"""Following a flow from noise to what it makes, by Euler steps, with guidance."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

from ...base.progress import Progress
from .configs import Sampling

Velocity = Callable[[Tensor, Tensor, bool], Tensor]
"""velocity(x, time (B,) in thousandths, whether the picture is shown) -> like x"""


def times(how: Sampling) -> np.ndarray:
    """(steps + 1,) from 1, noise, to 0."""
    t = np.linspace(1, 0, how.steps + 1)
    return how.rescale_t * t / (1 + (how.rescale_t - 1) * t)


def sample(
    velocity: Velocity, noise: Tensor, how: Sampling, progress: Progress, note: str
) -> Tensor:
    """What the flow makes of `noise`. `progress` is told before each step, and may cancel."""
    x = noise
    moments = times(how)
    for i, (now, then) in enumerate(pairwise(moments)):
        progress(i / how.steps, f"{note}, step {i + 1} of {how.steps}")
        time = torch.full((len(x),), float(1000 * now), dtype=torch.float32, device=x.device)
        v = velocity(x, time, True)
        if how.interval[0] <= now <= how.interval[1] and how.guidance != 0:
            v = (1 + how.guidance) * v - how.guidance * velocity(x, time, False)
        x = x - float(now - then) * v
    return x
