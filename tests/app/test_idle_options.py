"""Options that do nothing beside the others: each row of the table is met, and said."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from objectmorpher import __main__ as program
from objectmorpher.cli.idle_options import IDLE, refuse_idle
from objectmorpher.cli.parser import main, window_parser
from tests.photos import outlined, saved

ROOT = Path(__file__).parents[2]
EDIT = ("edit", "coffee.png", "--subject", "-o", "out.png")
SERVE = ("serve", "--port", "0")

# A command line for each row of the table, in its order, and which options are said to do nothing.
Line = tuple[str, ...] | dict[str, Any]  # or what is said on it
LINES: dict[str, list[tuple[Line, str]]] = {
    "edit": [
        ((*EDIT, "--flip"), "--flip has"),
        ((*EDIT, "--splats", "a.ply", "--lift", "relief"), "--lift has"),
        ({"splats": "a.ply", "back": "mirrored"}, "--back has"),
        ({"lift": "trellis", "thickness": 0.5, "trust": 0.0}, "--thickness and --trust have"),
        ((*EDIT, "--refine", "harmonise", "--refine-strength", "0.5"), "--refine-strength has"),
        ((*EDIT, "--remove", "--turn", "20"), "--turn has"),
        ({"key": ({"turn": (20.0, 0.0, 0.0)},)}, "--key has"),
        ((*EDIT, "--stiffness", "2", "--mask", "mask.png"), "--stiffness has"),
        ((*EDIT, "--seconds", "2"), "--seconds has"),
    ],
    "replay": [(("replay", "a.omorph", "-o", "out.png", "--video", "morph"), "--video has")],
    "batch": [(("batch", "a.json", "--format", "png"), "--format has")],
    "convert": [
        (("convert", "a.splat", "b.ply", "--count", "500"), "--count has"),
        (("convert", "a.omorph", "b.ply", "--flip"), "--flip has"),
    ],
    "models": [
        (("models", "list", "--yes"), "--yes has"),
        (("models", "setup", "--accept-licence", "x"), "--accept-licence has"),
        (("models", "get", "lama", "--convert"), "--convert has"),
        (("models", "list", "--offline"), "--offline has"),
        (("models", "verify", "--undo"), "--undo has"),
        (("models", "setup", "--undo", "--build", "cu128"), "--build has"),
    ],
    "serve": [
        ((*SERVE, "--alone", "--replicas", "2", "--store", "9"), "--replicas and --store have"),
        ((*SERVE, "--web", "--alone", "--stages", "lift"), "--stages and --alone have"),
    ],
    "window": [(("--sample", "coffee.png"), "--sample has")],
    "window without a display": [
        (("coffee.png", "--theme", "dark", "--frames", "3"), "--theme and --frames have"),
        (("a.omorph", "--seed", "3"), "--seed has"),
    ],
}  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    saved("coffee", tmp_path)
    Image.fromarray(np.uint8(255) * outlined("coffee")).save(tmp_path / "mask.png")
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


@pytest.mark.parametrize("command", LINES)
def test_what_has_no_effect_is_said_in_one_sentence(
    command: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len(LINES[command]) == len(IDLE[command])
    for row, (line, begin) in zip(IDLE[command], LINES[command], strict=True):
        if isinstance(line, dict):
            assert refuse_idle(command, line) == (f"{begin} no effect {row.why}",)
            continue
        before = sorted(folder.iterdir())
        run = program.main if command.startswith("window") else main
        assert run(line) == (1 if row.is_refused else 0), line
        told = capsys.readouterr().err.splitlines()
        assert told[0] == f"objectmorpher: {begin} no effect {row.why}"
        assert len(told) == 1, told
        assert (sorted(folder.iterdir()) == before) == row.is_refused, (
            "what is refused writes nothing"
        )


def test_the_table_names_options_that_there_are() -> None:
    told = (ROOT / "docs" / "reference" / "cli.md").read_text()
    for command, rows in IDLE.items():
        section = (
            f"objectmorpher {command}" if not command.startswith("window") else "objectmorpher"
        )
        text = re.split(rf"^## {section}$", told, flags=re.M)[1].partition("\n## ")[0]
        for row in rows:
            for option in row.options:
                assert f"`--{option.replace('_', '-')}`" in text, (command, option)


def test_what_has_an_effect_is_not_refused() -> None:
    for said in (
        {"flip": True, "splats": "a.ply"},
        {"thickness": 0.5, "lift": "relief"},
        {"turn": (20.0, 0.0, 0.0), "remove": True, "session": "s.omorph"},
        {"key": ({"turn": (20.0, 0.0, 0.0)},), "video": "keys", "save_video": "v.gif"},
        {"stiffness": 2.0, "key": ({"handle": ({"at": (1, 2)},)},), "session": "s.omorph"},
    ):
        refuse_idle("edit", said)
    refuse_idle("convert", {"count": 500, "source": Path("a.glb"), "flip": True})


def test_a_second_file_is_no_edit_without_a_display(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert program.main(("coffee.png", "coffee.png")) == 1
    assert "one photo is edited at a time" in capsys.readouterr().err
    options = window_parser().parse_args(["coffee.png", "--fov", "40"])
    assert options.fov == 40.0


def test_a_batch_refuses_photos_that_no_script_uses(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script = folder / "edit.json"
    script.write_text(json.dumps({"photo": "coffee.png", "out": "o.png", "mask": "mask.png"}))
    saved("chelsea", folder)
    assert main(["batch", "edit.json", "--photo", "chelsea.png"]) == 1
    assert "--photo has no effect" in capsys.readouterr().err
    assert not (folder / "o.png").exists()
