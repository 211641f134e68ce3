"""A real Ray of two nodes makes a batch and cases of the benchmark; workers are killed."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path

import pytest
from ray_apart import NEEDS_RAY_DATA, own_folder, told_by

from app import cli
from tests import shapes

pytestmark = [
    pytest.mark.slow,
    NEEDS_RAY_DATA,
    pytest.mark.skipif(
        any(find_spec(name) is None for name in ("skimage", "sklearn")),
        reason="the benchmark's photos are not installed",
    ),
]

EDITS = 6


@pytest.fixture
def folder():
    with own_folder() as at:
        yield at


def write_scripts(at: Path) -> None:
    """One file of many edits, and one that cannot be made."""
    at.mkdir()
    inside = shapes.mask("ellipse")
    (at.parent / "photo.png").write_bytes(shapes.png(shapes.picture(inside)))
    (at / "mask.png").write_bytes(shapes.mask_png(inside))
    common = {"photo": "../photo.png", "mask": "mask.png", "inpaint": "telea"}
    edits = [common | {"turn": [4 * k, 0, 0]} for k in range(1, EDITS + 1)]
    (at / "many.json").write_text(json.dumps(edits))
    (at / "none.json").write_text(json.dumps(common | {"photo": "nowhere.png"}))


def write_subjects(at: Path) -> None:
    """One that can be edited, and one that names a lifter that does not exist."""
    inside = shapes.mask("disc")
    for name, more in (("a", {}), ("b", {"lift": "nobody"})):
        (at / name).mkdir(parents=True)
        (at / name / "image.png").write_bytes(shapes.png(shapes.picture(inside)))
        (at / name / "m.png").write_bytes(shapes.mask_png(inside))
        told = {"mask": "m.png", "inpaint": "telea", "turn": [9, 0, 0]} | more
        (at / name / "guidance.json").write_text(json.dumps(told))


def test_killed_workers_lose_nothing(folder: Path) -> None:
    write_scripts(folder / "scripts")
    write_subjects(folder / "subjects")
    (folder / "out").mkdir()
    told = told_by("spread_edits.py", folder, folder)
    assert all(told["killed"])
    batch = told["batch"]
    assert told["status"] == cli.FAILED
    assert (batch["done"], batch["kept"], batch["failed"]) == (EDITS, 0, 1)
    outs = [entry["out"] for entry in batch["edits"]]
    assert outs == [str(folder / "out" / f"many-{k}.png") for k in range(1, EDITS + 1)] + [
        str(folder / "out" / "none.png")
    ]  # each once, in their order, whoever was done first
    assert "nowhere.png does not exist" in batch["edits"][-1]["error"]
    assert sorted(p.name for p in (folder / "out").iterdir()) == sorted(
        Path(name).name for name in outs[:-1]
    )
    one = json.loads((folder / "scripts" / "many.json").read_text())[EDITS - 1]
    (folder / "scripts" / "one.json").write_text(json.dumps(one))
    own = folder / "own.png"
    assert cli.main(["edit", "--script", str(folder / "scripts/one.json"), "-o", str(own)]) == 0
    assert own.read_bytes() == (folder / "out" / f"many-{EDITS}.png").read_bytes()
    assert [sentence[:3] for sentence in told["subjects"]] == ["b: "]
    assert sorted(p.name for p in (folder / "ours").iterdir()) == ["a.jsonl", "a.png"]
    here = folder / "here.json"
    asked = ["evaluate", "metrics", str(folder / "out"), str(folder / "next")]
    assert told["measured"] == cli.main([*asked, "--json", str(here)]) == 0
    assert json.loads(here.read_text()) == json.loads((folder / "spread.json").read_text())
    assert len(told["photos"]) == len(told["done"]) and all(told["done"])
