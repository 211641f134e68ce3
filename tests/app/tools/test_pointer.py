"""Strokes: begun, continued, ended or aborted as one."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from app.tools.pointer import Button, Hand, Pointer, Stroke

DOWN = Pointer(1, 2, is_down=True)
UP = Pointer(3, 4, is_down=False)


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


def test_an_aborted_stroke_never_ends_and_drops_the_preview() -> None:
    hand, log = Hand(), []
    editor: Any = SimpleNamespace(preview="something")
    hand.press(stroke(log), Button.LEFT)
    hand.move(DOWN)
    assert hand.abort(editor)
    assert editor.preview is None
    assert log == ["begin", (1, 2)]
    assert not hand.abort(editor)


def test_moves_without_a_stroke_are_ignored() -> None:
    Hand().move(DOWN)
