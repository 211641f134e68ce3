"""A photo's colours as a screen needs them, by their ICC profiles."""

from __future__ import annotations

import contextlib
import io
import logging
from collections.abc import Iterable, Iterator

import numpy as np
from PIL import Image, ImageCms

from ..base.arrays import U8

log = logging.getLogger(__name__)

GRID = 86  # values of each channel: every third of 256
MODES = {b"RGB ": "RGB", b"CMYK": "CMYK", b"GRAY": "L"}
UNSEEN = 1  # of 255: a table that changes nothing by more is none


def screen_table(
    photo: bytes | None, screen: bytes | None, proof: bytes | None = None
) -> U8 | None:
    """(blue, green, red, 3) what a screen shows for GRID values of each channel of a photo.

    The profiles are ICC; without one, or with one that cannot be read, it is sRGB. None where the
    screen shows the values as they are. What it cannot show becomes the nearest that it can.
    `proof`: the profile of a printer or another screen, whose colours are shown (a soft proof).
    """
    if photo is None and screen is None and proof is None:
        return None
    steps = np.linspace(0, 255, GRID).astype(np.uint8)
    values = np.stack(np.meshgrid(steps, steps, steps, indexing="ij")[::-1], axis=-1)
    grid = Image.fromarray(values.reshape(GRID * GRID, GRID, 3))
    try:
        shown = _shown(grid, _profile(photo), _profile(screen), proof)
    except ImageCms.PyCMSError as error:
        log.warning("colours are shown as they are: %s", error)
        return None
    table = np.asarray(shown).reshape(values.shape)
    is_same = np.abs(table.astype(np.int16) - values).max() <= UNSEEN
    return None if is_same else table


def in_srgb(frames: Iterable[U8], photo: bytes | None) -> Iterator[U8]:
    """Frames (h, w, 3 or 4) of a photo's colours, by its ICC profile, in those of sRGB.

    Where that changes nothing that is seen they stay as they are. Alpha always does.
    """
    if photo is None or screen_table(photo, None) is None:
        yield from frames
        return
    one, other = _profile(photo), _profile(None)
    for frame in frames:
        colours = np.ascontiguousarray(frame[..., :3])
        turned = np.asarray(_converted(Image.fromarray(colours), one, other, "RGB"))
        yield np.dstack([turned, frame[..., 3:]])


def _shown(
    picture: Image.Image,
    photo: ImageCms.ImageCmsProfile,
    screen: ImageCms.ImageCmsProfile,
    proof: bytes | None,
) -> Image.Image:
    """A picture of the photo's colours in those of the screen, by way of those of a proof."""
    if proof is None:
        return _converted(picture, photo, screen, "RGB")
    printed = ImageCms.ImageCmsProfile(io.BytesIO(proof))
    # In two steps, with whole numbers between them: one would let through what it cannot print.
    return _converted(_converted(picture, photo, printed, _mode(printed)), printed, screen, "RGB")


def _converted(
    picture: Image.Image,
    one: ImageCms.ImageCmsProfile,
    other: ImageCms.ImageCmsProfile,
    mode: str,
) -> Image.Image:
    transform = ImageCms.buildTransform(
        one, other, picture.mode, mode,
        ImageCms.Intent.RELATIVE_COLORIMETRIC, ImageCms.Flags.BLACKPOINTCOMPENSATION,
    )  # fmt: skip
    converted = Image.new(mode, picture.size)
    # Some profiles of inks cannot be written into the picture that is made by them.
    with contextlib.suppress(OSError):
        transform.apply(picture, converted)
    return converted


def profile_name(profile: bytes, is_proof: bool = False) -> str | None:
    """What a profile calls itself; None where it cannot be read.

    One of a screen is of RGB; one that colours are proofed by may also be of inks, or of greys.
    """
    try:
        found = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        is_right = _is_rgb(found) or (is_proof and _mode(found) != "")
        return ImageCms.getProfileDescription(found).strip() if is_right else None
    except (OSError, ValueError, ImageCms.PyCMSError):
        return None


def _profile(icc: bytes | None) -> ImageCms.ImageCmsProfile:
    if icc is not None:
        try:
            found = ImageCms.ImageCmsProfile(io.BytesIO(icc))
            if _is_rgb(found):
                return found
        except (OSError, ValueError, ImageCms.PyCMSError):
            log.warning("a colour profile that cannot be read is taken for sRGB")
    return ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB"))


def _mode(profile: ImageCms.ImageCmsProfile) -> str:
    """Pillow's name of a profile's colours; "" for others."""
    return MODES.get(profile.tobytes()[16:20], "")


def _is_rgb(profile: ImageCms.ImageCmsProfile) -> bool:
    return _mode(profile) == "RGB"
