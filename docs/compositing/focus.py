"""Focus of an edited object against the photo's at its new depth, where that is known.

A thing on a ground that is in focus where it stands; moved, it should be blurred as the ground is
there. And photographs that are sharp all over: what is blurred in them is blurred by mistake.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from objectmorpher_core.base.arrays import Pixels
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose import composite as composing
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.light.lighting import Lighting
from objectmorpher_core.compose.plate.plate import plate_cover
from objectmorpher_core.deform.puppet import puppet_of
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, EditObject, Photo, Placement
from objectmorpher_core.pictures.image import Picture, encode_picture
from objectmorpher_core.pipeline import lift_mask, make_plate
from tests import focussed
from tests.core.segment.truth_masks import TRUTHS, truth_mask
from tests.photos import photo

GROUNDS = ("slabs", "brick", "gravel", "grass")
FAR = (0.0, 1.5, 3.0, 5.0)  # px of blur at 1.8 times the depth
RATIOS = (0.8, 1.3, 1.8)  # of depths
STEPS = (-0.6, 1.0, 3.0)  # diameters that an object of a photograph is moved in depth
SEEN = 3.0  # levels, between a sharp and a soft object


@dataclass(frozen=True, eq=False)
class Focussed:
    """One case."""

    ground: str
    far: float
    ratio: float
    true: float  # px
    found: float
    sharp: float  # levels of 255 from the truth, where focus changes anything
    soft: float
    pictures: tuple[Pixels, Pixels, Pixels]  # sharp, as found, as it should be


def measured() -> list[Focussed]:
    return [_of(ground, far, ratio) for ground in GROUNDS for far in FAR for ratio in RATIOS]


def _of(ground: str, far: float, ratio: float) -> Focussed:
    scene = focussed.scene(far, ground)
    scene = edits.set_plate(scene, make_plate(scene.photo.pixels, plate_cover(scene)))
    document = focussed.farther(scene, ratio)
    true = float(focussed.blur_at(focussed.row_at(ratio), far))
    found = focussed.look(document).blur
    pictures = tuple(_blurred(document, blur) for blur in (0.0, found, true))
    sharp, soft, wanted = (p.astype(float) for p in pictures)
    there = np.abs(sharp - wanted).max(2) > SEEN
    if not there.any():
        there = np.abs(soft - wanted).max(2) > SEEN
    off = [float(np.abs(p - wanted)[there].mean()) if there.any() else 0.0 for p in (sharp, soft)]
    return Focussed(ground, far, ratio, true, found, off[0], off[1], pictures)


def _blurred(document: Document, blur: float) -> Pixels:
    """The edit with a given blur."""
    of = Lighting.of

    def given(*inputs, **more):
        return replace(of(*inputs, **more), blur=blur)

    composing.Lighting.of = given
    try:
        return composite(document).pixels
    finally:
        composing.Lighting.of = of


@dataclass(frozen=True)
class Sharp:
    """An object of a photograph that is sharp, and how often it was blurred."""

    name: str
    tried: int
    blurred: int
    most: float  # px


def on_photos() -> list[Sharp]:
    """Each object of the photographs."""
    return [_moved_about(t.name, photo(t.photo), truth_mask(t.name)) for t in TRUTHS]


def _moved_about(name: str, pixels: Pixels, mask: np.ndarray) -> Sharp:
    camera = Camera.from_fov(mask.shape[1], mask.shape[0])
    matte, lifted = lift_mask(pixels, camera, mask, "relief")
    item = EditObject("Object", mask=mask).with_lifted(matte, lifted)
    taken = Photo(Picture(pixels), camera, encode_picture(Picture(pixels), ".png"), "photo.png")
    document = edits.set_share(Document(taken, (item,)), 0, "defocus", 1.0)
    item, puppet = document.objects[0], puppet_of(item, camera)
    lighting, blurs = Lighting(document), []
    for step in STEPS:
        for down in (-0.15, 0.0, 0.15):  # of the photo's height
            place = Placement(move=(0.1 * camera.width, down * camera.height), depth=step)
            now = puppet.posed(None, place)
            for horizon in (None, 0.3 * camera.height):
                look = lighting.of(item, now, lambda: puppet.posed(None, Placement()), horizon)
                blurs.append(look.blur)
    return Sharp(name, len(blurs), sum(b > 0 for b in blurs), max(blurs))
