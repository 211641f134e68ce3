"""What can be saved of an edit that was carried out, as the bytes of a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..base.quoting import shown
from ..compose.composite import straight_cutout
from ..compose.depth_map import depth_picture
from ..compose.layers import layers
from ..compose.plate.plate import plate_picture
from ..pictures.image import ENDINGS, Picture, encode_picture
from ..pictures.openraster import encode_openraster
from ..pictures.video import ENDINGS as VIDEO_ENDINGS
from ..pictures.video import encode_video
from ..pipeline import Edited
from ..splat_files import SPLAT_ENDINGS
from ..splat_files import encode as encode_splats
from .animation import Clip, frames
from .script import ScriptError

OUTPUTS = {  # what can be saved, and the endings that each may have
    "photo": ENDINGS,
    "session": (".omorph",),
    "mask": (".png",),
    "plate": ENDINGS,
    "object": (".png", ".tif", ".tiff", ".webp"),
    "splats": SPLAT_ENDINGS,
    "depth": (".png", ".tif", ".tiff"),
    "layers": (".ora",),
    "video": VIDEO_ENDINGS,
}
PICTURES = ("photo", "mask", "plate", "object", "depth")  # those that are one picture
NEED_PLATE = ("plate", "layers", "video")
U8_MIN, U8_MAX = np.uint8(0), np.uint8(255)
USUAL_CLIP = Clip()


def output_picture(what: str, edited: Edited) -> Picture:
    """The picture of one of PICTURES, of the photo's size. Raises ScriptError as below."""
    _check_possible(what, edited, PICTURES)
    document = edited.document
    photo = document.photo.picture
    if what == "mask":
        mask = document.objects[0].mask
        if mask is None:
            raise ScriptError("the first object has no mask")
        return Picture(np.repeat(np.where(mask, U8_MAX, U8_MIN)[..., None], 3, 2), is_grey=True)
    if what == "plate":
        return Picture(plate_picture(document), is_grey=photo.is_grey, icc=photo.icc)
    if what == "object":
        cutout = straight_cutout(edited.composite, photo.pixels.dtype, document.photo.size)
        return Picture(cutout[..., :3], cutout[..., 3], icc=photo.icc)
    if what == "depth":
        return depth_picture(document, edited.puppets)
    return edited.picture


def encode_output(what: str, edited: Edited, path: Path, clip: Clip = USUAL_CLIP) -> bytes:
    """The bytes of a file called `path` that holds `what`, one of OUTPUTS; `clip` is a video's.

    Raises the one-sentence ValueErrors of what encodes it; ScriptError for an unknown `what`, and
    where a background is needed that was not made.
    """
    _check_possible(what, edited, tuple(OUTPUTS))
    if not path.name.lower().endswith(OUTPUTS[what]):
        raise ScriptError(f"{path}: the ending must be {' or '.join(OUTPUTS[what])}")
    document = edited.document
    if what in PICTURES:
        return encode_picture(output_picture(what, edited), path.suffix)
    if what == "session":
        from ..session.file import encode_session

        return encode_session(document)
    if what == "layers":
        return encode_openraster(layers(document)[1], edited.picture)
    if what == "video":
        return encode_video(frames(document, clip, keys=edited.keys), clip.rate, path.suffix)
    item = document.objects[edited.first]
    return encode_splats(edited.puppet.posed_gaussians(item.pose, item.placement), path)


def _check_possible(what: str, edited: Edited, known: tuple[str, ...]) -> None:
    if what not in known:
        raise ScriptError(f"there is no output {shown(what)}; known are {', '.join(known)}")
    if what in NEED_PLATE and edited.document.plate is None:
        raise ScriptError("there is no background: nothing was moved, and none was asked for")
