"""Depth Anything through transformers: a tiny one of random weights, from a folder of ours."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="Depth Anything needs torch")
transformers = pytest.importorskip("transformers", reason="Depth Anything needs transformers")

from objectmorpher_core import models  # noqa: E402
from objectmorpher_core.lift.relief import depth_look  # noqa: E402
from objectmorpher_core.models import device  # noqa: E402
from objectmorpher_core.models.depth_net import DepthTorch  # noqa: E402
from tests import photos  # noqa: E402
from tests.core.models.small_networks import brightness  # noqa: E402


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    torch.manual_seed(0)
    backbone = transformers.Dinov2Config(
        hidden_size=12, num_hidden_layers=4, num_attention_heads=2, mlp_ratio=1, image_size=56,
        patch_size=14, out_indices=[1, 2, 3, 4], reshape_hidden_states=False,
        apply_layernorm=True,
    )  # fmt: skip
    config = transformers.DepthAnythingConfig(
        backbone_config=backbone, reassemble_hidden_size=12, neck_hidden_sizes=[4, 4, 4, 4],
        fusion_hidden_size=4, head_hidden_size=4, patch_size=14,
    )  # fmt: skip
    at = tmp_path_factory.mktemp("depth") / "tiny"
    transformers.DepthAnythingForDepthEstimation(config).save_pretrained(at)
    return at


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path))


def test_a_folder_is_added_and_the_relief_looks_with_it(folder):
    assert depth_look.installed() is None
    assert models.use_folder("depth-anything", folder).state == "ok"
    there = depth_look.installed()
    assert there is not None and not there.is_onnx and there.at == folder
    pixels = photos.photo("coffee")[::4, ::4]
    mask = np.zeros(pixels.shape[:2], bool)
    mask[30:70, 40:90] = True
    seen, again = depth_look.look(pixels, mask), depth_look.look(pixels, mask)
    assert seen is not None and again is not None and seen.inverse is again.inverse
    assert max(seen.inverse.shape) == 518 and (seen.inverse >= 0).all()


def test_it_is_the_networks_own_answer_and_the_same_each_time(folder):
    rgb = photos.photo("coffee")[::6, ::6].copy()
    net = DepthTorch(folder)
    one = net.inverse_depth(rgb)
    assert np.array_equal(one, DepthTorch(folder).inverse_depth(rgb))
    assert one.shape[0] % 14 == 0 and one.shape[1] == 518 and np.ptp(one) > 0


def test_the_users_own_onnx_file_goes_first(folder, tmp_path):
    models.use_folder("depth-anything", folder)
    (tmp_path / "mine.onnx").write_bytes(brightness())
    models.add("depth", tmp_path / "mine.onnx")
    there = depth_look.installed()
    assert there is not None and there.is_onnx


def test_other_models_pickles_and_cut_off_files_are_one_sentence(folder, tmp_path):
    copy = shutil.copytree(folder, tmp_path / "copy")
    weights = copy / "model.safetensors"
    whole = weights.read_bytes()
    weights.write_bytes(whole[:-4])
    with pytest.raises(models.ModelError, match="cut off"):
        models.use_folder("depth-anything", copy)
    (copy / "pytorch_model.bin").write_bytes(b"pickle")
    weights.unlink()
    with pytest.raises(models.ModelError, match="can run any code"):
        models.use_folder("depth-anything", copy)
    weights.write_bytes(whole)
    config = copy / "config.json"
    config.write_text(config.read_text().replace('"depth_anything"', '"sam"'))
    with pytest.raises(models.ModelError, match="'sam', not depth-anything"):
        models.use_folder("depth-anything", copy)


def test_out_of_memory_is_one_sentence(folder, monkeypatch):
    net = DepthTorch(folder)

    def never(*_):
        raise torch.OutOfMemoryError("no")

    monkeypatch.setenv(device.DEVICE, "cpu")
    monkeypatch.setattr(net, "_seen", never)
    with pytest.raises(models.ModelError, match="not enough memory on the CPU"):
        net.inverse_depth(np.zeros((20, 30, 3), np.uint8))
