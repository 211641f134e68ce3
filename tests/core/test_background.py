"""A plate that is begun while its object is lifted: the same bytes, errors and progress."""

from __future__ import annotations

import threading
from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest

from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.compose import InpaintError
from objectmorpher_core.document.model import Document
from objectmorpher_core.lift import LiftError
from objectmorpher_core.pipeline import (
    continue_script,
    cut_out,
    lift_first,
    open_photo,
    run_script,
    select,
)
from objectmorpher_core.scripting import runner
from objectmorpher_core.scripting.background import PlateAhead, PlateTask
from objectmorpher_core.scripting.options import EditScript, ScriptError, script_from
from tests import photos, shapes
from tests.tree import quick

pytestmark = pytest.mark.usefixtures("lifted_once")

PIXELS, _, MASK = photos.small_cup(4, 40.0, 28.0)
PHOTO, MASK_PNG = shapes.png(PIXELS), shapes.mask_png(MASK)
NEARLY_ALL = np.ones_like(MASK)
NEARLY_ALL[0, 0] = False  # the hole is larger than what is selected
QUICK = {"gaussians": 300, "trust": 0.0, "inpaint": "patchmatch"}
HANDLE = [{"at": [75, 50], "to": [80, 45]}]
EDITS = {
    "turn": {"turn": [20, 0, 0]},
    "move with its shadow": {"move": [20, 5]},
    "move with its shadow, seen from above": {"move": [20, 5], "seen_from": 50},
    "spin": {"spin": 20},
    "spin and move": {"spin": 20, "move": [20, 5]},
    "removed": {"remove": True},
    "dragged": {"handle": HANDLE},
    "brighter, no shadow": {"exposure": 0.5, "scale": 0.8, "shadow": "none"},
    "hints": {"turn": [10, 0, 0], "fill_from": [{"source": [10, 10], "to": [75, 50]}]},
    "clean edge": {"move": [5, 5], "decontaminate": 0.7, "seed": 3},
}


def script(**options: object) -> EditScript:
    return script_from(QUICK | options)


def opened(wanted: EditScript) -> Document:
    """The photo, with the script's seed."""
    return open_photo(PHOTO, "cup.png", seed=wanted.seed)


def begun(document: Document, wanted: EditScript) -> PlateAhead | None:
    """The plate of an opened photo whose cup is selected and cut out, begun."""
    chosen = select(document, wanted, MASK_PNG)
    return runner.begun_plate(chosen, 0, cut_out(document.photo.pixels, MASK), wanted)


def asked(document: Document, wanted: EditScript) -> PlateTask:
    """What there is to be done for the plate of an edit that is complete."""
    casts = wanted.shadow == "auto" and runner.has_left(document.objects[0], document)
    return runner.plate_task(document, wanted, frozenset({0} if casts else ()))


def plates() -> list[str]:
    """The names of the threads that make one."""
    return [t.name for t in threading.enumerate() if t.name.startswith("plate")]


@pytest.mark.parametrize("options", quick(EDITS.values(), 5), ids=EDITS)
def test_what_was_begun_is_what_would_be_computed_afterwards(options: dict[str, object]) -> None:
    wanted = script(**options)
    photo = opened(wanted)
    edited = continue_script(photo, wanted, MASK_PNG)
    lifted = lift_first(photo, wanted, MASK_PNG)
    later = continue_script(lifted, wanted)  # it is lifted: there is nothing to do beside
    np.testing.assert_array_equal(edited.picture.pixels, later.picture.pixels)
    one, two = edited.document.plate, later.document.plate
    assert one is not None and two is not None
    np.testing.assert_array_equal(one.pixels, two.pixels)
    np.testing.assert_array_equal(one.hole, two.hole)
    assert edited.notes == later.notes
    assert plates() == []

    ahead, task = begun(photo, wanted), asked(edited.document, wanted)
    assert ahead is not None
    found = ahead.answer(task, silent)
    assert ahead.answer(task, silent) is found, "it was no other task, and is not computed again"
    np.testing.assert_array_equal(found.plate.pixels, one.pixels)
    ahead.drop()


