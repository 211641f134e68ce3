"""Corrections of a simulated artist, click by click, where truth is known to the pixel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from objectmorpher_core.base.arrays import RGB, Mask
from objectmorpher_core.base.progress import silent
from objectmorpher_core.document.model import Click, Prompt
from objectmorpher_core.segment import Segmenter, SelectionError
from tests.core.segment.composites import COMPOSITES, picture
from tests.core.segment.simulated_user import overlap, worst_click
from tests.core.segment.truth_masks import LATER, TRUTHS, truth_mask
from tests.photos import photo

CLICKS = 6  # of a run
RANDOM_RUNS = 3
DEEP = 2.0  # px: nobody clicks on an error that is narrower than twice that
WORSE = 0.02  # IoU that a click may cost


@dataclass(frozen=True, eq=False)
class Case:
    """Something to select, and the truth."""

    name: str
    group: str  # "outlined" by hand, or a "composite"
    kind: str  # "whole" or "part"
    is_held_out: bool
    rgb: RGB
    mask: Mask  # (H, W)


@dataclass(frozen=True)
class Made:
    """One click of a run."""

    case: Case
    run: str  # "middle" or "random"
    number: int  # from 1
    is_foreground: bool
    before: float  # IoU
    after: float
    sureness: float  # what the segmenter says of it
    prompt: Prompt

    @property
    def gain(self) -> float:
        return self.after - self.before


class Encoded:
    """Pictures as a segmenter sees them, each of them encoded once."""

    def __init__(self, segmenter: Segmenter) -> None:
        self._segmenter = segmenter
        self._known: dict[int, tuple[RGB, Any]] = {}  # by the identity of the picture, held here

    def __call__(self, case: Case) -> Any:
        """The embedding of a case's picture."""
        if id(case.rgb) not in self._known:
            self._known[id(case.rgb)] = case.rgb, self._segmenter.encode(case.rgb, silent)
        return self._known[id(case.rgb)][1]


def cases() -> list[Case]:
    """The outlined things, and the composites."""
    outlined = [
        Case(t.name, "outlined", t.kind, t.is_held_out, photo(t.photo), truth_mask(t.name))
        for t in (*TRUTHS, *LATER)
    ]
    made = [Case(c.name, "composite", "whole", c.is_held_out, *picture(c.name)) for c in COMPOSITES]
    return outlined + made


def correct_all(
    segmenter: Segmenter, encoded: Callable[[Case], Any], chosen: list[Case]
) -> list[Made]:
    """Every click of every run on each of the cases."""
    found = []
    for case in chosen:
        found += _run(segmenter, case, encoded(case), None)
        for seed in range(RANDOM_RUNS):
            found += _run(segmenter, case, encoded(case), np.random.default_rng(seed))
    return found


def _run(
    segmenter: Segmenter, case: Case, embedding: Any, rng: np.random.Generator | None
) -> list[Made]:
    """Clicks in the middle of the largest error; with `rng` at random places in errors."""
    nothing = np.zeros_like(case.mask)
    before, prompt, made = nothing, Prompt(level="part" if case.kind == "part" else "object"), []
    for number in range(1, CLICKS + 1):
        click = worst_click(before, case.mask) if rng is None else _random(before, case.mask, rng)
        if click is None:
            break
        prompt = replace(prompt, clicks=(*prompt.clicks, click))
        try:
            after = segmenter.segment(case.rgb, prompt, embedding, silent)
            sureness = segmenter.confidence(case.rgb, prompt, embedding)
        except SelectionError:
            after, sureness = nothing, None
        ious = overlap(before, case.mask), overlap(after, case.mask)
        how = "middle" if rng is None else "random"
        made.append(Made(case, how, number, click.is_foreground, *ious, sureness or 0.0, prompt))
        before = after
        if ious[1] == 1:
            break
    return made


def _random(found: Mask, truth: Mask, rng: np.random.Generator) -> Click | None:
    """A click at a place in an error, of either kind where there are both; None without any."""
    kinds = []
    for wrong, is_foreground in ((truth & ~found, True), (found & ~truth, False)):
        framed = np.pad(wrong, 1).astype(np.uint8)
        depth = cv2.distanceTransform(framed, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
        places = np.argwhere(depth > DEEP)
        if len(places):
            kinds.append((places, is_foreground))
    if not kinds:
        return None
    places, is_foreground = kinds[int(rng.integers(len(kinds)))]
    y, x = places[int(rng.integers(len(places)))]
    return Click(float(x) + 0.5, float(y) + 0.5, is_foreground)
