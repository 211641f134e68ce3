"""TRELLIS as a lifter: the object is made, found again in the photo, and given the photo back."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ...document import LiftedObject, LiftSettings
from ...gaussians import Gaussians
from ...progress import Progress, part
from ...splat_files.axes import QUARTER_TURN, turned
from .. import LiftError, Subject
from ..imported import lift_imported
from ..placement import Hints, Proposal, Registrar, register
from ..placement_view import Target
from . import weights
from .configs import Sampling

if TYPE_CHECKING:
    from .device import Plan
    from .generator import Folders, Generator
    from .picture import Picture

log = logging.getLogger(__name__)
STEPS = 12  # of each flow: what the publishers' own example takes
GUIDANCE = 7.5, 3.0  # of the flows, from the same place
UP = (0.0, -1.0, 0.0)  # of the object frame: y is down
FITS = 0.85  # score from which a pose that the network says itself is not looked for again
SPLATTING = "mip"  # as its Gaussians were trained


class TrellisLifter:
    """Image to 3D (paper 3.1). `LiftSettings.count` does not apply: all Gaussians are kept."""

    name = "trellis"
    ids: tuple[str, ...] = (weights.TRELLIS, weights.ENCODER)
    _kept: dict[str, Any] = {}  # noqa: RUF012  generators, loaded once in a process

    def missing(self) -> str | None:
        """See `Lifter`."""
        return weights.missing(*self.ids)

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
        from .device import Plan
        from .generator import Folders

        folders = Folders(*(weights.weights_folder(id) for id in self.ids))
        if (known := self._kept.get(self.name)) is None or known.folders != folders:
            self._kept[self.name] = self._new_generator(folders, Plan.best())
        return self._kept[self.name]

    def _new_generator(self, folders: Folders, plan: Plan) -> Generator:
        from .generator import Generator

        return Generator(folders, plan)


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


def within_memory(generator: Generator, make: Any) -> Any:
    """What `make()` makes; where the device's memory does not suffice, part by part."""
    import torch

    try:
        return make()
    except torch.OutOfMemoryError:
        log.warning("The GPU's memory is too small for all parts at once: one after another")
    generator.release()
    generator.plan = generator.plan.thrifty()
    try:
        return make()
    except torch.OutOfMemoryError as error:
        generator.release()
        raise LiftError(
            "the GPU's memory is too small for this object: close other programs, or lift it as a"
            " relief"
        ) from error
