"""The common part of refiners by diffusers' pipelines: sizes, detail, progress, seeds, adapters."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ... import models
from ...base.arrays import F32, RGB, unit_pixels
from ...base.progress import Progress
from ...models import HubModel, ModelError, device, ledger
from ...models.plans import Network, PipelineNeed, Plan
from ...models.weight_folder import (
    CONFIG,
    PLAIN,
    QUANTISED,
    check_safetensors,
    count_parameters,
    stamp,
)
from . import RefineError
from .refinement import measure, warped

# What a pipeline in a folder asks of memory, by its files, and how it is put where it runs.

# Layers that published folders in four bits keep whole: few numbers, through which all others go.
WHOLE = (
    "transformer_blocks.0.img_mod", "img_in", "txt_in", "time_text_embed", "norm_out", "proj_out",
    "x_embedder", "context_embedder", "time_guidance_embed",
)  # fmt: skip
QUANTISED_BY = {  # that read weights which are quantised already, by their method
    "bitsandbytes": "bitsandbytes", "gguf": "gguf", "nunchaku_lite": "kernels",
    "torchao": "torchao", "quanto": "optimum.quanto", "sdnq": "sdnq",
}  # fmt: skip


def need_of(
    folder: Path, work: Mapping[str, int], shrinks: tuple[str, ...], adapters: tuple[Path, ...]
) -> PipelineNeed:
    """Of the networks named in `work`, bytes beside each one's weights.

    `shrinks` are those that may be put in four bits; `adapters` lie beside the first network.
    Raises ModelError.
    """
    beside, networks, is_shrunk = sum(a.stat().st_size for a in adapters), [], False
    for name, own in work.items():
        at = folder / name
        if method(at):
            is_shrunk = True
            weights = sum(p.stat().st_size for p in at.iterdir() if p.suffix in (PLAIN, QUANTISED))
        else:
            weights = 2 * count_parameters(at)
        networks.append(Network(weights + (0 if networks else beside), own, name in shrinks))
    return PipelineNeed(tuple(networks), is_shrunk)


def method(at: Path) -> str:
    """By which method the network in a folder is quantised; empty: it is not. Raises ModelError."""
    if any(at.glob(f"*{QUANTISED}")):
        return "gguf"
    try:
        said = json.loads((at / CONFIG).read_text(encoding="utf-8"))
        return str((said.get("quantization_config") or {}).get("quant_method", ""))
    except (OSError, ValueError, AttributeError) as error:
        raise ModelError(f"{at.name}/{CONFIG} cannot be read") from error


def unreadable(folder: Path, names: tuple[str, ...]) -> str | None:
    """Which package is missing for the quantised networks of a folder, as one sentence."""
    for name in names:
        try:
            package = QUANTISED_BY.get(method(folder / name), "")
        except ModelError as error:
            return f"{folder.name}: {error}"
        if package and find_spec(package.partition(".")[0]) is None:
            told = f"`python -m pip install {package.replace('.', '-')}`"
            return f"{folder.name}'s {name} is quantised, and {package} is not installed: {told}"
    return None


def quantised(parts: tuple[str, ...]) -> Any:
    """Return diffusers' settings for the networks `parts` in four bits, computed in bfloat16."""
    import torch
    from diffusers.quantizers.pipe_quant_config import PipelineQuantizationConfig
    from diffusers.quantizers.quantization_config import BitsAndBytesConfig
    from transformers import BitsAndBytesConfig as TextConfig

    options: dict[str, Any] = {
        "load_in_4bit": True, "bnb_4bit_quant_type": "nf4",
        "bnb_4bit_compute_dtype": torch.bfloat16,
    }  # fmt: skip
    network: Any = BitsAndBytesConfig(**options, llm_int8_skip_modules=list(WHOLE))
    kinds: dict[str, Any] = {n: network for n in parts}
    if "text_encoder" in parts:
        kinds["text_encoder"] = TextConfig(**options)
    return PipelineQuantizationConfig(quant_mapping=kinds)


