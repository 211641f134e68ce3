"""The doctor: each stage's backend on this machine, the reason for it, and what would be better."""

from __future__ import annotations

import platform
import shutil
from collections.abc import Iterable
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version

from . import compose, lift, models, segment
from .base import backends
from .base.threads import core_count
from .compose import refine
from .lift.relief import depth_look
from .lift.trellis import configs
from .lift.workers import file as worker_file
from .models import device

PACKAGES = (
    "numpy",
    "opencv-contrib-python-headless",
    "onnxruntime",
    "torch",
    "transformers",
    "diffusers",
)


@dataclass(frozen=True)
class StageReport:
    """One stage of the work."""

    name: str
    uses: str  # the backend that "auto" takes
    why: str
    others: tuple[tuple[str, str], ...]  # backends that cannot run here, and why
    better: str = ""  # what would help; empty: nothing
    also: tuple[tuple[str, str], ...] = ()  # what can be asked for by its name, and what it is
    able: tuple[str, ...] = ()  # backends that can run here

    @property
    def auto(self) -> str:
        """The backend that "auto" is where somebody asks; empty: there is none."""
        return self.uses if self.uses in self.able else next(iter(self.able), "")


@dataclass(frozen=True)
class Machine:
    """The hardware to compute with."""

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
    return Machine(
        system, core_count(), device.free_memory("cpu"), shutil.disk_usage(where).free,
        _device(), tuple(found),
    )  # fmt: skip


def look_at_stages() -> tuple[StageReport, ...]:
    """Return each stage, in the order of the work."""
    stages = (
        (_selecting(), segment.BACKENDS), (_lifting(), lift.BACKENDS),
        (_filling(), compose.BACKENDS), (_harmonising(), refine.BACKENDS),
    )  # fmt: skip
    able = (replace(stage, able=_able(stage, table)) for stage, table in stages)
    return tuple(able)


def _able(stage: StageReport, table: Iterable[str]) -> tuple[str, ...]:
    absent = dict(stage.others)
    return (*(name for name in table if name not in absent), *(name for name, _ in stage.also))


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


def _selecting() -> StageReport:
    absent = backends.absent(segment.BACKENDS)
    chosen = segment.load("auto")
    uses, names = chosen.name, [name for name, _ in absent]
    if uses == "grabcut":
        why = "it goes by colour alone, and needs no model"
        better = "`objectmorpher models get`: a click is then a whole object"
        return StageReport("select", uses, why, absent, better)
    if uses == "dino":
        slow = [name for name in segment.BACKENDS if "sam" in name and name not in names]
        told = f"{', '.join(slow)} would take minutes a photo" if slow else "no SAM is"
        why, better = f"DINOv2 is here, and {told}", "`objectmorpher models get sam2.1-tiny`"
        if not device.has_torch():
            better = f"`{models.EXTRA}`, then {better}"
        if "subject" in names:
            better = "`objectmorpher models get u2netp`"
        return StageReport("select", uses, why, absent, better)
    model = getattr(chosen, "model", lambda: None)()
    told = f"{model.id} is here" if model is not None else "it is here"
    better = "`objectmorpher models get u2netp`, for the subject" if "subject" in names else ""
    return StageReport("select", uses, told, absent, better)


def _lifting() -> StageReport:
    absent = backends.absent(lift.BACKENDS)
    lifter = lift.load("auto")
    name = getattr(lifter, "name", next(n for n in lift.BACKENDS if n not in dict(absent)))
    if name != "relief":
        return StageReport("lift", name, "it is here", absent)
    has_shape = models.path("dinov2-vits14") is not None and models.is_shipped()
    depth = depth_look.installed()
    has_depth = depth is not None
    parts = ["the silhouette's body"]
    parts += ["our shape network"] if has_shape else []
    if depth is not None:
        parts += ["your depth network" if depth.is_onnx else "Depth Anything V2"]
    named = "`objectmorpher models get depth-anything-v2-small`"
    better = "" if has_depth else f"a depth network: {named}"
    if better and not device.has_torch():
        better += f" after `{models.EXTRA}`, or `objectmorpher models add depth FILE.onnx`"
    if not has_shape:
        better = "`objectmorpher models get dinov2-vits14`, for our shape network"
    if device.has_gpu() and "trellis" in dict(absent):
        better += "; " if better else ""
        better += "to make up what the photo does not show: " + " and ".join(
            f"`objectmorpher models get {id}`" for id in (configs.TRELLIS, configs.ENCODER)
        )
    workers = _workers()
    absent += tuple((n, told) for n, told, is_there in workers if not is_there)
    also = tuple((n, told) for n, told, is_there in workers if is_there)
    return StageReport("lift", name, f"from {' and '.join(parts)}", absent, better, also)


def _workers() -> list[tuple[str, str, bool]]:
    """The user's own lifters: name, description, whether it can run."""
    found = []
    for name in worker_file.worker_names():
        try:
            worker = worker_file.read_worker(name)
        except lift.LiftError as error:
            found.append((name, str(error), False))
            continue
        missing = worker.missing()
        told = f"a worker of yours, licence {worker.licence or 'not told'}"
        found.append((name, missing or told, missing is None))
    return found


def _filling() -> StageReport:
    absent = backends.absent(compose.BACKENDS)
    chosen = compose.load("auto").name
    if chosen != "patchmatch":
        better = ""
        if chosen in ("lama", "migan") and device.has_gpu():
            better = "`objectmorpher models get pixelhacker`, for this GPU"
        return StageReport(
            "background", chosen, "the first of its stage that can run here", absent, better
        )
    why = "it copies from the photo, and needs no model"
    if "pixelhacker" not in dict(absent):
        why += "; pixelhacker would take minutes without a GPU"
    better = "to invent what the photo does not show: `objectmorpher models get lama`, or migan"
    return StageReport("background", chosen, why, absent, better)


def _harmonising() -> StageReport:
    absent = backends.absent(refine.BACKENDS)
    others = [name for name in compose.REFINERS if name != "none"]
    others += [name for name in refine.BACKENDS if name not in dict(absent)]
    better = (
        "" if len(absent) < len(refine.BACKENDS) else "`objectmorpher models get flux2-klein-4b`"
    )
    if better and not device.has_torch():
        better = f"`{models.EXTRA}`, then {better}"
    if better and not device.has_gpu():  # hours a picture without one
        better = f"a GPU of 12 GB, here or in a server (docs/serve.md): {better}"
    why = f"unless it is asked for by its name: {', '.join(others)}"
    return StageReport("refine", "none", why, absent, better)
