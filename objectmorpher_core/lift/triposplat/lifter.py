"""TripoSplat as a lifter: as TRELLIS, with as many Gaussians as are asked for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ... import models
from ...base.progress import Progress
from ...document.gaussians import Gaussians
from ...document.model import LiftSettings
from ...splat_files.splats.ply import QUARTER_TURN, turned
from .. import LiftSubject
from ..registration.placement import Hints
from ..trellis import configs
from ..trellis.lifter import UP, TrellisLifter

if TYPE_CHECKING:
    from ...models.plans import Plan

FEWEST, MOST = 1 << 15, 1 << 18  # Gaussians, as published


class TripoSplatLifter(TrellisLifter):
    """Image to 3D. Its encoder, DINOv3, has a licence of its own."""

    name, title = "triposplat", "TripoSplat"
    ids = (configs.TRIPOSPLAT,)
    parameters = 2_500_000_000  # of 1.58; the encoders twice: they stay in single precision
    work = 3 << 30  # bytes beside the weights, estimated

    def missing(self) -> str | None:
        """See `Lifter`."""
        return models.not_installed(("diffusers",)) or super().missing()

    def _new_generator(self, folders: tuple[Path, ...], plan: Plan) -> Any:
        from .generator import TripoSplatGenerator

        return TripoSplatGenerator(folders[0], plan)

    def _made(
        self, subject: LiftSubject, settings: LiftSettings, progress: Progress, seed: int
    ) -> tuple[Gaussians, Hints]:
        from ..trellis.picture import ConditionPicture

        picture = ConditionPicture.of(subject.matte)
        count = min(max(settings.count, FEWEST), MOST)
        made = self.make(lambda generator: generator.make(picture, count, progress, seed))
        return turned(made, QUARTER_TURN), Hints(up=UP)
