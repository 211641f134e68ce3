"""Time and memory of a step at the published size, with random weights."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from . import TrainingError, adapter, edit_models
from .edit_models import EditModel
from .lora_plan import LoraPlan
from .train_lora import optimiser_of, prepared

SPREAD = 0.02  # of the random weights


@dataclass(frozen=True)
class Measured:
    """The figures of one process."""

    device: str  # its name
    number: str
    parameters: int  # of the transformer
    trained: int  # of the LoRA
    tokens: int  # of A and its conditions
    loading: float  # s until the transformer is there
    steps: tuple[float, ...]  # s of each, the first with what is done once
    peak: int | None  # bytes of GPU memory; None: no GPU


def measure(plan: LoraPlan, count: int = 3, size: dict[str, Any] | None = None) -> Measured:
    """`count` steps of `plan`, one triplet each, of random weights; `size`: another transformer."""
    import torch

    plan.check()
    if plan.base != "whole":
        raise TrainingError("a measurement is of whole weights: what four bits take is estimated")
    model = edit_models.load(plan.model)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    began = time.perf_counter()
    transformer = random_transformer(model, device, plan.number, size)
    whole = sum(p.numel() for p in transformer.parameters())
    transformer = adapter.with_adapter(transformer, model, plan.rank, plan.seed).to(device)
    prepared(transformer)
    optimiser = optimiser_of(transformer, plan)
    at = model.made_up(plan.side, plan.number, device)
    _wait(device)
    loading = time.perf_counter() - began
    steps = []
    for _ in range(count):
        began = time.perf_counter()
        step_of(model, transformer, optimiser, at, device)
        _wait(device)
        steps.append(time.perf_counter() - began)
    is_gpu = device == "cuda"
    return Measured(
        torch.cuda.get_device_name() if is_gpu else "the CPU", plan.number, whole,
        sum(p.numel() for p in adapter.parameters(transformer).values()),
        at.target.shape[1] + at.conditions.shape[1], loading, tuple(steps),
        torch.cuda.max_memory_allocated() if is_gpu else None,
    )  # fmt: skip


def random_transformer(
    model: EditModel, device: str, number: str, size: dict[str, Any] | None = None
) -> Any:
    """The published transformer with random weights, made on the `device` in `number` at once."""
    import torch
    from accelerate import init_empty_weights

    with init_empty_weights():  # what is no weight, as its tables of positions, is computed
        transformer = model.transformer_class()(**(model.size if size is None else size))
    # Module's own `to`: diffusers' warns of weights that are kept in float32, of which none is.
    transformer = torch.nn.Module.to(transformer, getattr(torch, number)).to_empty(device=device)
    source = torch.Generator(device).manual_seed(0)
    with torch.no_grad():
        for name, value in transformer.named_parameters():
            if value.dim() > 1:
                value.normal_(0, SPREAD, generator=source)
            else:
                value.fill_(1.0 if name.endswith("weight") else 0.0)
    return transformer


def step_of(model: EditModel, transformer: Any, optimiser: Any, at: Any, device: str) -> None:
    """One step of a training on made-up latents; on "meta" nothing is computed."""
    import torch

    noise = torch.randn_like(at.target)
    noisy = 0.5 * at.target + 0.5 * noise
    is_half = at.target.dtype == torch.bfloat16
    sigma = torch.full((1,), 0.5, device=device, dtype=at.target.dtype)
    kind = "cpu" if device == "meta" else device
    with torch.autocast(kind, torch.bfloat16, enabled=is_half and device != "meta"):
        found = model.velocity(transformer, noisy, sigma, at)
    loss = torch.nn.functional.mse_loss(found.float(), (noise - at.target).float())
    loss.backward()
    torch.nn.utils.clip_grad_norm_(list(adapter.parameters(transformer).values()), 1.0)
    optimiser.step()
    optimiser.zero_grad(set_to_none=True)


def _wait(device: str) -> None:
    import torch

    if device == "cuda":
        torch.cuda.synchronize()
