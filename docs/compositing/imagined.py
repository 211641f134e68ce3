"""Writes imagined.json: shadows found and imagined on the scenes of tests/shadow_scenes.py.

PYTHONPATH=. python docs/compositing/imagined.py: seeds 0 to 999, in ten minutes on two cores. Even
seeds are for choosing, odd ones are held out.

A shadow counts as visible in principle if an observer could be sure of it who knows its form and
what the ground looks like without it: laid on the photo where it is, the form explains more
darkness than it does at 99 of 100 other places and turns on the ground without the shadow.
"""

from __future__ import annotations

import json
import os
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
FIGURES = Path(__file__).resolve().parent / "imagined.json"
sys.path.append(str(ROOT))
from objectmorpher_core.base.arrays import F32, F64, Mask  # noqa: E402
from objectmorpher_core.compose.shadow.shadow_fit import (  # noqa: E402
    LIKELY,
    SURE,
    find_old_shadow,
)
from objectmorpher_core.segment.matting.matte import build_matte  # noqa: E402
from tests.shadow_scenes import Scene, scene  # noqa: E402

COUNT = 1000
MARGIN = 20  # px of the matte
LARGE = 0.15  # x the thing's area: a shadow that one sees at once
LEAST = 50  # px of a thing
CELL = 3  # px of the photo per cell on which a form is laid
PLACES = 400  # of a form on the ground without it
FAINT, DARK = 0.05, 0.12  # natural logarithm of light
NEAR = 12  # cells around a form, on which the ground is smooth
UNLIKELY = 0.99  # of the places


def main() -> None:
    counts: Counter[str] = Counter()
    with ProcessPoolExecutor(os.cpu_count(), initializer=cv2.setNumThreads, initargs=(1,)) as pool:
        for kinds in pool.map(_kinds, range(COUNT), chunksize=8):
            counts.update(kinds)
    text = json.dumps(dict(sorted(counts.items())), indent=1) + "\n"
    FIGURES.write_text(text, encoding="utf-8")
    print(text)


def _kinds(seed: int) -> list[str]:
    """What the scene of a seed counts to."""
    made = scene(seed)
    is_large = made.has_shadow and made.shade.sum() > LARGE * made.mask.sum()
    if made.mask.sum() < LEAST or (made.has_shadow and not is_large):
        return []
    kinds = ["large"] if is_large else ["none"]
    kinds += ["visible"] if is_large and is_visible(made) else []
    half = "held out" if seed % 2 else "chosen on"
    return [f"{half}, {kind}, {result}" for kind in kinds for result in ["in all", *_found(made)]]


def _found(made: Scene) -> list[str]:
    """Whether the window would offer the thing's shadow, and an edit take it along unasked."""
    matte = build_matte(made.photo, made.mask, MARGIN)
    if find_old_shadow(made.photo, matte, margin=LIKELY) is None:
        return []
    is_sure = find_old_shadow(made.photo, matte, margin=SURE) is not None
    return ["offered", "taken along"] if is_sure else ["offered"]


def is_visible(made: Scene) -> bool:
    """Whether the thing's shadow is visible in principle (see above)."""
    rng = np.random.default_rng(made.seed)
    small = [_shrunk(v) for v in ((made.photo / 255.0) ** 2.2, made.dark, made.mask * 1.0)]
    free = small[2] == 0
    form = -np.log(1 - np.clip(small[1], 0, 0.95)) * free
    bright = np.log(small[0] + 0.02).mean(-1)
    explained = _explained(bright, form, free)
    if explained is None:
        return False
    size, ground = form.shape[::-1], np.argwhere(free)[:, ::-1]
    middle = np.argwhere(form > DARK).mean(0)[::-1]
    others = []
    for _ in range(PLACES):
        matrix = cv2.getRotationMatrix2D(middle.tolist(), rng.uniform(0, 360), 1.0)
        matrix[:, 2] += ground[rng.integers(len(ground))] - middle
        laid = np.asarray(cv2.warpAffine(form, matrix, size), np.float32)
        laid = laid[:, ::-1] if rng.random() < 0.5 else laid
        other = _explained(bright + form, laid, free)
        others += [] if other is None else [other]
    return len(others) > PLACES // 20 and explained > np.quantile(others, UNLIKELY)


def _shrunk(picture: F64) -> F32:
    height, width = picture.shape[:2]
    size = width // CELL, height // CELL
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)


def _explained(bright: F32, form: F32, free: Mask) -> float | None:
    """How much of a form is in the brightness around it; 1 all; None where too little is seen."""
    near = cv2.dilate((form > FAINT).astype(np.uint8), np.ones((2 * NEAR + 1,) * 2)) > 0
    near &= free
    own = form[near].astype(float)
    if (form * free).sum() < 0.5 * form.sum() or (own > DARK).sum() < 8:
        return None
    if (own < FAINT).sum() < 20:
        return None
    rows, columns = np.nonzero(near)
    x, y = (columns - columns.mean()) / 30, (rows - rows.mean()) / 30
    basis = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y, -own], 1)
    return float(np.linalg.lstsq(basis, bright[near].astype(float), rcond=None)[0][6])


if __name__ == "__main__":
    main()
