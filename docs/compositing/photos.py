"""Photographs with their object's shadow, and without it."""

from __future__ import annotations

import cv2
import numpy as np
from plates import SAMPLES
from skimage import data

from objectmorpher_core.base.arrays import Pixels
from objectmorpher_core.compose import load
from objectmorpher_core.compose.plate.plate import plate_crop
from objectmorpher_core.compose.shadow.old_shadow import traceless_plate
from objectmorpher_core.compose.shadow.shadow_fit import find_old_shadow
from objectmorpher_core.pictures.image import Picture, encode_picture
from objectmorpher_core.pipeline import open_photo, run_script, select
from objectmorpher_core.scripting.options import EditScript, FillFrom
from objectmorpher_core.segment.matting.matte import build_matte


def _bowl() -> Pixels:
    picture = cv2.imread(str(SAMPLES / "bowl.jpg"))
    assert picture is not None
    return np.ascontiguousarray(picture[..., ::-1])


TABLE = (  # the grain to the right of the saucer, not the lamp's gleam to the left
    FillFrom((525.0, 325.0), (140.0, 330.0), 75.0),
    FillFrom((525.0, 325.0), (250.0, 345.0), 75.0),
)
PHOTOS = {
    "cup": (
        data.coffee,
        EditScript(
            box=(60.0, 20.0, 560.0, 400.0), move=(-30.0, -30.0, 0.0), scale=0.75, fill_from=TABLE
        ),
    ),
    "motorcycle": (
        lambda: data.stereo_motorcycle()[0],
        EditScript(subject=True, move=(-60.0, -10.0, 0.0), scale=0.8),
    ),
    "bowl": (
        _bowl,
        EditScript(box=(200.0, 70.0, 995.0, 676.0), move=(-30.0, 60.0, 0.0), scale=0.6),
    ),
}
MARGIN = 20  # px of the matte


def shadow_pictures() -> list[list[Pixels]]:
    """The photo as it is, with the ground in full light, and with the object moved."""
    rows = []
    for name, (make, script) in PHOTOS.items():
        photo = make()
        encoded = encode_picture(Picture(photo), ".png")
        document = select(open_photo(encoded, name, None), script)
        mask = document.objects[0].mask
        assert mask is not None
        old = find_old_shadow(photo, build_matte(photo, mask, MARGIN))
        height, width = mask.shape
        lit = photo
        if old is not None:
            plate = traceless_plate(photo, mask, [old], load("patchmatch"))
            lit = plate_crop(photo, plate, (0, 0, width, height))
        moved = run_script(encoded, name, script).composite.pixels
        rows.append([photo, np.where(mask[..., None], photo, lit), moved])
    return rows