def from_gguf(kind: str, at: Path, number: Any) -> Any:
    """diffusers' network of class `kind` from the GGUF file in a folder. Raises ModelError."""
    import diffusers
    from diffusers.quantizers.quantization_config import GGUFQuantizationConfig

    files = sorted(at.glob(f"*{QUANTISED}"))
    if len(files) != 1:
        raise ModelError(f"{at.parent.name}/{at.name} holds {len(files)} {QUANTISED} files")
    return getattr(diffusers, kind).from_single_file(
        str(files[0]), config=str(at), torch_dtype=number, local_files_only=True,
        quantization_config=GGUFQuantizationConfig(compute_dtype=number),
    )  # fmt: skip


def placed(pipeline: Any, plan: Plan) -> Any:
    """The pipeline where the plan wants it; a whole one was loaded there."""
    import torch

    if plan.way in ("parts", "parts in four bits"):
        pipeline.enable_model_cpu_offload(device=plan.device)
    elif plan.way == "layers":
        pipeline.enable_group_offload(
            onload_device=torch.device(plan.device), offload_type="leaf_level", use_stream=True
        )
    return pipeline


AREA = 1024 * 1024  # px that the networks were trained on
PACKAGES = ("torch", "diffusers", "transformers", "accelerate", "peft", "safetensors")
INSTRUCTION = (
    "Make the edited object in the last picture look as if it had been photographed there: fit its"
    " light, colours, shadow and edges to the scene, and repair what is torn or smeared. Keep its"
    " shape, its pose, its place and everything else exactly as they are."
)


class DiffusionRefiner:
    """A refiner whose pipeline stays open as long as the ledger has room for it."""

    name: str
    doing = "Refining"
    families: tuple[str, ...]  # of models.registry, the best first
    adapters: str  # family of the LoRA that was trained for this job
    pipeline: str  # diffusers' class
    transformer: str  # and of its largest network
    parts: tuple[str, ...]  # that may be in four bits
    work: Mapping[str, int]  # network -> bytes beside its weights, estimated
    step: int  # px of which both sides are multiples

    def missing(self) -> str | None:
        """See `Refiner`."""
        if reason := models.not_installed(PACKAGES):
            return reason
        if self.model() is None:
            best = self.choices()[0]
            size = f"{best.size / 1e9:.0f} GB, {best.licence}"
            return f"no model is there: `objectmorpher models get {best.id}` ({size})"
        return unreadable(self.folder(), tuple(self.work))

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
        size = working_size((width, height), self.step, self.sees)
        shown = [_resized(p, size) for p in (original, coarse)]
        progress(0.0, "Loading the refiner")
        made = ledger.SHARED.run(
            self._model(), lambda pipeline, plan: self._run(pipeline, plan, shown, progress, seed)
        )
        return brought_back(made, shown[1], coarse)

    def sees(self, size: tuple[int, int]) -> tuple[int, int]:
        """The width and height px at which the pipeline itself shows a picture to the network."""
        raise NotImplementedError

    def need(self) -> PipelineNeed:
        """What the model's files ask of memory. Raises ModelError."""
        adapters = tuple(file for _, file in self._sources())
        return need_of(self.folder(), self.work, self.parts, adapters)

    def _model(self) -> ledger.Model[Any]:
        made_of = (self.pipeline, self.folder(), stamp(self.folder()), self._sources())
        return ledger.Model("the refiner", made_of, self.need(), self._open)

    def _call(self, pipeline: Any, pictures: list[Any], given: dict[str, Any]) -> Any:
        raise NotImplementedError

    def _steps(self) -> int:
        raise NotImplementedError

    def _load(self, folder: Path, options: dict[str, Any]) -> Any:
        raise NotImplementedError

    def _sources(self) -> tuple[tuple[str, Path], ...]:
        """What the pipeline is made of besides its model: adapters by name."""
        return adapter_files((self.name, self.adapters))

    def folder(self) -> Path:
        """Return the folder of the model in use."""
        model = self.model()
        found = None if model is None else models.place(model.id)
        assert found is not None, "missing() was asked"
        return found

    def _open(self, plan: Plan) -> Any:
        import diffusers
        import torch

        diffusers.utils.logging.set_verbosity_error()
        diffusers.utils.logging.disable_progress_bar()
        folder = self.folder()
        options: dict[str, Any] = {
            "dtype": getattr(torch, plan.number), "local_files_only": True,
            "use_safetensors": True,
        }  # fmt: skip
        if plan.way in ("four bits", "parts in four bits"):
            options["quantization_config"] = quantised(self.parts)
        if plan.keeps:  # at once: main memory need not hold it
            options["device_map"] = plan.device
        try:
            if method(folder / "transformer") == "gguf":
                network = from_gguf(self.transformer, folder / "transformer", options["dtype"])
                options["transformer"] = network.to(plan.device) if plan.keeps else network
            pipeline = self._load(folder, options)
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
        self, pipeline: Any, plan: Plan, shown: list[RGB], progress: Progress, seed: int
    ) -> RGB:
        import torch
        from PIL import Image

        steps = self._steps()

        def tell(_: Any, step: int, __: Any, tensors: dict[str, Any]) -> dict[str, Any]:
            progress(0.1 + 0.85 * (step + 1) / steps, f"{self.doing}, step {step + 1} of {steps}")
            return tensors

        progress(0.1, self.doing)
        height, width = shown[0].shape[:2]
        given = {
            "height": height, "width": width, "num_inference_steps": steps, "output_type": "np",
            # On the CPU, so that a seed means the same on every machine.
            "generator": torch.Generator("cpu").manual_seed(seed), "callback_on_step_end": tell,
        }  # fmt: skip
        with torch.inference_mode():
            made = self._call(pipeline, [Image.fromarray(p) for p in shown], given).images[0]
        if not np.isfinite(made).all():
            raise RefineError("the refiner's picture holds values that are no numbers")
        return np.rint(np.clip(made, 0, 1) * 255).astype(np.uint8)


