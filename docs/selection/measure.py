"""Clicks of a simulated user on photos with reference masks, by every segmenter."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import cv2
import numpy as np

from objectmorpher_core import segment
from objectmorpher_core.base.arrays import RGB, Mask
from objectmorpher_core.base.progress import silent
from objectmorpher_core.document.model import Prompt
from objectmorpher_core.segment import Found, Quick, Segmenter, SelectionError
from tests.core.segment.simulated_user import Step, around, boundary_f, overlap, use, worst_click
from tests.core.segment.truth_masks import LATER, TRUTHS, Truth, truth, truth_mask
from tests.photos import photo

CLICKS = 3
BOX_CLICKS = 2  # after a box
LARGE_SIDE = 8  # x: the camera photo of 512 x 512 px becomes one of 17 megapixels
LARGE_NAME = "tower"


@dataclass(frozen=True)
class Glance:
    """What is answered at once, before a closer look."""

    seconds: float  # of a core
    iou: float
    is_final: bool  # a closer look would tell no better
    then: float  # IoU of the whole answer


@dataclass(frozen=True, eq=False)
class Clicked:
    """What the clicks on one object gave."""

    truth: Truth
    steps: list[Step]  # CLICKS
    confidences: list[float]  # of the steps; empty where the segmenter tells none
    seconds: list[float]  # of a busy core, of every click
    glances: list[Glance]  # of every click; empty where the segmenter has none


@dataclass(frozen=True, eq=False)
class Row:
    """One object."""

    ours: Clicked
    colors: Clicked  # no learned model
    subject: float  # IoU of the photo's subject, no click
    box: list[float]  # IoU of the object's box, ours, and after each of BOX_CLICKS
    color_box: list[float]


@dataclass(frozen=True, eq=False)
class Large:
    """The same on a large photo."""

    megapixels: float
    clicked: Clicked
    encoding: float  # s of a core
    first: float  # s of a core, of the first click, which looks closer at a tile


@cache
def segmenter(name: str) -> Segmenter:
    return segment.load(name)


@cache
def _encoded(name: str, picture: str) -> tuple[Any, float]:
    """The embedding of a photo, and how many seconds of a core it took."""
    start = time.process_time()
    embedding = segmenter(name).encode(photo(picture), silent)
    return embedding, time.process_time() - start


def measure() -> list[Row]:
    """Every object."""
    for name in ("dino", "subject"):  # networks are read once, and not by the first photo
        segmenter(name).encode(photo("coins"), silent)
    return [_row(each) for each in TRUTHS]


def measure_later() -> list[Row]:
    """Those that were drawn later."""
    return [_row(each) for each in LATER]


def encoding_seconds() -> float:
    """Median over the photos."""
    return float(np.median([_encoded("dino", p)[1] for p in {t.photo for t in TRUTHS}]))


def measure_large() -> Large:
    """A small and distant object of a photo that is enlarged."""
    size = tuple(side * LARGE_SIDE for side in photo(truth(LARGE_NAME).photo).shape[1::-1])
    rgb = cv2.resize(photo(truth(LARGE_NAME).photo), size, interpolation=cv2.INTER_CUBIC)
    mask = cv2.resize(truth_mask(LARGE_NAME).astype(np.float32), size) > 0.5
    backend = segment.load("dino")
    start = time.process_time()
    embedding = backend.encode(rgb, silent)
    encoding = time.process_time() - start
    clicked = _click(backend, rgb, embedding, truth(LARGE_NAME), mask)
    return Large(size[0] * size[1] / 1e6, clicked, encoding, clicked.seconds[0])


def _row(each: Truth) -> Row:
    rgb, mask = photo(each.photo), truth_mask(each.name)
    ours = _click(segmenter("dino"), rgb, _encoded("dino", each.photo)[0], each, mask)
    colors = _click(segmenter("grabcut"), rgb, None, each, mask)
    subject = _ask("subject", each.photo, Prompt(is_subject=True))
    boxed = [_boxed(name, each) for name in ("dino", "grabcut")]
    return Row(ours, colors, overlap(subject, mask), *boxed)


def _boxed(name: str, each: Truth) -> list[float]:
    """IoU of the object's box, and after each of BOX_CLICKS on the largest error."""
    mask = truth_mask(each.name)
    prompt, values = Prompt(box=around(mask)), []
    for _ in range(BOX_CLICKS + 1):
        found = _ask(name, each.photo, prompt)
        values.append(overlap(found, mask))
        if values[-1] < 1:
            prompt = replace(prompt, clicks=(*prompt.clicks, worst_click(found, mask)))
    return values


def _ask(name: str, picture: str, prompt: Prompt) -> Mask:
    embedding = None if name == "grabcut" else _encoded(name, picture)[0]
    return _segment(segmenter(name), photo(picture), embedding, prompt)


def _click(backend: Segmenter, rgb: RGB, embedding: Any, each: Truth, mask: Mask) -> Clicked:
    seconds: list[float] = []
    glances: list[Glance] = []

    def timed(prompt: Prompt) -> Mask:
        start = time.process_time()
        first = _glance(backend, rgb, embedding, prompt)
        middle = time.process_time()
        found = _segment(backend, rgb, embedding, prompt)
        seconds.append(time.process_time() - start)
        if first is not None:
            ious = overlap(first.mask, mask), overlap(found, mask)
            glances.append(Glance(middle - start, ious[0], first.is_final, ious[1]))
        return found

    steps = use(timed, mask, CLICKS, each.kind == "part")
    steps += steps[-1:] * (CLICKS - len(steps))
    confidences = [backend.confidence(rgb, step.prompt, embedding) for step in steps]
    told = [value for value in confidences if value is not None]
    return Clicked(each, steps, told, seconds, glances)


def _glance(backend: Segmenter, rgb: RGB, embedding: Any, prompt: Prompt) -> Found | None:
    """None, where the segmenter refuses, or answers at once anyway."""
    if not isinstance(backend, Quick):
        return None
    try:
        return backend.glance(rgb, prompt, embedding, silent)
    except SelectionError:
        return None


def _segment(backend: Segmenter, rgb: RGB, embedding: Any, prompt: Prompt) -> Mask:
    """Nothing, where the segmenter refuses."""
    try:
        return backend.segment(rgb, prompt, embedding, silent)
    except SelectionError:
        return np.zeros(rgb.shape[:2], bool)


Measure = Callable[[Clicked], float]


def iou(after: int) -> Measure:
    """IoU after so many clicks."""
    return lambda clicked: clicked.steps[after - 1].iou


def boundary(after: int) -> Measure:
    """Boundary F after so many clicks."""
    return lambda clicked: clicked.steps[after - 1].boundary


__all__ = ["Clicked", "Large", "Row", "boundary", "boundary_f", "iou", "measure", "measure_large",
           "measure_later"]  # fmt: skip
