"""TRELLIS and its kin as lifters: the object is made, found in the photo, and given the photo back.

Where an object of TRELLIS or TripoSplat stands is looked for; CUPID's network says it itself.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ...base.arrays import F64
from ...base.camera import Camera
from ...base.progress import Progress, part
from ...document.gaussians import Gaussians
from ...document.model import LiftedObject, LiftSettings
from ...models import ModelError, ledger, not_installed
from ...models.plans import Need
from ...models.weight_folder import count_parameters
from ...splat_files.splats.ply import QUARTER_TURN, turned
from .. import LiftError, LiftSubject
from ..registration.imported import lift_imported
from ..registration.placement import Hints, Proposal, Registrar, register
from ..registration.view import Target
from . import configs
from .camera import Framing, pose_in
from .configs import Sampling
from .picture import ConditionPicture

if TYPE_CHECKING:
    from ...models.plans import Plan
    from .generator import Generator

log = logging.getLogger(__name__)
T = TypeVar("T")
STEPS = 12  # of each flow: what the publishers' own example takes
GUIDANCE = 7.5, 3.0  # of the flows, from the same place
UP = (0.0, -1.0, 0.0)  # of the object frame: y is down
FITS = 0.85  # score from which a pose that the network says itself is not looked for again
SPLATTING = "mip"  # as its Gaussians were trained
FEWEST, MOST = 1 << 15, 1 << 18  # Gaussians of TripoSplat, as published


class TrellisLifter:
    """Image to 3D (paper 3.1). `LiftSettings.count` does not apply: all Gaussians are kept."""

    name, title = "trellis", "TRELLIS"
    ids: tuple[str, ...] = (configs.TRELLIS, configs.ENCODER)
    parameters = 1_924_000_000  # counted; the encoder twice: it stays in single precision
    work = 2 << 30  # bytes beside the weights, estimated

    def missing(self) -> str | None:
        """See `Lifter`."""
        return configs.missing(*self.ids)

    def lift(
        self, subject: LiftSubject, settings: LiftSettings, progress: Progress, seed: int = 0
    ) -> LiftedObject:
        """See `Lifter`. The same seed gives the same object on one device."""
        gaussians, hints = self._made(subject, settings, part(progress, 0.0, 0.8), seed)
        target = Target(subject.pixels, subject.mask, subject.camera)
        best = placed(gaussians, target, hints, part(progress, 0.8, 0.95), seed)
        log.info("Registered with an IoU of %.3f, score %.3f", best.iou, best.score)
        progress(0.95, f"Placed: the outlines agree by {best.iou:.0%}")
        rest = part(progress, 0.95, 1.0)
        lifted = lift_imported(gaussians, best, subject.matte, SPLATTING, rest, seed)
        return replace(lifted, backend=self.name)

    def _made(
        self, subject: LiftSubject, settings: LiftSettings, progress: Progress, seed: int
    ) -> tuple[Gaussians, Hints]:
        """The object in our axes, and what is known of its pose."""
        picture = ConditionPicture.of(subject.matte)
        made = self.make(lambda g: g.make(picture, progress, seed, example_sampling(g)))
        return turned(made.gaussians, QUARTER_TURN), Hints(up=UP)

    def make(self, use: Callable[[Any], T]) -> T:
        """What `use(generator)` makes, in the best way for which there is memory.

        Raises LiftError.
        """
        folders = tuple(configs.weights_folder(id) for id in self.ids)
        model = ledger.Model(
            self.title, folders, self.need(), lambda plan: self._new_generator(folders, plan)
        )
        try:
            return ledger.SHARED.run(model, lambda generator, _: use(generator))
        except ModelError as error:
            raise LiftError(f"{error}: close other programs, or lift it as a relief") from error

    def need(self) -> Need:
        """Return the memory that it needs: as published, and less where its files are smaller."""
        numbers = ("float16",)  # as published
        share = self._size()
        parameters, work = int(share * self.parameters), int(share * self.work)
        return Need(parameters, work, parts=True, numbers=numbers, is_slow_on_cpu=True)

    def _size(self) -> float:
        """How large the model in the files is, as a share of the published one; 1 without files.

        What stays in single precision counts twice in `parameters`, so all of it does here.
        """
        files = [f for id in self.ids for f in configs.weights_folder(id).rglob("*.safetensors")]
        try:
            counted = sum(count_parameters(at) for at in {file.parent for file in files})
        except ModelError:
            counted = 0  # who opens them says what is wrong
        return min(1.0, 2 * counted / self.parameters) if counted else 1.0

    def _new_generator(self, folders: tuple[Path, ...], plan: Plan) -> Any:
        from .generator import Folders, Generator

        return Generator(Folders(*folders), plan)


def placed(
    gaussians: Gaussians, target: Target, hints: Hints, progress: Progress, seed: int
) -> Proposal:
    """Return the object's place in the photo, near the hinted pose if it fits there."""
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


