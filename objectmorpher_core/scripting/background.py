"""What is behind the objects of an edit: their old shadows and the plate, perhaps begun ahead.

A plate needs an object's cut-out and nothing of its shape, and lifting needs no plate. Both compute
for seconds, most of them on one core, so that with two cores one of them costs little time.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from threading import Event

import numpy as np

from .. import compose
from ..base.arrays import Mask, Pixels
from ..base.progress import Cancelled, Progress
from ..compose.plate.plate import build_plate
from ..compose.shadow.old_shadow import OldShadow, traceless_plate
from ..compose.shadow.shadow_fit import find_old_shadow
from ..document.model import Matte, Plate
from ..document.settings import Hint

# What needs no weights, so that beside a lift it takes little memory.
LIGHT = frozenset({"patchmatch", "telea"})  # inpainters
LIGHT_LIFTERS = frozenset({"auto", "relief"})
WATCH_EVERY = 0.02  # s


@dataclass(frozen=True, eq=False)
class ShadowCaster:
    """An object that takes its shadow in the photo along."""

    matte: Matte
    has_gone: bool  # it stands nowhere any more where that shadow falls
    seen_from: float | None = None  # degrees above its ground, where that is said

    def is_like(self, other: ShadowCaster) -> bool:
        """Whether the shadow of the other one is the same, and what becomes of it."""
        one, two = self.matte, other.matte
        return (
            (one.left, one.top) == (two.left, two.top)
            and (self.has_gone, self.seen_from) == (other.has_gone, other.seen_from)
            and np.array_equal(one.alpha, two.alpha)
        )


@dataclass(frozen=True, eq=False)
class PlateTask:
    """What hides the background of a photo, and how it is to be filled in."""

    pixels: Pixels  # the photo's
    covered: Mask  # (H, W)
    casters: tuple[ShadowCaster, ...]
    hints: tuple[Hint, ...]
    inpaint: str  # the backend
    seed: int

    def run(self, progress: Progress) -> FoundBackground:
        """Find the shadows and fill in the background. Raises InpaintError."""
        shadows = tuple(
            find_old_shadow(self.pixels, caster.matte, self.covered, caster.seen_from)
            for caster in self.casters
        )
        found = zip(shadows, self.casters, strict=True)
        gone = [s for s, caster in found if s is not None and caster.has_gone]
        inpainter = compose.load(self.inpaint, bool(self.hints))
        if gone:
            plate = traceless_plate(
                self.pixels, self.covered, gone, inpainter, progress, self.seed, self.hints
            )
        else:
            plate = build_plate(
                self.pixels, self.covered, inpainter, progress, self.seed, self.hints
            )
        return FoundBackground(shadows, plate)

    def is_like(self, other: PlateTask) -> bool:
        """Whether the other one finds the same to the bit."""
        mine = self.hints, self.inpaint, self.seed, len(self.casters)
        return (
            (self.pixels is other.pixels or np.array_equal(self.pixels, other.pixels))
            and mine == (other.hints, other.inpaint, other.seed, len(other.casters))
            and np.array_equal(self.covered, other.covered)
            and all(a.is_like(b) for a, b in zip(self.casters, other.casters, strict=True))
        )


@dataclass(frozen=True, eq=False)
class FoundBackground:
    """The answer to a `PlateTask`."""

    shadows: tuple[OldShadow | None, ...]  # of its casters
    plate: Plate


class PlateAhead:
    """A task that a thread of its own carries out while its object is lifted."""

    def __init__(self, task: PlateTask) -> None:
        self._task, self._is_dropped = task, Event()
        self._steps: list[tuple[float, str]] = []  # of its progress
        self._thread = ThreadPoolExecutor(1, "plate")
        self._found = self._thread.submit(task.run, self._note)

    def _note(self, fraction: float, note: str) -> None:
        if self._is_dropped.is_set():
            raise Cancelled
        self._steps.append((fraction, note))

    def answer(self, task: PlateTask, progress: Progress) -> FoundBackground:
        """What `task` finds: what was begun, where that is the same, or else computed now.

        Raises what the task raises. `progress` gets all steps, here and in this thread.
        """
        if not task.is_like(self._task):
            self.drop()
            return task.run(progress)
        told, is_done = 0, False
        while not is_done:
            is_done = bool(wait((self._found,), WATCH_EVERY).done)
            steps = self._steps[told:]
            told += len(steps)
            for step in steps or self._steps[-1:]:  # the last again and again: it may end the wait
                progress(*step)
        return self._found.result()

    def drop(self) -> None:
        """Nobody wants it any more; comes back when the thread has ended, which it does soon."""
        self._is_dropped.set()
        self._thread.shutdown()
