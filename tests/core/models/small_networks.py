"""Tiny ONNX files, written by hand: networks whose answer is known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from objectmorpher_core.models.onnx_session import as_varint, bytes_field
from objectmorpher_core.models.plans import Plan

FLOAT = b"\x08\x01"  # TypeProto.Tensor.elem_type, and TensorProto.data_type in field 2


def value(name: str, *sizes: int | str) -> bytes:
    """ValueInfoProto of a float tensor; a size that is a word is any."""
    dims = b"".join(bytes_field(1, _dim(size)) for size in sizes)
    return bytes_field(1, name.encode()) + bytes_field(
        2, bytes_field(1, FLOAT + bytes_field(2, dims))
    )


def _dim(size: int | str) -> bytes:
    return b"\x08" + as_varint(size) if isinstance(size, int) else bytes_field(2, size.encode())


def node(kind: str, sources: list[str], target: str, attributes: bytes = b"") -> bytes:
    names = b"".join(bytes_field(1, s.encode()) for s in sources) + bytes_field(2, target.encode())
    return names + bytes_field(4, kind.encode()) + attributes


def floats(name: str, array: np.ndarray, outside: str = "") -> bytes:
    """TensorProto of float32; its numbers are in the file `outside`, if there is one."""
    dims = b"".join(b"\x08" + as_varint(n) for n in array.shape)
    if outside:
        place = bytes_field(1, b"location") + bytes_field(2, outside.encode())
        told = bytes_field(8, name.encode()) + bytes_field(13, place) + b"\x70\x01"
        return dims + b"\x10\x01" + told
    raw = np.ascontiguousarray(array, "<f4").tobytes()
    return dims + b"\x10\x01" + bytes_field(8, name.encode()) + bytes_field(9, raw)


def integer(name: str, number: int) -> bytes:
    """AttributeProto of an int."""
    return bytes_field(
        5, bytes_field(1, name.encode()) + b"\x18" + as_varint(number) + b"\xa0\x01\x02"
    )


def integers(name: str, numbers: list[int]) -> bytes:
    """AttributeProto of ints."""
    each = b"".join(b"\x40" + as_varint(n) for n in numbers)
    return bytes_field(5, bytes_field(1, name.encode()) + each + b"\xa0\x01\x07")


def model(nodes: list[bytes], tensors: list[bytes], ends: tuple[list[bytes], list[bytes]]) -> bytes:
    """ModelProto of nodes, constants, and inputs and outputs; IR 7, opset 12."""
    graph = b"".join(bytes_field(1, n) for n in nodes) + bytes_field(2, b"small")
    graph += b"".join(bytes_field(5, t) for t in tensors)
    graph += b"".join(bytes_field(11, v) for v in ends[0])
    graph += b"".join(bytes_field(12, v) for v in ends[1])
    return b"\x08\x07" + bytes_field(7, graph) + bytes_field(8, b"\x10\x0c")


def brightness() -> bytes:
    """Inverse depth is the mean of the three normalised channels: what is bright is near."""
    mean = node("ReduceMean", ["image"], "depth", integers("axes", [1]) + integer("keepdims", 0))
    ends = [value("image", "n", 3, "h", "w")], [value("depth", "n", "h", "w")]
    return model([mean], [], ends)


def constant(
    depth: np.ndarray, takes: tuple[int | str, ...] = ("n", 3, "h", "w"), outside: str = ""
) -> bytes:
    """Whatever the picture is, its inverse depth is `depth` (h, w)."""
    nothing = node("ReduceMean", ["image"], "mean", integer("keepdims", 0))
    none = node("Mul", ["mean", "zero"], "none")
    tensors = [floats("told", depth[None], outside), floats("zero", np.zeros(()))]
    ends = [value("image", *takes)], [value("depth", 1, *depth.shape)]
    return model([nothing, none, node("Add", ["told", "none"], "depth")], tensors, ends)


class Ways:
    """Of a model's need: these ways and no other, on the CPU."""

    is_slow_on_cpu = False

    def __init__(self, *plans: Plan) -> None:
        self._plans = plans

    def on(self, where: str) -> tuple[Plan, ...]:
        return self._plans if where == "cpu" else ()

    def lacking(self) -> str:
        return ""


def in_ways(model: Any, *plans: Plan) -> Any:
    """A model for the ledger that runs in these ways only."""
    return replace(model, need=Ways(*plans))
