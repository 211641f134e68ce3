"""The ways in which a model can run, the best first, and what each takes of memory.

A way is whole on the GPU, one part of the model at a time, in four bits, one layer at a time, or on
the CPU. Which of them is taken is the ledger's to decide.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, Protocol

from . import device
from .device import Device, Number

Way = Literal["whole", "parts", "four bits", "parts in four bits", "layers", "cpu"]

BYTES = {"float32": 4, "float16": 2, "bfloat16": 2}
RESIDENT = 0.35  # x weights that lie on the GPU where they are moved there a part at a time
FOUR_BITS = 0.32  # x the bytes of half precision: four bits, their scales, and what is kept whole
LAYERS = 1 << 30  # bytes on the GPU where layers are moved there one by one
QUANTISER = "bitsandbytes"
TOLD = {
    "whole": "", "parts": ", a part at a time", "four bits": ", in four bits",
    "parts in four bits": ", in four bits, a part at a time", "layers": ", layer by layer",
    "cpu": "",
}  # fmt: skip


@dataclass(frozen=True)
class Plan:
    """Where and how a model runs, and what it takes."""

    device: Device
    number: Number
    way: Way
    peak: int = 0  # bytes on the device while it runs
    kept: int = 0  # bytes of these that stay there afterwards
    host: int = 0  # bytes of main memory besides, which stay as well

    @property
    def keeps(self) -> bool:
        """Whether its weights stay on the device for the next time."""
        return self.kept > 0

    @property
    def in_words(self) -> str:
        """Return the plan in words."""
        return f"on {device.NAMES[self.device]} with {self.number}{TOLD[self.way]}"

    def takes(self, where: Device) -> int:
        """Bytes at most on a device."""
        return (self.peak if where == self.device else 0) + (self.host if where == "cpu" else 0)

    def holds(self, where: Device) -> int:
        """Bytes on a device between two runs."""
        return (self.kept if where == self.device else 0) + (self.host if where == "cpu" else 0)


class Needs(Protocol):
    """What a model asks of memory."""

    @property
    def is_slow_on_cpu(self) -> bool:
        """Whether a GPU that is too small is not followed by the CPU: it would take hours."""
        ...

    def on(self, where: Device) -> tuple[Plan, ...]:
        """Its ways on a device, the best first, whatever memory is there."""
        ...

    def lacking(self) -> str:
        """What would make it need less, as the end of a sentence; empty: nothing."""
        ...


@dataclass(frozen=True)
class Need:
    """Of one network, or of several that follow each other."""

    parameters: int
    work: int  # bytes beside the weights, at most
    parts: bool = False  # whether it can be moved to the GPU a part at a time
    numbers: tuple[Number, ...] = ()  # that it may have on a GPU; none: the device's better half
    is_slow_on_cpu: bool = False

    def bytes(self, number: Number, share: float = 1.0) -> int:
        """Weights, `share` of them, and work in memory."""
        return int(self.weights(number) * share) + self.work

    def weights(self, number: Number) -> int:
        """Bytes."""
        return self.parameters * BYTES[number]

    def on(self, where: Device) -> tuple[Plan, ...]:
        """See `Needs`."""
        if where == "cpu":
            share, kept = (RESIDENT, 0) if self.parts else (1.0, self.weights("float32"))
            return (Plan("cpu", "float32", "cpu", self.bytes("float32", share), kept),)
        numbers = self.numbers or (device.half(where),)
        found = [Plan(where, n, "whole", self.bytes(n), self.weights(n)) for n in numbers]
        if self.parts:
            found += [Plan(where, n, "parts", self.bytes(n, RESIDENT)) for n in numbers]
        return tuple(found)

    def lacking(self) -> str:
        """See `Needs`."""
        return ""


@dataclass(frozen=True)
class Network:
    """One of a pipeline's."""

    weights: int  # bytes at half precision, or of its files
    work: int = 0  # bytes beside them, estimated
    can_shrink: bool = False  # whether it may be put in four bits when it is opened

    def weighs(self, is_short: bool) -> int:
        """Bytes, in four bits if that is asked for and can be."""
        return int(FOUR_BITS * self.weights) if is_short and self.can_shrink else self.weights


@dataclass(frozen=True)
class PipelineNeed:
    """Of a pipeline of several networks, one of which works at a time."""

    networks: tuple[Network, ...]
    is_shrunk: bool = False  # whether its files are quantised already
    is_slow_on_cpu: bool = True
    can_shrink: bool | None = None  # whether four bits can be made; None: as this machine can

    def on(self, where: Device) -> tuple[Plan, ...]:
        """See `Needs`."""
        work = max(n.work for n in self.networks)
        weights = sum(n.weights for n in self.networks)
        if where == "cpu":
            if self.is_shrunk:
                return (Plan("cpu", "bfloat16", "cpu", weights + work, weights),)
            return (Plan("cpu", "float32", "cpu", 2 * weights + work, 2 * weights),)
        whole = Plan(where, "float16", "whole", weights + work, weights)
        return tuple(self._on_cuda(work)) if where == "cuda" else (whole,)

    def lacking(self) -> str:
        """See `Needs`."""
        if self.is_shrunk or has_quantiser() or not any(n.can_shrink for n in self.networks):
            return ""
        least = min(p.peak for p in self._shrunk(max(n.work for n in self.networks)))
        return f"in four bits it takes {least / 2**30:.1f} GB, but {QUANTISER} is not installed"

    def _on_cuda(self, work: int) -> Iterator[Plan]:
        """The others move memory in ways that only CUDA (and ROCm) can."""
        weights = sum(n.weights for n in self.networks)
        yield Plan("cuda", "bfloat16", "whole", weights + work, weights)
        most = max(n.weights + n.work for n in self.networks)
        yield Plan("cuda", "bfloat16", "parts", most, host=weights)
        if self.is_shrunk:
            return
        can_shrink = has_quantiser() if self.can_shrink is None else self.can_shrink
        if can_shrink and any(n.can_shrink for n in self.networks):
            yield from self._shrunk(work)
        # Pinned: none of it can be swapped out.
        yield Plan("cuda", "bfloat16", "layers", LAYERS + work, host=weights)

    def _shrunk(self, work: int) -> tuple[Plan, Plan]:
        """In four bits: all of it on the GPU, and one network at a time."""
        short = sum(n.weighs(True) for n in self.networks)
        most = max(n.weighs(True) + n.work for n in self.networks)
        return (
            Plan("cuda", "bfloat16", "four bits", short + work, short),
            Plan("cuda", "bfloat16", "parts in four bits", most, host=short),
        )


def has_quantiser() -> bool:
    """Whether four bits can be made and read here."""
    return importlib.util.find_spec(QUANTISER) is not None
