"""Strokes: begun, continued, ended or aborted as one."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from objectmorpher.tools.pointer import Button, Hand, Pointer, Stroke, draw_box

DOWN = Pointer(1, 2, is_down=True)
UP = Pointer(3, 4, is_down=False)


@pytest.fixture
def editor() -> Any:
    return SimpleNamespace(preview=None, rubber=None, view=SimpleNamespace(scale=1.0))


def stroke(log: list[object]) -> Stroke:
    log.append("begin")
    while (pointer := (yield)).is_down:
        log.append((pointer.x, pointer.y))
    log.append("end")


def test_a_stroke_is_one_paragraph() -> None:
    hand, log = Hand(), []
    hand.press(stroke(log), Button.LEFT)
    assert hand.is_busy
    hand.move(DOWN)
    hand.move(UP)
    assert log == ["begin", (1, 2), "end"]
    assert not hand.is_busy


def test_an_aborted_stroke_never_ends_and_drops_the_preview(editor: Any) -> None:
    hand, log = Hand(), []
    editor.preview = "something"
    hand.press(stroke(log), Button.LEFT)
    hand.move(DOWN)
    assert hand.abort(editor)
    assert editor.preview is None
    assert log == ["begin", (1, 2)]
    assert not hand.abort(editor)


def test_moves_without_a_stroke_are_ignored() -> None:
    hand = Hand()
    hand.move(DOWN)
    assert not hand.is_busy


def drawn_box(editor: Any, hand: Hand) -> list[Pointer | None]:
    """Begins a box at (0, 0); where it ends is put into the list."""
    ends: list[Pointer | None] = []

    def draw() -> Stroke:
        ends.append((yield from draw_box(editor, Pointer(0, 0))))

    hand.press(draw(), Button.LEFT)
    return ends


def test_a_box_is_shown_while_it_is_drawn(editor: Any) -> None:
    hand = Hand()
    ends = drawn_box(editor, hand)
    hand.move(Pointer(30, 40, is_down=True))
    assert editor.rubber == (0, 0, 30, 40)
    hand.move(up := Pointer(31, 40))
    assert editor.rubber is None
    assert ends == [up]


def test_a_press_that_does_not_move_draws_no_box(editor: Any) -> None:
    hand = Hand()
    ends = drawn_box(editor, hand)
    hand.move(Pointer(1, 2, is_down=True))
    assert editor.rubber is None
    hand.move(Pointer(1, 2))
    assert ends == [None]


def test_an_aborted_box_is_not_shown_any_more(editor: Any) -> None:
    hand = Hand()
    ends = drawn_box(editor, hand)
    hand.move(Pointer(30, 40, is_down=True))
    hand.abort(editor)
    assert editor.rubber is None
    assert ends == []
