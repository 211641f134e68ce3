"""Where a network runs and with which numbers, from what memory is free.

A plan is one of a few tiers, the best first: all on the GPU, on the GPU a part at a time, and on
the CPU. Where memory runs out all the same, `run` goes on with the next tier and says so.
"""

from __future__ import annotations

import ctypes
import importlib.util
import logging
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

from .registry import ModelError

log = logging.getLogger(__name__)
T = TypeVar("T")

Device = Literal["cuda", "mps", "cpu"]
Number = Literal["float32", "float16", "bfloat16"]
Tier = Literal["whole", "offload", "cpu"]

DEVICE = "OBJECTMORPHER_DEVICE"  # environment variable: cuda, mps or cpu
SPARE = 0.9  # x free memory that may be used
BYTES = {"float32": 4, "float16": 2, "bfloat16": 2}
RESIDENT = 0.35  # x weights that lie on the GPU where they are moved there a part at a time


@dataclass(frozen=True)
class Need:
    """What a model asks of memory."""

    parameters: int
    work: int  # bytes beside the weights, at half precision
    parts: bool = False  # whether it can be moved to the GPU a part at a time
    only_float32: bool = False  # whether half precision is known to harm it
    half: Number | None = None  # the short number it was published in; None: the device's better

    def bytes(self, number: Number, share: float = 1.0) -> int:
        """Weights, `share` of them, and work in memory."""
        return int(self.parameters * BYTES[number] * share + self.work * BYTES[number] / 2)


@dataclass(frozen=True)
class Plan:
    """Where and how it runs."""

    device: Device
    number: Number
    tier: Tier
    reason: str  # a part of a sentence, for people

    @property
    def keeps(self) -> bool:
        """Whether all parts stay in memory for the next time."""
        return self.tier == "whole"

    @property
    def told(self) -> str:
        """In words."""
        how = ", a part at a time" if self.tier == "offload" else ""
        return f"on {NAMES[self.device]} with {self.number}{how} ({self.reason})"


P = TypeVar("P", bound=Plan)
NAMES = {"cuda": "the GPU", "mps": "the GPU (MPS)", "cpu": "the CPU"}


def has_torch() -> bool:
    """Whether PyTorch is installed; it is not imported for that."""
    return importlib.util.find_spec("torch") is not None


def devices() -> tuple[Device, ...]:
    """What this machine has, the quickest first; the CPU is the last. Imports torch.

    ROCm's GPUs are "cuda", too: that is how PyTorch names them. Raises ModelError where the
    environment asks for a device that is not there.
    """
    import torch

    found: list[Device] = []
    if torch.cuda.is_available():
        found.append("cuda")
    if torch.backends.mps.is_available():
        found.append("mps")
    found.append("cpu")
    wanted = os.environ.get(DEVICE, "")
    if wanted and wanted not in found:
        raise ModelError(f"{DEVICE} is {wanted!r}; this machine has {', '.join(found)}")
    return tuple(d for d in found if d == wanted) if wanted else tuple(found)


def free_memory(device: Device) -> int | None:
    """Bytes that are free there, or None where nobody can tell."""
    if device == "cpu":
        return _free_main_memory()
    import torch

    if device == "cuda":
        return int(torch.cuda.mem_get_info()[0])
    return int(torch.mps.recommended_max_memory() - torch.mps.driver_allocated_memory())


def plans(need: Need) -> tuple[Plan, ...]:
    """The tiers on which a model fits, the best first. The last is always the CPU. Imports torch.

    Raises ModelError.
    """
    return tuple(p for device in devices() for p in _on(device, need, free_memory(device)))


def run(tiers: tuple[P, ...], attempt: Callable[[P], T]) -> T:
    """What `attempt` makes of the first tier whose memory suffices. Raises ModelError."""
    for k, plan in enumerate(tiers):
        try:
            return attempt(plan)
        except Exception as error:
            if not is_out_of_memory(error):
                raise
            empty_cache(plan.device)
            if k + 1 == len(tiers):
                raise ModelError(f"there is not enough memory {plan.told}") from error
            log.warning("Memory ran out %s; going on %s", plan.told, tiers[k + 1].told)
    raise AssertionError("a plan has tiers")


def is_out_of_memory(error: BaseException) -> bool:
    """Whether memory was the reason; PyTorch says it in several ways."""
    names = {kind.__name__ for kind in type(error).__mro__}
    if names & {"MemoryError", "OutOfMemoryError"}:
        return True
    return isinstance(error, RuntimeError) and any(
        sign in str(error)
        for sign in ("out of memory", "can't allocate memory", "not enough memory")
    )


def _on(device: Device, need: Need, free: int | None) -> list[Plan]:
    """The tiers on one device, `free` bytes of whose memory are left."""
    room = f"{free / 2**30:.1f} GB free" if free is not None else "free memory unknown"
    if device == "cpu":
        return [Plan("cpu", "float32", "cpu", room)]
    number: Number = "float32" if need.only_float32 else need.half or _half(device)
    found = []
    if free is None or need.bytes(number) <= SPARE * free:
        found.append(Plan(device, number, "whole", room))
    if need.parts and (free is None or need.bytes(number, RESIDENT) <= SPARE * free):
        found.append(Plan(device, number, "offload", room))
    return found


def _half(device: Device) -> Number:
    """The better of the short numbers: bfloat16 has float32's range."""
    import torch

    return "bfloat16" if device == "cuda" and torch.cuda.is_bf16_supported() else "float16"


def empty_cache(device: Device) -> None:
    """Gives what torch holds for later back to the device."""
    import torch

    if device == "cuda":
        torch.cuda.empty_cache()
    elif device == "mps":
        torch.mps.empty_cache()


def _free_main_memory() -> int | None:
    """Bytes of main memory that a program can have without others being swapped out."""
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass  # not Linux
    if sys.platform == "win32":
        return _free_on_windows()
    try:  # macOS: pages that are free or can be dropped are not told apart; half is cautious
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2
    except (ValueError, OSError, AttributeError):
        return None


class _MemoryStatus(ctypes.Structure):
    """MEMORYSTATUSEX of the Windows API."""

    _fields_ = (
        ("length", ctypes.c_ulong), ("load", ctypes.c_ulong),
        *((name, ctypes.c_ulonglong) for name in (
            "total", "available", "total_page", "available_page", "total_virtual",
            "available_virtual", "available_extended",
        )),
    )  # fmt: skip


def _free_on_windows() -> int | None:
    status = _MemoryStatus()
    status.length = ctypes.sizeof(status)
    kernel: Any = ctypes.windll.kernel32  # type: ignore[attr-defined]
    return int(status.available) if kernel.GlobalMemoryStatusEx(ctypes.byref(status)) else None
