"""R.json: its keys are a contract, its figures add up."""

from __future__ import annotations

import json
import subprocess
import sys
import time

import numpy as np
import pytest

from objectmorpher_core.pipeline import Edited, run_script
from objectmorpher_core.scripting.options import script_from
from objectmorpher_core.scripting.report import STAGES, Stopwatch, peak_memory_mb
from tests import shapes

pytestmark = pytest.mark.usefixtures("lifted_once")

MASK = shapes.mask("ellipse")
KEYS = {
    "version": None,
    "photo": {"width", "height"},
    "trust": {"sign", "invented", "astray"},
    "object": {"mask_area_px", "gaussians", "edge_gaussians", "control_points", "links",
               "components", "kind"},
    "handles": None,
    "energy": {"start", "end", "iterations"},
    "pixels": {"changed", "outside_footprint_changed", "from_photo", "from_lifter",
               "from_inpainter", "from_refiner", "from_paint", "shadow",
               "beside", "beside_like_object"},
    "backends": {"segment", "lift", "inpaint", "refine"},
    "seconds": {"load", "segment", "lift", "graph", "deform", "inpaint", "render", "refine",
                "save", "total"},
    "peak_memory_mb": None,
    "notes": None,
}  # fmt: skip


def _run(**options) -> Edited:
    script = script_from({"gaussians": 300, "trust": 0, "inpaint": "telea"} | options)
    return run_script(shapes.png(shapes.picture(MASK)), "made.png", script, shapes.mask_png(MASK))


@pytest.fixture(scope="module")
def report() -> dict:
    return _run(handle=[{"at": [100, 62], "to": [120, 40], "dz": 0.1}], turn=[10, 0, 0]).report()


def test_the_keys_are_those_of_the_design(report):
    assert set(report) == set(KEYS)
    for key, inner in KEYS.items():
        if inner is not None:
            assert set(report[key]) == inner
    assert set(report["handles"][0]) == {"from", "to", "reached", "error_px"}


def test_it_is_plain_json(report):
    assert json.loads(json.dumps(report)) == report


def test_it_tells_the_photo_and_the_object(report):
    assert report["version"] == 1
    assert report["photo"] == {"width": 160, "height": 120}
    assert report["object"]["mask_area_px"] == MASK.sum()
    assert report["object"]["components"] == 1
    assert report["object"]["links"] > 0
    assert report["backends"] == {
        "segment": "mask", "lift": "relief", "inpaint": "telea", "refine": "none"
    }  # fmt: skip


def test_the_shares_sum_to_one(report):
    shares = [report["pixels"][f"from_{k}"] for k in ("photo", "lifter", "inpainter", "refiner")]
    assert sum(shares) == pytest.approx(1, abs=1e-9)


def test_the_energy_falls(report):
    energy = report["energy"]
    assert 0 <= energy["end"] <= energy["start"]
    assert energy["iterations"] >= 1


def test_the_stages_take_no_longer_than_the_whole(report):
    seconds = report["seconds"]
    assert sum(v for k, v in seconds.items() if k != "total") <= seconds["total"] + 1e-3
    assert seconds["lift"] > 0
    assert seconds["refine"] == 0


def test_an_edit_without_handles_has_none_and_no_energy():
    report = _run(move=[5, 5]).report()
    assert report["handles"] == []
    assert report["energy"] == {"start": 0.0, "end": 0.0, "iterations": 0}


def test_nothing_changed_is_all_zeros():
    pixels = _run().report()["pixels"]
    assert set(pixels.values()) == {0}


def _fail_slowly(watch: Stopwatch) -> None:
    with watch.stage("lift"):
        time.sleep(0.01)
        _ = 1 / 0


def test_a_stopwatch_adds_up_by_stage_even_when_a_stage_fails():
    watch = Stopwatch()
    with watch.stage("lift"):
        time.sleep(0.01)
    with pytest.raises(ZeroDivisionError):
        _fail_slowly(watch)
    seconds = watch.read()
    assert tuple(seconds) == STAGES
    assert seconds["lift"] >= 0.02
    assert seconds["total"] >= seconds["lift"]


def test_the_memory_of_who_started_the_process_does_not_count():
    told = "from objectmorpher_core.scripting.report import peak_memory_mb; print(peak_memory_mb())"
    held = np.ones(100_000_000)  # 800 MB
    ran = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert 20 < float(ran.stdout) < held.nbytes / 1e6 - 200


def test_memory_is_told_in_megabytes():
    assert 20 < peak_memory_mb() < 100_000
