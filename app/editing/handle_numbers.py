"""The current handle in numbers, for fields that are dragged and typed into."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core import edits
from objectmorpher_core.rotations import turn_about

from ..texts import t

if TYPE_CHECKING:
    from ..editor import Editor

SIGHT = np.array([0.0, 0.0, 1.0])  # world, into the picture


@dataclass(frozen=True)
class Numbers:
    """One handle."""

    x: float  # image px
    y: float
    depth: float  # object diameters, farther away than at rest
    turn: float  # degrees about the line of sight, clockwise
    softness: float
    is_pin: bool
    is_free: bool  # it turns as the object does
    rest: tuple[float, float]  # image px, where its point was


class HandleNumbers:
    """Of the handle that was selected last. A change is previewed; `finish` makes it a step."""

    def __init__(self, editor: Editor) -> None:
        self._editor = editor

    def read(self) -> Numbers | None:
        editor = self._editor
        h = editor.posing.handle
        if h is None or editor.object is None or editor.document is None:
            return None
        handle, spot = editor.object.handles[h], editor.posing.spot(h)
        rest = editor.derived.spot(editor.document, editor.current, handle.point)
        return Numbers(
            float(spot.xy[0]), float(spot.xy[1]), (spot.depth - rest.depth) / spot.diameter,
            np.degrees(self._roll(h)), handle.softness, handle.is_pin, handle.turn is None,
            (float(rest.xy[0]), float(rest.xy[1])),
        )  # fmt: skip

    def _roll(self, h: int) -> float:
        """Radians about the line of sight."""
        editor = self._editor
        assert editor.document is not None
        turn = editor.derived.facts.turn_of(editor.document, editor.current)
        return turn_about(turn @ editor.posing.turn_of(h), SIGHT)

    def move(self, x: float, y: float, depth: float) -> None:
        """Previews the handle at image px, so many diameters farther than at rest."""
        editor = self._editor
        h = editor.posing.handle
        assert h is not None and editor.object is not None and editor.document is not None
        point = editor.object.handles[h].point
        rest = editor.derived.spot(editor.document, editor.current, point)
        there = rest.moved(np.zeros(2), depth)
        editor.posing.drag(h, replace(there, xy=np.array([x, y])))

    def turn(self, degrees: float) -> None:
        """Previews the handle turned so far about the line of sight."""
        posing = self._editor.posing
        h = posing.handle
        assert h is not None
        more = np.radians(degrees) - self._roll(h)
        posing.turn(h, posing.turn_of(h), more * SIGHT)

    def soften(self, softness: float) -> None:
        """Previews the handle giving way from now on: 0 = not at all."""
        editor = self._editor
        h = editor.posing.handle
        assert h is not None and editor.document is not None
        editor.posing.hold(edits.soften_handle(editor.document, editor.current, h, softness))

    def set_free(self, is_free: bool) -> None:
        """Whether it turns as the object does, or stays as it is turned now; one step."""
        editor = self._editor
        h = editor.posing.handle
        assert h is not None and editor.document is not None
        turn = None if is_free else editor.posing.turn_of(h)
        editor.posing.hold(edits.turn_handle(editor.document, editor.current, h, turn))
        editor.posing.finish(t("Free handle's turn") if is_free else t("Hold handle's turn"))

    def set_pin(self, is_pin: bool) -> None:
        """A pin holds, a handle is dragged; one step."""
        editor = self._editor
        h = editor.posing.handle
        assert h is not None and editor.document is not None
        editor.posing.hold(edits.set_pin(editor.document, editor.current, h, is_pin))
        editor.posing.finish(t("Make it a pin") if is_pin else t("Make it a handle"))
