"""Pictures in and out of files: upright, RGB, bit depth, alpha, profile and EXIF kept.

The pixels of a file that is read and written again as PNG, TIFF, WebP or JPEG XL are the same,
byte for byte; only 16-bit pixels that go into a format of 8 bits (`formats.py`) are rounded.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ..base.arrays import RGB, U8, Mask, Pixels, freeze
from ..base.library_output import logged_output
from ..base.limits import PICTURE_PIXELS as MAX_PIXELS
from . import exif, guests, png, tiff
from .formats import FLAT, READABLE, endings_of

if TYPE_CHECKING:
    from PIL import Image

# Pictures that are no files: arrays and Pillow's images, in and out of a `Picture`.

CHANNELS = {1: "grey", 2: "grey and alpha", 3: "RGB", 4: "RGB and alpha"}
AS_PNG = ("1", "L", "LA", "P", "RGB", "RGBA")  # modes of Pillow that PNG holds as they are
AS_TIFF = ("CMYK", "LAB")
WITH_ALPHA = {"RGBa": "RGBA", "La": "LA", "PA": "RGBA"}  # what they become first


def encode_array(
    array: np.ndarray, icc: bytes | None = None, described: bytes | None = None
) -> bytes:
    """The PNG file of pixels (H, W) or (H, W, 1..4), u8 or u16, RGB, with profile and EXIF.

    Raises ImageError.
    """
    if array.dtype not in (np.uint8, np.uint16):
        raise ImageError(
            f"a photo is an array of uint8 or uint16, not of {array.dtype};"
            " values from 0 to 1 become so by (255 * array).round().astype(np.uint8)"
        )
    samples = array[..., None] if array.ndim == 2 else array
    if samples.ndim != 3 or samples.shape[2] not in CHANNELS or samples.size == 0:
        raise ImageError(f"a photo is (H, W), (H, W, 3) or (H, W, 4), not {array.shape}")
    channels = samples.shape[2]
    pixels = samples[..., :3] if channels > 2 else np.repeat(samples[..., :1], 3, axis=2)
    alpha = samples[..., -1] if channels in (2, 4) else None
    return encode_picture(Picture(pixels, alpha, channels < 3, icc, described), ".png")


def encode_pil(image: Image.Image) -> bytes:
    """A file of Pillow's image, without loss, with its profile and EXIF. Raises ImageError."""
    image.load()  # first: Pillow turns a TIFF file then, and finds what is behind a PNG's pixels
    if image.format == "TIFF":
        block = tiff.described(image)  # without its size, which is that before the turn
    else:
        block = image.getexif().tobytes().removeprefix(exif.PREFIX) if image.getexif() else None
    icc = image.info.get("icc_profile")
    if image.mode.startswith("I;16"):
        return encode_array(np.asarray(image).astype(np.uint16), icc, block)
    if image.mode in ("I", "F"):
        raise ImageError(f"an image of mode {image.mode} is no photo; convert it to RGB")
    kind = "TIFF" if image.mode in AS_TIFF else "PNG"
    if image.mode not in (*AS_PNG, *AS_TIFF):
        image = image.convert(WITH_ALPHA.get(image.mode, "RGB"))
    more = {"exif": block} if block else {}
    out = io.BytesIO()
    image.save(out, kind, icc_profile=icc, **more)
    return out.getvalue()


def array_of(picture: Picture) -> np.ndarray:
    """A copy of its pixels (H, W, 3), or (H, W, 4) where it has an alpha channel."""
    if picture.alpha is None:
        return picture.pixels.copy()
    return np.dstack([picture.pixels, picture.alpha])


def pil_of(picture: Picture) -> Image.Image:
    """Pillow's image of a picture, with its profile and EXIF.

    Of 16 bits a channel Pillow keeps only grey without alpha; other pictures are rounded to 8.
    """
    picture = _without_false_grey(picture)
    colours = _grey(picture.pixels) if picture.is_grey else picture.pixels
    if not picture.is_grey or picture.alpha is not None:
        colours = to_u8(colours)
    if picture.alpha is not None:
        colours = np.dstack([colours, to_u8(picture.alpha)])
    image = _pillow(colours)
    icc = profile_for(picture.icc, len(image.getbands()))
    known = {"icc_profile": icc, "exif": picture.exif}
    image.info.update({key: value for key, value in known.items() if value})
    return image


