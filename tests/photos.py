"""Real photographs that come with the development packages."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np

NAMES = ("chelsea", "coffee", "astronaut", "rocket", "flower", "china")
OTHERS = ("motorcycle", "camera", "coins")  # the last two are grey


@cache
def photo(name: str) -> np.ndarray:
    """One of NAMES or OTHERS as (H, W, 3) u8 RGB, read-only."""
    if name in ("flower", "china"):
        pixels = _of_scikit_learn(name)
    elif name == "motorcycle":
        pixels = _motorcycle()
    else:
        from skimage import data

        pixels = getattr(data, name)()
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[..., None], 3, axis=2)
    pixels = np.ascontiguousarray(pixels)
    pixels.setflags(write=False)
    return pixels


def saved(name: str, folder: Path) -> Path:
    """`photo` as a PNG file in a folder."""
    from PIL import Image

    path = folder / f"{name}.png"
    Image.fromarray(photo(name)).save(path)
    return path


def outlined(name: str) -> np.ndarray:
    """(H, W) bool, what was outlined by hand in a photo (tests/core/segment/truth)."""
    from PIL import Image

    path = Path(__file__).parent / "core" / "segment" / "truth" / f"{name}.png"
    return np.array(Image.open(path).convert("L")) > 127


def _of_scikit_learn(name: str) -> np.ndarray:
    """Read from its folder: to import it takes two seconds."""
    from PIL import Image

    found = find_spec("sklearn")
    assert found is not None and found.submodule_search_locations
    folder = Path(found.submodule_search_locations[0], "datasets", "images")
    return np.array(Image.open(folder / f"{name}.jpg"))


def _motorcycle() -> np.ndarray:
    """The left one of the stereo pair; `data.stereo_motorcycle` reads the other, too."""
    import skimage
    from skimage import io

    return io.imread(Path(skimage.__file__).parent / "data" / "motorcycle_left.png")


def small_cup(step: int, across: float, up: float):
    """Pixels, camera and mask of the coffee photo's cup at every `step`-th pixel.

    The mask is an ellipse of the radii `across` and `up`, in px of the small photo.
    """
    from objectmorpher_core.base.camera import Camera

    pixels = photo("coffee")[::step, ::step].copy()
    height, width = pixels.shape[:2]
    y, x = np.mgrid[:height, :width]
    mask = ((x - 0.5 * width) / across) ** 2 + ((y - 0.5 * height) / up) ** 2 < 1
    return pixels, Camera.from_fov(width, height), mask
