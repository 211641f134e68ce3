"""An object from another photo: where it comes in, and what makes another one of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.document.model import (
    Document,
    EditObject,
    LiftedObject,
    Matte,
    Origin,
    Photo,
    Placement,
)
from objectmorpher_core.document.paint import Paint
from objectmorpher_core.document.visitor_edits import KEPT, MOST, arrived, changes_visitor
from objectmorpher_core.pictures.image import Picture
from tests import shapes

EXACT = 1e-6  # px: points are kept in single precision
BALL = shapes.ball(200)


def _lifted(depth: float) -> LiftedObject:
    lifted = shapes.lifted_cloud(BALL, BALL[:20], depth)
    return replace(lifted, origin=Origin("other", replace(shapes.camera(), focal=200.0)))


def _visitor(depth: float = 3.0) -> EditObject:
    matte = Matte(3, 2, np.ones((4, 5), np.float32), np.ones((4, 5, 3), np.float32))
    return EditObject("Ball", mask=np.zeros((120, 160), bool), matte=matte, lifted=_lifted(depth))


def _document(*objects: EditObject) -> Document:
    picture = Picture(np.zeros((120, 160, 3), np.uint8))
    return Document(Photo(picture, shapes.camera(), b"", "made"), objects)


def _seen(document: Document, item: EditObject, placement: Placement) -> tuple[F64, F64]:
    """Its points (N, 3) world, and the corners (2, 2) of what is seen of it, px."""
    assert item.lifted is not None
    motion = placement.matrix(item.lifted, document.photo.camera)
    world = item.lifted.world_points(item.lifted.gaussians.means) @ motion[:3, :3].T + motion[:3, 3]
    pixels = document.photo.camera.project(world)
    return world, np.array([pixels.min(0), pixels.max(0)])


@pytest.mark.parametrize("depth", [0.8, 1.5, 6.0])
@pytest.mark.parametrize("move", [(0.0, 0.0), (150.0, 0.0), (-170.0, 100.0), (10.0, -130.0)])
def test_it_comes_wholly_into_the_picture_and_no_larger_than_it_may(depth, move):
    document, visitor = _document(), _visitor(depth)
    visitor = replace(visitor, placement=Placement(move=move))
    came = arrived(document, visitor, lambda place: _seen(document, visitor, place)[0])
    _, (low, high) = _seen(document, came, came.placement)
    size = np.array(document.photo.size)
    assert (high - low <= MOST * size * 1.05).all(), "but for what four rounds leave"
    assert (low > -2).all() and (high < size + 2).all()
    assert came.mask is not None and came.mask.shape == (120, 160) and not came.mask.any()
    assert came.lifted is not None and came.lifted.origin is not None
    assert came.lifted.origin.home is came.placement


def test_what_fits_comes_as_far_away_and_in_the_direction_of_its_own_photo():
    document, visitor = _document(), _visitor(6.0)
    came = arrived(document, visitor, lambda place: _seen(document, visitor, place)[0])
    world, _ = _seen(document, came, came.placement)
    assert visitor.lifted is not None
    own = visitor.lifted.world_points(visitor.lifted.gaussians.means)
    np.testing.assert_allclose(world, own, atol=EXACT)


def test_a_visitor_changes_with_its_outline_and_its_shape_and_not_with_paint():
    """Each part of it, and each of its matte's, alone."""
    visitor = _visitor()
    before = _document(EditObject("own"), visitor)
    matte = visitor.matte
    assert matte is not None
    more = {
        "mask": np.ones((120, 160), bool), "coverage": np.ones((120, 160), np.uint8),
        "matte": None, "lifted": _lifted(3.0), "prompt": replace(visitor.prompt, is_subject=True),
        "found": np.ones((120, 160), bool), "mixed": np.ones((120, 160), bool),
        "stays_in_front": True,
    }  # fmt: skip
    assert set(more) == set(KEPT)
    others = [replace(visitor, **{name: value}) for name, value in more.items()]
    others += [replace(visitor, matte=replace(matte, **{name: getattr(matte, name) + 1}))
               for name in ("left", "alpha", "foreground")]  # fmt: skip
    for other in others:
        assert changes_visitor(before, _document(EditObject("own"), other)) is visitor
    paint = Paint((), np.zeros((200, 4), np.uint8))
    painted = replace(visitor, matte=replace(matte, paint=paint), placement=Placement(depth=1.0))
    for same in (visitor, painted):
        assert changes_visitor(before, _document(EditObject("another"), same)) is None
    assert changes_visitor(before, _document(visitor)) is None
