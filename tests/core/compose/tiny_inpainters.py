"""Tiny inpainters of random weights, in files and folders as the real ones come in."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from objectmorpher_core import models
from objectmorpher_core.models.onnx_session import as_varint, bytes_field
from tests.core.models.small_networks import floats, integer, integers, model, node

FAMILIES = ("pixelhacker", "moebius", "lama", "migan")  # one model each
SIDE = 64  # px that the tiny networks see
FLOAT, BYTE = 1, 2  # TensorProto's numbers of types
TINY = {
    "sample_size": 8, "block_out_channels": [8, 16], "layers_per_block": 1,
    "down_block_types": ["CrossAttnDownBlock2D", "DownBlock2D"],
    "up_block_types": ["UpBlock2D", "CrossAttnUpBlock2D"], "attention_head_dim": 2,
    "cross_attention_dim": 12, "encoder_hid_dim": 20, "norm_num_groups": 4,
}  # fmt: skip
TINIEST = {**TINY, "block_out_channels": [8, 16, 24]}  # three levels without a middle: Moebius
del TINIEST["down_block_types"], TINIEST["up_block_types"]
LATENT = {"pixelhacker": TINY, "moebius": TINIEST}


def bring(name: str, at: Path, monkeypatch: pytest.MonkeyPatch, seed: int = 0) -> Path:
    """A tiny `name` is the one that is used, out of a folder below `at`."""
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(at / "cache"))
    folder = at / name
    if name in LATENT:
        pytest.importorskip("diffusers")
        write_latent(name, folder, seed)
        models.use_folder(name, folder)
        return folder
    folder.mkdir(parents=True)
    (folder / "tiny.onnx").write_bytes(lama(seed) if name == "lama" else migan(seed))
    models.use_folder(name, folder / "tiny.onnx")
    return folder


_written: dict[tuple[str, int], dict[str, bytes]] = {}  # name, seed -> files


def write_latent(name: str, folder: Path, seed: int = 0) -> None:
    """config.json and the weights, and vae/ beside them."""
    if (name, seed) not in _written:
        _make(name, folder, seed)
        files = [p for p in folder.rglob("*") if p.is_file()]
        _written[name, seed] = {p.relative_to(folder).as_posix(): p.read_bytes() for p in files}
    for path, content in _written[name, seed].items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)


def _make(name: str, folder: Path, seed: int) -> None:
    from diffusers import AutoencoderKL
    from safetensors.torch import save_file

    network = latent(name, seed)
    folder.mkdir(parents=True)
    (folder / "config.json").write_text(json.dumps(LATENT[name]))
    save_file(network.state_dict(), str(folder / "diffusion_pytorch_model.safetensors"))
    codec = AutoencoderKL(
        block_out_channels=(4, 4, 4, 8), layers_per_block=1, norm_num_groups=4,
        down_block_types=("DownEncoderBlock2D",) * 4, up_block_types=("UpDecoderBlock2D",) * 4,
        latent_channels=4, scaling_factor=0.13025,
    )  # fmt: skip
    codec.save_pretrained(folder / "vae")


def latent(name: str, seed: int = 0) -> Any:
    """The network, in memory."""
    import torch

    from objectmorpher_core.compose.plate.inpaint_latent import LatentInpainter
    from objectmorpher_core.compose.plate.latent_diffusion import build

    torch.manual_seed(seed)
    kind = LatentInpainter(name).kind()
    return build(kind, {**kind.published, **LATENT[name]}).eval()


def value(name: str, kind: int, channels: int) -> bytes:
    """ValueInfoProto of (1, channels, SIDE, SIDE)."""
    dims = b"".join(
        bytes_field(1, b"\x08" + as_varint(n)) for n in (1, channels, SIDE, SIDE)
    )  # fmt: skip
    tensor = b"\x08" + as_varint(kind) + bytes_field(2, dims)
    return bytes_field(1, name.encode()) + bytes_field(2, bytes_field(1, tensor))


def _weights(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, 0.4, (3, 4, 5, 5)).astype(np.float32)


def lama(seed: int = 0, scale: float = 255.0) -> bytes:
    """What is known as it is, elsewhere a random blur: in [0, scale]."""
    nodes = [
        node("Concat", ["image", "mask"], "both", integer("axis", 1)),
        node("Conv", ["both", "weights"], "blur", integers("pads", [2, 2, 2, 2])),
        node("Sigmoid", ["blur"], "invented"), node("Sub", ["invented", "image"], "gap"),
        node("Mul", ["gap", "mask"], "change"), node("Add", ["image", "change"], "whole"),
        node("Mul", ["whole", "scale"], "output"),
    ]  # fmt: skip
    tensors = [floats("weights", _weights(seed)), floats("scale", np.full((), scale))]
    ends = [value("image", FLOAT, 3), value("mask", FLOAT, 1)], [value("output", FLOAT, 3)]
    return model(nodes, tensors, ends)


def migan(seed: int = 0) -> bytes:
    """A random blur of the masked picture, all in bytes; the mask's 255 is what is known."""
    nodes = [
        node("Cast", ["image"], "levels", integer("to", FLOAT)),
        node("Cast", ["mask"], "known", integer("to", FLOAT)),
        node("Concat", ["levels", "known"], "both", integer("axis", 1)),
        node("Mul", ["both", "unit"], "units"),
        node("Conv", ["units", "weights"], "blur", integers("pads", [2, 2, 2, 2])),
        node("Sigmoid", ["blur"], "invented"), node("Div", ["invented", "unit"], "bright"),
        node("Cast", ["bright"], "result", integer("to", BYTE)),
    ]  # fmt: skip
    tensors = [floats("weights", _weights(seed)), floats("unit", np.full((), 1 / 255))]
    ends = [value("image", BYTE, 3), value("mask", BYTE, 1)], [value("result", BYTE, 3)]
    return model(nodes, tensors, ends)
