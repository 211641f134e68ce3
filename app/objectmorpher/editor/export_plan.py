"""What can be exported, in which formats, and under which names. Plain values."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path

LOSSLESS = 100  # quality of WebP at which every pixel is kept


class What(Enum):
    """The things that an export may hold."""

    PHOTO = "Photo"
    CUTOUT = "Object cut-out"
    MASK = "Mask"
    DEPTH = "Depth"
    BACKGROUND = "Background"
    LAYERS = "Layers"
    VIDEO = "Video"


class Motion(Enum):
    """What a video shows, named as in `objectmorpher_core.scripting.animation.MOTIONS`."""

    MORPH = "Photo to edit"
    SWAY = "Sway"
    TURN = "Turn around"


class Format(Enum):
    """Kinds of image files."""

    PNG = "PNG"
    JPEG = "JPEG"
    TIFF = "TIFF"
    WEBP = "WebP"
    OPENRASTER = "OpenRaster"
    WEBM = "WebM"
    MP4 = "MP4"
    GIF = "GIF"

    @property
    def endings(self) -> tuple[str, ...]:
        """The usual one first."""
        return _ENDINGS[self]

    @property
    def has_16_bits(self) -> bool:
        return self in (Format.PNG, Format.TIFF, Format.OPENRASTER)

    @property
    def has_quality(self) -> bool:
        return self in (Format.JPEG, Format.WEBP)


_ENDINGS = {
    Format.PNG: (".png",),
    Format.JPEG: (".jpg", ".jpeg"),
    Format.TIFF: (".tif", ".tiff"),
    Format.WEBP: (".webp",),
    Format.OPENRASTER: (".ora",),
    Format.WEBM: (".webm",),
    Format.MP4: (".mp4",),
    Format.GIF: (".gif",),
}
_FLAT = (Format.PNG, Format.JPEG, Format.TIFF, Format.WEBP)
_TRANSPARENT = (Format.PNG, Format.TIFF, Format.WEBP)
FORMATS = {
    What.PHOTO: _FLAT,
    What.CUTOUT: _TRANSPARENT,
    What.MASK: (Format.PNG,),
    What.DEPTH: (Format.PNG, Format.TIFF),
    What.BACKGROUND: _FLAT,
    What.LAYERS: (Format.OPENRASTER, Format.PNG),
    What.VIDEO: (Format.WEBM, Format.MP4, Format.GIF, Format.WEBP),
}
NAMES = {  # what follows the photo's name
    What.PHOTO: "edited",
    What.CUTOUT: "object",
    What.MASK: "mask",
    What.DEPTH: "depth",
    What.BACKGROUND: "background",
    What.LAYERS: "layers",
    What.VIDEO: "video",
}
LENGTHS = (1.0, 12.0)  # s, of a video


def format_of(ending: str) -> Format | None:
    """The format that an ending (".JPG") names."""
    return next((f for f in Format if ending.lower() in f.endings), None)


@dataclass(frozen=True)
class Plan:
    """An export that was decided on."""

    what: What
    path: Path  # the file; of layers as PNG the folder
    object: int = 0  # index of the one whose cut-out or mask it is
    bits: int = 0  # 8 or 16 a channel; 0: the photo's own
    quality: int = 95  # of JPEG, and of WebP where LOSSLESS is just that
    motion: Motion = Motion.MORPH
    seconds: float = 4.0

    @property
    def is_folder(self) -> bool:
        return is_folder(self.what, format_of(self.path.suffix))


def is_folder(what: What, format: Format | None) -> bool:
    """Whether it is written as several files in a folder: layers that are not in one file."""
    return what is What.LAYERS and format is not Format.OPENRASTER
