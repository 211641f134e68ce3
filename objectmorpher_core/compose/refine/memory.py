"""In how much memory a pipeline of several networks can run, and with which numbers.

The tiers, the best first: all on the GPU; the transformer and the text encoder in four bits there
(where bitsandbytes is installed); one network after the other; one layer after the other; the CPU.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from typing import Any, Literal

from ...models import device
from ...models.device import BYTES, SPARE, Plan

Way = Literal["whole", "four bits", "networks", "layers", "cpu"]
FOUR_BITS = 0.32  # x the bytes of half precision: four bits, their scales, and what is kept whole
LAYERS = 1 << 30  # bytes on the GPU where layers are moved there one by one
TOLD = {
    "whole": "", "four bits": ", in four bits", "networks": ", one network at a time",
    "layers": ", layer by layer", "cpu": "",
}  # fmt: skip


@dataclass(frozen=True)
class PipelinePlan(Plan):
    """Where and how a pipeline runs."""

    way: Way = "whole"

    @property
    def told(self) -> str:
        """In words."""
        name = device.NAMES[self.device]
        return f"on {name} with {self.number}{TOLD[self.way]} ({self.reason})"


@dataclass(frozen=True)
class PipelineNeed:
    """What a pipeline asks of memory."""

    networks: tuple[int, ...]  # parameters of each that is in memory
    work: int  # bytes beside the weights, at half precision

    def bytes(self, way: Way) -> int:
        """On the GPU, at half precision."""
        half = [BYTES["bfloat16"] * n for n in self.networks]
        weights = {
            "whole": sum(half), "four bits": FOUR_BITS * sum(half), "networks": max(half),
            "layers": LAYERS, "cpu": 0,
        }[way]  # fmt: skip
        return int(weights) + self.work


def plans(need: PipelineNeed) -> tuple[PipelinePlan, ...]:
    """The tiers on which a pipeline fits, the best first. The last is the CPU. Imports torch.

    Raises ModelError.
    """
    found: list[PipelinePlan] = []
    for name in device.devices():
        found += on_device(name, need, device.free_memory(name))
    return tuple(found)


def on_device(
    name: device.Device, need: PipelineNeed, free: int | None
) -> tuple[PipelinePlan, ...]:
    """The tiers on one device, `free` bytes of whose memory are left."""
    room = f"{free / 2**30:.1f} GB free" if free is not None else "free memory unknown"
    if name == "cpu":
        return (PipelinePlan("cpu", "float32", "cpu", room, "cpu"),)
    ways: tuple[Way, ...] = ("whole",)
    if name == "cuda":  # the others move memory in a way that only CUDA (and ROCm) can
        ways = ("whole", *four_bits(), "networks", "layers")
    number: device.Number = "bfloat16" if name == "cuda" else "float16"
    return tuple(
        PipelinePlan(
            name, number, "whole" if way in ("whole", "four bits") else "offload", room, way
        )
        for way in ways
        if free is None or need.bytes(way) <= SPARE * free
    )


def four_bits() -> tuple[Way, ...]:
    """The tier that needs bitsandbytes, where that is installed."""
    return ("four bits",) if importlib.util.find_spec("bitsandbytes") is not None else ()


def quantised(parts: tuple[str, ...]) -> Any:
    """How diffusers is told to load the networks `parts` in four bits, worked with in bfloat16."""
    import torch
    from diffusers.quantizers.pipe_quant_config import PipelineQuantizationConfig

    options: dict[str, Any] = {
        "load_in_4bit": True, "bnb_4bit_quant_type": "nf4",
        "bnb_4bit_compute_dtype": torch.bfloat16,
    }  # fmt: skip
    return PipelineQuantizationConfig(
        quant_backend="bitsandbytes_4bit",
        quant_kwargs=options,
        components_to_quantize=list(parts),
    )


def placed(pipeline: Any, plan: PipelinePlan) -> Any:
    """The pipeline where the plan wants it."""
    import torch

    if plan.way == "networks":
        pipeline.enable_model_cpu_offload(device=plan.device)
    elif plan.way == "layers":
        pipeline.enable_group_offload(
            onload_device=torch.device(plan.device), offload_type="leaf_level", use_stream=True
        )
    else:
        pipeline.to(plan.device)
    return pipeline