FORMATS = ("PNG", "JPEG", "TIFF", "WEBP", "AVIF", "BMP", "GIF")  # plain pixels, no programs
ENDINGS = endings_of(FLAT)  # that can be written
READ_ENDINGS = READABLE  # of what counts as a picture in a folder of pictures
MASK_THRESHOLD = 127  # of 255; above it a mask's pixel belongs to the object
WEBP_MAX_SIDE = 16383  # px
JPEG_MAX_SIDE = 65535  # px
JPEG_EXIF = 65533  # bytes of a segment, without its length
AVIF_MAX_SIDE = 65535  # px
AVIF_SPEED = 8  # of 10; 6 takes three times as long for 3 % less
REASON = 200  # characters of what a decoder says
COLOURED = 4  # levels of 255 between channels, from which on a grey photo has got colour
LOSSLESS = 100  # quality of WebP that keeps every pixel


class ImageError(ValueError):
    """The bytes are not a picture that can be read, or cannot be written so; one sentence."""


@dataclass(frozen=True, eq=False)
class Picture:
    """Upright RGB pixels and everything of the file that must survive the edit."""

    pixels: Pixels  # (H, W, 3) u8 or u16, RGB
    alpha: np.ndarray | None = None  # (H, W) same dtype, straight
    is_grey: bool = False  # the file had one colour channel; so will the export
    icc: bytes | None = None  # colour profile
    exif: bytes | None = None  # raw EXIF block (a TIFF header first), orientation 1 (upright)
    focal_35mm: float | None = None  # mm, EXIF's 35-mm equivalent focal length

    def __post_init__(self) -> None:
        freeze(self, pixels=None, alpha=None)


@contextmanager
def naming(file: str | Path) -> Iterator[None]:
    """Put a file's name before what is wrong with the image in it, where there are several."""
    try:
        yield
    except ImageError as error:
        raise ImageError(f"{file}: {error}") from error


def read_picture(data: bytes, most: int = MAX_PIXELS) -> Picture:
    """The picture in the bytes of an image file; of several frames the first.

    CMYK and Lab become sRGB through their profile, palettes RGB. Raises ImageError, also where the
    picture has more than `most` px, before it is decoded.
    """
    if not data:
        raise ImageError("the image file is empty")
    with logged_output("a picture"):
        return _read(data, most)


def _read(data: bytes, most: int) -> Picture:
    if (kind := guests.kind_of(data)) is not None:
        return _read_guest(kind, data, most)
    from PIL import Image  # 40 ms that the first picture needs, not the program's start

    Image.MAX_IMAGE_PIXELS = MAX_PIXELS  # Pillow's own guard, before ours in some formats
    try:
        image = Image.open(io.BytesIO(data), formats=FORMATS)
    except Image.DecompressionBombError:
        raise ImageError(f"the image has more than {MAX_PIXELS // 10**6} megapixels") from None
    except Exception:  # Pillow raises whatever a broken file makes it stumble over
        image = None  # perhaps a TIFF that only tifffile knows
    if image is None and data[:4] not in tiff.MARKS:
        raise ImageError(
            "the file is not an image that can be read (PNG, JPEG, TIFF, WebP, AVIF, BMP, GIF)"
        )
    if image is not None and image.width * image.height > most:
        allowed = f"{most // 10**6} megapixels" if most >= 10**6 else f"{most:,} px"
        raise ImageError(f"the image is {image.width} x {image.height} px, more than {allowed}")
    try:
        return _read_16_bit(data, image, most) or _read_8_bit(data, image)
    except ImageError:
        raise
    except MemoryError as error:
        raise ImageError("the image cannot be read: there is not enough memory for it") from error
    except Image.DecompressionBombError as error:  # what lies in its blocks, not its size
        raise ImageError("the image cannot be read: it would unpack to too much") from error
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())[:REASON] or "it is damaged"
        raise ImageError(f"the image cannot be read: {reason}") from error
    except Exception as error:  # as above
        raise ImageError("the image cannot be read: it is damaged or ends early") from error


