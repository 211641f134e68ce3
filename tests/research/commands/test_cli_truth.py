"""`objectmorpher evaluate truth` on the command line."""

from __future__ import annotations

import json

import pytest

from objectmorpher.cli import parser as cli
from objectmorpher_research.evaluation.truth import cases

FEW = {"turn": (0,), "limb": (0,)}  # of the quick set: one that moves as a whole, one that bends


def test_a_folder_of_another_run_is_one_sentence(tmp_path, capsys):
    (tmp_path / "run.json").write_text('{"cases": 1, "seed": 5}')
    assert cli.main(["evaluate", "truth", str(tmp_path), "--quick"]) == 1
    told = capsys.readouterr().err
    assert "run of other cases" in told and told.count("\n") == 1


@pytest.mark.slow
def test_a_few_of_the_quick_set(tmp_path, capsys, monkeypatch):
    """And the stereo pair, which is in every set."""
    monkeypatch.setattr(cases, "QUICK", FEW)
    assert cli.main(["evaluate", "truth", str(tmp_path), "--quick"]) == 0
    assert "report.html" in capsys.readouterr().out
    told = json.loads((tmp_path / "report.json").read_text())
    names = {row["case"] for row in told["cases"]}
    assert len(names) == 3
    means = {(m["category"], m["method"], m["figure"]): m["value"] for m in told["means"]}
    for other in ("nothing", "paste", "card", "warp"):
        assert means["turn", "ours", "psnr"] > means["turn", other, "psnr"]
    assert means["all", "ours", "psnr"] > means["all", "nothing", "psnr"]
    assert means["all", "nothing", "changed"] == 0
    page = (tmp_path / "report.html").read_text()
    assert page.count("src='data:image/jpeg;base64,") > 9 * len(names) and "http" not in page
    lines = (tmp_path / "report.csv").read_text().splitlines()
    assert len(lines) == 1 + len(told["cases"])
