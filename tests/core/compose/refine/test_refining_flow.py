"""From the edit to the refined picture, by the real code on a pipeline of random weights.

Random weights paint noise, which lies nowhere: it passes only where the photo is one flat
colour and nothing in it tells where it lies. Elsewhere it has to be refused.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("diffusers")
pytest.importorskip("peft")

import tiny_pipelines

from objectmorpher.worker import job_functions
from objectmorpher_core import models
from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.refine import RefineError, diffusion, klein
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Placement
from objectmorpher_core.models import device, ledger
from objectmorpher_core.pipeline import run_script
from objectmorpher_core.scripting.options import script_from
from objectmorpher_core.scripting.runner import RefineOptions, coarse_edit
from tests import shapes

pytestmark = pytest.mark.slow

INSIDE = shapes.mask("ellipse")
FLAT = np.full((*INSIDE.shape, 3), 128, np.uint8)


@pytest.fixture(scope="module", autouse=True)
def here(tmp_path_factory):
    """Models folder of its own with a small pipeline, the CPU, few steps."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OBJECTMORPHER_CACHE", str(tmp_path_factory.mktemp("models")))
        patch.setenv(device.DEVICE, "cpu")
        patch.setattr(klein, "STEPS", 2)
        patch.setattr(diffusion, "AREA", 160 * 128)  # of the crop that is refined
        folder = tiny_pipelines.write_klein(tmp_path_factory.mktemp("klein") / "klein")
        models.use_folder("flux2-klein-4b", folder)
        yield


@cache
def moved(is_flat=True):
    pixels = FLAT if is_flat else shapes.picture(INSIDE)
    document = shapes.lifted_scene(pixels, INSIDE, 800).document()
    return edits.set_placement(document, 0, Placement(move=(12.0, -5.0)))


def test_the_job_refines_the_edit_and_the_export_shows_it():
    bare, told = moved(), []
    how = RefineOptions("auto", seed=2, strength=0.5)
    made = job_functions.refine(
        coarse_edit(bare), how, lambda share, note: told.append((share, note))
    )
    assert (made.backend, made.seed, made.strength) == ("klein", 2, 0.5)
    shares = [share for share, _ in told]
    assert shares == sorted(shares) and any("step 2 of 2" in note for _, note in told)
    before, after = composite(bare), composite(edits.set_refined(bare, made))
    assert not np.array_equal(after.pixels, before.pixels)
    outside = ~before.footprint
    assert np.array_equal(after.pixels[outside], before.pixels[outside])


def test_the_next_one_finds_the_pipeline_open():
    bare = moved()
    first = job_functions.refine(coarse_edit(bare), RefineOptions("klein"), silent)
    opened = ledger.SHARED.opened("the refiner")
    other = job_functions.refine(coarse_edit(bare), RefineOptions("klein", seed=1), silent)
    assert opened is not None and ledger.SHARED.opened("the refiner") is opened
    assert not np.array_equal(first.pixels, other.pixels)


def test_the_job_stops_within_a_step():
    def stop(share: float, note: str) -> None:
        if "step 1" in note:
            raise Cancelled

    with pytest.raises(Cancelled):
        job_functions.refine(coarse_edit(moved()), RefineOptions("klein"), stop)


def test_a_picture_of_something_else_is_refused():
    with pytest.raises(RefineError, match="try another seed"):
        job_functions.refine(coarse_edit(moved(is_flat=False)), RefineOptions("klein"), silent)


def test_a_script_asks_for_a_refiner():
    options = {"gaussians": 800, "move": [12, -5], "inpaint": "telea"}
    photo = shapes.png(FLAT)
    plain, refined = (
        run_script(photo, "flat.png", script_from(options | more), shapes.mask_png(INSIDE))
        for more in ({}, {"refine": "klein", "refine_strength": 0.5})
    )
    assert refined.document.refined is not None
    assert ("refine", "klein") in refined.document.backends
    assert not np.array_equal(refined.composite.pixels, plain.composite.pixels)
