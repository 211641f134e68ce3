"""The light of a new place against the true one: it varies over a photo, and an object is moved.

Backgrounds of one material and photographs, which have many, are multiplied in linear light by a
light that is known at every place; so is a solid, by that of where it is. Moved without a turn, its
truth is its own picture in the light of the new place. Only light is compared: edges are the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import worlds
from skimage import data
from sklearn.datasets import load_sample_image
from worlds import CAMERA, GAMMA, LIGHTS, SIDE

from objectmorpher_core.base.arrays import F64, Pixels, pixels_from_unit
from objectmorpher_core.compose.light.harmonize import at_strength, light_gain, light_map
from objectmorpher_core.compose.silhouette import Silhouette
from objectmorpher_core.document.model import Document, Photo
from objectmorpher_core.document.settings import USUAL_SHARES
from objectmorpher_core.pictures.image import Picture, encode_picture

SIZE = 150  # px, of the object's square
LEFT, RIGHT, TOP = 30, 332, 181  # px, where it is
MATERIALS = ("brick", "gravel", "grass", "wood", "plain", "sky")
PHOTOS: dict[str, Callable[[], Pixels]] = {
    "table": data.coffee,
    "launch tower": data.rocket,
    "portrait": data.astronaut,
    "cat": data.chelsea,
    "dahlia": lambda: load_sample_image("flower.jpg"),
    "pavilion": lambda: load_sample_image("china.jpg"),
    "garage": lambda: data.stereo_motorcycle()[0],
}
SKY = np.s_[20:260, 330:620]  # of the rocket's photo: evening, darker farther up
SOLIDS = ("duck", "teddy", "mug", "box")
LEAST = 1.0  # levels: an error that nobody sees is none
WORSE = 1.05


@dataclass(frozen=True, eq=False)
class Moved:
    """One case: root mean square errors in levels of 255."""

    light: str
    ground: str
    is_plain: bool  # of one material
    plain: float
    harmonised: float

    @property
    def ratio(self) -> float:
        return max(self.harmonised, LEAST) / max(self.plain, LEAST)


def lights() -> dict[str, F64]:
    """(h, w, 3) what a photo's linear light is multiplied by."""
    x = np.linspace(0, 1, SIDE)[None, :, None] * np.ones((SIDE, 1, 1))
    step = 1 / (1 + np.exp((0.5 - x) * 30))
    near = np.exp(-(((x - 0.2) / 0.35) ** 2))
    tint = np.array([1.0, 0.92, 0.78])
    cold = np.array([0.86, 0.95, 1.0])
    even = np.ones((SIDE, SIDE, 3))
    return {
        "the same everywhere": even,
        "falling to a half": even * (1 - 0.5 * x),
        "falling to a quarter": even * (1 - 0.75 * x),
        "half in shadow": even * (1 - 0.55 * step),
        "a lamp in a dark room": 0.3 * even + 0.7 * near * tint,
        "warm beside cold": tint + x * (cold - tint),
    }


def _backgrounds() -> Iterator[tuple[str, F64]]:
    """(h, w, 3) linear."""
    for kind in MATERIALS:
        sky = kind == "sky"
        yield kind, _filled(_linear(data.rocket()[SKY]) if sky else worlds._texture(kind))
    for name, make in PHOTOS.items():
        yield name, _filled(_linear(make()))


def _linear(picture: Pixels) -> F64:
    return (picture[..., :3] / 255.0) ** GAMMA


def _filled(picture: F64) -> F64:
    scale = SIDE / min(picture.shape[:2])
    size = (max(round(picture.shape[1] * scale), SIDE), max(round(picture.shape[0] * scale), SIDE))
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(picture, size, interpolation=way)[:SIDE, :SIDE], np.float64)


def measured(meshes: Path) -> list[Moved]:
    objects = [_object(name, meshes) for name in SOLIDS]
    found = []
    for ground, background in _backgrounds():
        for light, field in lights().items():
            encoded = np.clip(background * field, 0, 1) ** (1 / GAMMA)
            pixels = pixels_from_unit(encoded.astype(np.float32), np.dtype(np.uint8))
            picture = Picture(pixels)
            photo = Photo(picture, CAMERA, encode_picture(picture, ".png"), "a.png")
            document = Document(photo)
            seen = light_map(document)
            for linear, alpha in objects:
                for start, end in ((LEFT, RIGHT), (RIGHT, LEFT)):
                    shape = Silhouette(alpha.astype(np.float32), start, TOP, 1.0)
                    gain = light_gain(seen, SIDE, shape, replace(shape, left=end))
                    harmony = np.array(at_strength(gain, USUAL_SHARES["harmony"]))
                    before, after = (
                        np.clip(linear * _at(field, left), 0, 1) ** (1 / GAMMA)
                        for left in (start, end)
                    )
                    own = alpha > 0.5
                    errors = [
                        255 * float(np.sqrt(((np.clip(c, 0, 1) - after)[own] ** 2).mean()))
                        for c in (before, before * harmony)
                    ]
                    found.append(Moved(light, ground, ground in MATERIALS, *errors))
    return found


def _at(field: F64, left: int) -> F64:
    """(SIZE, SIZE, 3) the light on an object there: that of its middle, for it has one depth."""
    middle = field[TOP + SIZE // 2, left + SIZE // 2]
    return np.broadcast_to(middle, (SIZE, SIZE, 3))


def _object(name: str, meshes: Path) -> tuple[F64, F64]:
    """Linear colours (SIZE, SIZE, 3) of a solid under a lamp, and its alpha."""
    view = worlds.draw(worlds.stand(name, meshes), LIGHTS[1], np.eye(3))
    rows, columns = np.flatnonzero(view.alpha.any(1)), np.flatnonzero(view.alpha.any(0))
    part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    size = (SIZE, SIZE)
    colour = cv2.resize(np.asarray(view.color[part]), size, interpolation=cv2.INTER_AREA)
    alpha = cv2.resize(np.asarray(view.alpha[part], np.float64), size, interpolation=cv2.INTER_AREA)
    return np.asarray(colour) ** GAMMA, np.asarray(alpha)
