"""A real Ray of two nodes makes triplets; a worker is killed, and each shard is there once."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from ray_apart import HERE, NEEDS_RAY_DATA, claim_gpu, own_folder, told_by

from objectmorpher_research.training.composition.shards import SHARD
from tests import shapes

pytestmark = [pytest.mark.slow, NEEDS_RAY_DATA]

PAIRS = 8


@pytest.fixture
def folder():
    with own_folder() as at:
        yield at


def write_pairs(at: Path) -> Path:
    """Each of two equal pictures, with masks."""
    at.mkdir()
    for k in range(PAIRS):
        inside = shapes.mask(("ellipse", "disc", "star")[k % 3])
        picture, mask = shapes.png(shapes.picture(inside, k)), shapes.mask_png(inside)
        for side in "ab":
            (at / f"thing-{k:02d}-{side}.png").write_bytes(picture)
            (at / f"thing-{k:02d}-{side}.mask.png").write_bytes(mask)
    return at


@pytest.mark.parametrize("installed", [(), ("trellis-image-large",)], ids=["cores", "GPUs"])
def test_a_killed_worker_loses_nothing_and_each_shard_is_there_once(
    folder: Path, installed: tuple[str, ...]
) -> None:
    source, out, notes, workers = (folder / name for name in ("source", "out", "notes", "workers"))
    write_pairs(source)
    for at in (out, notes, workers):
        at.mkdir()
    command = json.dumps(["{python}", str(HERE / "pose_worker.py"), str(notes)])
    (workers / "same-pose.toml").write_text(f'name = "same-pose"\ncommand = {command}\n')
    told = told_by(
        "spread_shards.py", folder, source, out, notes, *installed,
        OBJECTMORPHER_WORKERS=str(workers), OMP_NUM_THREADS="1",
        **(claim_gpu(folder, 12 << 30) if installed else {}),
    )  # fmt: skip
    # Two processes do not fit on such a GPU: each has one to itself, and keeps it.
    assert told["gpus"] == (["0"] if installed else [""])
    least = 2 if installed else 3  # one more beside the killed one: a GPU has place for one
    assert len(told["killed"]) == 1 and told["nodes"] == 2 and told["workers"] >= least
    assert told["asked"] > PAIRS  # what the killed one had begun was begun anew
    assert told["unfinished"] >= 1  # and what it left behind is no shard
    assert sorted(p.name for p in out.glob("*shard-*")) == told["shards"]
    assert len(told["progress"]) == len(told["shards"]) and told["progress"][-1] == 1
    made = [n for s in told["shards"] for n in json.loads((out / s / SHARD).read_text())["made"]]
    assert sorted(made) == [f"thing-{k:02d}" for k in range(PAIRS)] and told["made"] == PAIRS
    for shard in told["shards"]:
        pictures = sorted(p.name for p in (out / shard).glob("*.png"))
        assert len(pictures) == 8  # two triplets
