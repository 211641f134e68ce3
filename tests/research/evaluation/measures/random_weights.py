"""Random weights that keep the size of what passes through them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np


def random_state(wanted: Mapping[str, tuple[int, ...]], seed: int = 0) -> dict[str, Any]:
    """torch.Tensor by name, of these shapes: of convolutions and of batch normalisations."""
    import torch

    random = torch.Generator().manual_seed(seed)
    state = {}
    for name, shape in wanted.items():
        values = torch.randn(shape, generator=random)
        if len(shape) == 4:
            values *= (2 / float(np.prod(shape[1:]))) ** 0.5
        elif name.endswith(("running_var", "bn.weight")):
            values = 1 + 0.1 * values.abs()
        else:
            values *= 0.05
        state[name] = values
    return state
