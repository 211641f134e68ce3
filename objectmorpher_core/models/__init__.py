"""Learned weights: a registry, a verified cache on disk, and how to fill it.

Nothing here is needed to run: every stage has a weight-free backend.
"""

from .fetch import State, fetch, folder, path, verify
from .registry import ModelError, Weight, weight, weights

__all__ = [
    "ModelError",
    "State",
    "Weight",
    "fetch",
    "folder",
    "path",
    "verify",
    "weight",
    "weights",
]
