"""A photo's colours as a screen needs them, by their ICC profiles."""

from __future__ import annotations

import io
import logging

import numpy as np
from PIL import Image, ImageCms

from ..base.arrays import U8

log = logging.getLogger(__name__)

GRID = 86  # values of each channel: every third of 256
UNSEEN = 1  # of 255: a table that changes nothing by more is none


def screen_table(photo: bytes | None, screen: bytes | None) -> U8 | None:
    """(blue, green, red, 3) what a screen shows for GRID values of each channel of a photo.

    The profiles are ICC; without one, or with one that cannot be read, it is sRGB. None where the
    screen shows the values as they are. What it cannot show becomes the nearest that it can.
    """
    if photo is None and screen is None:
        return None
    steps = np.linspace(0, 255, GRID).astype(np.uint8)
    values = np.stack(np.meshgrid(steps, steps, steps, indexing="ij")[::-1], axis=-1)
    grid = Image.fromarray(values.reshape(GRID * GRID, GRID, 3))
    try:
        transform = ImageCms.buildTransform(
            _profile(photo), _profile(screen), "RGB", "RGB",
            ImageCms.Intent.RELATIVE_COLORIMETRIC, ImageCms.Flags.BLACKPOINTCOMPENSATION,
        )  # fmt: skip
        shown = ImageCms.applyTransform(grid, transform)
    except ImageCms.PyCMSError as error:
        log.warning("colours are shown as they are: %s", error)
        return None
    assert shown is not None, "it is not done in place"
    table = np.asarray(shown).reshape(values.shape)
    is_same = np.abs(table.astype(np.int16) - values).max() <= UNSEEN
    return None if is_same else table


def profile_name(profile: bytes) -> str | None:
    """What a profile calls itself; None where it is none of RGB that can be read."""
    try:
        found = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        return ImageCms.getProfileDescription(found).strip() if _is_rgb(found) else None
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


def _is_rgb(profile: ImageCms.ImageCmsProfile) -> bool:
    return profile.tobytes()[16:20] == b"RGB "
