"""`objectmorpher bench pipeline`: what it reports, and that it is of the edit that is meant."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from objectmorpher.cli import parser as cli
from objectmorpher_core.pictures.image import read_picture
from objectmorpher_core.scripting.report import STAGES
from objectmorpher_research.bench import pipeline


@pytest.mark.slow
def test_the_report_has_the_seconds_that_the_design_names(tmp_path: Path) -> None:
    file = tmp_path / "pipeline.json"
    assert cli.main(["bench", "pipeline", "--quick", "--json", str(file)]) == 0
    report = json.loads(file.read_text())
    assert set(report["machine"]) == {"cpu", "cores", "gl_renderer"}
    first, again = report["rows"]
    assert (first["run"], again["run"]) == ("first", "again")
    assert first["start_s"] > 0 and "start_s" not in again
    for row in (first, again):
        assert (row["photo"], row["width"], row["height"]) == ("sample", 600, 400)
        assert row["mask_area_px"] > 10_000 and row["gaussians"] > 1_000
        seconds = row["seconds"]
        assert set(seconds) == set(STAGES)
        stages = [seconds[stage] for stage in STAGES if stage != "total"]
        assert min(stages) >= 0 and sum(stages) <= seconds["total"] + 0.01
        used = [seconds[stage] for stage in ("load", "segment", "lift", "inpaint", "render")]
        assert min(used) > 0, "the whole edit was done"
    assert first["mask_area_px"] == again["mask_area_px"], "the same edit again"


@pytest.mark.parametrize(("file", "told"), [("none/b.json", "does not exist"), ("", "is a folder")])
def test_a_file_that_cannot_be_written_is_refused_before_anything_is_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    file: str, told: str,
) -> None:  # fmt: skip
    needed = "objectmorpher_research.bench.deform"  # by what measures, which alone imports it
    monkeypatch.delitem(sys.modules, needed, raising=False)
    assert cli.main(["bench", "deform", "--quick", "--json", str(tmp_path / file)]) == 1
    assert told in capsys.readouterr().err
    assert needed not in sys.modules


@pytest.mark.parametrize("name", pipeline.PHOTOS[1:])
def test_the_larger_photos_have_a_megapixel_and_are_clicked_inside(name: str) -> None:
    case = pipeline._case(name)
    pixels = read_picture(case.data).pixels
    height, width = pixels.shape[:2]
    assert 1e6 < width * height < 1.1e6
    assert 0 < case.click[0] < width and 0 < case.click[1] < height


def test_the_enlarged_photo_is_clicked_on_what_the_sample_is_clicked_on() -> None:
    colours = []
    for name in ("sample", "enlarged"):
        case = pipeline._case(name)
        x, y = (int(n) for n in case.click)
        around = read_picture(case.data).pixels[y - 3 : y + 4, x - 3 : x + 4]
        colours.append(around.mean((0, 1)))
    np.testing.assert_allclose(*colours, atol=8)  # levels
