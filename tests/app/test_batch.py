"""`objectmorpher batch`: many scripts, whatever becomes of each."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from objectmorpher.cli import parser as cli
from objectmorpher_core.pictures.image import read_picture
from tests import shapes

pytestmark = pytest.mark.usefixtures("lifted_once")

MASK = shapes.mask("ellipse")
PIXELS = shapes.picture(MASK)
QUICK = {"mask": "mask.png", "gaussians": 300, "trust": 0, "inpaint": "telea"}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two photos, a mask, and a folder of scripts."""
    monkeypatch.chdir(tmp_path)
    for name in ("scripts", "out", "photos"):
        Path(name).mkdir()
    Path("scripts/mask.png").write_bytes(shapes.mask_png(MASK))
    for name in ("one.png", "two.png"):
        (tmp_path / "photos" / name).write_bytes(shapes.png(PIXELS))
    return tmp_path


def _script(name: str, *edits: dict) -> None:
    whole = [QUICK | {"photo": "../photos/one.png"} | edit for edit in edits]
    text = json.dumps(whole if len(whole) > 1 else whole[0])
    Path("scripts", name).write_text(text, encoding="utf-8")


def _batch(*more: str) -> int:
    return cli.main(["batch", "scripts", "-o", "out", *more])


def _made() -> list[str]:
    return sorted(path.name for path in Path("out").iterdir())


def test_a_failure_does_not_stop_the_others(folder, capsys):
    _script("a.json", {"move": [9, 4]})
    _script("b.json", {"photo": "../photos/nowhere.png"})
    Path("scripts/c.json").write_text("{", encoding="utf-8")
    _script("d.json", {"turn": [20, 0, 0]}, {"remove": True})
    assert _batch("--report", "r.json") == cli.FAILED
    assert _made() == ["a.png", "d-1.png", "d-2.png"]
    told = capsys.readouterr()
    lines = told.out.splitlines()
    assert [line.split()[0] for line in lines[:-1]] == ["done", "failed", "failed", "done", "done"]
    assert lines[-1] == "3 done, 0 kept, 2 failed"
    assert "nowhere.png does not exist" in lines[1] and "not JSON" in lines[2]
    assert told.err.splitlines()[-1].endswith("2 of 5 edits failed")
    report = json.loads(Path("r.json").read_text())
    assert (report["done"], report["failed"], len(report["edits"])) == (3, 2, 5)
    outs = [entry["out"] and Path(entry["out"]).name for entry in report["edits"]]
    assert outs == ["a.png", "b.png", None, "d-1.png", "d-2.png"]
    assert report["edits"][0]["report"]["pixels"]["outside_footprint_changed"] == 0


def test_it_makes_and_says_what_edit_does(folder, capsys):
    _script("a.json", {"turn": [120, 0, 0]})
    assert _batch() == 0
    said = capsys.readouterr().err.replace(str(Path("out/a.png")), "own.png")
    assert "own.png: Object 1 is turned so far that it is guesswork" in said
    assert cli.main(["edit", "--script", "scripts/a.json", "-o", "own.png"]) == 0
    assert capsys.readouterr().err == said
    assert Path("out/a.png").read_bytes() == Path("own.png").read_bytes()


def test_what_was_made_already_is_kept_until_something_changes(folder, capsys):
    _script("a.json", {"move": [9, 4]})
    assert _batch() == 0
    made = Path("out/a.png").stat()
    assert _batch() == 0
    assert "1 kept" in capsys.readouterr().out
    assert Path("out/a.png").stat().st_mtime_ns == made.st_mtime_ns
    for changed in ("scripts/a.json", "photos/one.png", "scripts/mask.png"):
        later = Path("out/a.png").stat().st_mtime + 5
        os.utime(changed, (later, later))
        assert _batch() == 0
        assert "1 done" in capsys.readouterr().out.splitlines()[-1], changed
        os.utime(changed, (1, 1))
    assert _batch("--overwrite") == 0
    assert "1 done" in capsys.readouterr().out


def test_a_script_without_a_photo_is_for_all_that_are_named(folder):
    Path("scripts/a.json").write_text(json.dumps(QUICK | {"move": [9, 4]}), encoding="utf-8")
    assert _batch("--photo", "photos") == 0
    assert _made() == ["one-a.png", "two-a.png"]
    one, two = (read_picture(Path("out", name).read_bytes()).pixels for name in _made())
    assert np.array_equal(one, two) and (one != PIXELS).any()


