"""A long session neither grows nor becomes slower; and one that does is found out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("moderngl")

from tests import photos
from tests.soak.judging import chart, problems, slower
from tests.soak.session import Hundred, Sample, Session

EDITS, EVERY = 240, 20
MOST = 1.6  # x the first hundred edits: other tests run beside it on the same cores


def level(count: int) -> list[Sample]:
    return [
        Sample(k, 1.0, 900, 400, 5.0, 30, 8, 2, 12, 40, 9, 4, 17.0) for k in range(1, count + 1)
    ]


def test_what_stays_as_it_is_is_no_problem() -> None:
    assert problems(level(40)) == []


@pytest.mark.parametrize("name", ["worker", "files", "threads", "children"])
def test_what_grows_is_told(name: str) -> None:
    grown = [replace(s, **{name: getattr(s, name) * (1 + k / 20)}) for k, s in enumerate(level(40))]
    (problem,) = problems(grown)
    assert problem.startswith(name)


def test_what_becomes_slower_is_told() -> None:
    even = [Hundred(k, 2.0 + 0.3 * (k % 2), 3.0, 50.0, 9.0, 600.0, 30, 8) for k in range(10)]
    assert slower(even) == []
    slowing = [replace(h, drag=50.0 * (1 + k / 20)) for k, h in enumerate(even)]
    (problem,) = slower(slowing)
    assert problem.startswith("drag")


@pytest.mark.parametrize("name", ["memory", "textures", "buffers"])
def test_what_the_same_edits_leave_behind_is_reported(name: str) -> None:
    hundreds = [Hundred(k, 2.0, 3.0, 50.0, 9.0, 600.0, 30, 8) for k in range(4)]
    hundreds[-1] = replace(hundreds[-1], **{name: 1.06 * getattr(hundreds[-1], name)})
    (problem,) = slower(hundreds)
    assert problem.startswith(name)


def test_the_picture_holds_every_line() -> None:
    told = chart(level(40))
    assert told.count('fill="none"') == 7 and told.endswith("</svg>\n")


@pytest.mark.slow
def test_a_day_of_edits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OBJECTMORPHER_DATA", str(tmp_path / "data"))
    try:
        session = Session(
            photos.saved("astronaut", tmp_path), photos.outlined("astronaut"), tmp_path
        )
    except RuntimeError as error:
        pytest.skip(str(error))
    try:
        session.hundred()  # fills the caches
        hundreds = [session.hundred(), session.hundred()]
        samples = list(session.samples(EDITS, EVERY))
        hundreds += [session.hundred(), session.hundred()]
    finally:
        session.close()
    assert len(samples) == EDITS // EVERY
    assert problems(samples) == []
    assert slower(hundreds, MOST) == []
