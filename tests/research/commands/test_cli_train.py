"""`objectmorpher train pairs` and `train lora`: what they say, and what they refuse."""

from __future__ import annotations

import json
from importlib.util import find_spec

import numpy as np
import pytest

from objectmorpher.cli.parser import main
from tests import shapes

needs_torch = pytest.mark.skipif(
    any(find_spec(name) is None for name in ("torch", "diffusers", "peft", "accelerate")),
    reason="needs torch, diffusers, peft and accelerate",
)


def write_pairs(at, count=3):
    """Of objects too small to be used."""
    at.mkdir()
    inside = np.zeros((60, 80), bool)
    inside[20:24, 30:34] = True
    for k in range(count):
        for letter in "ab":
            (at / f"thing{k}-{letter}.png").write_bytes(shapes.png(shapes.picture(inside, k)))
            (at / f"thing{k}-{letter}.mask.png").write_bytes(shapes.mask_png(inside))
    return at


def test_pairs_are_told_of_and_not_looked_at_twice(tmp_path, capsys):
    source, out = write_pairs(tmp_path / "pairs"), tmp_path / "out"
    command = ["train", "pairs", str(source), str(out), "--shard-size", "2", "--inpaint", "telea"]
    assert main(command) == 0
    told = capsys.readouterr().out
    assert "0 triplets, 6 pairs rejected" in told and "6 x the object covers 0.3%" in told
    shards = sorted(out.glob("shard-*"))
    assert [s.name for s in shards] == ["shard-00000", "shard-00001", "shard-00002"]
    stamps = [(s / "shard.json").stat().st_mtime_ns for s in shards]
    assert main(command) == 0 and capsys.readouterr().out == told
    assert [(s / "shard.json").stat().st_mtime_ns for s in shards] == stamps
    found = json.loads((shards[0] / "thing0.json").read_text())
    assert "covers 0.3%" in found["rejected"] and found["area"]["b"] == pytest.approx(16 / 4800)


@pytest.mark.parametrize(("arguments", "words"), [
    (["pairs", "NONE", "OUT"], "there is no "),
    (["pairs", "PAIRS", "OUT", "--poses", "mine"], "there is no source of poses 'mine'"),
    (["pairs", "PAIRS", "OUT", "--layout", "rows"], "there is no layout 'rows'"),
    (["pairs", "PAIRS", "OUT", "--shard-size", "0"], "a shard of 0 pairs is none"),
    (["pairs", "PAIRS", "OUT", "--segment", "nobody"], "there is no segmenter 'nobody'"),
    (["pairs", "PAIRS", "OUT", "--size", "10"], "--size is at least 64 px"),
    (["pairs", "PAIRS", "PAIRS"], "is not empty"),
    (["pairs", "PAIRS", "FILE"], "thing0-a.png is a file, not a folder"),
])  # fmt: skip
def test_what_cannot_be_made_is_one_sentence(tmp_path, capsys, arguments, words):
    names = {"NONE": tmp_path / "none", "OUT": tmp_path / "out"}
    names["PAIRS"] = write_pairs(tmp_path / "pairs")
    names["FILE"] = names["PAIRS"] / "thing0-a.png"
    assert main(["train", *(str(names.get(word, word)) for word in arguments)]) != 0
    told = capsys.readouterr().err
    assert words in told and told.count("\n") == 1 and "Traceback" not in told


@needs_torch
@pytest.mark.parametrize("what", ["shape", "flat", "shadow", "rods", "lora"])
@pytest.mark.parametrize("within", ["", "folder"])
def test_a_file_in_place_of_the_folder_is_one_sentence(tmp_path, capsys, what, within):
    pytest.importorskip("onnx")
    file = tmp_path / "notes.txt"
    file.write_text("mine")
    where = [str(file), str(file / within)] if what == "lora" else ["--folder", str(file / within)]
    assert main(["train", what, *where]) == 1
    assert capsys.readouterr().err == f"objectmorpher: {file} is a file, not a folder\n"


@needs_torch
@pytest.mark.parametrize(("arguments", "words"), [
    (["DATA", "OUT", "--model", "gwen"], "there is no model 'gwen' to train"),
    (["DATA", "OUT", "--size", "1000"], "no multiple of 32"),
    (["DATA", "OUT", "--number", "int8"], "--number is one of"),
    (["DATA", "OUT", "--weights", "DATA"], "is no pipeline's folder"),
    (["DATA", "OUT"], "no model is there"),
    (["DATA"], "name the folder of triplets"),
    (["DATA", "OUT", "--steps", "0"], "--steps and --save-every"),
])  # fmt: skip
def test_what_cannot_be_trained_is_one_sentence(tmp_path, capsys, monkeypatch, arguments, words):
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "models"))
    names = {"DATA": tmp_path, "OUT": tmp_path / "out"}
    assert main(["train", "lora", *(str(names.get(word, word)) for word in arguments)]) != 0
    told = capsys.readouterr().err
    assert words in told and told.count("\n") == 1
    assert not (tmp_path / "out").exists()
