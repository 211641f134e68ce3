"""An ONNX file can be asked for an inner tensor, and for other picture sizes."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.models.onnx_session import (
    as_varint,
    bytes_field,
    open_session,
    with_interface,
)


def value(name: str, *sizes: int) -> bytes:
    """ValueInfoProto of a float tensor of fixed sizes."""
    dims = b"".join(bytes_field(1, b"\x08" + as_varint(size)) for size in sizes)
    tensor = bytes_field(1, b"\x08\x01" + bytes_field(2, dims))
    return bytes_field(1, name.encode()) + bytes_field(2, tensor)


def node(kind: str, source: str, target: str) -> bytes:
    names = bytes_field(1, source.encode()) + bytes_field(2, target.encode())
    return names + bytes_field(4, kind.encode())


def small_model() -> bytes:
    """y = sigmoid(relu(x)) for x of exactly (1, 3, 4, 4)."""
    graph = bytes_field(1, node("Relu", "x", "inner")) + bytes_field(
        1, node("Sigmoid", "inner", "y")
    )
    graph += bytes_field(2, b"small")
    graph += bytes_field(11, value("x", 1, 3, 4, 4)) + bytes_field(12, value("y", 1, 3, 4, 4))
    return b"\x08\x07" + bytes_field(7, graph) + bytes_field(8, b"\x10\x0e")  # IR 7, opset 14


def test_an_inner_tensor_comes_out_at_a_size_the_file_did_not_allow():
    model = with_interface(small_model(), "x", "inner")
    session = open_session(model)
    assert [o.name for o in session.get_outputs()] == ["inner"]
    assert b"Relu" in model
    assert b"Sigmoid" not in model, "nobody asked for what it computes"
    x = np.random.default_rng(0).standard_normal((2, 3, 5, 7)).astype(np.float32)
    np.testing.assert_array_equal(session.run(None, {"x": x})[0], np.maximum(x, 0))


def test_bytes_that_are_no_onnx_file_are_refused():
    with pytest.raises(ValueError, match="not an ONNX file"):
        with_interface(b"\x0f" * 20, "x", "y")


@pytest.mark.parametrize("number", [0, 1, 127, 128, 300, 2**31, 97_447_603])
def test_numbers_survive_their_encoding(number):
    from objectmorpher_core.models.onnx_session import _varint

    encoded = as_varint(number)
    assert _varint(memoryview(encoded), 0) == (number, len(encoded))
