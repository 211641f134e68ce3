"""The trained decoder as one small ONNX file, which runs without torch, and back again."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from objectmorpher_core.lift.crop import SIDE

from .shape_net import GRID, PLANES, WIDTH, ShapeNet

OPSET = 17
INPUTS, OUTPUT = ("planes", "tokens"), "shape"
HALF = ".half"  # ends the name of a weight that is kept in half precision
DROPPED = 5  # of the 10 binary digits of its fraction: an archive is smaller by a quarter


def export(net: ShapeNet, path: Path) -> str:
    """Writes `path`, its weights in half precision or less (`_rounded`); their SHA-256.

    They are widened again where they are read: what is computed is single precision. Every weight
    keeps its name and its form, so that training can go on from the file (`weights_of`); what can
    be joined, as normalisations into convolutions, onnxruntime joins when it opens it.
    """
    inputs = (torch.zeros(1, PLANES, SIDE, SIDE), torch.zeros(1, WIDTH, GRID, GRID))
    return write_onnx(net, inputs, path, INPUTS, (OUTPUT,), DROPPED)


def write_onnx(
    net: nn.Module, inputs: tuple[Tensor, ...], path: Path, names: Sequence[str],
    outputs: Sequence[str], dropped: int,
) -> str:  # fmt: skip
    """Write any network as `export` does, its weights without `dropped` digits; its SHA-256."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    torch.onnx.export(
        net.eval(), inputs, path, input_names=list(names), output_names=list(outputs),
        opset_version=OPSET, dynamo=False, do_constant_folding=False,
        training=torch.onnx.TrainingMode.PRESERVE,
    )  # fmt: skip
    model = onnx.load(path)
    graph = model.graph
    narrow, casts = [], []
    for weight in graph.initializer:
        if weight.data_type != TensorProto.FLOAT or len(weight.dims) < 2:
            narrow.append(weight)
            continue
        half = _rounded(numpy_helper.to_array(weight).astype(np.float16), dropped)
        narrow.append(numpy_helper.from_array(half, weight.name + HALF))
        casts.append(
            helper.make_node("Cast", [weight.name + HALF], [weight.name], to=TensorProto.FLOAT)
        )
    nodes = [*casts, *graph.node]
    del graph.initializer[:], graph.node[:]
    graph.initializer.extend(narrow)
    graph.node.extend(nodes)
    onnx.checker.check_model(model)
    data = model.SerializeToString()
    path.write_bytes(data)
    return hashlib.sha256(data).hexdigest()


def _rounded(weights: np.ndarray, dropped: int) -> np.ndarray:
    """Weights of float16, to the nearest whose last `dropped` binary digits are 0; ties to even.

    On six photographs DROPPED moves what the network sees by a hundredth of its spread.
    """
    bits, step = weights.view(np.uint16).astype(np.uint32), 1 << dropped
    nearest = (bits + step // 2 - 1 + (bits // step & 1)) // step * step
    return nearest.astype(np.uint16).view(np.float16)


def weights_of(path: Path, net: ShapeNet) -> dict[str, torch.Tensor]:
    """The weights in a file that `export` wrote, as `net.state_dict()` names them.

    Raises ValueError for weights of another network.
    """
    import onnx
    from onnx import numpy_helper

    kept = {
        tensor.name.removesuffix(HALF): numpy_helper.to_array(tensor).astype("float32")
        for tensor in onnx.load(path).graph.initializer
        if tensor.data_type in (onnx.TensorProto.FLOAT, onnx.TensorProto.FLOAT16)
    }
    state = dict(net.state_dict())
    for name, value in state.items():
        if not value.is_floating_point():  # how many batches a normalisation has seen
            continue
        if name not in kept or kept[name].shape != tuple(value.shape):
            raise ValueError(f"{path} holds weights of another network: {name} is not as here")
        state[name] = torch.from_numpy(kept[name].copy())
    return state
