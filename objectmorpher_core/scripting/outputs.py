"""What can be saved of an edit that was carried out, as the bytes of a file."""

from __future__ import annotations

from pathlib import Path

from ..compose.composite import straight_cutout
from ..compose.depth_map import depth_picture
from ..compose.layers import layers
from ..compose.plate.plate import plate_picture
from ..pictures.image import ENDINGS, Picture, encode_mask, encode_picture
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
NEED_PLATE = ("plate", "layers", "video")
USUAL_CLIP = Clip()


def encode_output(what: str, edited: Edited, path: Path, clip: Clip = USUAL_CLIP) -> bytes:
    """The bytes of a file called `path` that holds `what`, one of OUTPUTS; `clip` is a video's.

    Raises the one-sentence ValueErrors of what encodes it; ScriptError for an unknown `what`, and
    where a background is needed that was not made.
    """
    if what not in OUTPUTS:
        raise ScriptError(f"{what!r} cannot be saved; what can is {', '.join(OUTPUTS)}")
    if not path.name.lower().endswith(OUTPUTS[what]):
        raise ScriptError(f"{path}: the ending must be {' or '.join(OUTPUTS[what])}")
    document = edited.document
    if what in NEED_PLATE and document.plate is None:
        raise ScriptError("there is no background: nothing was moved, and none was asked for")
    if what == "photo":
        return encode_picture(edited.picture, path.suffix)
    if what == "session":
        from ..session.file import encode_session

        return encode_session(document)
    if what == "mask":
        mask = document.objects[0].mask
        if mask is None:
            raise ScriptError("the first object has no mask")
        return encode_mask(mask)
    if what == "plate":
        plate = Picture(plate_picture(document), is_grey=document.photo.picture.is_grey,
                        icc=document.photo.picture.icc)  # fmt: skip
        return encode_picture(plate, path.suffix)
    if what == "object":
        cutout = straight_cutout(edited.composite, document.photo.pixels.dtype, document.photo.size)
        picture = Picture(cutout[..., :3], cutout[..., 3], icc=document.photo.picture.icc)
        return encode_picture(picture, path.suffix)
    if what == "depth":
        return encode_picture(depth_picture(document, edited.puppets), path.suffix)
    if what == "layers":
        return encode_openraster(layers(document)[1], edited.picture)
    if what == "video":
        return encode_video(frames(document, clip), clip.rate, path.suffix)
    item = document.objects[edited.first]
    return encode_splats(edited.puppet.posed_gaussians(item.pose, item.placement), path)
