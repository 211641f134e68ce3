"""What a pipeline in a folder asks of memory, by its files, and how it is put where it runs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ...models import ModelError
from ...models.plans import Network, PipelineNeed, Plan
from ...models.weight_folder import CONFIG, PLAIN, QUANTISED, count_parameters

# Layers that published folders in four bits keep whole: few numbers, through which all others go.
WHOLE = (
    "transformer_blocks.0.img_mod", "img_in", "txt_in", "time_text_embed", "norm_out", "proj_out",
    "x_embedder", "context_embedder", "time_guidance_embed",
)  # fmt: skip
PACKAGES = {  # that read weights which are quantised already, by their method
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
            package = PACKAGES.get(method(folder / name), "")
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
