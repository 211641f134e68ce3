"""Taking the whole object: what a press does where, and that angles stay in range."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.derived import ObjectFrame
from app.feedback import Hover
from app.tools.place_tool import PlaceTool, gizmo, wrapped
from app.tools.pointer import Button, Hand, Pointer
from app.view import View
from objectmorpher_core.document import Placement


class FakeObject:
    """As much of the editor as the tool sees: a square object, 100 px, around (200, 150)."""

    def __init__(self) -> None:
        self.view = View(width=400, height=300)
        self.hover, self.hand = Hover(), Hand()
        self.placement = Placement()
        self.preview: Placement | None = None
        self.label = ""

    def object_frame(self) -> ObjectFrame:
        centre = np.array([200.0, 150.0]) + self.placement.move
        offsets = np.array([[-50, -50], [50, -50], [50, 50], [-50, 50]])
        return ObjectFrame(centre + offsets, centre, 90.0)

    def surface_at(self, xy: np.ndarray) -> object | None:
        return "surface" if np.abs(xy - (200, 150)).max() < 50 else None

    def place(self, placement: Placement) -> None:
        self.preview = placement

    def commit(self, label: str) -> None:
        self.label = label


@pytest.fixture
def editor() -> Any:
    return FakeObject()


def stroke(editor: Any, start: tuple[float, float], end: tuple[float, float], **held: bool) -> Any:
    pointer = Pointer(*start, button=Button.LEFT, is_down=True)
    editor.hand.press(PlaceTool().press(editor, pointer), Button.LEFT)
    editor.hand.move(Pointer(*end, is_down=True, **held))
    editor.hand.move(Pointer(*end, is_down=False))
    return editor.preview


def test_dragging_the_object_moves_it_by_the_same_px(editor: Any) -> None:
    assert stroke(editor, (200, 150), (230, 140)) == Placement(move=(30.0, -10.0))
    assert editor.label == "Move object"


def test_shift_keeps_one_axis(editor: Any) -> None:
    assert stroke(editor, (200, 150), (230, 140), shift=True).move == (30.0, 0.0)


def test_dragging_a_corner_outwards_scales_up(editor: Any) -> None:
    placement = stroke(editor, (250, 200), (300, 250))
    assert placement.scale == pytest.approx(2.0)


def test_dragging_along_the_ring_rolls(editor: Any) -> None:
    placement = stroke(editor, (290, 150), (200, 240))
    assert placement.turn == pytest.approx((0, 0, 90))


def test_dragging_beside_the_object_to_the_right_turns_its_front_to_the_right(editor: Any) -> None:
    yaw, pitch, roll = stroke(editor, (20, 20), (70, 20)).turn
    assert yaw < 0  # DESIGN section 6: positive yaw turns the front to the left
    assert pitch == roll == 0


def test_a_click_changes_nothing(editor: Any) -> None:
    assert stroke(editor, (200, 150), (201, 150)) is None
    assert editor.label == ""


def test_the_gizmo_stays_on_the_canvas_at_any_zoom(editor: Any) -> None:
    editor.view = replace(editor.view, zoom=20.0)
    shown = gizmo(editor)
    assert shown is not None
    assert (shown.corners >= 0).all()
    assert (shown.corners <= (400, 300)).all()
    assert shown.radius < 150


@pytest.mark.parametrize(("angle", "same"), [(190, -170), (-180, 180), (540, 180), (0, 0)])
def test_angles_are_wrapped(angle: float, same: float) -> None:
    assert wrapped(angle) == pytest.approx(same)