def _read_guest(kind: str, data: bytes, most: int) -> Picture:
    """The picture of a file that another package decodes."""
    try:
        found = guests.read(kind, data, most)
    except guests.GuestError as error:
        raise ImageError(str(error)) from error
    except MemoryError as error:
        raise ImageError("the image cannot be read: there is not enough memory for it") from error
    return _picture(found.samples, found.exif, found.icc, turn=1)


def _read_16_bit(data: bytes, image: Image.Image | None, most: int) -> Picture | None:
    """The picture of a file with 16 bits a channel; None where it has fewer."""
    if data.startswith(png.SIGNATURE) and image is not None:
        if png.bit_depth(data) != 16:
            return None
        samples, block = png.read_16_bit(data)
        return _picture(samples, block, image.info.get("icc_profile"), turn=None)
    found = tiff.read_16_bit(data, most) if data[:4] in tiff.MARKS else None
    if found is None:
        return None
    samples, turn, icc = found
    if image is None:
        return _picture(samples, tiff.described_raw(data), icc, turn)
    return _picture(samples, tiff.described(image), image.info.get("icc_profile"), turn)


def _read_8_bit(data: bytes, image: Image.Image | None) -> Picture:
    """The picture of any file that Pillow decodes to 8 bits a channel."""
    if image is None:
        raise ImageError("this kind of TIFF file cannot be read")
    if image.mode in ("F", "I") or image.mode.startswith("I;"):
        raise ImageError("only images of 8 or 16 whole-number bits a channel can be read")
    turn = 1 if image.format == "TIFF" else None  # Pillow turns TIFF files itself
    if image.mode in ("CMYK", "LAB"):
        samples = np.asarray(_through_profile(image))
        return _picture(samples, _exif_block(image), None, turn)
    clear = image.info.get("transparency")
    if image.mode == "L" and image.format == "PNG" and isinstance(clear, int):
        top = (1 << png.bit_depth(data)) - 1  # Pillow looks for the value among scaled samples
        image.info["transparency"] = (clear & top) * 255 // top
    has_alpha = image.mode in ("LA", "La", "PA", "RGBA", "RGBa") or "transparency" in image.info
    is_grey = image.mode in ("1", "L", "LA", "La")
    mode = ("LA" if has_alpha else "L") if is_grey else ("RGBA" if has_alpha else "RGB")
    samples = np.asarray(image.convert(mode))
    block, icc = _exif_block(image), image.info.get("icc_profile")
    return _picture(samples.reshape(*samples.shape[:2], -1), block, icc, turn)


def _through_profile(image: Image.Image) -> Image.Image:
    """A CMYK or Lab image as sRGB, through its own profile where it has one."""
    from PIL import ImageCms

    source = ImageCms.createProfile("LAB") if image.mode == "LAB" else None
    if icc := image.info.get("icc_profile"):
        source = io.BytesIO(icc)
    if source is not None:
        try:
            target = ImageCms.createProfile("sRGB")
            turned = ImageCms.profileToProfile(image, source, target, outputMode="RGB")
            if turned is not None:
                return turned
        except ImageCms.PyCMSError:
            pass  # a broken profile: the plain formula below is better than no picture
    return image.convert("RGB")


def _picture(
    samples: np.ndarray, block: bytes | None, icc: bytes | None, turn: int | None
) -> Picture:
    """Upright Picture of stored samples (H, W, 1..4): grey, grey + alpha, RGB or RGBA.

    `turn` is the EXIF orientation, None to take it from the EXIF `block`.
    """
    if turn is None:
        turn = exif.orientation(block) if block else 1
    samples = _upright(samples, turn)
    channels = samples.shape[2]
    return Picture(
        pixels=samples[..., :3] if channels > 2 else np.repeat(samples[..., :1], 3, axis=2),
        alpha=samples[..., -1] if channels in (2, 4) else None,
        is_grey=channels < 3,
        icc=icc or None,
        exif=exif.upright(block) if block else None,
        focal_35mm=exif.focal_35mm(block) if block else None,
    )


