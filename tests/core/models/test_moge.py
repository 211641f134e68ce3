"""MoGe's outputs: a tiny ONNX graph of the same inputs and outputs, whose scene is known."""

from __future__ import annotations

import numpy as np
import pytest

onnx = pytest.importorskip("onnx")
from onnx import TensorProto, helper, numpy_helper  # noqa: E402

from objectmorpher_core import models  # noqa: E402
from objectmorpher_core.lift import LiftError  # noqa: E402
from objectmorpher_core.lift.relief import depth_look  # noqa: E402
from objectmorpher_core.models.depth_net import DepthNet, seen_at  # noqa: E402
from tests import photos  # noqa: E402

SIZE = 518, 392  # px, of a picture of 4 to 3 as the network sees it


def scene(focal: float, shift: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of a wavy wall and of nothing beside it, depth less `shift`; what is there; depth."""
    width, height = SIZE
    y, x = np.mgrid[:height, :width] + 0.5
    depth = 3 + 0.4 * np.sin(x / 60) + 0.3 * np.cos(y / 45)
    points = np.stack([(x - width / 2) / focal * depth, (y - height / 2) / focal * depth, depth], 2)
    is_there = np.hypot(x - width / 2, y - height / 2) < 180
    points[..., 2] -= shift
    return points.astype(np.float32), is_there, depth


def graph(points: np.ndarray, is_there: np.ndarray) -> bytes:
    """A network that sees this in every picture of its size, and the picture's brightness."""
    given = [
        helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, "h", "w"]),
        helper.make_tensor_value_info("num_tokens", TensorProto.INT64, []),
    ]
    told = [
        helper.make_tensor_value_info("points", TensorProto.FLOAT, [1, "h", "w", 3]),
        helper.make_tensor_value_info("normal", TensorProto.FLOAT, [1, "h", "w", 3]),
        helper.make_tensor_value_info("mask", TensorProto.FLOAT, [1, "h", "w"]),
        helper.make_tensor_value_info("metric_scale", TensorProto.FLOAT, [1]),
    ]
    kept = {"p": points[None], "m": is_there[None].astype(np.float32), "zero": np.float32([0])}
    nodes = [
        helper.make_node("Cast", ["num_tokens"], ["count"], to=TensorProto.FLOAT),
        helper.make_node("Mul", ["count", "zero"], ["none"]),
        helper.make_node("Add", ["p", "none"], ["points"]),
        helper.make_node("Identity", ["points"], ["normal"]),
        helper.make_node("ReduceMean", ["image"], ["bright"], keepdims=0),
        helper.make_node("Mul", ["bright", "zero"], ["dark"]),
        helper.make_node("Add", ["m", "dark"], ["mask"]),
        helper.make_node("Add", ["zero", "bright"], ["metric_scale"]),
    ]
    starts = [numpy_helper.from_array(np.asarray(v, np.float32), k) for k, v in kept.items()]
    made = helper.make_graph(nodes, "moge", given, told, starts)
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return model.SerializeToString()


@pytest.mark.parametrize(("focal", "shift"), [(300.0, 0.0), (600.0, 2.0), (900.0, -5.0)])
def test_depth_and_camera_are_those_of_the_scene(tmp_path, focal, shift):
    points, is_there, depth = scene(focal, shift)
    (tmp_path / "net.onnx").write_bytes(graph(points, is_there))
    net = DepthNet(tmp_path / "net.onnx")
    rgb = photos.photo("coffee")[:300, :400]
    inverse = net.inverse_depth(rgb)
    assert inverse.shape == SIZE[::-1] and (inverse[~is_there] == 0).all()
    np.testing.assert_allclose(inverse[is_there] * depth[is_there], 1, atol=0.02)
    found = net.focal(rgb)
    assert found is not None and found * SIZE[0] / 400 == pytest.approx(focal, rel=0.02)


def test_noise_moves_the_camera_little_and_nothing_seen_is_refused():
    points, is_there, _ = scene(600.0, 1.5)
    noisy = points + 0.01 * np.random.default_rng(0).normal(size=points.shape).astype(np.float32)
    assert seen_at(noisy, is_there).focal == pytest.approx(600.0, rel=0.03)
    with pytest.raises(ValueError, match="hardly anything"):
        seen_at(points, np.zeros_like(is_there))


def test_the_relief_looks_with_it_without_pytorch(tmp_path, monkeypatch):
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))
    (tmp_path / "net.onnx").write_bytes(graph(*scene(600.0, 0.0)[:2]))
    assert depth_look.installed() is None
    (tmp_path / "notes.onnx").write_text("hello")
    with pytest.raises(models.ModelError, match="not an ONNX network"):
        models.use_folder("moge-2-vits", tmp_path / "notes.onnx")
    assert depth_look.installed() is None
    models.use_folder("moge-2-vits", tmp_path / "net.onnx")
    there = depth_look.installed()
    assert there is not None and there.is_onnx and there.at.name == "net.onnx"
    assert DepthNet(there.at).inverse_depth(photos.photo("coffee")[:300, :400]).max() > 0
    there.at.write_bytes(bytes(there.at.stat().st_size))
    assert models.verify_hub("moge-2-vits").state == "damaged"
    photo = photos.photo("coffee")[:300, :400]
    with pytest.raises(LiftError, match="models remove moge-2-vits"):
        depth_look.look(photo, np.ones(photo.shape[:2], bool))
