"""How long a plate takes and how much memory, for photos of two sizes."""

from __future__ import annotations

import multiprocessing
import time
from dataclasses import dataclass

import cv2
import numpy as np
from skimage import data

from objectmorpher_core.pipeline import make_plate
from objectmorpher_core.scripting.report import peak_memory_mb

MEGAPIXELS = (1, 24)
REACH = 0.15  # of the photo's width, radius of the thing that is taken out


@dataclass(frozen=True)
class Taken:
    """By one plate."""

    megapixels: int
    seconds: float  # of all processors
    megabytes: float  # of the whole process, at most


def measured() -> list[Taken]:
    """Each in a process of its own, compiled before."""
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        return [pool.apply(_taken, (size,)) for size in MEGAPIXELS]


def _taken(megapixels: int) -> Taken:
    small = data.astronaut()
    make_plate(small, _thing(small))
    side = round((megapixels * 1e6) ** 0.5)
    photo = np.asarray(cv2.resize(small, (side, side), interpolation=cv2.INTER_CUBIC), np.uint8)
    thing = _thing(photo)
    begun = time.process_time()
    make_plate(photo, thing)
    return Taken(megapixels, time.process_time() - begun, peak_memory_mb())


def _thing(photo: np.ndarray) -> np.ndarray:
    """A disc in the wall, beside the shuttle."""
    height, width = photo.shape[:2]
    y, x = np.ogrid[:height, :width]
    return np.hypot(x - 0.72 * width, y - 0.25 * height) < REACH * width