class CupidLifter(TrellisLifter):
    """Image to 3D that stands where the photo shows it."""

    name, title = "cupid", "CUPID"
    ids = (configs.CUPID, configs.ENCODER, configs.TRELLIS)

    def _new_generator(self, folders: tuple[Path, ...], plan: Plan) -> Any:
        from .generator import CupidGenerator, Folders

        return CupidGenerator(Folders(*folders), plan)

    def stance(self, subject: LiftSubject, progress: Progress, seed: int = 0) -> F64 | None:
        """(4, 4) world from the network's own frame of the object; None where no camera sees it so.

        The frame is about the same for two pictures of one object. Raises LiftError.
        """
        picture = ConditionPicture.of(subject.matte)
        made = self.make(lambda generator: generator.make(picture, progress, seed))
        assert made.view is not None
        return pose_seen(made.view, picture, subject.camera)

    def _made(
        self, subject: LiftSubject, settings: LiftSettings, progress: Progress, seed: int
    ) -> tuple[Gaussians, Hints]:
        picture = ConditionPicture.of(subject.matte)
        made = self.make(lambda generator: generator.make(picture, progress, seed))
        assert made.view is not None
        start = pose_seen(made.view, picture, subject.camera)
        return turned(made.gaussians, QUARTER_TURN), Hints(up=UP, start=start)


class TripoSplatLifter(TrellisLifter):
    """Image to 3D, in as many Gaussians as are asked for. Its encoder has a licence of its own."""

    name, title = "triposplat", "TripoSplat"
    ids = (configs.TRIPOSPLAT,)
    parameters = 2_500_000_000  # of 1.58; the encoders twice: they stay in single precision
    work = 3 << 30  # bytes beside the weights, estimated

    def missing(self) -> str | None:
        """See `Lifter`."""
        return not_installed(("diffusers",)) or super().missing()

    def _new_generator(self, folders: tuple[Path, ...], plan: Plan) -> Any:
        from ..triposplat.generator import TripoSplatGenerator

        return TripoSplatGenerator(folders[0], plan)

    def _made(
        self, subject: LiftSubject, settings: LiftSettings, progress: Progress, seed: int
    ) -> tuple[Gaussians, Hints]:
        picture = ConditionPicture.of(subject.matte)
        count = min(max(settings.count, FEWEST), MOST)
        made = self.make(lambda generator: generator.make(picture, count, progress, seed))
        return turned(made, QUARTER_TURN), Hints(up=UP)


def pose_seen(seen: Framing, picture: ConditionPicture, camera: Camera) -> F64 | None:
    """(4, 4) world from object, in our axes, where the photo's camera sees it so.

    The photo's focal length is kept, whatever the network's view has. None where there is none.
    """
    return pose_in(camera, seen.points @ QUARTER_TURN.T, picture.photo_xy(seen.uv))
