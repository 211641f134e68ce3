"""What is said of a mistyped command line: one sentence with what was meant."""

from __future__ import annotations

import pytest

from objectmorpher import __main__ as program

SAID = {
    "edti photo.jpg": "no command and no file edti, did you mean edit?",
    "wibble photo.jpg": "no file wibble: edit, batch, select",
    "models": "models needs one of list, get, path, verify, add, remove",
    "bench": "bench needs one of deform, render, pipeline",
    "evaluate": "evaluate needs one of metrics, truth, ablation",
    "models lst": "there is no 'lst' here, did you mean list?: list, get",
    "edit photo.jpg --clik 1,2": "edit has no option --clik, did you mean --click?",
    "edit photo.jpg -o a.png more.jpg": "edit cannot do anything with more.jpg",
    "evaluate metrics a b --sed 4": "evaluate metrics has no option --sed, did you mean --seed?",
    "--theem dark": "objectmorpher has no option --theem, did you mean --theme?",
    f"edit a.png -o b.png --pin={'1' * 5000},2,3": "1111...",
    "info": "info needs SESSION",
    "batch a.json --format bmp": "there is no 'bmp' here: png, jpg, tif, webp",
}


@pytest.mark.parametrize("typed", SAID)
def test_a_mistyped_command_line_is_told_with_what_was_meant(typed, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        program.main(typed.split())
    told = capsys.readouterr().err
    assert ended.value.code == 2
    assert len(told) < 300
    assert SAID[typed] in told and told.startswith("objectmorpher: ") and told.count("\n") == 1
