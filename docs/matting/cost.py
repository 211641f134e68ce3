"""What a cut-out costs: seconds of one core and memory, for photos of one and of 24 megapixels."""

from __future__ import annotations

import time
import tracemalloc
from dataclasses import dataclass
from statistics import median

import cv2
import numpy as np
from methods import Method, methods
from truth import continued, ellipse, fitted, photo, strands

from objectmorpher_core.base.arrays import Mask, Pixels, pixels_from_unit

SIZES = {"1 MP": (1155, 866), "24 MP": (6000, 4000)}
RUNS = {"1 MP": 5, "24 MP": 3}
TOO_LARGE = {("pymatting, narrow", "24 MP"), ("pymatting, wide", "24 MP")}
SMALL = (602, 400)  # px at which the scene is made


@dataclass(frozen=True)
class Cost:
    name: str
    size: str
    seconds: float  # of the process, median
    waiting: float  # of the clock, median
    peak: float  # MB above what was there, with the result


def scene(width: int, height: int) -> tuple[Pixels, Mask]:
    """A furry oval on a quarter of a photo, as sharp as its size allows, with some noise."""
    image = fitted(photo("chelsea.png"), (SMALL[1], SMALL[0], 3))
    inside = ellipse(image.shape, (290, 205), (170, 145))
    whole = continued(image, inside)
    soft, back = strands(inside, 14, 1500, 0), fitted(photo("china.jpg"), image.shape)

    def large(picture: np.ndarray) -> np.ndarray:
        return cv2.resize(picture, (width, height), interpolation=cv2.INTER_CUBIC)

    share = np.clip(large(soft), 0, 1)
    share = np.clip(0.5 + (share - 0.5) * width / SMALL[0] / 1.5, 0, 1)  # not blurred by enlarging
    mixed = large(back)
    mixed += share[..., None] * (large(whole) - mixed)
    mixed += np.random.default_rng(0).normal(size=mixed.shape).astype(np.float32) * (2 / 255)
    return pixels_from_unit(mixed, np.dtype(np.uint8)), share > 0.5


def measure() -> list[Cost]:
    costs = []
    for size, (width, height) in SIZES.items():
        pixels, mask = scene(width, height)
        for name, method in methods().items():
            if name != "hard mask" and (name, size) not in TOO_LARGE:
                costs.append(_measured(name, size, method, pixels, mask))
                print(costs[-1], flush=True)
    return costs


def _measured(name: str, size: str, method: Method, pixels: Pixels, mask: Mask) -> Cost:
    seconds, waiting = [], []
    for _ in range(RUNS[size]):
        start, clock = time.process_time(), time.perf_counter()
        method(pixels, mask)
        seconds.append(time.process_time() - start)
        waiting.append(time.perf_counter() - clock)
    tracemalloc.start()
    method(pixels, mask)
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    return Cost(name, size, median(seconds), median(waiting), peak)
