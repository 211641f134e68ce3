"""What each stage would use on this machine, why, and what would make it better."""

from __future__ import annotations

import os
import platform
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version

from . import compose, lift, models, segment
from .models import device

PACKAGES = ("numpy", "opencv-contrib-python-headless", "onnxruntime", "torch", "transformers")


@dataclass(frozen=True)
class Stage:
    """One step of the work."""

    name: str
    uses: str  # the backend that "auto" takes
    why: str
    others: tuple[tuple[str, str], ...]  # backends that cannot run here, and why
    better: str = ""  # what would help; empty: nothing


@dataclass(frozen=True)
class Machine:
    """What there is to compute with."""

    system: str
    cores: int
    memory: int | None  # bytes that are free
    disk: int  # bytes that are free where models are kept
    device: str  # where networks run
    packages: tuple[tuple[str, str], ...]  # name, version; those that are installed


def look_at_machine() -> Machine:
    """Asks the system; imports torch where it is installed."""
    found = []
    for name in PACKAGES:
        try:
            found.append((name, version(name)))
        except PackageNotFoundError:
            continue
    where = models.folder()
    while not where.exists() and where != where.parent:
        where = where.parent
    system = f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return Machine(
        system, cores or 1, device.free_memory("cpu"), shutil.disk_usage(where).free,
        _device(), tuple(found),
    )  # fmt: skip


def look_at_stages() -> tuple[Stage, ...]:
    """Each stage, in the order of the work."""
    return _selecting(), _lifting(), _filling(), _harmonising()


def _device() -> str:
    if not device.has_torch():
        return "the CPU, by onnxruntime: PyTorch is not installed"
    try:
        first = device.devices()[0]
    except models.ModelError as error:
        return str(error)
    if first == "cpu":
        return "the CPU: PyTorch finds no GPU"
    import torch

    name = torch.cuda.get_device_name() if first == "cuda" else "Apple's GPU"
    free = device.free_memory(first)
    return name if free is None else f"{name}, {free / 2**30:.1f} GB free"


def _absent(table: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Of a stage's backends those that cannot run here, each with its sentence."""
    found = []
    for name, where in table.items():
        module, _, kind = where.partition(":")
        reason = getattr(import_module(module), kind)().missing()
        if reason is not None:
            found.append((name, reason))
    return tuple(found)


def _selecting() -> Stage:
    absent = _absent(segment.BACKENDS)
    chosen = segment.load("auto")
    uses, names = chosen.name, [name for name, _ in absent]
    if uses == "grabcut":
        why, better = "it goes by colour alone, and needs no model", "`objectmorpher models get`"
        return Stage("select", uses, why, absent, better)
    if uses == "dino":
        why = "DINOv2 is here, and no SAM that is quick enough"
        better = "" if "sam2" not in names else "`objectmorpher models get sam2.1-tiny`"
        if better and not device.has_torch():
            better = f"`{models.EXTRA}`, then {better}"
        if "subject" in names:
            better = "`objectmorpher models get u2netp`"
        return Stage("select", uses, why, absent, better)
    model = getattr(chosen, "model", lambda: None)()
    told = f"{model.id} is here" if model is not None else "it is here"
    better = "`objectmorpher models get u2netp`, for the subject" if "subject" in names else ""
    return Stage("select", uses, told, absent, better)


def _lifting() -> Stage:
    absent = _absent(lift.BACKENDS)
    lifter = lift.load("auto")
    name = getattr(lifter, "name", next(n for n in lift.BACKENDS if n not in dict(absent)))
    if name != "relief":
        return Stage("lift", name, "it is here", absent)
    has_shape = models.path("dinov2-vits14") is not None and models.shipped.is_shipped()
    has_depth = models.added("depth").state == "ok"
    parts = ["the silhouette's body"]
    parts += ["our shape network"] if has_shape else []
    parts += ["your depth network"] if has_depth else []
    better = "" if has_depth else "a depth network: `objectmorpher models add depth FILE.onnx`"
    if not has_shape:
        better = "`objectmorpher models get dinov2-vits14`, for our shape network"
    return Stage("lift", name, f"from {' and '.join(parts)}", absent, better)


def _filling() -> Stage:
    absent = _absent(compose.BACKENDS)
    chosen = compose.load("auto").name
    why = "the first of its stage that can run here"
    return Stage("background", chosen, why, absent)


def _harmonising() -> Stage:
    others = ", ".join(name for name in compose.REFINERS if name != "none")
    return Stage("refine", "none", f"what is asked for: {others}", ())
