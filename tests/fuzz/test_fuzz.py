"""Damaged files: a sound value or one sentence, in bounded time and memory. Never anything else."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz.__main__ import fuzz
from tests.fuzz.damage import Damage
from tests.fuzz.readers import by_name, readers
from tests.tree import PYTHONPATH

ROOT = Path(__file__).parents[2]

FOUND = Path(__file__).parent / "found"  # files that once did worse
SLOW = ("drawn-session",)  # what is drawn has to be compiled first
EACH = 3  # files of each reader
MANY = 15  # the same files each time: new ones are for `make fuzz`

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="the limits on a process are Linux's"
)


def names() -> list[str]:
    return [reader.name for reader in readers() if reader.name not in SLOW]


def test_a_few_damaged_files_and_all_that_once_did_harm() -> None:
    tally = fuzz(names(), "fixed", EACH, 300.0, keep=None, kept=FOUND)
    assert list(tally.found) == []
    assert all(tally.files[name] == EACH for name in names())
    assert tally.refused.total() > len(names()) / 2  # else nothing was damaged


@pytest.mark.slow
def test_many_damaged_files_of_every_reader() -> None:
    everything = [reader.name for reader in readers()]
    tally = fuzz(everything, "slow", MANY, 1800.0, keep=None)
    assert list(tally.found) == []


WHOLE = """
import sys
from pathlib import Path
from tests.fuzz.child import MEMORY, bound, failure
from tests.fuzz.readers import by_name
names = sys.argv[2:]
pools = {name: by_name(name).seeds() for name in names}
before = {n: [failure(by_name(n), d, Path(sys.argv[1])) for d in pools[n]] for n in names}
bound(MEMORY)
for name in names:
    for k, data in enumerate(pools[name]):
        after = failure(by_name(name), data, Path(sys.argv[1]))
        print(name, k, "same" if after == before[name][k] else after)
        print(name, "read" if after == "" else "refused")
"""


@pytest.mark.slow
def test_whole_pictures_are_read_within_the_limits(tmp_path: Path) -> None:
    """Or the damaged ones would be refused for want of memory, and nothing of them tried."""
    names = ("photo", "jxl", "psd")
    done = subprocess.run(
        [sys.executable, "-c", WHOLE, tmp_path, *names], capture_output=True, text=True, cwd=ROOT,
        env=os.environ | {"PYTHONPATH": PYTHONPATH},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    said = done.stdout.splitlines()
    assert [line for line in said if len(line.split()) > 2 and not line.endswith("same")] == []
    assert {"photo read", "jxl read", "psd refused"} <= set(said)
    assert not {"photo refused", "jxl refused", "psd read"} & set(said)


def test_the_same_seed_gives_the_same_file() -> None:
    for name in ("ply", "script", "photo"):
        pool = by_name(name).seeds()
        first, again = (Damage(f"1:{name}:5", pool).file() for _ in range(2))
        assert first == again


@pytest.mark.parametrize("path", sorted(FOUND.iterdir()), ids=lambda path: path.name)
def test_kept_files_are_small_and_have_a_reader(path: Path) -> None:
    assert path.stat().st_size < 20_000
    assert by_name(path.name.rpartition("-")[0])
