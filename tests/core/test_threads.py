"""Loops in pieces: every index once, in no more pieces than asked for."""

from __future__ import annotations

import pytest

from objectmorpher_core.base.threads import core_count, in_threads
from tests.tree import over


@over("count", [0, 1, 2, 7, 1000])
@over("parts", [1, 3])
def test_every_index_is_visited_once(count, parts):
    pieces: list[tuple[int, int]] = []
    in_threads(lambda first, last: pieces.append((first, last)), count, parts)
    assert len(pieces) <= core_count() * parts
    assert sorted(i for first, last in pieces for i in range(first, last)) == list(range(count))


def test_no_piece_is_shorter_than_the_least():
    pieces: list[int] = []
    in_threads(lambda first, last: pieces.append(last - first), 1000, 8, least=400)
    assert min(pieces) >= 400


def test_an_error_in_a_piece_is_raised():
    def fail(first: int, last: int) -> None:
        raise ArithmeticError(first)

    with pytest.raises(ArithmeticError):
        in_threads(fail, 1000)
