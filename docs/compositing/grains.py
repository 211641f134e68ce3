"""The grain of an edited object against the photo's: noise that is known, and an edit.

A disc before a ground, both smooth, with noise whose strength grows with brightness; half of it is
the same in all channels. What is compared is the noise on the moved disc, in rings of its spectrum.
And on photographs, how strong added noise is found to be.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from skimage import data

from objectmorpher_core.base.arrays import F64, Pixels
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.light.noise import find_noise
from objectmorpher_core.compose.plate.plate import plate_cover
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Photo, Placement
from objectmorpher_core.pictures.image import Picture, encode_picture
from objectmorpher_core.pipeline import lift_mask, make_plate

WIDTH, HEIGHT = 480, 360  # px
MIDDLE, RADIUS = (150.0, 180.0), 100.0  # px
MOVE = 150.0  # px
SEEN = np.s_[148:212, 268:332]  # inside of the disc there
RINGS = {"coarse": (0.0, 0.1), "middle": (0.1, 0.25), "fine": (0.25, 0.8)}  # cycles per px
NOISES = {"white, 6 levels": (6.0, 0.0), "soft, 6 levels": (6.0, 0.6), "white, 2.5": (2.5, 0.0)}
PLACES = {
    "half a pixel": Placement(move=(MOVE + 0.5, 0.5)),
    "rolled 30": Placement(move=(MOVE, 0.0), turn=(0.0, 0.0, 30.0)),
    "turned 35": Placement(move=(MOVE, 0.0), turn=(35.0, 0.0, 0.0)),
    "x 0.6": Placement(move=(MOVE, 0.0), scale=0.6),
    "x 1.5": Placement(move=(MOVE, 0.0), scale=1.5),
    "x 2.2": Placement(move=(MOVE, 0.0), scale=2.2),
}
PHOTOS = ("astronaut", "coffee", "chelsea", "rocket", "gravel")
ADDED = (2.0, 4.0, 8.0)  # levels at half brightness
TESTED = (64, 128, 192)  # levels at which what is found is compared


@dataclass(frozen=True, eq=False)
class Grained:
    """One case: deviation and power in RINGS, over those of the photo's noise."""

    noise: str
    place: str
    plain: tuple[float, ...]  # deviation, then the roots of power
    grained: tuple[float, ...]
    pictures: tuple[Pixels, Pixels, Pixels]  # the photo's disc, plain, grained


def measured() -> list[Grained]:
    return [case for name in NOISES for case in _of(name)]


def noise_of(blur: float, seed: int, shape: tuple[int, int] = (HEIGHT, WIDTH)) -> F64:
    """(h, w, 3) of deviation 1."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(*shape, 3)) + rng.normal(size=(*shape, 1))
    if blur > 0:
        noise = np.asarray(cv2.GaussianBlur(noise, (0, 0), blur))
    return noise / noise.std()


def _of(name: str) -> list[Grained]:
    level, blur = NOISES[name]
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    inside = np.hypot(x - MIDDLE[0], y - MIDDLE[1]) < RADIUS
    clean = np.where(inside, 0.6 - 0.1 * x / WIDTH, 0.35 + 0.1 * y / HEIGHT)[..., None]
    pixels = _bytes(clean + level / 255 * (0.5 + clean) * noise_of(blur, 1))
    camera = Camera.from_fov(WIDTH, HEIGHT)
    matte, lifted = lift_mask(pixels, camera, inside)
    photo = encode_picture(Picture(pixels), ".png")
    document = edits.add_object(Document(Photo(Picture(pixels), camera, photo, "a.png")))
    item = document.objects[0].with_mask(inside, document.objects[0].prompt)
    document = document.with_object(0, item.with_lifted(matte, lifted))
    document = edits.set_plate(document, make_plate(pixels, plate_cover(document)))
    wanted = _powers(255 * level / 255 * (0.5 + 0.57) * noise_of(blur, 9, (64, 64)))
    cases = []
    for place, placement in PLACES.items():
        moved = edits.set_placement(document, 0, placement)
        found = [composite(d).pixels for d in (moved, edits.set_share(moved, 0, "grain", 1.0))]
        plain, grained = (tuple(_powers(p[SEEN].astype(float)) / wanted) for p in found)
        here = pixels[148:212, 118:182]
        pictures = (here, found[0][SEEN], found[1][SEEN])
        cases.append(Grained(name, place, plain, grained, pictures))
    return cases


def _powers(patch: F64) -> F64:
    """Deviation of the noise on a smooth patch (h, w, 3), and the roots of its power in RINGS."""
    height, width = patch.shape[:2]
    y, x = np.mgrid[:height, :width] / height
    table = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], -1).reshape(-1, 6)
    flat = patch.reshape(-1, 3)
    rest = (flat - table @ np.linalg.lstsq(table, flat, rcond=None)[0]).reshape(patch.shape)
    window = np.outer(np.hanning(height), np.hanning(width))[..., None]
    power = (np.abs(np.fft.fft2(rest * window, axes=(0, 1))) ** 2).sum(2)
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.fftfreq(width))
    rings = [power[(frequency > a) & (frequency <= b)].mean() for a, b in RINGS.values()]
    return np.array([rest.std(), *np.sqrt(rings)])


def found_on_photos() -> dict[str, list[float]]:
    """How strong noise is found to be, over how strong it is, for each of ADDED."""
    found = {}
    for name in PHOTOS:
        picture = getattr(data, name)()
        picture = np.repeat(picture[..., None], 3, 2) if picture.ndim == 2 else picture[..., :3]
        smooth = cv2.GaussianBlur(picture / 255.0, (0, 0), 1.5)  # next to nothing of its own
        shares = []
        for level in ADDED:
            noise = noise_of(0.0, 3, smooth.shape[:2])
            noisy = find_noise(_bytes(smooth + level / 255 * (0.5 + smooth) * noise))
            true = [level * (0.5 + k / 255) for k in TESTED]
            own = [0.0 if noisy is None else 255 * noisy.deviation[k].mean() for k in TESTED]
            shares.append(float(np.mean(np.array(own) / true)))
        found[name] = shares
    return found


def _bytes(values: F64) -> Pixels:
    return np.rint(values.clip(0, 1) * 255).astype(np.uint8)
