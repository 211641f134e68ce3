"""`objectmorpher evaluate metrics` on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from objectmorpher.cli import parser as cli
from objectmorpher_core.pictures.image import Picture, encode_mask, encode_picture
from tests.photos import photo

NUMBERS = "psnr,ssim"


@pytest.fixture
def sets(tmp_path: Path) -> tuple[Path, Path, Path]:
    """Folders A, B and of masks: three photos, their left halves changed."""
    random = np.random.default_rng(0)
    folders = tmp_path / "a", tmp_path / "b", tmp_path / "masks"
    for folder in folders:
        folder.mkdir()
    for name in ("chelsea", "coffee", "flower"):
        rgb = photo(name)[:120, :160].copy()
        mask = np.zeros(rgb.shape[:2], bool)
        mask[:, :80] = True
        other = np.where(mask[..., None], random.integers(0, 255, rgb.shape, np.uint8), rgb)
        for folder, pixels in zip(folders, (rgb, other), strict=False):
            (folder / f"{name}.png").write_bytes(encode_picture(Picture(pixels), ".png"))
        (folders[2] / f"{name}.png").write_bytes(encode_mask(mask))
    return folders


def test_two_folders_and_masks_give_a_table_and_figures(sets, tmp_path, capsys):
    a, b, masks = map(str, sets)
    out = tmp_path / "figures.json"
    words = ["evaluate", "metrics", a, b, "--mask", masks, "--only", NUMBERS, "--json", str(out)]
    assert cli.main(words) == 0
    told = json.loads(out.read_text())
    assert told["pairs"] == 3
    found = {(s["metric"], s["region"]): s for s in told["scores"]}
    assert found["psnr", "outside"]["value"] == "inf"
    assert found["psnr", "inside"]["value"] < found["psnr", "whole"]["value"]
    assert found["ssim", "inside"]["low"] <= found["ssim", "inside"]["value"]
    assert set(found["ssim", "whole"]["each"]) == {"chelsea", "coffee", "flower"}
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["3", "pairs", "whole", "inside", "outside"]
    assert [line.split()[0] for line in lines[1:]] == ["psnr", "ssim"]


@pytest.mark.parametrize("region", ["inside", "outside"])
def test_masks_that_leave_nothing_to_measure_are_named(sets, tmp_path, capsys, region):
    """As those are whose values are 0 and 1, of which nothing is white."""
    a, b, masks = map(str, sets)
    words = ["evaluate", "metrics", a, b, "--mask", masks, "--only", NUMBERS]
    assert cli.main(words) == 0
    assert "nothing to measure" not in capsys.readouterr().out
    low, high = (0, 1) if region == "inside" else (254, 255)
    for name in ("chelsea", "flower"):
        grey = np.full((120, 160, 3), low, np.uint8)
        grey[:, :80] = high
        (sets[2] / f"{name}.png").write_bytes(encode_picture(Picture(grey), ".png"))
    assert cli.main(words) == 0
    (line,) = [one for one in capsys.readouterr().out.splitlines() if "nothing to" in one]
    assert line.startswith(f"nothing to measure {region} the mask")
    assert line.endswith(": chelsea, flower")


def test_two_files(sets, capsys):
    a, b, _ = sets
    words = ["evaluate", "metrics", str(a / "coffee.png"), str(b / "coffee.png")]
    assert cli.main([*words, "--only", "psnr"]) == 0
    assert "1 pair" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["{a}", "{a}/coffee.png"], "not one with the other"),
        (["{a}", "{nowhere}"], "there is no"),
        (["{a}", "{b}", "--only", "beauty"], "there is no measure 'beauty'"),
        (["{a}", "{b}", "--mask", "{a}/broken.png"], "there is no"),
        (["{a}", "{b}", "--weights", "{nowhere}"], "there is no folder"),
        (["{a}", "{b}", "--subset-size", "1"], "--subset-size is at least 2"),
        (["{a}", "{empty}"], "holds no picture"),
        (["{a}", "{fewer}"], "has no picture called 'chelsea'"),
        (["{a}/coffee.png", "{small}"], "different sizes"),
        (["{a}/coffee.png", "{broken}"], "broken.png"),
        (["{a}", "{b}", "--json", "{nowhere}/x.json"], "nowhere does not exist"),
        (["{a}", "{b}", "--json", "{empty}"], "empty is a folder"),
        (["{a}/coffee.png", "{b}/coffee.png", "--json", "{b}/coffee.png"], "is an input"),
    ],
)
def test_failures_are_one_sentence(sets, tmp_path, capsys, words, told):
    a, b, _ = sets
    empty, fewer, small = tmp_path / "empty", tmp_path / "fewer", tmp_path / "small.png"
    broken = tmp_path / "broken.png"
    empty.mkdir()
    fewer.mkdir()
    (fewer / "coffee.png").write_bytes((b / "coffee.png").read_bytes())
    small.write_bytes(encode_picture(Picture(photo("coffee")[:20, :20].copy()), ".png"))
    broken.write_bytes(b"no picture")
    places = {"a": a, "b": b, "empty": empty, "fewer": fewer, "small": small, "broken": broken}
    filled = [word.format(**places, nowhere=tmp_path / "nowhere") for word in words]
    assert (
        cli.main(
            ["evaluate", "metrics", *filled, *([] if "--only" in words else ["--only", NUMBERS])]
        )
        == 1
    )
    said = capsys.readouterr()
    assert told in said.err and len(said.err.splitlines()) == 1 and not said.out
    assert "went wrong" not in said.err, "it is no fault of the program"
