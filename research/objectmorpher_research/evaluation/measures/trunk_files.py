"""The networks of the measures: which a measure needs, where its file is, and reading its numbers.

The official ones (`TRUNKS`) come from elsewhere and are never fetched here, for no package carries
them: a folder of the user's, or `evaluation` among the models in the cache, holds them under the
names that they are published with. Others are weights of the registry, each measure under a name of
its own.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from objectmorpher_core import models
from objectmorpher_core.models import device
from objectmorpher_core.models.fetch import sha256_of
from objectmorpher_core.models.weight_folder import PLAIN

from ..error import EvaluationError

Tensors = Mapping[str, Any]  # torch.Tensor by its name in torchvision's state dict
Shapes = Mapping[str, tuple[int, ...]]


@dataclass(frozen=True)
class Trunk:
    """An official network, one file, which the user brings."""

    name: str
    files: tuple[str, ...]  # published names, which hold the first digits of the SHA-256

    def check(self, path: Path, sha256: str) -> None:
        """Raises EvaluationError where a file is not what its name says; safetensors have none."""
        begins = path.name.rpartition("-")[2].partition(".")[0]
        if path.suffix != PLAIN and not sha256.startswith(begins):
            told = f"its SHA-256 starts with {sha256[: len(begins)]}, not {begins}"
            raise EvaluationError(f"{path} is not {self.name} as published: {told}")


TRUNKS = {
    "alexnet": Trunk("AlexNet", ("alexnet-owt-7be5be79.pth", "alexnet-owt-4df8aa71.pth")),
    "vgg16": Trunk("VGG16", ("vgg16-397923af.pth",)),
    "inception-v3": Trunk(
        "torchvision's Inception-v3",
        ("inception_v3_google-0cc3c7bd.pth", "inception_v3_google-1a9a5a14.pth"),
    ),
    "fid-inception": Trunk(
        "FID's Inception",
        ("weights-inception-2015-12-05-6726825d.pth", "pt_inception-2015-12-05-6726825d.pth"),
    ),
}
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
    where = folder if folder is not None else _usual_folder()
    if id in TRUNKS:
        return _first_of(TRUNKS[id].files, where)
    return _first_of(HEADS.get(id, ()), where) or models.path(id)


def _usual_folder() -> Path:
    return models.folder() / "evaluation"


def _first_of(names: tuple[str, ...], where: Path) -> Path | None:
    """The first of the names that is in a folder, or the same tensors as safetensors."""
    for name in names:
        for path in (where / name, (where / name).with_suffix(PLAIN)):
            if path.is_file():
                return path
    return None


def checked(id: str, folder: Path | None) -> tuple[Path, str]:
    """The file, and its SHA-256. Raises EvaluationError where it is not what its name says."""
    path = find(id, folder)
    if path is None:
        raise EvaluationError(_told_missing(id, folder))
    try:
        sha256 = _sha256_of(path, path.stat().st_size, path.stat().st_mtime_ns)
    except OSError as error:
        raise EvaluationError(f"{path} cannot be read: {error.strerror or error}") from error
    if id in TRUNKS:
        TRUNKS[id].check(path, sha256)
    elif path.suffix != PLAIN and sha256 != models.weight(id).sha256:
        raise EvaluationError(f"{path} is not the file that {id} is: wrong hash")
    return path, sha256


@cache
def _sha256_of(path: Path, _size: int, _changed: int) -> str:
    """Of a file that has not changed, computed once in a process."""
    return sha256_of(path)


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


def _told_missing(id: str, folder: Path | None) -> str:
    if id not in TRUNKS:
        return f"the model {id} is not here: `objectmorpher models get {id}`"
    known = TRUNKS[id]
    where = str(folder) if folder else f"{_usual_folder()}, or --weights DIR"
    return f"{known.name} is not here ({known.files[0]} in {where})"
