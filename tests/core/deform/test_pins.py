"""A pin holds what is around it: about a point of its front alone a body would turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.deform.deformer import Deformer
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Handle, Pose
from objectmorpher_core.document.pose import turn_at
from objectmorpher_core.document.settings import DeformSettings
from tests import shapes

BAR = shapes.capsule()
PULLED = np.array([0.0, -0.1, 0.15])  # the right end, away from the line of the pins
HELD = 0.02  # rad, and object units
ROLLED = 0.1  # rad: what a bar does that is held at points


@pytest.fixture(scope="module")
def document() -> Document:
    """A bar along x."""
    plain = shapes.scene("ellipse", 300).document()
    lifted = shapes.lifted_surface(BAR.points, BAR.normals)
    return plain.with_object(0, replace(plain.objects[0], lifted=lifted, handles=(), pose=None))


def on_top(x: float) -> F64:
    """The bar's surface point above (x, 0, 0)."""
    return BAR.points[((BAR.points - (x, 0.2, 0.0)) ** 2).sum(1).argmin()]


def pulled(document: Document, is_pin: bool, **settings) -> tuple[Document, F64]:
    """Held at two points of one line, pulled at the end; how far it is turned there, rad."""
    for x in (-0.4, 0.0):
        document = edits.add_handle(document, 0, on_top(x), is_pin=is_pin)
    document = edits.add_handle(document, 0, on_top(0.45), on_top(0.45) + PULLED)
    item = document.objects[0]
    assert item.lifted is not None
    pose = Deformer(item.lifted, DeformSettings(**settings)).solve(item.handles).pose
    return edits.set_pose(document, 0, pose), _turns(pose, item.handles)


def _turns(pose: Pose, handles: tuple[Handle, ...]) -> F64:
    """How far the first two are turned, rad."""
    vectors = np.array([turn_at(pose, h.control_point) for h in handles[:2]])
    return np.sqrt((vectors**2).sum(1))


def test_a_body_does_not_roll_about_its_pins(document):
    _, at_pins = pulled(document, is_pin=True)
    _, at_points = pulled(document, is_pin=False)
    assert at_pins.max() < HELD
    assert at_points.min() > ROLLED


def test_a_pin_can_be_let_turn(document):
    held, _ = pulled(document, is_pin=True)
    for h in range(2):
        held = edits.turn_handle(held, 0, h, None)
    item = held.objects[0]
    assert item.lifted is not None
    pose = Deformer(item.lifted, DeformSettings()).solve(item.handles).pose
    assert _turns(pose, item.handles).min() > ROLLED


def test_the_papers_pins_hold_a_place_alone(document):
    _, pins = pulled(document, is_pin=True, is_faithful=True)
    _, points = pulled(document, is_pin=False, is_faithful=True)
    assert np.array_equal(pins, points)


def test_a_pin_set_on_a_posed_body_holds_its_turn(document):
    posed, _ = pulled(document, is_pin=False)
    h = 0
    pinned = edits.set_pin(posed, 0, h, True).objects[0].handles[h]
    assert pinned.turn is not None
    assert np.array_equal(pinned.turn, turn_at(posed.objects[0].pose, pinned.control_point))
    new = edits.add_handle(posed, 0, on_top(-0.2), is_pin=True).objects[0].handles[-1]
    assert new.turn is not None and np.linalg.norm(new.turn) > ROLLED


def test_a_pin_that_is_dragged_turns_freely(document):
    pinned = edits.add_handle(document, 0, on_top(0.0), is_pin=True)
    assert pinned.objects[0].handles[0].turn is not None
    assert edits.set_pin(pinned, 0, 0, False).objects[0].handles[0].turn is None
    dragged = edits.add_handle(document, 0, on_top(0.0))
    turned = edits.turn_handle(dragged, 0, 0, np.array([0.0, 0.0, 1.0]))
    kept = edits.set_pin(turned, 0, 0, True).objects[0].handles[0]
    assert kept.turn is not None and np.array_equal(kept.turn, (0.0, 0.0, 1.0))
