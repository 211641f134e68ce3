"""Sets of models: what of a set fits this machine, how it would run, what it takes, getting it all.

Nothing of a set need be there: memory is planned from the parameters of the published files, and
seconds are the operations that `docs/estimates` counts, at a third of 80 T a second, and the way of
the weights to the GPU where they do not stay there.
"""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from dataclasses import dataclass

from . import models
from .base.progress import Progress, silent
from .compose.plate import inpaint_latent
from .compose.refine import klein, qwen
from .compose.refine.diffusion import DiffusionRefiner
from .lift.trellis.lifter import TrellisLifter, TripoSplatLifter
from .models import HubModel, ModelError, ModelSet, depth_net, device
from .models.device import Device
from .models.ledger import Ledger, Model
from .models.plans import Need, Needs, Network, PipelineNeed, Plan
from .segment.sam import sam_torch

SPEED = 80e12 / 3  # operations a second: a third of what a GPU of 2023 can do at half precision
BUS = 12e9  # bytes a second to the GPU
DRIVER = 600 << 20  # bytes of a card that its driver keeps
OPERATIONS = {  # 10^12, of a photo, an object, a square, a crop in four steps
    "sam2.1-small": 0.36, "sam-vit-huge": 6.0, "trellis-image-large": 191.0, "pixelhacker": 29.0,
    "qwen-image-edit-2511": 1243.0, "flux2-klein-4b": 516.0,
}  # fmt: skip
PIPELINES: Mapping[str, tuple[type[DiffusionRefiner], tuple[int, ...]]] = {
    # Millions of parameters of the networks that are in memory, the largest first.
    "qwen-image-edit": (qwen.QwenRefiner, (20_430, 8_292, 127)),
    "flux2-klein": (klein.KleinRefiner, (3_876, 84)),
}
LIFTERS = {"trellis": TrellisLifter, "cupid": TrellisLifter, "triposplat": TripoSplatLifter}
STEPS = 4  # of both, in how many the weights travel again where layers do


@dataclass(frozen=True)
class Card:
    """A machine's memory when no other program runs; a `Memory` of the ledger's."""

    gpu: int  # bytes; 0: there is no GPU
    host: int
    kind: Device = "cuda"

    def devices(self) -> tuple[Device, ...]:
        """See `Memory`."""
        return (self.kind, "cpu") if self.gpu else ("cpu",)

    def free_memory(self, where: Device, /) -> int:
        """See `Memory`."""
        return self.host if where == "cpu" else max(0, self.gpu - DRIVER)

    def empty_cache(self, where: Device, /) -> None:
        """See `Memory`."""


@dataclass(frozen=True)
class SetStep:
    """One of a set's models on a card."""

    model: HubModel
    plan: Plan | None  # None: it does not run there, or only beside another
    why_not: str = ""
    seconds: float = 0.0  # on a GPU, about


@dataclass(frozen=True)
class SetOffer:
    """A set on a card."""

    set: ModelSet
    card: Card
    steps: tuple[SetStep, ...]
    missing: int  # bytes that are still to be downloaded

    @property
    def fits(self) -> bool:
        """Whether all of it runs there."""
        return not any(step.why_not for step in self.steps)

    @property
    def size(self) -> int:
        """Bytes on the disk."""
        return sum(step.model.size for step in self.steps)

    @property
    def licences(self) -> tuple[str, ...]:
        """Their names, each once."""
        return tuple(dict.fromkeys(step.model.licence for step in self.steps))

    @property
    def seconds(self) -> float | None:
        """Of a whole edit, about; None without a GPU, where nobody has counted them."""
        on_gpu = self.fits and all(s.plan is None or s.plan.device != "cpu" for s in self.steps)
        return sum(step.seconds for step in self.steps) if on_gpu else None


def this_card() -> Card:
    """This machine's, by the driver's own program: PyTorch takes seconds to import."""
    host = device.total_memory()
    try:
        asked = ["nvidia-smi", "--query-gpu=memory.total", "--format=csv,noheader,nounits"]
        said = subprocess.run(asked, capture_output=True, text=True, timeout=10, check=True).stdout
        return Card(int(said.split()[0]) << 20, host)
    except (OSError, ValueError, IndexError, subprocess.SubprocessError):
        if device.has_torch() and device.devices()[0] != "cpu":
            kind = device.devices()[0]
            return Card((device.free_memory(kind) or 0) + DRIVER, host, kind)
        return Card(0, host)


def offers(card: Card | None = None) -> tuple[SetOffer, ...]:
    """All sets on a card; None: this machine's."""
    here = card or this_card()
    return tuple(offer(each, here) for each in models.model_sets())


def offer(wanted: ModelSet, card: Card) -> SetOffer:
    """A set on a card, with what takes the place of models that do not fit it."""
    steps = []
    for id in wanted.models:
        step = _step(id, card)
        whose = id if id not in wanted.instead or wanted.instead[id] else _beside(wanted, id)
        if whose in wanted.instead and _step(whose, card).why_not:
            if not wanted.instead[id]:
                continue  # an adapter of a model that is not taken
            step = _step(wanted.instead[id], card)
        steps.append(step)
    there = {step.model.id for step in steps if models.place(step.model.id) is not None}
    missing = sum(step.model.size for step in steps if step.model.id not in there)
    return SetOffer(wanted, card, tuple(steps), missing)


def get_set(chosen: SetOffer, progress: Progress = silent, accepted: str = "") -> None:
    """Downloads all that is missing of a set, one after the other.

    Raises ModelError: one sentence, before anything starts where the disk is too small.
    `Cancelled` passes through; the next call goes on from there.
    """
    missing = [step.model for step in chosen.steps if models.place(step.model.id) is None]
    models.get_all(missing, chosen.set.id, progress, accepted)


def need_of(model: HubModel) -> Needs | None:
    """What a published model asks of memory; None: nothing that is counted, or beside another."""
    numbers = model.parameters * 1_000_000
    if model.family in sam_torch.WORK:
        return Need(numbers, sam_torch.WORK[model.family])
    if model.family in LIFTERS:
        return LIFTERS[model.family]().need()
    if model.family == "depth-anything":
        return Need(numbers, depth_net.WORK, numbers=("float32",))
    if model.family in inpaint_latent.TITLES:
        return inpaint_latent.need(numbers)
    if model.family not in PIPELINES:
        return None
    refiner, counts = PIPELINES[model.family]
    networks = zip(counts, refiner.work.items(), strict=True)
    return PipelineNeed(
        tuple(Network(2_000_000 * n, work, name in refiner.parts) for n, (name, work) in networks),
        can_shrink=True,  # the extra brings what it takes
    )


def _step(id: str, card: Card) -> SetStep:
    model = models.hub_model(id)
    need = need_of(model)
    if need is None:
        return SetStep(model, None)
    try:
        plan = Ledger(card).plan(Model(id, id, need, lambda plan: plan))
    except ModelError as error:
        return SetStep(model, None, str(error))
    moved = 0
    if plan.way != "whole" and isinstance(need, PipelineNeed) and not plan.keeps:
        moved = plan.host * (STEPS if plan.way == "layers" else 1)
    return SetStep(model, plan, "", 1e12 * OPERATIONS.get(id, 0.0) / SPEED + moved / BUS)


def _beside(wanted: ModelSet, id: str) -> str:
    """The model that an adapter lies beside: the one whose name it holds."""
    return next(other for other, instead in wanted.instead.items() if instead and other in id)
