"""The pointer as tools see it, and strokes: a drag is a generator, so it reads as a paragraph.

    def press(self, editor, pointer):
        ...                                  # the button went down
        while (pointer := (yield)).is_down:
            editor.preview = ...             # it moved, or the wheel turned
        editor.commit("Move handle")         # it went up

Aborting a stroke (Esc, lost focus) closes the generator before its end and drops the preview.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from objectmorpher_core.document.model import Document

from ..editor.view import ViewState

CLICK_SLACK = 4.0  # points; a press that moves less is a click
TURN_SPEED = 0.4  # degrees per point that the pointer moves
SNAP = 15.0  # degrees, with Shift


class Button(Enum):
    """Mouse buttons."""

    LEFT = 0
    RIGHT = 1
    MIDDLE = 2


class PointerShape(Enum):
    """Shapes of the pointer, which announce the effect of a press."""

    ARROW = "arrow"
    CROSS = "cross"
    HAND = "hand"
    MOVE = "move"
    TURN = "turn"
    SIZE = "size"
    SPLIT = "split"


@dataclass(frozen=True)
class Pointer:
    """The pointer's place and the keys held with it."""

    x: float  # canvas px
    y: float
    button: Button | None = None  # that was pressed
    is_down: bool = False
    shift: bool = False
    alt: bool = False
    ctrl: bool = False
    space: bool = False
    clicks: int = 1  # in quick succession, of which this press is the last
    wheel: float = 0.0  # notches since the last event, positive = away from the user

    @property
    def xy(self) -> np.ndarray:
        return np.array([self.x, self.y])  # (2,) canvas px


Stroke = Generator[None, Pointer, None]


class Previewing(Protocol):
    """What a stroke shows while it lasts: the editor's state."""

    view: ViewState
    rubber: tuple[float, float, float, float] | None  # box being drawn, canvas px

    @property
    def preview(self) -> Document | None:
        """The document of the stroke."""

    @preview.setter
    def preview(self, preview: Document | None) -> None: ...


class Hand:
    """The stroke in progress."""

    def __init__(self) -> None:
        self._stroke: Stroke | None = None
        self.button: Button | None = None

    @property
    def is_busy(self) -> bool:
        return self._stroke is not None

    def press(self, stroke: Stroke, button: Button | None) -> None:
        """Begins a stroke, up to its first `yield`."""
        assert self._stroke is None, "one stroke at a time"
        self._stroke, self.button = stroke, button
        self._advance(None)

    def move(self, pointer: Pointer) -> None:
        """The pointer moved, the wheel turned, or (`not pointer.is_down`) the button went up."""
        self._advance(pointer)

    def abort(self, editor: Previewing) -> bool:
        """Ends the stroke as if it had never begun. Whether there was one."""
        if self._stroke is None:
            return False
        self._stroke.close()
        self._stroke = None
        editor.preview = None
        return True

    def _advance(self, pointer: Pointer | None) -> None:
        stroke = self._stroke
        if stroke is None:
            return
        try:
            if pointer is None:
                next(stroke)
            else:
                stroke.send(pointer)
                assert pointer.is_down, "a stroke ends when the button goes up"
        except StopIteration:
            self._stroke = None


def has_moved(editor: Previewing, start: Pointer, now: Pointer) -> bool:
    """Whether a press has become a drag."""
    return float(np.hypot(*(now.xy - start.xy))) > CLICK_SLACK * editor.view.scale


def one_axis(delta: np.ndarray, pointer: Pointer) -> np.ndarray:
    """(2,) without its smaller part while Shift is held."""
    if not pointer.shift:
        return delta
    is_larger = np.arange(2) != np.abs(delta).argmin()
    return delta * is_larger


def ignore() -> Stroke:
    """Do nothing until the button goes up."""
    while (yield).is_down:
        pass


def draw_box(editor: Previewing, start: Pointer) -> Generator[None, Pointer, Pointer | None]:
    """Shows the box that is drawn; where it ended, or None where the press was a click."""
    is_box = False
    try:
        while (pointer := (yield)).is_down:
            is_box = is_box or has_moved(editor, start, pointer)
            if is_box:
                editor.rubber = (start.x, start.y, pointer.x, pointer.y)
    finally:
        editor.rubber = None
    return pointer if is_box else None
