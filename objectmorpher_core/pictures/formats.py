"""The one table of file formats, for the window, the command line and the library."""

from __future__ import annotations

from enum import Enum, Flag, auto


class Trait(Flag):
    """What a format can hold."""

    DEEP = auto()  # 16 bits a channel
    ALPHA = auto()
    QUALITY = auto()  # it can be made smaller at the cost of the pixels
    READ = auto()  # as a photo


DEEP, ALPHA, QUALITY, READ = Trait.DEEP, Trait.ALPHA, Trait.QUALITY, Trait.READ
NONE = Trait(0)
RAW_ENDINGS = (
    ".dng", ".cr2", ".cr3", ".nef", ".arw", ".orf", ".rw2", ".raf", ".pef", ".srw",
)  # fmt: skip


class Format(Enum):
    """A kind of file. Its value is its name in the window and in the settings."""

    PNG = "PNG", (".png",), DEEP | ALPHA | READ
    JPEG = "JPEG", (".jpg", ".jpeg"), QUALITY | READ
    TIFF = "TIFF", (".tif", ".tiff"), DEEP | ALPHA | READ
    WEBP = "WebP", (".webp",), ALPHA | QUALITY | READ
    AVIF = "AVIF", (".avif",), ALPHA | QUALITY | READ
    JXL = "JPEG XL", (".jxl",), ALPHA | QUALITY | READ
    BMP = "BMP", (".bmp",), READ
    HEIC = "HEIC", (".heic", ".heif", ".hif"), READ
    RAW = "camera RAW", RAW_ENDINGS, READ
    OPENRASTER = "OpenRaster", (".ora",), DEEP | ALPHA
    PSD = "PSD", (".psd",), DEEP | ALPHA
    WEBM = "WebM", (".webm",), NONE
    MP4 = "MP4", (".mp4",), NONE
    GIF = "GIF", (".gif",), NONE
    COMPRESSED_PLY = "compressed PLY", (".compressed.ply",), NONE
    PLY = "PLY", (".ply",), NONE
    SPLAT = "SPLAT", (".splat",), NONE
    SPZ = "SPZ", (".spz",), NONE
    GLB = "GLB", (".glb",), NONE
    SESSION = "session", (".omorph",), NONE

    def __new__(cls, name: str, endings: tuple[str, ...], traits: Trait) -> Format:
        self = object.__new__(cls)
        self._value_ = name
        self.endings = endings
        self.traits = traits
        return self

    endings: tuple[str, ...]  # lower case, the usual one first
    traits: Trait

    @property
    def has_16_bits(self) -> bool:
        """Whether it can hold 16 bits a channel."""
        return Trait.DEEP in self.traits

    @property
    def has_quality(self) -> bool:
        """Whether there is a choice between its size and its truth."""
        return Trait.QUALITY in self.traits


FLAT = (Format.PNG, Format.JPEG, Format.TIFF, Format.WEBP, Format.AVIF, Format.JXL)  # written
TRANSPARENT = tuple(format for format in FLAT if Trait.ALPHA in format.traits)
LOSSLESS_AT_100 = (Format.WEBP, Format.JXL)  # where this quality keeps every pixel
SPLATS = (Format.PLY, Format.COMPRESSED_PLY, Format.SPLAT, Format.SPZ)


def endings_of(formats: tuple[Format, ...]) -> tuple[str, ...]:
    """Return the endings of several formats, in their order."""
    return tuple(ending for format in formats for ending in format.endings)


def format_of(name: str) -> Format | None:
    """Return the format that a file's name or ending (".JPG") names; None for an unknown one."""
    return next((f for f in Format if name.lower().endswith(f.endings)), None)


READABLE = endings_of(tuple(format for format in Format if Trait.READ in format.traits))

WRITTEN = {  # what can be saved of an edit, and the formats that each may have
    "photo": FLAT,
    "session": (Format.SESSION,),
    "mask": (Format.PNG,),
    "plate": FLAT,
    "object": TRANSPARENT,
    "splats": SPLATS,
    "mesh": (Format.GLB,),
    "depth": (Format.PNG, Format.TIFF),
    "layers": (Format.OPENRASTER, Format.PSD),
    "video": (Format.WEBM, Format.MP4, Format.GIF, Format.WEBP),
}
NEED_PLATE = ("plate", "layers", "video")
