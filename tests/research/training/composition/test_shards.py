"""A shard is there whole or not at all, once, and a folder is gone on with only as it was begun.

What of its triplets is held out is not trained on in any other way either.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import time
from dataclasses import replace
from itertools import pairwise

import made_up
import numpy as np
import pytest

from objectmorpher_core.base.progress import Cancelled
from objectmorpher_research.training.composition import TrainingError
from objectmorpher_research.training.composition.lora_plan import LoraPlan, parted
from objectmorpher_research.training.composition.shards import (
    SHARD,
    UNFINISHED,
    begin,
    finish,
    left_over,
    shards_of,
    write_shard,
)
from objectmorpher_research.training.composition.triplet import TripletPlan
from objectmorpher_research.training.composition.triplet_folder import Stored, triplets_in
from tests.tree import quick

PARTS = shards_of(made_up.pairs(7), 3)
HOW = TripletPlan()


def begun(out):
    begin(out, PARTS, HOW)
    return out


def test_triplets_come_back_as_they_were_made(tmp_path):
    out = made_up.write_triplets(tmp_path / "out", 7, 3)
    stored = triplets_in(out)
    assert [t.name for t in stored] == [f"made-{k:03d}" for k in (0, 1, 3, 4, 6)]
    for one in stored:
        expected = made_up.triplet(int(one.name[-3:]))
        for found, meant in zip(one.read(), (expected.b, expected.coarse, expected.a), strict=True):
            assert np.array_equal(found, meant)
    assert len({one.content for one in stored}) == 5
    told = json.loads((out / "shard-00000" / "made-002.json").read_text())
    assert told["rejected"] == "every third is rejected" and told["iou"] == 0.5
    found = finish(out, shards_of(made_up.pairs(7), 3))
    assert (found["made"], found["rejected"]) == (5, 2)
    assert found["reasons"] == {"every third is rejected": 2}


def stored(folder, photographs):
    """Triplets of photographs (B, A), which are bytes."""
    found = []
    for k, (b, a) in enumerate(photographs):
        found.append(Stored(f"t{k}", folder))
        for picture, data in (("b", b), ("coarse", b"%d" % k), ("a", a)):
            found[-1].file(picture).write_bytes(data)
    return tuple(found)


@pytest.mark.parametrize("seed", quick(range(12), 4))
def test_no_photograph_of_what_is_held_out_is_trained_on(tmp_path, seed):
    rng = np.random.default_rng(seed)
    taken = [rng.bytes(9) for _ in range(40)]
    two = list(zip(taken[::2], taken[1::2], strict=True))  # pictures of 20 things
    frames = list(pairwise(taken))  # of a video
    for pairs, loses in ((two, False), (frames, True)):
        both_ways = [way for b, a in pairs for way in ((b, a), (a, b))]
        triplets = stored(tmp_path, [both_ways[k] for k in rng.permutation(len(both_ways))])
        for held_out in (0, 1, 4, 6):
            left, aside = parted(triplets, LoraPlan(held_out=held_out))
            assert len(aside) == held_out and not set(left) & set(aside)
            shown = {one.file(side).read_bytes() for one in aside for side in "ba"}
            assert not shown & {one.file(side).read_bytes() for one in left for side in "ba"}
            assert len(shown) == 2 * -(-held_out // 2) or loses
            if held_out % 2 == 0 and not loses:
                assert len(left) + len(aside) == len(triplets), "whole pairs"
            again = parted(triplets[::-1], LoraPlan(held_out=held_out))
            assert {one.name for one in again[1]} == {one.name for one in aside}


def test_a_shard_that_does_not_say_what_it_holds_is_refused(tmp_path):
    out = made_up.write_triplets(tmp_path / "out", 7, 3)
    (out / "shard-00001" / "shard.json").write_text("{}")
    with pytest.raises(TrainingError, match="does not say which triplets"):
        triplets_in(out)


def test_what_is_there_is_not_made_again_and_what_is_not_is(tmp_path):
    out = begun(tmp_path / "out")
    assert write_shard(out, PARTS[1], HOW, make=made_up.make)
    assert [s.number for s in left_over(out, PARTS)] == [0, 2]
    assert not write_shard(out, PARTS[1], HOW, make=made_up.make)
    with pytest.raises(TrainingError, match="2 shards are not made"):
        finish(out, PARTS)
    begin(out, PARTS, HOW)  # as it was begun
    for other, words in ((replace(HOW, seed=1), "in another way"),):
        with pytest.raises(TrainingError, match=words):
            begin(out, PARTS, other)
    with pytest.raises(TrainingError, match="begun of other pairs"):
        begin(out, shards_of(made_up.pairs(8), 3), HOW)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "file").write_text("mine")
    with pytest.raises(TrainingError, match="is not empty"):
        begin(tmp_path / "other", PARTS, HOW)


def test_whoever_comes_second_leaves_the_first_ones(tmp_path):
    out = begun(tmp_path / "out")

    def meanwhile(pair, how, progress):
        made = made_up.make(pair, how, progress)
        if pair.item == "1":
            assert write_shard(out, PARTS[0], HOW, make=made_up.make)
        return made

    assert not write_shard(out, PARTS[0], HOW, make=meanwhile)
    assert sorted(p.name for p in out.iterdir()) == ["plan.json", "shard-00000"]


def test_stopped_within_a_shard_it_leaves_nothing(tmp_path):
    out = begun(tmp_path / "out")

    def stop(fraction, note):
        if "pair 2" in note:
            raise Cancelled

    with pytest.raises(Cancelled):
        write_shard(out, PARTS[0], HOW, stop, made_up.make)
    assert [p.name for p in out.iterdir()] == ["plan.json"]


def slow(pair, how, progress):
    time.sleep(0.05)
    return made_up.make(pair, how, progress)


def work(out) -> None:
    for part in PARTS:
        write_shard(out, part, HOW, make=slow)


def test_killed_at_any_time_each_shard_is_there_once_in_the_end(tmp_path):
    out = begun(tmp_path / "out")
    context = multiprocessing.get_context("fork")
    for seconds in (0.05, 0.12, 0.2, 0.3):
        process = context.Process(target=work, args=(out,))
        process.start()
        time.sleep(seconds)
        os.kill(process.pid, signal.SIGKILL)
        process.join()
        for shard in out.glob("shard-*"):  # what is there is whole
            made = json.loads((shard / SHARD).read_text())["made"]
            assert len(list(shard.glob("*.png"))) == 4 * len(made)
    left_behind = list(out.glob(f"{UNFINISHED}*"))
    assert left_behind
    work(out)
    assert finish(out, PARTS)["made"] == 5
    assert sorted(p.name for p in out.iterdir()) == ["plan.json", *(s.name for s in PARTS)]
