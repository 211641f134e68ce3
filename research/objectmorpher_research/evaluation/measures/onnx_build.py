"""Puts networks of convolutions together as ONNX files, which onnxruntime runs: without PyTorch.

One protobuf message (onnx.proto3): ModelProto.graph is field 7, opset_import 8; GraphProto's node,
name, initializer, input and output are fields 1, 2, 5, 11 and 12.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from objectmorpher_core.base.arrays import F32
from objectmorpher_core.models.onnx_session import GRAPH, INPUT, OUTPUT, as_varint, bytes_field

IR, OPSET = 7, 13  # versions that every onnxruntime of ours knows
NODE, NAME, INITIALIZER, OPSETS = 1, 2, 5, 8  # field numbers
FLOAT, INT, INTS = 1, 2, 7  # TensorProto.FLOAT; kinds of attributes
Options = Mapping[str, int | Sequence[int]]  # attributes by their names
AXES = ("n", "c", "h", "w")  # of any size


@dataclass
class OnnxGraph:
    """Nodes in the order in which they are added; each gives the tensor called as it is."""

    _nodes: list[bytes] = field(default_factory=list)
    _tensors: list[bytes] = field(default_factory=list)

    def constant(self, name: str, values: F32) -> str:
        """A tensor of weights."""
        dims = b"".join(_number(1, size) for size in values.shape)
        data = bytes_field(9, values.astype("<f4").tobytes())
        self._tensors.append(dims + _number(2, FLOAT) + _text(8, name) + data)
        return name

    def add(self, kind: str, name: str, inputs: Sequence[str], options: Options) -> str:
        """A node of ONNX's `kind` with integers as attributes; returns its name."""
        body = b"".join(_text(1, source) for source in inputs) + _text(2, name) + _text(4, kind)
        body += b"".join(bytes_field(5, _attribute(key, of)) for key, of in options.items())
        self._nodes.append(body)
        return name

    def model(self, images: str, outputs: Sequence[str]) -> bytes:
        """The file: `images` (n, c, h, w) of any size in, tensors called `outputs` out; float32."""
        graph = b"".join(bytes_field(NODE, node) for node in self._nodes) + _text(NAME, "network")
        graph += b"".join(bytes_field(INITIALIZER, tensor) for tensor in self._tensors)
        graph += bytes_field(INPUT, _value(images))
        graph += b"".join(bytes_field(OUTPUT, _value(name)) for name in outputs)
        opset = bytes_field(OPSETS, _text(1, "") + _number(2, OPSET))
        return _number(1, IR) + bytes_field(GRAPH, graph) + opset


def _attribute(name: str, value: int | Sequence[int]) -> bytes:
    if isinstance(value, int):
        return _text(1, name) + _number(3, value) + _number(20, INT)
    return _text(1, name) + b"".join(_number(8, n) for n in value) + _number(20, INTS)


def _value(name: str) -> bytes:
    """ValueInfoProto of a float tensor of four axes of any length."""
    shape = b"".join(bytes_field(1, _text(2, f"{name}_{axis}")) for axis in AXES)
    tensor = bytes_field(1, _number(1, FLOAT) + bytes_field(2, shape))
    return _text(1, name) + bytes_field(2, tensor)


def _number(field_number: int, value: int) -> bytes:
    return as_varint(field_number << 3) + as_varint(value)


def _text(field_number: int, value: str) -> bytes:
    return bytes_field(field_number, value.encode())
