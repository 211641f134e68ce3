"""Whether two values are the same to the last bit."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def same_values(a: Any, b: Any) -> bool:
    """Types, shapes, dtypes and bytes; a number of numpy's is Python's."""
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(b, np.generic):
        b = b.item()
    if isinstance(a, np.generic):
        a = a.item()
    if type(a) is not type(b):
        return False
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(map(same_values, a, b))
    if is_dataclass(a):
        return all(same_values(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    return a == b
