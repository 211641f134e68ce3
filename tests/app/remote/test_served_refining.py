"""A server refines: what is asked and answered, and what is done without it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import desk as desks
import numpy as np
import pytest
from desk import Desk
from same_values import same_values

from objectmorpher.server.address import ServerLost
from objectmorpher.server.client import call
from objectmorpher.server.fitting import is_sound
from objectmorpher.server.running import Offer
from objectmorpher.worker import job_functions
from objectmorpher.worker.jobs import Jobs
from objectmorpher_core.base.arrays import F32, RGB, frozen
from objectmorpher_core.base.progress import Progress, silent
from objectmorpher_core.compose import refine
from objectmorpher_core.compose.refine.refinement import CoarseEdit
from objectmorpher_core.scripting.runner import RefineOptions


class Dimming:
    """A refiner that needs nothing: what was edited is darker."""

    name = "dimming"

    def missing(self) -> str | None:
        return None

    def refine(
        self, original: RGB, coarse: RGB, object_alpha: F32, progress: Progress, seed: int = 0
    ) -> RGB:
        progress(0.5, "dimming")
        return np.rint(coarse * (1 - 0.1 * object_alpha[..., None]) - seed).astype(np.uint8)


@pytest.fixture
def dimming(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refine, "BACKENDS", {"dimming": f"{__name__}:Dimming"})


def coarse() -> CoarseEdit:
    """An edit of the noisy photo: what was a hole is brighter."""
    pixels, hole = desks.fill()[:2]
    alpha = frozen(hole.astype(np.float32))
    brighter = np.where(hole[..., None], pixels + np.uint8(60), pixels)
    return CoarseEdit(7, 5, pixels, frozen(brighter), alpha)


def test_a_refinement_is_what_it_is_here(desk: Desk, dimming: None) -> None:
    asked = coarse(), RefineOptions("dimming", 2, 0.5)
    assert desk.server is not None
    there = call(desk.server, "refine", asked, silent)
    assert same_values(there, job_functions.refine(*asked, progress=silent))
    assert desk.runner.asked == ["refine"]


@pytest.mark.parametrize("depth", ["uint8", "uint16"])
def test_a_refinement_is_of_the_edit_that_was_asked_about(
    desk: Desk, dimming: None, depth: str
) -> None:
    edit = coarse()
    scale = np.array(257 if depth == "uint16" else 1, depth)
    edit = replace(edit, pixels=edit.pixels * scale)
    how = RefineOptions("auto")
    assert desk.server is not None
    made = call(desk.server, "refine", (edit, how), silent)
    assert (made.backend, made.left, made.top, made.pixels.dtype.name) == ("dimming", 7, 5, depth)
    assert is_sound(made, (edit, how))
    elsewhere = np.full_like(made.alpha, 255)  # would show it outside the footprint
    for wrong in (
        replace(made, left=8), replace(made, alpha=elsewhere), replace(made, strength=7.0),
        replace(made, pixels=made.pixels[1:]), replace(made, pixels=made.pixels.astype(np.int64)),
    ):  # fmt: skip
        assert not is_sound(wrong, (edit, how))


def test_an_edit_whose_parts_disagree_is_refused(desk: Desk, dimming: None) -> None:
    edit, how = coarse(), RefineOptions("dimming")
    for wrong in (
        (replace(edit, coarse=edit.coarse[1:]), how), (replace(edit, alpha=edit.alpha * 2), how),
        (replace(edit, alpha=edit.alpha[:, 1:]), how), (edit, replace(how, strength=1.5)),
    ):  # fmt: skip
        with pytest.raises(ServerLost, match="refused"):
            call(desk.server, "refine", wrong, silent)
    assert desk.runner.asked == []


def test_a_refinement_without_the_server_is_done_here_or_says_why_not(
    desk: Desk,
) -> None:
    """The worker is a process of its own: it has the refiners that this machine has."""
    desk.front.close()
    desk.ask(job_functions.refine, coarse(), RefineOptions("qwen"))
    desk.wait()
    assert len(desk.said) == 1 and "cannot be reached" in desk.said[0]
    assert desk.answers or desk.errors[0].sentence == refine.missing("qwen")


@pytest.mark.slow
def test_a_networks_refinement_is_the_same_there_and_here_when_the_server_has_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A FLUX.2-klein of random weights; of a flat photo, where nothing tells where noise lies."""
    for package in ("torch", "diffusers", "peft"):
        pytest.importorskip(package)
    from objectmorpher_core import models
    from objectmorpher_core.models import device
    from tests.core.compose.refine import tiny_pipelines

    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "models"))
    monkeypatch.setenv(device.DEVICE, "cpu")
    models.use_folder("flux2-klein-4b", tiny_pipelines.write_klein(tmp_path / "klein"))
    flat, hole = np.full((96, 96, 3), 128, np.uint8), np.zeros((96, 96), np.float32)
    hole[40:60, 40:60] = 1
    asked = CoarseEdit(0, 0, flat, flat, hole), RefineOptions("auto", 3)
    desk = Desk(Jobs())  # its worker starts with that folder
    try:
        assert desk.runner.offers()["refine"] == Offer("klein", ("klein",))
        for _ in range(2):
            desk.ask(job_functions.refine, *asked)
            desk.wait()
            desk.front.close()
    finally:
        desk.close()
        desk.jobs.close()
    assert desk.errors == [] and len(desk.said) == 1 and desk.runner.asked == ["refine"]
    there, here = desk.answers
    assert there.backend == "klein" and same_values(there, here)
