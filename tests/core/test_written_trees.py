"""Values as JSON and back, `session/tree.py`: which arrays become pictures, and which are taken."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace

import numpy as np
import pytest

from objectmorpher_core.base.arrays import U8, Mask, Pixels
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import LiftedObject, LiftSettings, Origin
from objectmorpher_core.session.tree import ArrayError, TreeReader, TreeWriter, read_npy
from tests import shapes

RNG = np.random.default_rng(0)
CAMERA = Camera(120.5, 80.0, 60.25, 160, 120)
KINDS = {  # of array: its type in a dataclass, an array of it, whether it becomes a picture
    "mask": (Mask, RNG.random((7, 9)) < 0.5, True),
    "RGB": (Pixels, RNG.integers(0, 256, (5, 6, 3)).astype(np.uint8), True),
    "RGB of 16 bits": (Pixels, RNG.integers(0, 65536, (5, 6, 3)).astype(np.uint16), True),
    "RGBA": (U8, RNG.integers(0, 256, (4, 3, 4)).astype(np.uint8), True),
    "list of truths": (np.ndarray, np.array([True, False]), False),
    "bytes without channels": (np.ndarray, RNG.integers(0, 256, (4, 3)).astype(np.uint8), False),
    "two channels": (np.ndarray, RNG.integers(0, 256, (4, 3, 2)).astype(np.uint8), False),
    "numbers": (np.ndarray, RNG.random((4, 3, 3)), False),
    "nothing": (np.ndarray, np.zeros((0, 5), bool), False),
}


@pytest.mark.parametrize("kind", KINDS)
def test_an_array_comes_back_out_of_a_picture_or_as_it_is(kind):
    hint, array, is_picture = KINDS[kind]
    writer = TreeWriter()
    tree = writer.tree(array, "one/two")
    assert tree == ({"png": "one/two.png"} if is_picture else {"array": "one/two"})
    assert list(writer.pictures) == ["one/two.png"] * is_picture
    assert list(writer.arrays) == ["one/two"] * (not is_picture)
    back = TreeReader(writer.pictures, writer.arrays).value(hint, tree, "it")
    assert back.dtype == array.dtype
    np.testing.assert_array_equal(back, array)


def test_an_array_has_eight_dimensions_at_most():
    for dimensions in (1, 8, 9):
        out = io.BytesIO()
        array = np.arange(2.0).reshape((2,) + (1,) * (dimensions - 1))
        np.lib.format.write_array(out, array)
        if dimensions <= 8:
            np.testing.assert_array_equal(read_npy(out.getvalue()), array)
        else:
            with pytest.raises(ArrayError, match="no array"):
                read_npy(out.getvalue())


@dataclass
class Both:
    shape: LiftSettings
    lifted: LiftedObject


def test_what_older_sessions_do_not_say_is_as_it_was_then():
    """Depth networks told the relief, and objects were like the kinds that they were said to be."""
    ball = shapes.ball(20)
    new = replace(shapes.lifted_cloud(ball, ball[:8]), origin=Origin("other", CAMERA, (0.1, 0, 1)))
    writer = TreeWriter()
    tree = writer.tree(Both(LiftSettings(uses_depth=False), replace(new, likeness=0.5)), "")
    reader = TreeReader(writer.pictures, writer.arrays)
    same = reader.value(Both, tree, "both")
    assert not same.shape.uses_depth
    assert (same.lifted.likeness, same.lifted.origin) == (0.5, new.origin)
    tree["shape"] = {}
    del tree["lifted"]["likeness"], tree["lifted"]["origin"]
    old = reader.value(Both, tree, "both")
    assert old.shape.uses_depth
    assert (old.lifted.likeness, old.lifted.origin) == (1.0, None)
