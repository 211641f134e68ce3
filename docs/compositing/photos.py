"""Photographs with their object's shadow, and without it."""

from __future__ import annotations

import numpy as np
from skimage import data

from objectmorpher_core.arrays import Pixels
from objectmorpher_core.compose.old_shadow import without_shadow
from objectmorpher_core.compose.shadow_fit import find_old_shadow
from objectmorpher_core.image import Picture, encode_picture
from objectmorpher_core.pipeline import open_photo, select
from objectmorpher_core.script import EditScript
from objectmorpher_core.segment.matte import build_matte

PHOTOS = {
    "cup": (data.coffee, EditScript(box=(60.0, 20.0, 560.0, 400.0))),
    "motorcycle": (lambda: data.stereo_motorcycle()[0], EditScript(subject=True)),
}
MARGIN = 20  # px of the matte


def shadow_pairs() -> list[list[Pixels]]:
    """The photo as it is, and with the ground in full light."""
    rows = []
    for name, (make, script) in PHOTOS.items():
        photo = make()
        document = select(open_photo(encode_picture(Picture(photo), ".png"), name, None), script)
        mask = document.objects[0].mask
        assert mask is not None
        old = find_old_shadow(photo, build_matte(photo, mask, MARGIN))
        height, width = mask.shape
        lit = photo if old is None else without_shadow(photo, old, (0, 0, width, height))[0]
        rows.append([photo, np.where(mask[..., None], photo, lit)])
    return rows
