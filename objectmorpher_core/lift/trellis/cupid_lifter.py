"""CUPID as a lifter: as TRELLIS, but the network itself says where the object stands."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base.arrays import F64
from ...base.camera import Camera
from ...base.progress import Progress
from ...document.gaussians import Gaussians
from ...document.model import LiftSettings
from ...splat_files.splats.ply import QUARTER_TURN, turned
from .. import LiftSubject
from ..registration.placement import Hints
from . import configs
from .camera import Framing, pose_in
from .lifter import UP, TrellisLifter
from .picture import ConditionPicture

if TYPE_CHECKING:
    from ...models.plans import Plan


class CupidLifter(TrellisLifter):
    """Image to 3D that stands where the photo shows it."""

    name, title = "cupid", "CUPID"
    ids = (configs.CUPID, configs.ENCODER, configs.TRELLIS)

    def _new_generator(self, folders: tuple[Path, ...], plan: Plan) -> Any:
        from .cupid import CupidGenerator
        from .generator import Folders

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


def pose_seen(seen: Framing, picture: ConditionPicture, camera: Camera) -> F64 | None:
    """(4, 4) world from object, in our axes, where the photo's camera sees it so.

    The photo's focal length is kept, whatever the network's view has. None where there is none.
    """
    return pose_in(camera, seen.points @ QUARTER_TURN.T, picture.photo_xy(seen.uv))