def _exif_block(image: Image.Image) -> bytes | None:
    """The EXIF block without prefix of an image that is decoded; None where there is none."""
    if image.format == "TIFF":
        return tiff.described(image)
    block = image.info.get("exif")
    return block.removeprefix(exif.PREFIX) or None if isinstance(block, bytes) else None


def _upright(samples: np.ndarray, orientation: int) -> np.ndarray:
    """Stored samples (H, W, C) turned and mirrored as EXIF orientation 1..8 says."""
    if orientation >= 5:  # rows are columns
        samples = samples.transpose(1, 0, 2)
    if orientation in (2, 3, 6, 7):
        samples = samples[:, ::-1]
    if orientation in (3, 4, 7, 8):
        samples = samples[::-1]
    return samples


def encode_picture(
    picture: Picture, ending: str, quality: int = 95, webp_quality: int = LOSSLESS
) -> bytes:
    """The bytes of an image file of the kind that `ending` (".png", "jpg") names.

    PNG and TIFF keep the bit depth; 16 bits are rounded to 8 for the others. `quality` is that of
    JPEG and AVIF; WebP and JPEG XL are lossless unless `webp_quality` is below 100. Grey stays
    grey (not in WebP and AVIF, which have none) unless something of another colour came into it.
    Raises ImageError for an unknown ending, and where the format cannot hold the picture.
    """
    ending = "." + ending.lower().removeprefix(".")
    if ending not in ENDINGS:
        raise ImageError(f"pictures cannot be written as {ending}, only as {', '.join(ENDINGS)}")
    picture = _without_false_grey(picture)
    try:
        if ending in (".jpg", ".jpeg"):
            return _encode_jpeg(picture, quality)
        if ending == ".webp":
            return _encode_webp(picture, webp_quality)
        if ending == ".avif":
            return _encode_avif(picture, quality)
        if ending == ".jxl":
            return _encode_jxl(picture, webp_quality)
        codec = png if ending == ".png" else tiff
        samples = _Channels(picture)
        return codec.encode(samples, profile_for(picture.icc, samples.shape[2]), picture.exif)
    except ImageError:
        raise
    except (OSError, ValueError, MemoryError, cv2.error) as error:
        reason = " ".join(str(error).split())[:REASON] or "there is not enough memory"
        raise ImageError(f"the picture cannot be written as {ending}: {reason}") from error


class _Channels:
    """The channels that a file stores (H, W, 1..4): grey or RGB, then alpha.

    They are put together for the rows that are asked for: a second picture may not fit.
    """

    def __init__(self, picture: Picture) -> None:
        self._picture = picture
        self.dtype = picture.pixels.dtype
        channels = (1 if picture.is_grey else 3) + (picture.alpha is not None)
        self.shape = (*picture.pixels.shape[:2], channels)

    def __getitem__(self, rows: slice) -> np.ndarray:
        picture = self._picture
        colours = picture.pixels[rows]
        if picture.is_grey:
            colours = _grey(colours)[..., None]
        if picture.alpha is None:
            return colours
        return np.concatenate([colours, picture.alpha[rows][..., None]], axis=2)


def _without_false_grey(picture: Picture) -> Picture:
    """The picture, no longer grey where a pixel is of another colour than a rounded grey."""
    least = COLOURED * np.iinfo(picture.pixels.dtype).max / 255
    red, green, blue = (picture.pixels[..., k] for k in range(3))
    pairs = (red, green), (green, blue), (blue, red)
    if picture.is_grey and any(int(cv2.absdiff(a, b).max(initial=0)) > least for a, b in pairs):
        return replace(picture, is_grey=False)
    return picture


def _pillow(samples: np.ndarray) -> Image.Image:
    from PIL import Image

    return Image.fromarray(samples)


def _grey(pixels: Pixels) -> np.ndarray:
    """(H, W) luma; exactly the grey that all three channels share where they do."""
    return cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)


