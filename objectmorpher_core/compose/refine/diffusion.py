"""What all refiners by diffusers' pipelines share: sizes, detail, progress, seeds, adapters."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ... import models
from ...base.arrays import F32, RGB
from ...base.progress import Progress
from ...models import HubModel, ModelError, device
from ...models.weight_folder import PLAIN, check_safetensors
from . import RefineError
from .memory import PipelineNeed, PipelinePlan, placed, plans, quantised

AREA = 1024 * 1024  # px that the networks were trained on
STEP = 32  # px of which both sides are multiples
PACKAGES = ("torch", "diffusers", "transformers", "accelerate", "peft", "safetensors")
INSTRUCTION = (
    "Make the edited object in the last picture look as if it had been photographed there: fit its"
    " light, colours, shadow and edges to the scene, and repair what is torn or smeared. Keep its"
    " shape, its pose, its place and everything else exactly as they are."
)


class DiffusionRefiner:
    """A refiner whose pipeline is loaded once in a process, where memory allows."""

    name: str
    families: tuple[str, ...]  # of models.registry, the best first
    adapters: str  # family of the LoRA that was trained for this job
    pipeline: str  # diffusers' class
    parts: tuple[str, ...]  # that may be in four bits
    work: int  # bytes at half precision beside the weights

    def __init__(self) -> None:
        """Nothing is loaded yet."""
        self._opened: tuple[object, Any] | None = None  # what it was made of, the pipeline
        self._tiers: tuple[PipelinePlan, ...] | None = None

    def missing(self) -> str | None:
        """See `Refiner`."""
        if reason := models.not_installed(PACKAGES):
            return reason
        if self.model() is None:
            best = self.choices()[0]
            size = f"{best.size / 1e9:.0f} GB, {best.licence}"
            return f"no model is there: `objectmorpher models get {best.id}` ({size})"
        return None

    def choices(self) -> tuple[HubModel, ...]:
        """The models that it can use, the best first."""
        return tuple(m for m in models.hub_models() if m.family in self.families)

    def model(self) -> HubModel | None:
        """The best that is there."""
        return next((m for m in self.choices() if models.place(m.id) is not None), None)

    def refine(
        self, original: RGB, coarse: RGB, object_alpha: F32, progress: Progress, seed: int = 0
    ) -> RGB:
        """See `Refiner`."""
        if (sentence := self.missing()) is not None:
            raise RefineError(sentence)
        height, width = coarse.shape[:2]
        size = working_size(width, height)
        small = [_resized(p, size) for p in (original, coarse)]
        self._tiers = self._tiers or plans(self.need())
        first = self._tiers

        def attempt(plan: PipelinePlan) -> RGB:
            made = self._run(self._loaded(plan, progress), plan, small, progress, seed)
            # A tier that was too small once is not tried again.
            self._tiers = first[first.index(plan) :]
            return made

        made = device.run(first, attempt)
        return with_detail(made, small[1], coarse)

    def need(self) -> PipelineNeed:
        """What the chosen model asks of memory."""
        raise NotImplementedError

    def _call(self, pipeline: Any, pictures: list[Any], given: dict[str, Any]) -> Any:
        raise NotImplementedError

    def _steps(self) -> int:
        raise NotImplementedError

    def _load(self, folder: Path, options: dict[str, Any], plan: PipelinePlan) -> Any:
        raise NotImplementedError

    def _sources(self) -> tuple[tuple[str, Path], ...]:
        """What the pipeline is made of besides its model: adapters by name."""
        return adapter_files((self.name, self.adapters))

    def folder(self) -> Path:
        """Of the model that is used."""
        model = self.model()
        found = None if model is None else models.place(model.id)
        assert found is not None, "missing() was asked"
        return found

    def _loaded(self, plan: PipelinePlan, progress: Progress) -> Any:
        made_of = (plan, self.folder(), self._sources())
        if self._opened is None or self._opened[0] != made_of:
            progress(0.0, "Loading the refiner")
            self._opened = None  # not two at a time
            self._opened = made_of, self._open(plan)
        return self._opened[1]

    def _open(self, plan: PipelinePlan) -> Any:
        import diffusers
        import torch

        diffusers.utils.logging.set_verbosity_error()
        diffusers.utils.logging.disable_progress_bar()
        folder = self.folder()
        options: dict[str, Any] = {
            "dtype": getattr(torch, plan.number), "local_files_only": True,
            "use_safetensors": True,
        }  # fmt: skip
        if plan.way == "four bits":
            options["quantization_config"] = quantised(self.parts)
        try:
            pipeline = self._load(folder, options, plan)
            names = []
            for name, file in self._sources():
                check_safetensors(file)
                pipeline.load_lora_weights(
                    str(file.parent), weight_name=file.name, adapter_name=name,
                    local_files_only=True, use_safetensors=True,
                )  # fmt: skip
                names.append(name)
            if names:
                pipeline.set_adapters(names, [1.0] * len(names))
        except ModelError:
            raise
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise ModelError(
                f"{folder.name} cannot be opened as {self.pipeline}: {error}"
            ) from error
        except RuntimeError as error:
            if device.is_out_of_memory(error):
                raise
            raise ModelError(
                f"the weights of {folder.name} do not fit its configuration"
            ) from error
        pipeline.set_progress_bar_config(disable=True)
        return placed(pipeline, plan)

    def _run(
        self, pipeline: Any, plan: PipelinePlan, small: list[RGB], progress: Progress, seed: int
    ) -> RGB:
        import torch
        from PIL import Image

        steps = self._steps()

        def tell(_: Any, step: int, __: Any, tensors: dict[str, Any]) -> dict[str, Any]:
            progress(0.1 + 0.85 * (step + 1) / steps, f"Refining, step {step + 1} of {steps}")
            return tensors

        progress(0.1, "Refining")
        height, width = small[0].shape[:2]
        given = {
            "height": height, "width": width, "num_inference_steps": steps, "output_type": "np",
            # On the CPU, so that a seed means the same on every machine.
            "generator": torch.Generator("cpu").manual_seed(seed), "callback_on_step_end": tell,
        }  # fmt: skip
        with torch.inference_mode():
            made = self._call(pipeline, [Image.fromarray(p) for p in small], given).images[0]
        if not np.isfinite(made).all():
            raise RefineError("the refiner's picture holds values that are no numbers")
        return np.rint(np.clip(made, 0, 1) * 255).astype(np.uint8)


def working_size(width: int, height: int) -> tuple[int, int]:
    """(width, height) px nearly of a crop's shape, at most what the networks were trained on."""
    factor = min(1.0, math.sqrt(AREA / (width * height)))
    return tuple(max(STEP, round(side * factor / STEP) * STEP) for side in (width, height))  # type: ignore[return-value]


def with_detail(made: RGB, small: RGB, coarse: RGB) -> RGB:
    """`made` from `small`, at the size of `coarse`, of which `small` is the reduction.

    What the reduction lost is the coarse picture's own: only the change is enlarged.
    """
    height, width = coarse.shape[:2]
    if made.shape == coarse.shape:
        return made
    change = made.astype(np.float32) - small.astype(np.float32)
    large = cv2.resize(change, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.rint(np.clip(coarse + large, 0, 255)).astype(np.uint8)


def adapter_files(*wanted: tuple[str, str]) -> tuple[tuple[str, Path], ...]:
    """The LoRA files that are there, of pairs (name, family)."""
    found = []
    for name, family in wanted:
        for model in models.installed(family)[:1]:
            folder = models.place(model.id)
            files = sorted(folder.rglob(f"*{PLAIN}")) if folder is not None else []
            found += [(name, file) for file in files[:1]]
    return tuple(found)


def _resized(picture: RGB, size: tuple[int, int]) -> RGB:
    way = cv2.INTER_AREA if size[0] < picture.shape[1] else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(picture, size, interpolation=way), np.uint8)
