"""GPU memory of a training before it starts: a step on PyTorch's meta device, bytes counted.

The published network is built without memory for it, and two steps run through one with a few of
its blocks, forward, back and AdamW's, in the plan's numbers. What is alive at a time is summed up;
attention keeps what a fused kernel keeps. Each further block adds what the last ones did. Weights
in four bits and weights that are sharded are counted in their place.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from objectmorpher_core.compose.refine.diffusion import WHOLE
from objectmorpher_core.model_sets import DRIVER
from objectmorpher_core.models.ledger import SPARE

from . import adapter, edit_models
from .lora_plan import LoraPlan
from .measure import optimiser_of, prepared, step_of

if TYPE_CHECKING:
    from torch import nn

CARDS = (8, 12, 16, 24, 48, 80)  # GB
SHARDED = (2, 4, 8)  # GPUs
LAYERS, FEW = ("num_layers", "num_single_layers"), 2  # blocks that are looked at, of each kind
SDPA = "scaled_dot_product_attention"
NF4 = 0.5 + 0.127 / 8  # bytes of a weight: four bits, and 0.127 bits of scales that are quantised


@dataclass(frozen=True)
class TrainingMemory:
    """Bytes on each GPU."""

    weights: int  # of the frozen network
    learned: int  # the LoRA, its gradients, AdamW's memory and the moving mean
    step: int  # all else that a step has at a time

    @property
    def whole(self) -> int:
        """In all."""
        return self.weights + self.learned + self.step

    def fits(self, card: int) -> bool:
        """Whether a card of so many bytes holds it."""
        return self.whole <= SPARE * (card - DRIVER)


@dataclass(frozen=True)
class _Network:
    """What of a network matters for memory besides what a step takes."""

    weights: int  # bytes
    in_four_bits: int  # bytes
    largest_layer: int  # bytes, which four bits are unpacked to
    largest_block: int  # bytes, which sharded weights are gathered to
    learned: int  # numbers of the LoRA
    step: int  # bytes that a step has at most besides


def table(plan: LoraPlan, size: dict[str, Any] | None = None) -> dict[str, TrainingMemory]:
    """The ways in which a plan can be trained; `size`: of another network than the published."""
    found = _looked_at(plan, edit_models.load(plan.model).size if size is None else size)
    adam = 4 * found.learned * (5 if plan.mean else 4)
    whole = TrainingMemory(found.weights, adam, found.step)
    ways = {plan.number: whole}
    for count in SHARDED:
        gathered = 2 * found.largest_block  # one is in use, the next on its way
        ways[f"{plan.number}, sharded over {count} GPUs"] = TrainingMemory(
            found.weights // count, adam // count, found.step + gathered
        )
    ways["nf4"] = replace(
        whole, weights=found.in_four_bits, step=found.step + found.largest_layer
    )  # fmt: skip
    return ways


def told(plan: LoraPlan, ways: dict[str, TrainingMemory]) -> str:
    """Return lines for the terminal."""
    lines = [f"{plan.model}, {plan.side} x {plan.side} px, rank {plan.rank}: GB on each GPU, about"]
    for name, way in ways.items():
        cards = [str(gb) for gb in CARDS if way.fits(gb << 30)]
        parts = " + ".join(f"{part / 2**30:.1f}" for part in (way.weights, way.learned, way.step))
        fits = f"fits {cards[0]} GB" if cards else f"more than {CARDS[-1]} GB"
        lines.append(f"  {name}: {way.whole / 2**30:.1f} (weights, LoRA, step: {parts}); {fits}")
    return "\n".join(lines)


def weights_of(network: nn.Module) -> tuple[int, int]:
    """Bytes of a network's weights, and of the same with a base in four bits."""
    whole, short = sum(map(_bytes, network.parameters())), _layers(network)
    return whole, whole - sum(map(_bytes, short)) + int(NF4 * sum(w.numel() for w in short))


def _looked_at(plan: LoraPlan, size: dict[str, Any]) -> _Network:
    network = _network(plan, size)
    weights, in_four_bits = weights_of(network)
    largest = max(map(_bytes, _layers(network)))
    blocks = [sum(map(_bytes, block.parameters())) for block in _blocks(network)]
    learned = sum(p.numel() for p in adapter.parameters(_adapted(network, plan)).values())
    config = network.config
    few = size | {name: FEW for name in LAYERS if name in config}
    base, peak = _peak(plan, few), 0.0
    for name in LAYERS:  # each more adds the same
        if name in config:
            slope = (_peak(plan, few | {name: 2 * FEW}) - base) / FEW
            peak += (config[name] - FEW) * slope
    step = int(base + peak) - 12 * learned
    return _Network(weights, in_four_bits, largest, max(blocks), learned, step)


