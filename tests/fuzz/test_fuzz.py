"""Damaged files: a sound value or one sentence, in bounded time and memory. Never anything else."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.fuzz.__main__ import fuzz
from tests.fuzz.damage import Damage
from tests.fuzz.readers import by_name, readers

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


def test_the_same_seed_gives_the_same_file() -> None:
    for name in ("ply", "script", "photo"):
        pool = by_name(name).seeds()
        first, again = (Damage(f"1:{name}:5", pool).file() for _ in range(2))
        assert first == again


@pytest.mark.parametrize("path", sorted(FOUND.iterdir()), ids=lambda path: path.name)
def test_kept_files_are_small_and_have_a_reader(path: Path) -> None:
    assert path.stat().st_size < 20_000
    assert by_name(path.name.rpartition("-")[0])
