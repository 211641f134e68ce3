"""Which triplet comes when, and with which noise: a function of the seed and a count, nothing else.

So a training that is killed goes on as if it had not been, and one on eight processes draws what
one on a single process draws.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor

ORDER, NOISE = 0, 1  # streams of a seed


def chosen(seed: int, number: int, count: int) -> int:
    """Which of `count` triplets the `number`-th sample is: each once in a pass, mixed anew."""
    done, place = divmod(number, count)
    return int(np.random.default_rng([ORDER, seed, done]).permutation(count)[place])


def drawn(seed: int, number: int, shape: tuple[int, ...]) -> tuple[float, Tensor]:
    """A time in [0, 1) and noise of `shape`, float32 on the CPU, of the `number`-th sample."""
    import torch

    word = np.random.SeedSequence([NOISE, seed, number]).generate_state(1, np.uint64)[0]
    source = torch.Generator("cpu").manual_seed(int(word >> np.uint64(1)))
    time = float(torch.rand((), generator=source, dtype=torch.float64))
    return time, torch.randn(shape, generator=source)