def test_another_task_is_computed_anew() -> None:
    wanted = script(move=[20, 5])
    photo = opened(wanted)
    ahead = begun(photo, wanted)
    task = asked(continue_script(photo, wanted, MASK_PNG).document, wanted)
    assert ahead is not None
    assert len(task.casters) == 1
    stays = replace(task.casters[0], has_gone=False)
    assert not replace(task, seed=7).is_like(task)
    assert not replace(task, covered=np.roll(task.covered, 1)).is_like(task)
    assert not replace(task, pixels=255 - task.pixels).is_like(task)
    assert replace(task, pixels=task.pixels.copy()).is_like(task)
    assert not replace(task, casters=()).is_like(task)
    assert not replace(task, casters=(stays,)).is_like(task)
    assert replace(task, covered=task.covered.copy()).is_like(task)
    other = replace(task, seed=7)
    found = ahead.answer(other, silent)
    np.testing.assert_array_equal(found.plate.pixels, other.run(silent).plate.pixels)
    assert plates() == []


@pytest.mark.parametrize("options", [
    {"lift": "triposplat"}, {"inpaint": "nothing"},
], ids=lambda options: next(iter(options)))  # fmt: skip
def test_it_is_not_begun_where_it_would_be_heavy_or_impossible(
    options: dict[str, object],
) -> None:
    wanted = script(**{"move": [5, 5]} | options)
    assert begun(opened(wanted), wanted) is None


def test_an_object_that_stays_leaves_no_hole() -> None:
    unchanged = ({}, {"turn": [0, 0, 0]}, {"pin": [[75, 50]]}, {"seed": 4}, {"thickness": 1.5})
    assert not any(runner.leaves_a_hole(script(**options)) for options in unchanged)
    assert all(runner.leaves_a_hole(script(**options)) for options in EDITS.values())
    assert plates() == []


def test_an_error_of_the_lift_is_raised_though_the_plate_was_begun() -> None:
    tiny = np.zeros_like(MASK)
    tiny[40:44, 60:64] = True
    with pytest.raises(LiftError, match="too small to lift"):
        run_script(PHOTO, "", script(turn=[5, 0, 0]), shapes.mask_png(tiny))
    assert plates() == []


def test_an_error_of_the_plate_is_raised_when_its_turn_comes() -> None:
    everything = shapes.mask_png(NEARLY_ALL)
    steps: list[str] = []
    with pytest.raises(InpaintError, match="hole covers everything"):
        run_script(
            PHOTO, "", script(turn=[5, 0, 0]), everything, lambda _, note: steps.append(note)
        )
    assert "Filling in its sides" in steps, "the object was lifted first"
    assert plates() == []


def test_of_two_errors_the_first_in_order_is_raised() -> None:
    everything = shapes.mask_png(NEARLY_ALL)
    off = [{"at": [-5, -5], "to": [10, 10]}]
    with pytest.raises(ScriptError, match="outside the photo"):
        run_script(PHOTO, "", script(handle=off), everything)
    assert plates() == []


def test_progress_says_all_that_is_done_in_order() -> None:
    steps: list[tuple[float, str]] = []
    wanted, main = script(move=[20, 5]), threading.current_thread()

    def note(fraction: float, text: str) -> None:
        assert threading.current_thread() is main
        steps.append((fraction, text))

    run_script(PHOTO, "", wanted, MASK_PNG, note)
    assert [fraction for fraction, _ in steps] == sorted(fraction for fraction, _ in steps)
    alone: list[tuple[float, str]] = []
    asked(run_script(PHOTO, "", wanted, MASK_PNG).document, wanted).run(
        lambda fraction, text: alone.append((fraction, text))
    )
    first = [text for _, text in steps].index("Filling in the background")
    assert first > [text for _, text in steps].index("Filling in its sides")
    said = [text for (_, text), _ in groupby(steps[first:])]
    assert said[: len(list(groupby(alone)))] == [text for (_, text), _ in groupby(alone)]


@pytest.mark.parametrize("stage", ["Inflating", "Choosing", "Copying the details", "joining"])
def test_who_cancels_leaves_no_thread_behind(stage: str) -> None:
    def stop(fraction: float, note: str) -> None:
        if note.startswith(stage):
            raise Cancelled

    with pytest.raises(Cancelled):
        run_script(PHOTO, "", script(move=[20, 5]), MASK_PNG, stop)
    assert plates() == []