Size = tuple[int, int]  # width and height, px


def working_size(size: Size, step: int, sees: Callable[[Size], Size]) -> Size:
    """The size at which a crop of `size` is refined: about AREA, and nearly of its shape.

    It is one that the pipeline leaves as it is, so that the edit, both pictures that it is made
    from and their positions in the network are on one grid.
    """
    ratio, best = size[0] / size[1], (math.inf, (step, step))
    for height in range(step, round(2 * math.sqrt(AREA / ratio)) + 2 * step, step):
        for width in _near(ratio * height, step) | _near(AREA / height, step):
            if sees((width, height)) != (width, height):
                continue
            cost = abs(math.log(width / height / ratio)) + abs(math.log(width * height / AREA)) / 4
            best = min(best, (cost, (width, height)))
    return best[1]


def _near(length: float, step: int) -> set[int]:
    """The multiples of `step` on both sides of a length."""
    low = max(math.floor(length / step), 1) * step
    return {low, low + step}


def brought_back(made: RGB, shown: RGB, coarse: RGB) -> RGB:
    """`made` from `shown`, which was made from `coarse` (h, w, 3) for it, at the size of that.

    What a reduction lost is the coarse picture's own: only the change is enlarged, once what was
    made lies where it was shown.
    """
    height, width = coarse.shape[:2]
    if shown.shape[0] * shown.shape[1] >= height * width:
        return _resized(made, (width, height))
    found, meant = unit_pixels(made), unit_pixels(shown)
    alignment = measure(found, meant)
    if math.isfinite(alignment.left):
        found = warped(found, alignment)
    large = cv2.resize(found - meant, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.rint(np.clip(coarse + 255 * large, 0, 255)).astype(np.uint8)


def adapter_files(*wanted: tuple[str, str]) -> tuple[tuple[str, Path], ...]:
    """The LoRA files that are there, of pairs (name, family)."""
    found = []
    for name, family in wanted:
        for model in models.installed(family)[:1]:
            files = [file for file in models.files(model.id) if file.suffix == PLAIN]
            found += [(name, file) for file in files[:1]]
    return tuple(found)


def _resized(picture: RGB, size: tuple[int, int]) -> RGB:
    way = cv2.INTER_AREA if size[0] < picture.shape[1] else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(picture, size, interpolation=way), np.uint8)
