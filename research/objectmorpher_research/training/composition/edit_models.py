"""The protocol of an image-editing model in training, and the stored form of a triplet."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from objectmorpher_core import models
from objectmorpher_core.base.arrays import RGB

from . import TrainingError
from .shards import read_json

if TYPE_CHECKING:
    from torch import Tensor, nn

Grid = tuple[int, int]  # rows and columns of tokens


@dataclass(frozen=True, eq=False)
class Latents:
    """A triplet as the transformer sees it, of one sample."""

    target: Tensor  # (1, n, c) A's tokens
    conditions: Tensor  # (1, m, c) B's, then the coarse edit's
    embedding: Tensor  # (1, l, d) what the text encoder says
    grids: tuple[Grid, Grid, Grid]  # of A, B and the coarse edit
    mask: Tensor | None = None  # (1, l) of the embedding; None: all of it counts


class EditModel(Protocol):
    """A transformer that turns [B, coarse A] into A by flow matching, and what surrounds it."""

    name: str
    families: tuple[str, ...]  # of the model registry that can be trained, the best first
    pipeline: str  # diffusers' class
    targets: tuple[str, ...]  # modules that get an adapter
    sees_pictures: bool  # whether the text encoder does; else it says the same of every triplet
    size: dict[str, Any]  # of the published transformer, where its class's defaults are others

    def encoders(self, folder: Path, device: str, number: str) -> Any:
        """The pipeline without its transformer; as a context for `encode`."""
        ...

    def decoder(self, folder: Path, device: str, number: str) -> Any:
        """The pipeline without transformer and text encoder, for `decode`."""
        ...

    def encode(self, pipeline: Any, pictures: tuple[RGB, RGB, RGB], side: int) -> Latents:
        """B, coarse A and A as latents; A has about `side` x `side` px."""
        ...

    def decode(self, pipeline: Any, tokens: Tensor, grid: Grid) -> RGB:
        """The picture (h, w, 3) of A's tokens (1, n, c)."""
        ...

    def transformer_class(self) -> Any:
        """Diffusers' class."""
        ...

    def velocity(self, transformer: nn.Module, noisy: Tensor, sigma: Tensor, at: Latents) -> Tensor:
        """(1, n, c) noise less picture, of `noisy` (1, n, c) at `sigma` (1,) in [0, 1]."""
        ...

    def shift(self, scheduler: Any, tokens: int, steps: int) -> float:
        """mu of the scheduler for a picture of so many tokens, as the pipeline has it."""
        ...

    def made_up(self, side: int, number: str, device: str) -> Latents:
        """Random latents of the published model's shapes, for a measurement."""
        ...


BACKENDS = {  # imported when chosen
    "qwen": "objectmorpher_research.training.composition.qwen_edit:QwenEdit",
    "klein": "objectmorpher_research.training.composition.klein_edit:KleinEdit",
}


def load(name: str) -> EditModel:
    """Raises TrainingError for an unknown name."""
    if name not in BACKENDS:
        raise TrainingError(f"there is no model {name!r} to train; known: {', '.join(BACKENDS)}")
    module, _, kind = BACKENDS[name].partition(":")
    return getattr(import_module(module), kind)()


def folder_of(model: EditModel, weights: Path | None) -> Path:
    """The pipeline's folder: `weights`, or what the model manager has. Raises TrainingError."""
    if weights is not None:
        at = weights / "model_index.json"
        if not at.is_file():
            raise TrainingError(f"{weights} is no pipeline's folder: it has no model_index.json")
        kind = read_json(at).get("_class_name")
        if kind != model.pipeline:
            raise TrainingError(f"{weights} holds a {kind}, not a {model.pipeline}")
        return weights
    known = [m for m in models.hub_models() if m.family in model.families]
    for one in known:
        if (at := models.place(one.id)) is not None:
            return at
    raise TrainingError(f"no model is there: `objectmorpher models get {known[0].id}`")


def open_pipeline(kind: Any, folder: Path, number: str, **parts: Any) -> Any:
    """Diffusers' pipeline of the class `kind`; `parts` stand in for what the folder has.

    `number` is the name of torch's type. Nothing is fetched.
    """
    import torch

    return kind.from_pretrained(
        folder, dtype=getattr(torch, number), local_files_only=True, use_safetensors=True, **parts
    )


def rgb_of(pipeline: Any, decoded: Tensor) -> RGB:
    """(h, w, 3) of what a pipeline's VAE decoded, (1, 3, h, w)."""
    shown = pipeline.image_processor.postprocess(decoded.float(), output_type="np")[0]
    return np.rint(np.clip(np.nan_to_num(shown), 0, 1) * 255).astype(np.uint8)


def level(scheduler: Any, mu: float, time: float) -> float:
    """The noise level at a `time` in [0, 1), spread as the sampler's own steps are."""
    import torch

    config = scheduler.config
    if config.use_dynamic_shifting:
        return float(scheduler.time_shift(mu, 1.0, torch.tensor([max(time, 1e-4)]))[0])
    return config.shift * time / (1 + (config.shift - 1) * time)


def scheduler_of(folder: Path) -> Any:
    """The pipeline's own. Raises TrainingError."""
    from diffusers.schedulers.scheduling_flow_match_euler_discrete import (
        FlowMatchEulerDiscreteScheduler,
    )

    try:
        return FlowMatchEulerDiscreteScheduler.from_pretrained(folder / "scheduler")
    except (OSError, ValueError, TypeError) as error:
        raise TrainingError(f"{folder}'s scheduler cannot be read: {error}") from error
