"""Sixteen photos with their object turned, and what is measured of each picture.

python docs/lifting/sheet.py [NAME ...]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from outlines import outline_of
from pictures import CLICKS, SAMPLES, _sized, _write
from skimage import data
from sklearn.datasets import load_sample_image
from smear import smear_of

from objectmorpher_core.compose.light.lighting import object_texture
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.document.placement import gimbal_of
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.pictures.image import Picture, encode_picture
from objectmorpher_core.pipeline import lift_mask, open_photo, select
from objectmorpher_core.raster.trust import trust_in
from objectmorpher_core.scripting.options import EditScript

FOLDER = Path(__file__).resolve().parent
TURNS = [(a, 0.0, 0.0) for a in (-35.0, -25.0, -15.0, 15.0, 25.0, 35.0)]
TURNS += [(0.0, a, 0.0) for a in (-20.0, 20.0)]
LONGEST = 700  # px, of a photo: larger ones are made smaller
GREY = 0.72  # of what is behind a turned object
WIDTH = 170  # px, of a picture on the sheet
SUBJECT = EditScript(subject=True)
BOXES = {
    "horse": (10.0, 10.0, 390.0, 320.0), "coins": (25.0, 20.0, 75.0, 70.0),
    "moon": (130.0, 130.0, 400.0, 400.0), "camera": (20.0, 50.0, 420.0, 512.0),
    "clock": (100.0, 60.0, 320.0, 260.0), "retina": (0.0, 0.0, 700.0, 700.0),
    "cell": (365.0, 265.0, 540.0, 450.0), "colorwheel": (0.0, 0.0, 371.0, 370.0),
    "china": (90.0, 30.0, 640.0, 420.0), "logo": (5.0, 5.0, 495.0, 495.0),
}  # fmt: skip

PHOTOS = [*CLICKS, "bowl", *BOXES]


@dataclass(frozen=True)
class Row:
    """What is measured of one turn."""

    name: str
    turn: tuple[float, float, float]
    wobble: float  # of the outline, over that at rest
    torn: float  # share of the area apart from the largest piece, more than at rest
    streaks: float
    flat: float
    invented: float
    sign: str

    def __str__(self) -> str:
        yaw, pitch, _ = self.turn
        return (
            f"{self.name:10} yaw {yaw:+3.0f} pitch {pitch:+3.0f} wobble {self.wobble:.2f} "
            f"torn {self.torn:.3f} streaks {self.streaks:.3f} flat {self.flat:.3f} "
            f"invented {self.invented:.2f} {self.sign}"
        )


def pixels_of(name: str) -> np.ndarray:
    """(h, w, 3) u8 of scikit-image or scikit-learn."""
    found = load_sample_image("china.jpg") if name == "china" else getattr(data, name)()
    found = np.asarray(found)
    if found.dtype == np.bool_:  # a black shape
        found = np.where(found, 90, 235)
    found = found.astype(np.uint8)
    rgb = np.dstack([found] * 3) if found.ndim == 2 else found[..., :3]
    return np.ascontiguousarray(_sized(rgb, LONGEST) if rgb.shape[1] > LONGEST else rgb)


def lifted(name: str) -> Document:
    """The photo with its object chosen and lifted."""
    if name in BOXES:
        source = encode_picture(Picture(pixels_of(name)), ".png")
        script = replace(SUBJECT, subject=False, box=BOXES[name])
    else:
        source, script = (SAMPLES / f"{name}.jpg").read_bytes(), CLICKS.get(name, SUBJECT)
    document = select(open_photo(source, name), script)
    photo, mask = document.photo, document.objects[0].mask
    assert mask is not None, "it was chosen"
    return edits.set_lifted(document, 0, *lift_mask(photo.pixels, photo.camera, mask))


def measured(name: str, document: Document) -> tuple[list[Row], list[np.ndarray]]:
    """What is measured of each turn, and its picture (h, w, 3) u8 on grey."""
    item, camera = document.objects[0], document.photo.camera
    assert item.lifted is not None and item.matte is not None, "it was lifted"
    texture = object_texture(item.matte, item.lifted)
    puppet = Puppet(item.lifted, DeformSettings(), camera)
    rest = puppet.draw(None, Placement(), texture, camera)
    gimbal = gimbal_of(item, document)
    still, rows, pictures = outline_of(rest.alpha), [], []
    for turn in TURNS:
        place = Placement(turn=gimbal.turn(turn))
        picture, trust = (
            puppet.draw(None, place, texture, camera),
            trust_in(puppet.posed(None, place)),
        )
        drawn, smear = outline_of(picture.alpha), smear_of(picture, rest)
        wobble = drawn.curvature / max(still.curvature, 1e-6)
        torn = max(drawn.torn - still.torn, 0.0)
        rows.append(
            Row(name, turn, wobble, torn, smear.streaks, smear.flat, trust.invented, trust.sign)
        )
        shown = picture.color + (1 - picture.alpha[..., None]) * GREY
        pictures.append(np.rint(255 * shown.clip(0, 1)).astype(np.uint8))
    return rows, pictures


def draw_sheet(names: list[str], path: Path) -> list[Row]:
    """Writes the sheet of the photos called `names`, and returns what is measured of them."""
    sheet: list[list[np.ndarray]] = []
    found: list[Row] = []
    for name in names:
        document = lifted(name)
        rows, pictures = measured(name, document)
        print("\n".join(map(str, rows)), flush=True)
        found += rows
        sheet.append([document.photo.pixels, *pictures])
    labels = [f"yaw {a:+.0f}" if a else f"pitch {b:+.0f}" for a, b, _ in TURNS]
    _write(path, ["the photo", *labels], sheet, WIDTH)
    return found


if __name__ == "__main__":
    asked = sys.argv[1:]
    name = f"turned-{'-'.join(asked)}.jpg"
    draw_sheet(asked or PHOTOS, Path.cwd() / name if asked else FOLDER / "turned.jpg")
