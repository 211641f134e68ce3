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
INPUTS, OUTPUTS = ("planes", "tokens"), ("shape", "flat")
MASK = 3  # the plane of the mask
# Ends of the names of a weight's whole numbers, of what one of them is worth in each channel, and
# of the same numbers where they are read.
WHOLE, STEP, WIDE = ".whole", ".step", ".wide"
MOST = 127  # the largest of them
CLIPPED = np.linspace(0.6, 1.0, 9)  # x a channel's largest weight, from which it may be cut off
FLAT = "flat."  # begins the names of the weights that say whether a thing is flat
HALF = ".half"  # ends the name of a weight that an earlier version kept in half precision


def export(net: ShapeNet, path: Path) -> str:
    """Writes `path`, its weights in bytes (`in_bytes`); its SHA-256.

    They are widened again where they are read: what is computed is single precision. Every weight
    keeps its name and its form, so that training can go on from the file (`weights_of`); what can
    be joined, as normalisations into convolutions, onnxruntime joins when it opens it.
    """
    inputs = (torch.zeros(1, PLANES, SIDE, SIDE), torch.zeros(1, WIDTH, GRID, GRID))
    whole = _Whole()
    whole.load_state_dict(net.state_dict())
    return write_onnx(whole, inputs, path, INPUTS, OUTPUTS)


def export_flatness(net: ShapeNet, old: Path, path: Path) -> str:
    """Write `path`: what is flat as `net` says it, and the surfaces of the file `old`; its SHA-256.

    The weights of the surfaces are carried over as they are, so that they see the very same.
    """
    import onnx

    export(net, path)
    model = onnx.load(path)
    kept = {weight.name: weight for weight in onnx.load(old).graph.initializer}
    for weight in model.graph.initializer:
        if not weight.name.startswith(FLAT):
            weight.CopyFrom(kept[weight.name])
    data = model.SerializeToString()
    path.write_bytes(data)
    return hashlib.sha256(data).hexdigest()


class _Whole(ShapeNet):
    """With the log odds (n,) that the object is flat beside the surfaces."""

    def forward(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, planes: Tensor, tokens: Tensor
    ) -> tuple[Tensor, Tensor]:
        return super().forward(planes, tokens), self.flat(planes[:, MASK : MASK + 1], tokens)


def write_onnx(
    net: nn.Module, inputs: tuple[Tensor, ...], path: Path, names: Sequence[str],
    outputs: Sequence[str],
) -> str:  # fmt: skip
    """Write any network as `export` does; the file's SHA-256."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    torch.onnx.export(
        net.eval(), inputs, path, input_names=list(names), output_names=list(outputs),
        opset_version=OPSET, dynamo=False, do_constant_folding=False,
        training=torch.onnx.TrainingMode.PRESERVE,
    )  # fmt: skip
    model = onnx.load(path)
    graph = model.graph
    narrow, widened = [], []
    for weight in graph.initializer:
        name = weight.name
        if weight.data_type != TensorProto.FLOAT or len(weight.dims) < 2:
            narrow.append(weight)
            continue
        whole, step = in_bytes(numpy_helper.to_array(weight))
        narrow.append(numpy_helper.from_array(whole, name + WHOLE))
        narrow.append(numpy_helper.from_array(step, name + STEP))
        widened += [
            helper.make_node("Cast", [name + WHOLE], [name + WIDE], to=TensorProto.FLOAT),
            helper.make_node("Mul", [name + WIDE, name + STEP], [name]),
        ]
    nodes = [*widened, *graph.node]
    del graph.initializer[:], graph.node[:]
    graph.initializer.extend(narrow)
    graph.node.extend(nodes)
    onnx.checker.check_model(model)
    data = model.SerializeToString()
    path.write_bytes(data)
    return hashlib.sha256(data).hexdigest()


def in_bytes(weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights (c, ...) as whole numbers int8, and what one is worth in each channel (c, 1, ...).

    Of several places where a channel's largest weights may be cut off, each takes the one with the
    least square error. On ten made-up photographs the shape network sees a front that is 0.7 % of
    its spread off; in half precision without five of ten digits it was as far off, and half as
    large again in an archive.
    """
    flat = weights.reshape(len(weights), -1).astype(np.float32)
    largest = np.maximum(np.abs(flat).max(1, keepdims=True), np.float32(1e-12))
    steps = CLIPPED[:, None, None].astype(np.float32) * largest / MOST
    whole = np.clip(np.rint(flat / steps), -MOST, MOST)
    best = ((whole * steps - flat) ** 2).sum(2).argmin(0)
    channels = np.arange(len(flat))
    wide = (-1, *[1] * (weights.ndim - 1))
    step = np.ascontiguousarray(steps[best, channels].reshape(wide))
    return whole[best, channels].reshape(weights.shape).astype(np.int8), step


def weights_of(path: Path, net: nn.Module) -> dict[str, torch.Tensor]:
    """The weights in a file that `write_onnx` wrote, as `net.state_dict()` names them.

    What an earlier version did not have, whether a thing is flat, stays as `net` has it. Raises
    ValueError for weights of another network.
    """
    import onnx
    from onnx import numpy_helper

    kept = {
        tensor.name.removesuffix(HALF): numpy_helper.to_array(tensor).astype("float32")
        for tensor in onnx.load(path).graph.initializer
    }
    for name in [name for name in kept if name.endswith(WHOLE)]:
        own = name.removesuffix(WHOLE)
        kept[own] = kept[name] * kept[own + STEP]
    state = dict(net.state_dict())
    for name, value in state.items():
        if not value.is_floating_point():  # how many batches a normalisation has seen
            continue
        if name.startswith(FLAT) and name not in kept:
            continue
        if name not in kept or kept[name].shape != tuple(value.shape):
            raise ValueError(f"{path} holds weights of another network: {name} is not as here")
        state[name] = torch.from_numpy(kept[name].copy())
    return state
