"""Sessions that an attacker made: bounded in memory and time, whatever their members hold."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from objectmorpher.cli import parser as cli
from tests.fuzz.documents import session_seeds
from tests.fuzz.hostile import ZEROS, Entry, entries_of, mended, readings

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="the memory of a process is measured as on Linux"
)


@pytest.mark.slow
def test_no_attack_takes_much_more_than_the_session_as_it_was() -> None:
    found = list(readings(session_seeds()[0]))
    assert [reading for reading, is_bounded in found if not is_bounded] == []
    assert len(found) > 100
    told = {reading.attack: reading.told for reading, _ in found}
    assert told["a member that nothing names"] == "read"
    assert "unpack from" in told["arrays.npz is zeros"]
    assert "holds too many members" in told["400,000 members"]
    assert "more than 9,600 px" in told["objects/0/mask.png of 240 MP"]


def test_info_of_a_session_with_a_member_too_many(tmp_path: Path, capsys) -> None:
    session = tmp_path / "s.omorph"
    entries = entries_of(session_seeds()[0])
    session.write_bytes(mended([*entries, Entry("more.bin", b"", ZEROS)]))
    assert cli.main(["info", str(session)]) == 0
    assert "- Cat: " in capsys.readouterr().out
