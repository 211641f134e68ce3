"""A depth network that the user brings: tried, kept whole, told of, and removed."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_core import models
from objectmorpher_core.models.depth_net import DEVIATION, MEAN, PATCH, SIDE, DepthNet
from tests.core.models.small_networks import brightness, constant, integer, integers, model
from tests.core.models.small_networks import node as onnx_node
from tests.core.models.small_networks import value as onnx_value

BLACK = np.zeros((30, 80, 3), np.uint8)
RAMP = np.linspace(0, 1, 35, dtype=np.float32).reshape(5, 7)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "models"


def written(tmp_path: Path, data: bytes, name: str = "mine.onnx") -> Path:
    path = tmp_path / name
    path.write_bytes(data)
    return path


def test_nothing_is_there_before_a_file_is_added() -> None:
    own = models.added("depth")
    assert own.state == "missing" and own.sha256 == ""


def test_a_network_is_kept_with_its_name_and_hash_and_removed(tmp_path: Path, cache: Path) -> None:
    source = written(tmp_path, brightness())
    own = models.add("depth", source)
    assert own.state == "ok" and own.name == "mine.onnx" and own.size == source.stat().st_size
    assert own.sha256 == hashlib.sha256(source.read_bytes()).hexdigest()
    source.unlink()
    assert models.added("depth") == own
    again = models.add("depth", written(tmp_path, constant(RAMP), "other.onnx"))
    assert models.added("depth").name == "other.onnx" != own.name and again.sha256 != own.sha256
    models.remove("depth")
    models.remove("depth")
    assert models.added("depth").state == "missing"
    assert list(cache.iterdir()) == []


def test_a_file_that_changed_on_the_disk_is_damaged(tmp_path: Path) -> None:
    own = models.add("depth", written(tmp_path, brightness()))
    own.path.write_bytes(own.path.read_bytes()[:-1])
    assert models.added("depth").state == "damaged"
    own.path.with_suffix(".json").write_text("{", encoding="utf-8")
    assert models.added("depth").state == "damaged"


def _two_inputs() -> bytes:
    both = [onnx_value("a", 1, 3, 8, 8), onnx_value("b", 1, 3, 8, 8)]
    return model([onnx_node("Add", ["a", "b"], "c")], [], (both, [onnx_value("c", 1, 3, 8, 8)]))


def _of_grey() -> bytes:
    ends = [onnx_value("a", 1, 1, "h", "w")], [onnx_value("b", 1, 1, "h", "w")]
    return model([onnx_node("Relu", ["a"], "b")], [], ends)


def _three_channels_out() -> bytes:
    ends = [onnx_value("a", 1, 3, "h", "w")], [onnx_value("b", 1, 3, "h", "w")]
    return model([onnx_node("Relu", ["a"], "b")], [], ends)


def _flat_output() -> bytes:
    mean = onnx_node("ReduceMean", ["a"], "b", integers("axes", [1, 2]) + integer("keepdims", 0))
    return model([mean], [], ([onnx_value("a", 1, 3, "h", "w")], [onnx_value("b", 1, "w")]))


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"no network", "not an ONNX network"),
        (_two_inputs(), "2 inputs"),
        (_of_grey(), r"pictures \(n, 3, h, w\)"),
        (_three_channels_out(), "not a depth per pixel"),
        (_flat_output(), "not a depth per pixel"),
        (constant(np.full((3, 4), np.nan, np.float32)), "not finite"),
    ],
)
def test_what_is_no_depth_network_is_one_sentence_and_changes_nothing(
    tmp_path: Path, cache: Path, data: bytes, sentence: str
) -> None:
    with pytest.raises(models.ModelError, match=sentence) as caught:
        models.add("depth", written(tmp_path, data))
    assert "\n" not in str(caught.value)
    assert models.added("depth").state == "missing" and list(cache.iterdir()) == []


def test_weights_in_a_second_file_are_refused(tmp_path: Path) -> None:
    (tmp_path / "weights.bin").write_bytes(RAMP.tobytes())
    data = constant(RAMP, outside="weights.bin")
    assert DepthNet(written(tmp_path, data)).inverse_depth(BLACK).shape == RAMP.shape
    with pytest.raises(models.ModelError, match="all in one file"):
        models.add("depth", tmp_path / "mine.onnx")
    assert models.added("depth").state == "missing"


def test_a_missing_file_and_an_unknown_kind_are_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(models.ModelError, match="cannot be added"):
        models.add("depth", tmp_path / "none.onnx")
    with pytest.raises(models.ModelError, match=r"'shape'.* depth"):
        models.add("shape", written(tmp_path, brightness()))


def test_the_network_gets_the_picture_as_it_was_trained_on_it(tmp_path: Path) -> None:
    net = DepthNet(written(tmp_path, brightness()))
    rgb = np.full((300, 800, 3), (255, 128, 0), np.uint8)
    depth = net.inverse_depth(rgb)
    assert max(depth.shape) == SIDE and not any(n % PATCH for n in depth.shape)
    assert depth.shape[1] / depth.shape[0] == pytest.approx(800 / 300, rel=0.05)
    expected = ((np.array([255, 128, 0]) / 255 - MEAN) / DEVIATION).mean()
    assert np.abs(depth - expected).max() < 1e-5


def test_a_network_of_one_size_gets_that_size(tmp_path: Path) -> None:
    net = DepthNet(written(tmp_path, constant(RAMP, (1, 3, 28, 42))))
    assert net.size_for(800, 300) == (42, 28)
    np.testing.assert_array_equal(net.inverse_depth(BLACK), RAMP)