def test_a_script_names_its_own_output(folder):
    _script("a.json", {"move": [9, 4], "out": "../out/mine.tif"})
    assert cli.main(["batch", "scripts/a.json"]) == 0
    assert _made() == ["mine.tif"]


WRONG = {
    "no photo": ({"photo": None}, 'names no "photo"'),
    "over its photo": ({"out": "../photos/one.png"}, "is an input"),
    "another kind of file": ({"out": "../out/a.txt"}, "the ending must be"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_is_a_line(folder, capsys, case):
    change, sentence = WRONG[case]
    whole = {k: v for k, v in (QUICK | {"photo": "../photos/one.png"} | change).items() if v}
    Path("scripts/a.json").write_text(json.dumps(whole), encoding="utf-8")
    before = Path("photos/one.png").read_bytes()
    assert _batch() == cli.FAILED
    assert sentence in capsys.readouterr().out
    assert Path("photos/one.png").read_bytes() == before and _made() == []


def test_two_edits_do_not_write_one_file(folder, capsys):
    _script("a.json", {"move": [9, 4], "out": "../out/x.png"}, {"scale": 2, "out": "../out/x.png"})
    assert _batch() == cli.FAILED
    assert "1 done, 0 kept, 1 failed" in capsys.readouterr().out


def test_without_a_script_there_is_nothing_to_run(folder, capsys):
    assert _batch() == cli.FAILED
    assert "no script" in capsys.readouterr().err
    assert cli.main(["batch", "scripts", "-o", "scripts/mask.png"]) == cli.FAILED
    assert "is no folder" in capsys.readouterr().err


@pytest.mark.slow
def test_outputs_keep_their_photos_format_in_a_folder_that_is_made(folder):
    Image.open("photos/two.png").convert("RGB").save("photos/three.JPG")
    Path("photos/two.png").unlink()
    Path("scripts/a.json").write_text(json.dumps(QUICK | {"move": [3, 1]}), encoding="utf-8")
    photos = ("batch", "scripts", "--photo", "photos")
    assert cli.main([*photos, "-o", "made/here"]) == 0
    assert sorted(p.name for p in Path("made/here").iterdir()) == ["one-a.png", "three-a.jpg"]
    assert Image.open("made/here/three-a.jpg").format == "JPEG"
    assert cli.main([*photos, "-o", "tif", "--format", "tif"]) == 0
    assert sorted(p.name for p in Path("tif").iterdir()) == ["one-a.tif", "three-a.tif"]


def test_a_folder_of_photos_gives_all_that_can_be_read(folder):
    """Also those in formats that are not written, whose edits become PNG files."""
    _script("a.json", {"move": [9, 4]})
    script = json.loads(Path("scripts/a.json").read_text())
    del script["photo"]
    Path("scripts/a.json").write_text(json.dumps(script))
    Image.fromarray(PIXELS).save("photos/three.bmp")
    assert _batch("--photo", "photos") == 0
    assert _made() == ["one-a.png", "three-a.png", "two-a.png"]


def test_what_is_made_beside_the_photos_is_no_photo_of_the_next_run(folder, capsys):
    _script("a.json", {"move": [9, 4]})
    script = json.loads(Path("scripts/a.json").read_text())
    del script["photo"]
    Path("scripts/a.json").write_text(json.dumps(script))
    more = ("scripts", "-o", "photos", "--photo", "photos", "--report", "scripts/report.json")
    for told in ("2 done, 0 kept, 0 failed", "0 done, 2 kept, 0 failed"):
        assert cli.main(["batch", *more]) == 0
        assert capsys.readouterr().out.splitlines()[-1] == told
    assert len(list(Path("photos").iterdir())) == 4


def test_the_report_replaces_no_script(folder, capsys):
    _script("a.json", {"move": [9, 4]})
    before = Path("scripts/a.json").read_bytes()
    for scripts in ("scripts/a.json", "scripts"):
        assert cli.main(["batch", scripts, "-o", "out", "--report", "scripts/a.json"]) != 0
        assert "is an input" in capsys.readouterr().err
    assert Path("scripts/a.json").read_bytes() == before
