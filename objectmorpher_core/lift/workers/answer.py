"""The small JSON files that workers leave, and the poses in them (docs/workers.md)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import F64
from ...base.limits import WORKER_FILE
from ...base.quoting import shown

VERSION = 1  # of the protocol
TOLERANCE = 1e-3  # of a turn's rows, in its size
# What reading a file raises that says something else than it should.
WRONG = (OSError, ValueError, LookupError, TypeError, RecursionError, OverflowError)


def read_told(at: Path) -> Any:
    """Read a JSON file of our version. Raises one of WRONG."""
    if at.is_symlink() or at.stat().st_size > WORKER_FILE:
        raise ValueError("it is no small file")
    told = json.loads(at.read_text(encoding="utf-8"))
    if told["version"] != VERSION:
        raise ValueError(f"version {shown(told['version'])} is not known")
    return told


def check_similarity(matrix: F64, name: str, size: float | None = None) -> None:
    """Raises ValueError unless it is a (4, 4) of a turn, a `size` (None: any) and a place."""
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ValueError(f"{name} is no 4 x 4 of numbers")
    linear = matrix[:3, :3]
    volume = np.linalg.det(linear)
    squared = np.cbrt(volume) ** 2 if size is None else size**2
    is_turn = volume > 0 and np.allclose(linear @ linear.T / squared, np.eye(3), atol=TOLERANCE)
    if not is_turn or not np.allclose(matrix[3], [0, 0, 0, 1]):
        known = "size" if size is None else f"size of {size:g}"
        raise ValueError(f"{name} is no turn, {known} and place")
