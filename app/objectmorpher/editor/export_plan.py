"""Export formats and the names of the exported files. Plain values."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from objectmorpher_core.pictures.formats import WRITTEN, Format, format_of

LOSSLESS = 100  # quality of LOSSLESS_AT_100 at which every pixel is kept


class What(Enum):
    """The things that an export may hold."""

    PHOTO = "Photo"
    CUTOUT = "Object cut-out"
    MASK = "Mask"
    DEPTH = "Depth"
    BACKGROUND = "Background"
    LAYERS = "Layers"
    VIDEO = "Video"
    SOLID = "3D object"

    @property
    def key(self) -> str:
        """Its name in the table of what can be saved, `objectmorpher_core.pictures.formats`."""
        return _KEYS[self]


_KEYS = {
    What.PHOTO: "photo", What.CUTOUT: "object", What.MASK: "mask", What.DEPTH: "depth",
    What.BACKGROUND: "plate", What.LAYERS: "layers", What.VIDEO: "video", What.SOLID: "splats",
}  # fmt: skip


class VideoMotion(Enum):
    """Subjects of a video, named as in `objectmorpher_core.scripting.animation.MOTIONS`."""

    MORPH = "Photo to edit"
    SWAY = "Sway"
    TURN = "Turn around"
    KEYS = "Key poses"


FORMATS = {what: WRITTEN[what.key] for what in What} | {
    What.LAYERS: (*WRITTEN["layers"], Format.PNG),  # in a folder
    What.VIDEO: (*WRITTEN["video"], Format.PNG),  # likewise
    What.SOLID: (*WRITTEN["mesh"], *WRITTEN["splats"]),
}
NAMES = {  # what follows the photo's name
    What.PHOTO: "edited",
    What.CUTOUT: "object",
    What.MASK: "mask",
    What.DEPTH: "depth",
    What.BACKGROUND: "background",
    What.LAYERS: "layers",
    What.VIDEO: "video",
    What.SOLID: "object",
}
LENGTHS = (1.0, 12.0)  # s, of a video


@dataclass(frozen=True)
class ExportPlan:
    """An export that was decided on."""

    what: What
    path: Path  # the file; of layers and frames as PNG the folder
    object: int = 0  # index of the one whose cut-out or mask it is
    bits: int = 0  # 8 or 16 a channel; 0: the photo's own
    quality: int = 95  # of the format; 100 is lossless where it has that
    motion: VideoMotion = VideoMotion.MORPH
    seconds: float = 4.0

    @property
    def is_folder(self) -> bool:
        return is_folder(self.what, format_of(self.path.name))


def is_folder(what: What, format: Format | None) -> bool:
    """Whether it is written as PNG files in a folder: layers, or frames, that are not one file."""
    return what in (What.LAYERS, What.VIDEO) and format not in WRITTEN[what.key]
