"""`objectmorpher evaluate paper`, `study` and `study-results` on the command line."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from objectmorpher.cli import parser as cli
from objectmorpher_core.pictures.image import encode_mask
from objectmorpher_research.evaluation.measures import dino
from objectmorpher_research.evaluation.paper.interaction_log import read_recorded
from objectmorpher_research.study.design import CRITERIA
from objectmorpher_research.study.store import PageAnswer, Study, StudyStore
from tests.research.study.study_set import METHODS, SIZE, save, small, write_set

needs_dino = pytest.mark.skipif(dino.missing() is not None, reason=str(dino.missing()))


@pytest.fixture
def folder(tmp_path) -> Path:
    return write_set(tmp_path / "set")


def answer_all(folder: Path, people: int) -> None:
    """People who like the second method better, and one who does not read."""
    methods = {name: METHODS for name in ("coffee", "chelsea")}
    store = StudyStore(folder, Study(methods, seed=0, checks=2))
    for number in range(people):
        key, person = store.join()
        for k, item in enumerate(person.items):
            good = 5 - number % 2 if item.method == METHODS[1] else 1 + number % 3
            ratings = item.check or (good, 3, 4)
            if number == people - 1 and item.check:
                ratings = (1, 1, 1)
            store.answer(key, k, PageAnswer(ratings, 5.0 + k, "2026-01-01T00:00:00+00:00"))


@needs_dino
def test_the_table_names_what_is_absent_and_what_was_recorded(folder, tmp_path, capsys):
    log = folder / "coffee" / "results" / f"{METHODS[0]}.jsonl"
    log.write_text(
        '{"t": 0, "event": "begin", "what": "net"}\n{"t": 12, "event": "end", "what": "net"}\n'
        '{"t": 13, "event": "input"}\n{"t": 13.02, "event": "feedback"}\n'
    )
    out = tmp_path / "figures.json"
    assert cli.main(["evaluate", "paper", str(folder), "--json", str(out)]) == 0
    said = capsys.readouterr().out
    head, nothing, first, second, *rest = said.splitlines()
    assert head.split() == ["method", "n", "LPIPS", "SIFID", "KID", "RI", "MT"]
    assert nothing.startswith("(nothing done)")
    assert rest[1].split()[3] == "DINO-perceptual" and "1.000 [1.000, 1.000]" in rest[2]
    assert "yes, 20 ms" in first and first.rstrip().endswith("12 s")
    assert second.count("not recorded") == 2 and second.split()[2:5] == ["absent"] * 3
    assert any(line.startswith("absent: LPIPS: AlexNet is not here") for line in rest)
    assert f"{METHODS[0]} has logs of 1 of 2" in rest
    told = json.loads(out.read_text())
    row = next(m for m in told["methods"] if m["method"] == METHODS[0])
    assert row["computing_s"]["value"] == 12
    assert row["interaction_s"]["value"] == pytest.approx(0.02)
    assert set(row["each"]["DINO-identity"]) == {"coffee", "chelsea"}


@needs_dino
@pytest.mark.slow
def test_our_own_method_is_run_and_timed(folder, tmp_path, capsys):
    """Handles and a placement; what cannot be edited is told and left out."""
    mask = np.zeros(SIZE[::-1], bool)
    mask[25:80, 40:110] = True
    scripts = {
        "coffee": {
            "mask": "m.png",
            "handle": [{"at": [70, 50], "to": [80, 45]}],
            "pin": [[60, 70]],
        },
        "chelsea": {"mask": "m.png", "move": [10, 0, 0], "turn": [10, 0, 0]},
        "rocket": {"mask": "m.png", "handle": [{"at": [1, 1], "to": [9, 9]}]},
    }
    for name, script in scripts.items():
        save(folder / name / "image.png", small(name))
        (folder / name / "m.png").write_bytes(encode_mask(mask))
        (folder / name / "guidance.json").write_text(json.dumps(script))
    ours = tmp_path / "ours"
    words = ["evaluate", "paper", str(folder), "--run", str(ours)]
    assert cli.main(words) == 0
    said = capsys.readouterr().out
    assert "not edited: rocket: " in said and "objectmorpher has results of 2 of 3" in said
    for name in ("coffee", "chelsea"):
        found = read_recorded(ours / f"{name}.jsonl")
        assert found.computing is not None and found.computing > 0
        assert len(found.latencies) == 30 and 0 < min(found.latencies) <= max(found.latencies) < 60
    before = {path: path.stat().st_mtime_ns for path in ours.iterdir()}
    assert cli.main(words) == 0
    assert before == {path: path.stat().st_mtime_ns for path in ours.iterdir()}, "made once"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["paper", "{nowhere}"], "there is no folder"),
        (["paper", "{empty}"], "has no subjects"),
        (["paper", "{bare}"], "there is no result of any method"),
        (["paper", "{set}", "--results", "x={nowhere}"], "there is no folder"),
        (["paper", "{set}", "--results", "x={empty}"], "holds no result of any of the 2"),
        (["paper", "{set}", "--results", "x={set}", "--results", "x={set}"], "the same name"),
        (["paper", "{set}", "--weights", "{nowhere}"], "there is no folder"),
        (["paper", "{set}", "--seed", "-1"], "--seed is at least 0"),
        (["paper", "{broken}"], "guidance.json"),
        (["paper", "{set}", "--json", "{nowhere}/x.json"], "nowhere does not exist"),
        (["paper", "{bare}", "--run", "{nowhere}"], "none of the subjects could be edited: cup: "),
        (["study", "{bare}"], "has no result of any method"),
        (["study", "{silent}"], "nothing tells what is asked"),
        (["study", "{set}", "--only", "them"], "there is no result of 'them'"),
        (["study", "{set}", "--checks", "99"], "checks to 20"),
        (["study", "{set}", "--consent", "{nowhere}"], "nowhere"),
        (["study-results", "{set}"], "holds no study"),
        (["study-results", "{answers}", "--chart", "x.png"], "must be .svg"),
        (["study-results", "{answers}", "--csv", "{set}/x", "--json", "{set}/x"], "the same name"),
    ],
)
def test_failures_are_one_sentence(folder, tmp_path, capsys, words, told):
    places = {name: tmp_path / name for name in ("empty", "bare", "broken", "silent", "answers")}
    places["empty"].mkdir()
    for name in ("bare", "broken", "silent"):
        save(places[name] / "cup" / "image.png", small("coffee"))
    (places["broken"] / "cup" / "guidance.json").write_text('{"clik": [[1, 2]]}')
    save(places["silent"] / "cup" / "results" / "a.png", small("coffee"))
    answer_all(places["answers"], 1)
    filled = [w.format(**places, set=folder, nowhere=tmp_path / "nowhere") for w in words]
    assert cli.main(["evaluate", *filled]) == 1
    said = capsys.readouterr()
    assert told in said.err and len(said.err.splitlines()) == 1
    assert words[0] != "paper" or not said.out, "nothing was measured"


def test_what_people_said(tmp_path, capsys):
    answer_all(tmp_path / "set" / "study", 7)
    names = {name: tmp_path / f"out.{name}" for name in ("csv", "json", "chart")}
    names["chart"] = names["chart"].with_suffix(".svg")
    words = [word for name, path in names.items() for word in (f"--{name}", str(path))]
    assert cli.main(["evaluate", "study-results", str(tmp_path / "set"), *words]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "7 took part, 6 count"
    assert lines[1] == "excluded: 7: has answered a check of attention otherwise than it said"
    assert lines[2].split() == ["method", "n", *CRITERIA]
    assert lines[3].startswith(METHODS[1]) and lines[4].startswith(METHODS[0])
    assert lines[5].startswith("Krippendorff's alpha")
    told = json.loads(names["json"].read_text())
    assert [m["method"] for m in told["methods"]] == [METHODS[1], METHODS[0]]
    best = told["methods"][0]["means"]["guidance"]
    assert best["value"] == pytest.approx(4.5) and best["low"] < 4.5 < best["high"]
    assert told["counted"] == 6 and told["alpha"]["guidance"]["value"] > 0.5
    assert len(names["csv"].read_text().splitlines()) == 1 + 7 * 6
    assert METHODS[0] in names["chart"].read_text()


def test_the_command_serves_and_ends_when_it_is_told_to(folder):
    command = [
        sys.executable,
        "-m",
        "objectmorpher",
        "evaluate",
        "study",
        str(folder),
        "--port",
        "0",
    ]
    with subprocess.Popen(
        command, cwd=Path(__file__).parents[2], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        address = re.search(r"http://127\.0\.0\.1:\d+", process.stdout.readline())
        assert address is not None
        request = urllib.request.Request(
            address[0] + "/api/begin", b'{"agreed": true}', {"Content-Type": "application/json"}
        )
        with urllib.request.urlopen(request, timeout=20) as answer:
            assert json.load(answer)["number"] == 1
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 0
    assert (folder / "study" / "participants" / "0001.json").is_file()
