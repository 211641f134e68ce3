"""A stranger's values in our sentences."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from objectmorpher_core.base.quoting import LONGEST, named, shown

ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(ANYTHING)
def test_it_is_one_line_that_can_be_read(value: Any) -> None:
    text = shown(value)
    assert 0 < len(text) <= LONGEST
    assert text.isprintable()


@given(st.text())
def test_a_name_that_is_short_and_printable_stays(name: str) -> None:
    text = named(name)
    assert len(text) <= LONGEST
    if name.isprintable() and len(name) <= LONGEST:
        assert text == name


def test_what_cannot_be_written_is_left_out() -> None:
    deep: Any = 0
    for _ in range(100_000):
        deep = [deep]
    assert shown(deep) == shown(10**5000) == "..."


@pytest.mark.parametrize("letter", ["\n", "\ud800", "‮", "\0"])
def test_letters_that_disturb_a_line_are_replaced(letter: str) -> None:
    assert named(f"a{letter}b") == "a?b"
