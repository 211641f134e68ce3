"""The file of handles: it says where they are, and they go where it has them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from objectmorpher_core.document.edits import set_placement
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.scripting.handle_file import encode_handles, with_handles
from objectmorpher_core.scripting.options import ScriptError
from tests import shapes


def document(turn: tuple[float, float, float] = (0, 0, 0)) -> Document:
    found = shapes.scene("ellipse").document()
    lifted = found.objects[0].lifted
    assert lifted is not None
    handles = tuple(shapes.handle(lifted, k, np.array([0.05, 0.0, 0.02])) for k in (3, 40, 90))
    item = replace(found.objects[0], handles=(replace(handles[0], is_pin=True), *handles[1:]))
    return set_placement(replace(found, objects=(item,)), 0, Placement(turn=turn, scale=1.3))


@settings(deadline=None, max_examples=6)
@given(st.tuples(*[st.floats(-60, 60)] * 3), st.tuples(*[st.floats(-0.05, 0.05)] * 3))
def test_a_handle_goes_where_the_file_has_it_and_the_others_stay(
    turn: tuple[float, float, float], shift: tuple[float, float, float]
) -> None:
    before = document(turn)
    told = json.loads(encode_handles(before))
    assert with_handles(before, json.dumps(told).encode()) is before  # nothing was moved
    handles = told["objects"][0]["handles"]
    handles[2]["place"] = [a + b for a, b in zip(handles[2]["place"], shift, strict=True)]
    after = with_handles(before, json.dumps(told).encode())
    again = json.loads(encode_handles(after))["objects"][0]["handles"]
    np.testing.assert_allclose(
        [h["place"] for h in again], [h["place"] for h in handles], atol=1e-9
    )
    item = after.objects[0]
    if np.linalg.norm(shift) > 1e-4:
        assert item.pose is not None
        nodes = [handle.control_point for handle in item.handles]
        assert len(set(nodes)) == 3 and np.isfinite(item.pose.points).all()


@pytest.mark.parametrize("wrong", [
    b"", b"[]", b"null", b"{}", b'{"objects": 3}', b"[" * 100_000, b" " * (2 << 20),
    b'{"objects": [{"number": 2, "handles": []}]}',
    b'{"objects": [{"number": 1, "handles": []}]}',
    b'{"objects": [{"number": 1, "handles": [{"place": [1, 2]}]}]}',
    b'{"objects": [{"number": 1, "handles": [{"place": [1, 2, NaN]}]}]}',
    b'{"objects": [{"number": 1, "handles": [{"place": ["a", 2, 3]}]}]}',
])  # fmt: skip
def test_what_is_no_such_file_is_refused_with_a_sentence(wrong: bytes) -> None:
    with pytest.raises(ScriptError):
        with_handles(document(), wrong)
