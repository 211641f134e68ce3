"""Networks that were put together here compute what their formulas say."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.models.onnx_session import open_session
from objectmorpher_research.evaluation.measures.onnx_build import OnnxGraph


def run(model: bytes, x: np.ndarray) -> list[np.ndarray]:
    session = open_session(model)
    return [np.asarray(found) for found in session.run(None, {"x": x})]


@pytest.mark.parametrize("size", [(6, 8), (7, 5), (1, 1)])
def test_a_convolution_a_rectifier_and_a_pooling_at_any_size(size):
    random = np.random.default_rng(0)
    kernel, bias = random.normal(size=(4, 2, 3, 3)), random.normal(size=4)
    x = random.normal(size=(1, 2, *size)).astype(np.float32)
    graph = OnnxGraph()
    weights = graph.constant("w", kernel.astype(np.float32))
    inputs = ["x", weights, graph.constant("b", bias.astype(np.float32))]
    conv = graph.add("Conv", "conv", inputs, {"pads": (1, 1, 1, 1)})
    relu = graph.add("Relu", "relu", [conv], {})
    options = {"kernel_shape": (2, 2), "strides": (2, 2), "ceil_mode": 1}
    pool = graph.add("MaxPool", "pool", [relu], options)
    found, pooled = run(graph.model("x", [relu, pool]), x)

    padded = np.pad(x[0], ((0, 0), (1, 1), (1, 1)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(1, 2))
    expected = np.einsum("chwij,ocij->ohw", windows, kernel) + bias[:, None, None]
    expected = np.maximum(expected, 0)
    assert found[0] == pytest.approx(expected, abs=1e-4)
    height, width = size
    rows, columns = range(0, height, 2), range(0, width, 2)  # a last odd one stays
    largest = [[expected[:, r : r + 2, c : c + 2].max((1, 2)) for c in columns] for r in rows]
    assert pooled[0] == pytest.approx(np.moveaxis(np.array(largest), -1, 0), abs=1e-4)
