"""Photos that scikit-image and scikit-learn carry: what made-up pictures are made of."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
from PIL import Image

from objectmorpher_core.base.arrays import RGB

from .evaluation.error import EvaluationError

MISSING = (
    "the photos of scikit-image and scikit-learn are needed: pip install 'objectmorpher[research]'"
)


def photo(name: str) -> RGB:
    """(h, w, 3) of the photo called `name`. Raises EvaluationError where it is not here."""
    try:
        from skimage import data
    except ImportError as error:
        raise EvaluationError(MISSING) from error
    try:
        if name in ("flower", "china"):
            pixels: np.ndarray = _of_scikit_learn(name)
        elif name == "motorcycle":
            pixels = data.stereo_motorcycle()[0]
        else:
            pixels = np.asarray(getattr(data, name)())
    except (OSError, ImportError, ValueError) as error:  # some come by the network
        raise EvaluationError(f"scikit-image's photo {name!r} is not here: {error}") from error
    colour = pixels if pixels.ndim == 3 else np.repeat(pixels[..., None], 3, 2)
    return np.asarray(colour[..., :3], np.uint8)


def _of_scikit_learn(name: str) -> RGB:
    """Read from its folder: to import it takes two seconds. Raises OSError, EvaluationError."""
    found = find_spec("sklearn")
    if found is None or not found.submodule_search_locations:
        raise EvaluationError(MISSING)
    folder = Path(found.submodule_search_locations[0], "datasets", "images")
    return np.asarray(Image.open(folder / f"{name}.jpg"))