def _encode_jpeg(picture: Picture, quality: int) -> bytes:
    height, width = picture.pixels.shape[:2]
    if picture.alpha is not None and (picture.alpha != np.iinfo(picture.alpha.dtype).max).any():
        raise ImageError("JPEG cannot hold transparency; choose .png, .tif or .webp")
    if max(width, height) > JPEG_MAX_SIDE:
        raise ImageError(f"JPEG cannot hold {width} x {height} px; choose .png or .tif")
    pixels = to_u8(picture.pixels)
    image = _pillow(_grey(pixels) if picture.is_grey else pixels)
    out = io.BytesIO()
    profile = profile_for(picture.icc, 1 if picture.is_grey else 3)
    block = _exif_for_jpeg(exif.PREFIX + picture.exif) if picture.exif else b""
    image.save(out, "JPEG", quality=quality, subsampling=0, icc_profile=profile, exif=block)
    return out.getvalue()


def _exif_for_jpeg(block: bytes) -> bytes:
    """The block; without the maker's note, or empty, where there is no room for all of it."""
    from PIL import Image

    if len(block) > JPEG_EXIF:
        found = Image.Exif()
        try:
            found.load(block)
            found.get_ifd(exif.EXIF_IFD).pop(exif.MAKER_NOTE, None)
            block = found.tobytes()
        except Exception:  # Pillow raises whatever a broken block makes it stumble over
            return b""
    return block if len(block) <= JPEG_EXIF else b""


def _encode_webp(picture: Picture, quality: int) -> bytes:
    height, width = picture.pixels.shape[:2]
    if max(width, height) > WEBP_MAX_SIDE:
        raise ImageError(f"WebP cannot hold {width} x {height} px; choose .png or .tif")
    out = io.BytesIO()
    how = {"lossless": True} if quality >= LOSSLESS else {"quality": quality}
    _pillow(_colours_and_alpha(picture)).save(
        out, "WEBP", **how, exact=True,  # exact: colours under transparency stay
        icc_profile=profile_for(picture.icc, 3) or b"", exif=picture.exif or b"",
    )  # fmt: skip
    return out.getvalue()


def _encode_avif(picture: Picture, quality: int) -> bytes:
    height, width = picture.pixels.shape[:2]
    if max(width, height) > AVIF_MAX_SIDE:
        raise ImageError(f"AVIF cannot hold {width} x {height} px; choose .png or .tif")
    out = io.BytesIO()
    _pillow(_colours_and_alpha(picture)).save(
        out, "AVIF", quality=quality, subsampling="4:4:4", speed=AVIF_SPEED,
        icc_profile=profile_for(picture.icc, 3) or b"", exif=_exif_for_avif(picture.exif),
    )  # fmt: skip
    return out.getvalue()


def _exif_for_avif(block: bytes | None) -> bytes:
    """The block, which Pillow takes apart for AVIF; empty where it is too damaged for that."""
    from PIL import Image

    found = Image.Exif()
    try:
        found.load(block or b"")
        found.get(exif.ORIENTATION)
        found.tobytes()
    except Exception:  # Pillow raises whatever a broken block makes it stumble over
        return b""
    return block or b""


def _encode_jxl(picture: Picture, quality: int) -> bytes:
    has_pair = picture.is_grey and picture.alpha is not None  # which the library does not take
    samples = _colours_and_alpha(picture) if has_pair else to_u8(_Channels(picture)[:])
    icc = profile_for(picture.icc, samples.shape[2])
    try:
        return guests.encode_jxl(samples, icc, picture.exif, quality)
    except (guests.GuestError, RuntimeError) as error:
        raise ImageError(str(error)) from error


def _colours_and_alpha(picture: Picture) -> RGB:
    """(H, W, 3 or 4) u8."""
    pixels = to_u8(picture.pixels)
    return pixels if picture.alpha is None else np.dstack([pixels, to_u8(picture.alpha)])


def profile_for(icc: bytes | None, channels: int) -> bytes | None:
    """The ICC profile of a file of 1 to 4 channels, of which 3 have colours.

    A grey one becomes one of colours with the same tones, so that all pixels stay as they are;
    None for a profile of colours in a grey file, and for what cannot be read.
    """
    space, wanted = (icc or b"")[16:20], b"GRAY" if channels < 3 else b"RGB "
    if space == wanted:
        return icc
    return _with_colours(icc) if icc and (space, wanted) == (b"GRAY", b"RGB ") else None


