"""The devices on which networks can run, and what memory is free there."""

from __future__ import annotations

import ctypes
import gc
import importlib.util
import os
import sys
from pathlib import Path
from typing import Any, Literal

from .registry import ModelError

Device = Literal["cuda", "mps", "cpu"]
Number = Literal["float32", "float16", "bfloat16"]

DEVICE = "OBJECTMORPHER_DEVICE"  # environment variable: cuda, mps or cpu
NAMES = {"cuda": "the GPU", "mps": "the GPU (MPS)", "cpu": "the CPU"}
_room = 0  # bytes of the GPU that this process keeps to; 0: all


def has_torch() -> bool:
    """Whether PyTorch is installed; it is not imported for that."""
    return importlib.util.find_spec("torch") is not None


def devices() -> tuple[Device, ...]:
    """Return this machine's devices, the quickest first and the CPU last.

    Imports torch, unless the environment asks for the CPU. ROCm's GPUs are "cuda", too: that is how
    PyTorch names them. Raises ModelError where the environment asks for a device that is not there.
    """
    wanted = os.environ.get(DEVICE, "")
    if wanted == "cpu":
        return ("cpu",)
    import torch

    found: list[Device] = []
    if torch.cuda.is_available():
        found.append("cuda")
    if torch.backends.mps.is_available():
        found.append("mps")
    found.append("cpu")
    if wanted and wanted not in found:
        raise ModelError(f"{DEVICE} is {wanted!r}; this machine has {', '.join(found)}")
    return tuple(d for d in found if d == wanted) if wanted else tuple(found)


def has_gpu() -> bool:
    """Whether PyTorch is installed and would use one. Imports torch."""
    try:
        return has_torch() and devices()[0] != "cpu"
    except ModelError:
        return False


def total_memory() -> int:
    """Bytes of main memory; what is free where nobody can tell."""
    if sys.platform != "win32":
        try:
            return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        except (ValueError, OSError):
            pass
    return _free_main_memory() or 0


def free_memory(device: Device) -> int | None:
    """Bytes that this process can have there, or None where nobody can tell.

    What PyTorch has reserved and does not use counts as free, though not for other programs.
    """
    if device == "cpu":
        return _free_main_memory()
    import torch

    if device == "cuda":
        taken = torch.cuda.memory_allocated()
        free = int(torch.cuda.mem_get_info()[0]) + torch.cuda.memory_reserved() - taken
        return min(free, max(0, _room - taken)) if _room else free
    return int(torch.mps.recommended_max_memory() - torch.mps.current_allocated_memory())


def keep_to(room: int) -> None:
    """This process takes `room` bytes of its GPU at most, whatever is free there; 0: all."""
    global _room
    _room = room


def is_out_of_memory(error: BaseException) -> bool:
    """Whether memory was the reason; PyTorch says it in several ways."""
    names = {kind.__name__ for kind in type(error).__mro__}
    if names & {"MemoryError", "OutOfMemoryError"}:
        return True
    return isinstance(error, RuntimeError) and any(
        sign in str(error)
        for sign in ("out of memory", "can't allocate memory", "not enough memory")
    )


def half(device: Device) -> Number:
    """The better of the short numbers: bfloat16 has float32's range.

    Both are of one size: memory can be planned where PyTorch is not installed yet.
    """
    if device != "cuda" or not has_torch():
        return "float16"
    import torch

    return "bfloat16" if torch.cuda.is_bf16_supported() else "float16"


def empty_cache(device: Device) -> None:
    """Gives what nobody uses any more back to the device."""
    gc.collect()  # hooks and pipelines refer to each other
    if device == "cpu":
        return
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
    try:  # macOS: pages that are free or can be dropped are not distinguished; half is cautious
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
