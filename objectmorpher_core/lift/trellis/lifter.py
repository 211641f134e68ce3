"""TRELLIS as a lifter: the object is made, found again in the photo, and given the photo back."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ...base.progress import Progress, part
from ...document.gaussians import Gaussians
from ...document.model import LiftedObject, LiftSettings
from ...models import ModelError, device
from ...splat_files.splats.axes import QUARTER_TURN, turned
from .. import LiftError, Subject
from ..registration.imported import lift_imported
from ..registration.placement import Hints, Proposal, Registrar, register
from ..registration.view import Target
from . import configs
from .configs import Sampling

if TYPE_CHECKING:
    from ...models.device import Plan
    from .generator import Folders, Generator, Made
    from .picture import Picture

log = logging.getLogger(__name__)
STEPS = 12  # of each flow: what the publishers' own example takes
GUIDANCE = 7.5, 3.0  # of the flows, from the same place
UP = (0.0, -1.0, 0.0)  # of the object frame: y is down
FITS = 0.85  # score from which a pose that the network says itself is not looked for again
PARAMETERS = 1_924_000_000  # counted; the encoder twice: it stays in single precision
WORK = 2 << 30  # bytes at half precision, estimated
SPLATTING = "mip"  # as its Gaussians were trained


class TrellisLifter:
    """Image to 3D (paper 3.1). `LiftSettings.count` does not apply: all Gaussians are kept."""

    name = "trellis"
    ids: tuple[str, ...] = (configs.TRELLIS, configs.ENCODER)
    _kept: dict[str, Any] = {}  # noqa: RUF012  generators, loaded once in a process

    def missing(self) -> str | None:
        """See `Lifter`."""
        return configs.missing(*self.ids)

    def lift(
        self, subject: Subject, settings: LiftSettings, progress: Progress, seed: int = 0
    ) -> LiftedObject:
        """See `Lifter`. The same seed gives the same object on one device."""
        from .picture import Picture

        picture = Picture.of(subject.matte)
        gaussians, hints = self._made(picture, subject, part(progress, 0.0, 0.8), seed)
        target = Target(subject.pixels, subject.mask, subject.camera)
        best = placed(gaussians, target, hints, part(progress, 0.8, 0.95), seed)
        log.info("Registered with an IoU of %.3f, score %.3f", best.iou, best.score)
        progress(0.95, f"Placed: the outlines agree by {best.iou:.0%}")
        rest = part(progress, 0.95, 1.0)
        lifted = lift_imported(gaussians, best, subject.matte, SPLATTING, rest, seed)
        return replace(lifted, backend=self.name)

    def _made(
        self, picture: Picture, subject: Subject, progress: Progress, seed: int
    ) -> tuple[Gaussians, Hints]:
        """The object in our axes, and what is known of its pose."""
        generator = self._generator()
        how = example_sampling(generator)
        made = within_memory(generator, lambda: generator.make(picture, progress, seed, how))
        return turned(made.gaussians, QUARTER_TURN), Hints(up=UP)

    def _generator(self) -> Generator:
        from .generator import Folders

        folders = Folders(*(configs.weights_folder(id) for id in self.ids))
        if (known := self._kept.get(self.name)) is None or known.folders != folders:
            self._kept[self.name] = self._new_generator(folders, tiers())
        return self._kept[self.name]

    def _new_generator(self, folders: Folders, tiers: tuple[Plan, ...]) -> Generator:
        from .generator import Generator

        return Generator(folders, *tiers)


def placed(
    gaussians: Gaussians, target: Target, hints: Hints, progress: Progress, seed: int
) -> Proposal:
    """Where the object stands in the photo; near the pose that is hinted at if it fits there."""
    if hints.start is not None:
        progress(0.0, "Fitting the object")
        registrar = Registrar(gaussians, target, seed)
        best = registrar.improved(registrar.rated(hints.start))
        if best.score >= FITS:
            return best
    return register(gaussians, target, hints, progress, seed).best


def example_sampling(generator: Generator) -> tuple[Sampling, Sampling]:
    """The model's own sampling with the steps and guidance of the publishers' example."""
    own = generator.pipeline
    first, second = (
        replace(flow, steps=min(STEPS, flow.steps), guidance=guidance)
        for flow, guidance in zip((own.structure, own.latent), GUIDANCE, strict=True)
    )
    return first, second


def need() -> device.Need:
    """What it asks of memory."""
    return device.Need(PARAMETERS, WORK, parts=True, half="float16")  # as published


def tiers() -> tuple[Plan, ...]:
    """How it can run here, the best first; a GPU that has room is not followed by an hour's work.

    Raises LiftError.
    """
    try:
        found = device.plans(need())
    except ModelError as error:
        raise LiftError(str(error)) from error
    return tuple(plan for plan in found if plan.device != "cpu") or found


def within_memory(generator: Generator, make: Callable[[], Made]) -> Made:
    """What `make()` makes; where the memory of its plan does not suffice, with the next one.

    It stays with that. Raises LiftError.
    """
    left = generator.tiers[generator.tiers.index(generator.plan) :]

    def attempt(plan: Plan) -> Made:
        if plan != generator.plan:
            generator.release()
            generator.plan = plan
        return make()

    try:
        return device.run(left, attempt)
    except ModelError as error:
        generator.release()
        raise LiftError(f"{error}: close other programs, or lift it as a relief") from error