def _with_colours(grey: bytes) -> bytes | None:
    """The profile of sRGB with the tone curve, the name and the date of a grey one."""
    from PIL import ImageCms

    if grey[20:24] != b"XYZ ":  # its curve would be one of lightness
        return None
    try:
        curve = _tags(grey)[b"kTRC"]
        name = ImageCms.getProfileDescription(ImageCms.ImageCmsProfile(io.BytesIO(grey))).strip()
    except (KeyError, struct.error, OSError, ImageCms.PyCMSError):
        return None
    said = name.encode("utf-16-be")
    own = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    tags = _tags(own) | dict.fromkeys((b"rTRC", b"gTRC", b"bTRC"), curve)
    tags[b"desc"] = struct.pack(">4s3I4s2I", b"mluc", 0, 1, 12, b"enUS", len(said), 28) + said
    at, table, body = 132 + 12 * len(tags), [struct.pack(">I", len(tags))], []
    for tag, data in tags.items():
        table.append(struct.pack(">4s2I", tag, at, len(data)))
        body.append(data + bytes(-len(data) % 4))
        at += len(body[-1])
    return b"".join([struct.pack(">I", at), own[4:24], grey[24:36], own[36:128], *table, *body])


def _tags(icc: bytes) -> dict[bytes, bytes]:
    """An ICC profile's data by their signatures. Raises struct.error."""
    count = struct.unpack_from(">I", icc, 128)[0]
    listed = [struct.unpack_from(">4s2I", icc, 132 + 12 * k) for k in range(count)]
    return {tag: icc[at : at + size] for tag, at, size in listed}


def to_u8(pixels: np.ndarray) -> RGB:
    """8-bit values of u8 or u16 pixels of any shape, rounded (65535 / 255 = 257)."""
    if pixels.dtype == np.uint8:
        return pixels
    found = cv2.convertScaleAbs(pixels, alpha=1 / 257)  # which drops a last axis of length 1
    return found.astype(np.uint8, copy=False).reshape(pixels.shape)


def resized(pixels: np.ndarray, width: int, height: int) -> np.ndarray:
    """Pixels (H, W[, C]) at another size in px: area means when smaller, Lanczos when larger."""
    is_smaller = width * height < pixels.shape[0] * pixels.shape[1]
    method = cv2.INTER_AREA if is_smaller else cv2.INTER_LANCZOS4
    return cv2.resize(pixels, (width, height), interpolation=method)


def at_most(pixels: np.ndarray, longest: int) -> np.ndarray:
    """Pixels (H, W[, C]), made smaller where their longer side is more than `longest` px."""
    height, width = pixels.shape[:2]
    if max(width, height) <= longest:
        return pixels
    shrink = longest / max(width, height)
    return resized(pixels, max(round(width * shrink), 1), max(round(height * shrink), 1))


def encode_mask(mask: Mask) -> bytes:
    """8-bit grey PNG file of a mask (H, W): 0 and 255."""
    return png.encode(np.where(mask, np.uint8(255), np.uint8(0))[..., None], None, None)


def encode_coverage(coverage: U8) -> bytes:
    """8-bit grey PNG file of a soft mask (H, W)."""
    return png.encode(coverage[..., None], None, None)


def read_mask(data: bytes, size: tuple[int, int]) -> Mask:
    """Mask (H, W) out of an image file: what `read_coverage` finds at least half covered."""
    return read_coverage(data, size) > MASK_THRESHOLD


def read_coverage(data: bytes, size: tuple[int, int]) -> U8:
    """Soft mask (H, W) out of an image file: bright and opaque is the object.

    `size` is the photo's (width, height) px. Raises ImageError where the mask has another.
    """
    picture = read_picture(data)
    height, width = picture.pixels.shape[:2]
    if (width, height) != tuple(size):
        raise ImageError(f"the mask is {width} x {height} px, the photo {size[0]} x {size[1]} px")
    coverage = _grey(to_u8(picture.pixels))
    return coverage if picture.alpha is None else np.minimum(coverage, to_u8(picture.alpha))
