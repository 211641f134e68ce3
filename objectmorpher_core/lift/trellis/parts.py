"""The parts of a model: built from their description, loaded strictly from safetensors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from .. import LiftError
from .blocks import NetworkPart
from .configs import (
    GaussianDecoderConfig,
    LatentEncoderConfig,
    LatentFlowConfig,
    StructureDecoderConfig,
    StructureFlowConfig,
    ViewLatentFlowConfig,
    config,
    read_json,
)
from .latent import LatentFlow, ViewLatentFlow
from .structure import StructureDecoder, StructureFlow
from .windowed import GaussianDecoder, LatentEncoder

PICKLES = (".pt", ".pth", ".bin", ".ckpt", ".pkl")


@dataclass(frozen=True)
class PublishedKind:
    """The meaning of a published class name."""

    config: type[Any]
    part: Callable[[Any], NetworkPart]


KINDS = {
    "SparseStructureFlowModel": PublishedKind(StructureFlowConfig, StructureFlow),
    "SparseStructureDecoder": PublishedKind(StructureDecoderConfig, StructureDecoder),
    "SLatFlowModel": PublishedKind(LatentFlowConfig, LatentFlow),
    "SLatGaussianDecoder": PublishedKind(GaussianDecoderConfig, GaussianDecoder),
    "SLatEncoder": PublishedKind(LatentEncoderConfig, LatentEncoder),
    "VisualLatentConditioningSLatFlowModel": PublishedKind(ViewLatentFlowConfig, ViewLatentFlow),
}


def build(description: dict[str, Any]) -> NetworkPart:
    """The network of a part's json, with weights as torch makes them. Raises LiftError."""
    name, args = description.get("name"), description.get("args")
    kind = KINDS.get(str(name).removeprefix("Elastic"))
    if kind is None or not isinstance(args, dict):
        raise LiftError(f"a part called {name!r} is not known; known are {', '.join(KINDS)}")
    return kind.part(config(kind.config, args))


def load_part(path: Path, device: torch.device, dtype: torch.dtype) -> NetworkPart:
    """The part whose files are `path`.json and `path`.safetensors, on `device`, to be run.

    Its transformer or convolutions get `dtype`, the rest stays in single precision, as published.
    Every key and shape must be as the description says. Raises LiftError: one sentence.
    """
    with torch.device("meta"):
        part = build(read_json(path.with_name(path.name + ".json")))
    wanted = part.state_dict()
    lower = part.lower_precision()
    found = {}
    with opened(path.with_name(path.name + ".safetensors")) as file:
        shapes = {key: tuple(file.get_slice(key).get_shape()) for key in file.keys()}  # noqa: SIM118
        refuse_differences(path.name, shapes, {key: tuple(t.shape) for key, t in wanted.items()})
        for key in wanted:
            own = dtype if key in lower else torch.float32
            found[key] = file.get_tensor(key).to(device=device, dtype=own)
    part.load_state_dict(found, strict=True, assign=True)
    part.precision = dtype
    return part.eval().requires_grad_(False)


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """A safetensors file. Nothing else is ever read: other formats can run code."""
    from safetensors import SafetensorError, safe_open

    if not path.exists():
        beside = [end for end in PICKLES if path.with_suffix(end).exists()]
        reason = f"; {path.stem}{beside[0]} could run code and is not read" if beside else ""
        raise LiftError(f"{path} is missing{reason}")
    try:
        with safe_open(str(path), framework="pt") as file:
            yield file
    except (SafetensorError, OSError) as error:
        raise LiftError(f"{path} is damaged: {error}") from error


def refuse_differences(
    name: str, found: dict[str, tuple[int, ...]], wanted: dict[str, tuple[int, ...]]
) -> None:
    """Raises LiftError where the keys or shapes of weights are not those that are wanted."""
    absent, more = sorted(set(wanted) - set(found)), sorted(set(found) - set(wanted))
    if absent or more:
        parts = [f"lacks {absent[0]} and {len(absent) - 1} others"] if absent else []
        parts += [f"has {more[0]} and {len(more) - 1} others too many"] if more else []
        raise LiftError(
            f"the weights {name} are not those of their description: {'; '.join(parts)}"
        )
    for key, shape in wanted.items():
        if found[key] != shape:
            raise LiftError(f"in the weights {name} {key} is {found[key]}, expected {shape}")


def save_part(part: NetworkPart, description: dict[str, Any], path: Path) -> None:
    """Writes what `load_part` reads."""
    import json

    from safetensors.torch import save_file

    path.parent.mkdir(parents=True, exist_ok=True)
    tensors: dict[str, Tensor] = {k: t.contiguous() for k, t in part.state_dict().items()}
    save_file(tensors, str(path.with_name(path.name + ".safetensors")))
    path.with_name(path.name + ".json").write_text(json.dumps(description), encoding="utf-8")
