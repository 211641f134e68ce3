"""The networks of the measures: which a measure needs, where its file is, and reading its numbers.

The official ones come from elsewhere and are never fetched here: a folder of the user's, or
`evaluation` among the models in the cache, holds them under the names that they are published with
(models/published.py). Others are weights of the registry, each measure under a name of its own.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from objectmorpher_core import models
from objectmorpher_core.models import device
from objectmorpher_core.models.added import (
    PLAIN,
    check_published,
    find_file,
    hash_once,
    trunk_folder,
)

from ..error import EvaluationError

Tensors = Mapping[str, Any]  # torch.Tensor by its name in torchvision's state dict
Shapes = Mapping[str, tuple[int, ...]]
NEEDS: Mapping[str, tuple[str, ...]] = {  # ids of trunks and weights by the measure's name
    "lpips-alex": ("alexnet", "lpips-alex"),
    "lpips-vgg": ("vgg16", "lpips-vgg"),
    "sifid-64": ("inception-v3",), "sifid-192": ("inception-v3",), "sifid-768": ("inception-v3",),
    "fid": ("fid-inception",), "kid": ("fid-inception",), "kid-paired": ("fid-inception",),
    "hed-vgg-perceptual": ("hed-vgg",),
    "dinov2-perceptual": ("dinov2-vits14",), "dinov2-identity": ("dinov2-vits14",),
    "dinov2-mmd-paired": ("dinov2-vits14",),
}  # fmt: skip
OWN = ("dinov2-vits14", "hed-vgg")  # of measures under names of their own; they run in onnxruntime
HEADS = {  # weights that the user may have as files, too, and what they are called then
    "lpips-alex": ("lpips-v0.1-alex.pth", "alex.pth"),
    "lpips-vgg": ("lpips-v0.1-vgg.pth", "vgg.pth"),
}


def why_missing(measure: str, folder: Path | None = None) -> str | None:
    """Why a measure cannot be taken here, or None; `folder` of the user's own files."""
    for id in NEEDS.get(measure, ()):
        if find(id, folder) is None:
            return _told_missing(id, folder)
        if id not in OWN and not device.has_torch():
            return f"PyTorch is needed: {models.EXTRA}"
    return None


def find(id: str, folder: Path | None) -> Path | None:
    """The file of a trunk or a weight: in `folder`, or among the models where none is given."""
    where = folder if folder is not None else trunk_folder()
    if id in _trunks():
        return find_file(_trunks()[id].files, where)
    return find_file(HEADS.get(id, ()), where) or models.path(id)


def checked(id: str, folder: Path | None) -> tuple[Path, str]:
    """The file, and its SHA-256. Raises EvaluationError where it is not what its name says."""
    path = find(id, folder)
    if path is None:
        raise EvaluationError(_told_missing(id, folder))
    try:
        if id in _trunks():
            check_published(_trunks()[id], path)
        sha256 = hash_once(path)
    except models.ModelError as error:
        raise EvaluationError(str(error)) from error
    if id not in _trunks() and path.suffix != PLAIN and sha256 != models.weight(id).sha256:
        raise EvaluationError(f"{path} is not the file that {id} is: wrong hash")
    return path, sha256


def read(path: Path, shapes: Shapes) -> dict[str, Any]:
    """The tensors called so, as float32. Raises EvaluationError: one sentence.

    Pickles are read by PyTorch's reader of plain numbers, which runs nothing. What else the file
    holds (a classifier) is left out.
    """
    import torch

    try:
        if path.suffix == PLAIN:
            from safetensors.torch import load_file

            found: Any = load_file(str(path))
        else:
            found = torch.load(path, map_location="cpu", weights_only=True)
    except OSError as error:
        raise EvaluationError(f"{path} cannot be read: {error.strerror or error}") from error
    except (pickle.UnpicklingError, RuntimeError, EOFError, ValueError, KeyError) as error:
        raise EvaluationError(f"{path} is damaged, or holds more than numbers") from error
    except Exception as error:  # safetensors' own, which has no public base
        raise EvaluationError(f"{path} is no {PLAIN} file") from error
    if not isinstance(found, dict):
        raise EvaluationError(f"{path} is no table of tensors")
    taken = {}
    for name, shape in shapes.items():
        tensor: Any = found.get(name)
        if not isinstance(tensor, torch.Tensor) or tuple(tensor.shape) != shape:
            what = tuple(tensor.shape) if isinstance(tensor, torch.Tensor) else "not there"
            raise EvaluationError(f"{path}: {name} is {what}, it should be {shape}")
        taken[name] = tensor.float()
    return taken


def _trunks() -> dict[str, models.Trunk]:
    return {known.id: known for known in models.trunks()}


def _told_missing(id: str, folder: Path | None) -> str:
    if id not in _trunks():
        return f"the model {id} is not here: `objectmorpher models get {id}`"
    known = _trunks()[id]
    where = f"in {folder}" if folder else f"`objectmorpher models add {id} FILE`, or --weights DIR"
    return f"{known.name} is not here ({known.files[0]}: {where})"
