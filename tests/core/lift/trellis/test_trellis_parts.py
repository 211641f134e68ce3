"""Weights are loaded strictly, only from safetensors, and each fault is one sentence."""

# ruff: noqa: E402 (nothing that needs torch can be imported before the skip)
from __future__ import annotations

import json
import struct

import pytest

torch = pytest.importorskip("torch", reason="TRELLIS needs torch")
pytest.importorskip("transformers", reason="TRELLIS needs transformers")

from safetensors.torch import load_file, save_file
from transformers import Dinov2WithRegistersModel

from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.trellis.configs import part_path, pipeline
from objectmorpher_core.lift.trellis.parts import build, load_part
from objectmorpher_core.lift.trellis.picture import MEAN, STD, Encoder
from tests.core.lift.trellis import tiny_trellis

CPU = torch.device("cpu")
ROLE = "slat_decoder_gs"


@pytest.fixture
def saved(tmp_path):
    torch.manual_seed(0)
    part = build(tiny_trellis.description(ROLE))
    tiny_trellis.save_part(part, tiny_trellis.description(ROLE), tmp_path / "part")
    return part, tmp_path / "part"


def refused(path, *words):
    with pytest.raises(LiftError) as error:
        load_part(path, CPU, torch.float32)
    text = str(error.value)
    assert "\n" not in text and all(word in text for word in words), text


def test_what_is_saved_is_loaded(saved):
    part, path = saved
    found = load_part(path, CPU, torch.float32)
    for key, value in part.state_dict().items():
        assert torch.equal(found.state_dict()[key], value)
    assert not any(p.requires_grad for p in found.parameters())


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_only_the_torso_is_of_lower_precision(saved, dtype):
    found = load_part(saved[1], CPU, dtype)
    kinds = {key: t.dtype for key, t in found.state_dict().items()}
    assert kinds["blocks.0.attn.to_qkv.weight"] == dtype
    assert kinds["out_layer.weight"] == kinds["offset_perturbation"] == torch.float32


def test_other_weights_are_refused(saved):
    path = saved[1]
    file = path.with_suffix(".safetensors")
    own = load_file(str(file))
    save_file({k: v for k, v in own.items() if k != "out_layer.bias"}, str(file))
    refused(path, "lacks out_layer.bias")
    save_file({**own, "stranger": torch.zeros(1)}, str(file))
    refused(path, "stranger", "too many")
    save_file({**own, "out_layer.bias": torch.zeros(3)}, str(file))
    refused(path, "out_layer.bias", "(3,)")


def test_damaged_and_lying_files_are_refused(saved):
    path = saved[1]
    file = path.with_suffix(".safetensors")
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    refused(path, "damaged")
    file.write_bytes(struct.pack("<Q", 1 << 62) + b"{}")
    refused(path, "damaged")
    file.write_bytes(b"")
    refused(path, "damaged")


def test_a_pickle_is_never_read(saved):
    path = saved[1]
    path.with_suffix(".safetensors").unlink()
    refused(path, "missing")
    torch.save({}, path.with_suffix(".pt"))
    refused(path, "could run code")


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"num_blocks": 1 << 40}, "num_blocks"),
        ({"num_blocks": -1}, "num_blocks"),
        ({"model_channels": "many"}, "model_channels"),
        ({"num_heads": 5}, "heads"),
        ({"num_heads": None}, "heads"),
        ({"pe_mode": "rope"}, "pe_mode"),
        ({"attn_mode": "full"}, "attn_mode"),
        ({"surprise": 1}, "surprise"),
        ({"representation_config": None}, "Gaussians"),
    ],
)
def test_descriptions_that_are_not_understood_are_refused(saved, changes, word):
    path = saved[1]
    said = tiny_trellis.description(ROLE)
    said["args"] = {**said["args"], **changes}
    path.with_suffix(".json").write_text(json.dumps(said), encoding="utf-8")
    refused(path, word)


@pytest.mark.parametrize("text", ["", "[]", "{", '{"name": "os.system", "args": {}}', "{}" * 999])
def test_a_description_that_is_none_is_refused(saved, text):
    saved[1].with_suffix(".json").write_text(text, encoding="utf-8")
    refused(saved[1])


def test_a_folder_without_its_files_is_refused(tmp_path):
    with pytest.raises(LiftError, match="not complete"):
        pipeline(tmp_path)
    for text in ("{}", '{"args": []}', '{"args": {"models": 3}}'):
        (tmp_path / "pipeline.json").write_text(text, encoding="utf-8")
        with pytest.raises(LiftError):
            pipeline(tmp_path)


def test_no_part_lies_outside_the_folder(tmp_path):
    (tmp_path / "out.json").write_text("{}", encoding="utf-8")
    inner = tmp_path / "model"
    inner.mkdir()
    for where in ("../out", str(tmp_path / "out")):
        with pytest.raises(LiftError, match="out of its folder"):
            part_path(inner, where)


def test_the_encoder_is_dinov2_before_its_last_norm(tmp_path):
    folder = tiny_trellis.write_encoder(tmp_path / "encoder")
    encoder = Encoder(folder, CPU, torch.float32)
    rgb = torch.rand(28, 28, 3)
    tokens = encoder.tokens(rgb.numpy())
    assert tokens.shape == (1, 1 + 4 + 4, tiny_trellis.WIDTH)
    net = Dinov2WithRegistersModel.from_pretrained(folder)
    net.layernorm = torch.nn.Identity()
    seen = (rgb - torch.from_numpy(MEAN)) / torch.from_numpy(STD)
    whole = net(seen.permute(2, 0, 1)[None]).last_hidden_state
    assert torch.allclose(tokens, torch.layer_norm(whole, [tiny_trellis.WIDTH]), atol=1e-4)
    file = folder / "model.safetensors"
    kept = load_file(str(file))
    kept.pop(next(key for key in kept if key.endswith("fc1.weight")))
    save_file(kept, str(file), metadata={"format": "pt"})
    with pytest.raises(LiftError, match="not DINOv2"):
        Encoder(folder, CPU, torch.float32)
    file.unlink()
    with pytest.raises(LiftError):
        Encoder(folder, CPU, torch.float32)
