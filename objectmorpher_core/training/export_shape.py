"""The trained decoder as one small ONNX file, which runs without torch."""

from __future__ import annotations

import hashlib
from pathlib import Path

import torch

from ..lift.crop import SIDE
from .shape_net import GRID, PLANES, WIDTH, ShapeNet

OPSET = 17
INPUTS, OUTPUT = ("planes", "tokens"), "shape"


def export(net: ShapeNet, path: Path) -> str:
    """Writes `path`, its weights in half precision; their SHA-256.

    They are widened again where they are read: what is computed is single precision.
    """
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    inputs = (torch.zeros(1, PLANES, SIDE, SIDE), torch.zeros(1, WIDTH, GRID, GRID))
    torch.onnx.export(
        net.eval(), inputs, path, input_names=list(INPUTS), output_names=[OUTPUT],
        opset_version=OPSET, dynamo=False,
    )  # fmt: skip
    model = onnx.load(path)
    graph = model.graph
    narrow, casts = [], []
    for weight in graph.initializer:
        if weight.data_type != TensorProto.FLOAT or len(weight.dims) < 2:
            narrow.append(weight)
            continue
        half = numpy_helper.to_array(weight).astype("float16")
        narrow.append(numpy_helper.from_array(half, weight.name + ".half"))
        casts.append(
            helper.make_node("Cast", [weight.name + ".half"], [weight.name], to=TensorProto.FLOAT)
        )
    nodes = [*casts, *graph.node]
    del graph.initializer[:], graph.node[:]
    graph.initializer.extend(narrow)
    graph.node.extend(nodes)
    onnx.checker.check_model(model)
    data = model.SerializeToString()
    path.write_bytes(data)
    return hashlib.sha256(data).hexdigest()
