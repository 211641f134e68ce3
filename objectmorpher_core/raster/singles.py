"""Numbers of 32 bits for kernels: a plain 1.0 would make 64-bit arithmetic of what it meets."""

from __future__ import annotations

import numpy as np

ZERO, HALF, ONE, TWO, THREE = (np.float32(value) for value in (0, 0.5, 1, 2, 3))
INFINITE = np.float32(np.inf)