def _peak(plan: LoraPlan, size: dict[str, Any]) -> int:
    """Bytes that a step, not the first one, has at most beside weights and LoRA."""
    import torch

    network = _adapted(_network(plan, size), plan)
    prepared(network)
    optimiser = optimiser_of(network, plan)
    model = edit_models.load(plan.model)
    at = model.made_up(plan.side, plan.number, "meta")
    with counting() as count, as_on_a_gpu(getattr(torch, plan.number)):
        for value in network.parameters():  # views of them are made in the step
            count.add(value)
        count.now = count.most = 0
        for _ in range(2):
            step_of(model, network, optimiser, at, "meta")
    return count.most


def _network(plan: LoraPlan, size: dict[str, Any]) -> Any:
    import torch
    from accelerate import init_empty_weights

    with init_empty_weights():
        network = edit_models.load(plan.model).transformer_class()(**size)
    return torch.nn.Module.to(network, device="meta", dtype=getattr(torch, plan.number))


def _adapted(network: nn.Module, plan: LoraPlan) -> nn.Module:
    import torch

    with torch.device("meta"):
        return adapter.with_adapter(network, edit_models.load(plan.model), plan.rank, plan.seed)


def _bytes(tensor: Any) -> int:
    return tensor.numel() * tensor.element_size()


def _layers(network: nn.Module) -> list[Any]:
    """The weights that four bits are made of: all linear layers but those that are kept whole."""
    from torch import nn

    return [
        module.weight
        for name, module in network.named_modules()
        if isinstance(module, nn.Linear) and not any(kept in name for kept in WHOLE)
    ]


def _blocks(network: Any) -> list[Any]:
    """What is checkpointed and sharded as one."""
    kinds = set(network._no_split_modules)
    return [module for module in network.modules() if type(module).__name__ in kinds]


class LiveBytes:
    """Bytes of the tensors that are alive."""

    def __init__(self) -> None:
        self.now = self.most = 0
        self._known: dict[int, weakref.finalize[Any, Any]] = {}

    def add(self, tensor: Any) -> None:
        """Counts a tensor's storage until it is freed."""
        storage = tensor.untyped_storage()
        key = storage._cdata
        known = self._known.get(key)
        if known is not None and known.alive:
            return
        size = storage.nbytes()
        self._known[key] = weakref.finalize(storage, self._drop, size)
        self.now += size
        self.most = max(self.most, self.now)

    def _drop(self, size: int) -> None:
        self.now -= size


@contextmanager
def counting() -> Iterator[LiveBytes]:
    """Counts what is made meanwhile."""
    import torch
    from torch.utils._python_dispatch import TorchDispatchMode
    from torch.utils._pytree import tree_map_only

    found = LiveBytes()

    class Counting(TorchDispatchMode):
        def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None):
            made = func(*args, **(kwargs or {}))
            tree_map_only(torch.Tensor, found.add, made)
            return made

    with Counting():
        yield found


@contextmanager
def as_on_a_gpu(number: Any) -> Iterator[None]:
    """Meta tensors keep what a GPU's autocast and fused attention keep."""
    import torch
    from torch.nn import functional

    class Attention(torch.autograd.Function):
        @staticmethod
        def forward(ctx: Any, query: Any, key: Any, value: Any) -> Any:
            made = torch.empty_like(query)
            ctx.save_for_backward(query, key, value, made)
            return made

        @staticmethod
        def backward(ctx: Any, *grads: Any) -> Any:
            return tuple(torch.empty_like(t) for t in ctx.saved_tensors[:3])

    linear, norm = functional.linear, functional.layer_norm

    def attention(query: Any, key: Any, value: Any, *_: Any, **__: Any) -> Any:
        return Attention.apply(query, key, value)

    def half_linear(input: Any, weight: Any, bias: Any = None) -> Any:
        return linear(
            input.to(number), weight.to(number), None if bias is None else bias.to(number)
        )

    def whole_norm(input: Any, shape: Any, weight: Any = None, bias: Any = None, eps: float = 1e-5):
        scale, shift = (None if value is None else value.float() for value in (weight, bias))
        return norm(input.float(), shape, scale, shift, eps)

    own = {"linear": half_linear, "layer_norm": whole_norm, SDPA: attention}
    theirs = {name: getattr(functional, name) for name in own}
    try:
        for name, function in own.items():
            setattr(functional, name, function)
        yield
    finally:
        for name, function in theirs.items():
            setattr(functional, name, function)
