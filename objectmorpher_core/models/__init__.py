"""Learned weights: a registry, a verified cache on disk, and how to fill it.

Nothing here is needed to run: every stage has a weight-free backend.
"""

from .added import KINDS, Added, add, added, remove
from .fetch import State, fetch, folder, look, path, verify
from .registry import ModelError, Weight, weight, weights

__all__ = [
    "KINDS",
    "Added",
    "ModelError",
    "State",
    "Weight",
    "add",
    "added",
    "fetch",
    "folder",
    "look",
    "path",
    "remove",
    "verify",
    "weight",
    "weights",
]
