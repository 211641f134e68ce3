"""LPIPS on random weights against a transcription; files that are refused; DINOv2's measures."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_core import models
from objectmorpher_core.pictures.image import Picture, encode_picture
from objectmorpher_research.evaluation.error import EvaluationError
from objectmorpher_research.evaluation.measures import dino
from objectmorpher_research.evaluation.measures.inception import DEEPEST
from objectmorpher_research.evaluation.measures.inception import shapes as inception_shapes
from objectmorpher_research.evaluation.measures.lpips import Lpips
from objectmorpher_research.evaluation.measures.plain_convolutions import (
    ALEX_LAYERS,
    VGG_LAYERS,
    shapes,
)
from objectmorpher_research.evaluation.measures.trunk_files import find
from objectmorpher_research.evaluation.metrics import Choices, measure
from objectmorpher_research.evaluation.pairs import find_pairs
from tests.photos import photo
from tests.research.evaluation.measures.random_weights import random_state

pytestmark = pytest.mark.slow

torch = pytest.importorskip("torch")
nn = torch.nn
F32 = 1e-4  # relative, of sums of some thousand products

LAYERS = {"alex": ALEX_LAYERS, "vgg": VGG_LAYERS}
WIDTHS = {"alex": (64, 192, 384, 256, 256), "vgg": (64, 128, 256, 512, 512)}


@pytest.fixture(scope="module")
def weights(tmp_path_factory) -> Path:
    """A folder of random weights under the published names."""
    folder = tmp_path_factory.mktemp("weights")
    for net, file in (("alex", "alexnet-owt-7be5be79.pth"), ("vgg", "vgg16-397923af.pth")):
        torch.save(random_state(shapes(LAYERS[net])), folder / file)
        heads = {
            f"lin{k}.model.1.weight": torch.rand(1, c, 1, 1) for k, c in enumerate(WIDTHS[net])
        }
        torch.save(heads, folder / f"lpips-v0.1-{net}.pth")
    state = random_state(inception_shapes(DEEPEST))
    torch.save(state, folder / "inception_v3_google-0cc3c7bd.pth")
    torch.save(state, folder / "weights-inception-2015-12-05-6726825d.pth")
    return folder


@pytest.fixture(scope="module")
def pair() -> tuple[np.ndarray, np.ndarray]:
    cat = photo("chelsea")[40:180, 80:248].copy()
    return cat, np.ascontiguousarray(255 - cat[:, ::-1])


def opened(net: str, weights: Path) -> Lpips:
    trunk = {"alex": "alexnet-owt-7be5be79.pth", "vgg": "vgg16-397923af.pth"}[net]
    return Lpips(net, weights / trunk, weights / f"lpips-v0.1-{net}.pth")


def transcribed_lpips(net: str, weights: Path, a: np.ndarray, b: np.ndarray) -> float:
    """The paper's eq. 1 on modules in a row, as torchvision's `features` are."""
    if net == "alex":
        row = [nn.Conv2d(3, 64, 11, 4, 2), nn.ReLU(), nn.MaxPool2d(3, 2),
            nn.Conv2d(64, 192, 5, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2),
            nn.Conv2d(192, 384, 3, padding=1), nn.ReLU(), nn.Conv2d(384, 256, 3, padding=1),
            nn.ReLU(), nn.Conv2d(256, 256, 3, padding=1), nn.ReLU()]  # fmt: skip
        told, file = (1, 4, 7, 9, 11), "alexnet-owt-7be5be79.pth"
    else:
        row, before = [], 3
        for width in (64, 64, 0, 128, 128, 0, 256, 256, 256, 0, 512, 512, 512, 0, 512, 512, 512):
            row += (
                [nn.Conv2d(before, width, 3, padding=1), nn.ReLU()] if width else [nn.MaxPool2d(2)]
            )
            before = width or before
        told, file = (3, 8, 15, 22, 29), "vgg16-397923af.pth"
    net_of = nn.Sequential(*row)
    state = torch.load(weights / file, weights_only=True)
    net_of.load_state_dict({name.removeprefix("features."): t for name, t in state.items()})
    heads = torch.load(weights / f"lpips-v0.1-{net}.pth", weights_only=True)
    shift, scale = np.array([-0.030, -0.088, -0.188]), np.array([0.458, 0.448, 0.450])
    total = 0.0
    with torch.no_grad():
        sides = []
        for rgb in (a, b):
            x = torch.tensor(((rgb / 127.5 - 1 - shift) / scale).transpose(2, 0, 1)[None]).float()
            found = []
            for k, module in enumerate(net_of):
                x = module(x)
                if k in told:
                    found.append(x / (x.pow(2).sum(1, keepdim=True).sqrt() + 1e-10))
            sides.append(found)
        for k, (x, y) in enumerate(zip(*sides, strict=True)):
            head = heads[f"lin{k}.model.1.weight"]
            total += float(nn.functional.conv2d((x - y) ** 2, head).mean())
    return total


@pytest.mark.parametrize("net", ["alex", "vgg"])
def test_lpips_is_what_the_paper_defines(weights, pair, net):
    a, b = pair
    lpips = opened(net, weights)
    assert lpips(a, b, [None])[0] == pytest.approx(transcribed_lpips(net, weights, a, b), rel=F32)
    assert lpips(a, a, [None])[0] == 0
    assert lpips(a, b, [None]) == pytest.approx(lpips(b, a, [None]), rel=F32)
    whole = np.ones(a.shape[:2])
    assert lpips(a, b, [whole]) == pytest.approx(lpips(a, b, [None]), rel=F32)


def test_safetensors_give_the_same(weights, pair, tmp_path):
    safetensors = pytest.importorskip("safetensors.torch")
    for name in ("alexnet-owt-7be5be79", "lpips-v0.1-alex"):
        state = torch.load(weights / f"{name}.pth", weights_only=True)
        safetensors.save_file(state, tmp_path / f"{name}.safetensors")
    trunk, heads = (find(id, tmp_path) for id in ("alexnet", "lpips-alex"))
    assert trunk is not None and heads is not None
    assert Lpips("alex", trunk, heads)(*pair, [None]) == opened("alex", weights)(*pair, [None])


def test_lpips_is_taken_in_the_region(weights, pair):
    a, _ = pair
    b = a.copy()
    b[:, 120:] = 0
    far = np.zeros(a.shape[:2])
    far[:, :10] = 1
    near, distant = opened("alex", weights)(a, b, [1 - far, far])
    assert distant < near / 10


@pytest.fixture(scope="module")
def plain_weights(weights, tmp_path_factory) -> Path:
    """The same as safetensors: the names of .pth files tell their hash, which random ones lack."""
    safetensors = pytest.importorskip("safetensors.torch")
    folder = tmp_path_factory.mktemp("plain")
    for file in weights.glob("*.pth"):
        state = torch.load(file, weights_only=True)
        safetensors.save_file(state, folder / f"{file.stem}.safetensors")
    return folder


def test_a_file_that_is_not_what_its_name_says_is_refused(weights, tmp_path):
    (tmp_path / "a.png").write_bytes(
        encode_picture(Picture(photo("coffee")[:40, :40].copy()), ".png")
    )
    pairs = find_pairs(tmp_path / "a.png", tmp_path / "a.png")
    with pytest.raises(EvaluationError, match=r"not AlexNet as published.*, not 7be5be79"):
        measure(pairs, Choices(("lpips-alex",), weights))
    for name in ("alexnet-owt-7be5be79.pth", "lpips-v0.1-alex.pth"):
        (tmp_path / name).write_bytes((weights / name).read_bytes())
    os.truncate(tmp_path / "alexnet-owt-7be5be79.pth", 0)
    with pytest.raises(EvaluationError, match=r"SHA-256 starts with e3b0c442"):  # of nothing
        measure(pairs, Choices(("lpips-alex",), tmp_path))


@pytest.mark.slow
def test_everything_in_one_run(plain_weights, tmp_path):
    weights = plain_weights
    for name in "ab":
        (tmp_path / name).mkdir()
    for k, of in enumerate(("chelsea", "coffee", "flower")):
        rgb = photo(of)[:150, :160].copy()
        for name, pixels in (("a", rgb), ("b", 255 - rgb)):
            (tmp_path / name / f"{k}.png").write_bytes(encode_picture(Picture(pixels), ".png"))
    pairs = find_pairs(tmp_path / "a", tmp_path / "b")
    chosen = ("lpips-alex", "sifid-192", "fid", "kid", "kid-paired")
    results = measure(pairs, Choices(chosen, weights))
    found = {s.metric: s.estimate.value for s in results.scores}
    assert len(results.weights) == 4 and all(len(v) == 64 for v in results.weights.values())
    assert set(found) == set(chosen) and all(np.isfinite(v) for v in found.values())
    assert found["fid"] > 0
    same = find_pairs(tmp_path / "a", tmp_path / "a")
    found = {s.metric: s.estimate.value for s in measure(same, Choices(chosen, weights)).scores}
    assert found["lpips-alex"] == 0 and found["kid-paired"] == pytest.approx(0, abs=1e-9)
    assert found["kid"] < 0
    left = measure(pairs, Choices(weights=tmp_path)).lacking
    assert {"lpips-alex", "lpips-vgg", "sifid-192", "fid", "kid"} <= {item.metric for item in left}


class Evil:
    def __reduce__(self):
        return print, ("run",)


def test_files_that_do_not_fit_are_refused(weights, tmp_path, capsys):
    wrong = {"cut": b"PK\x03\x04 and no more", "empty": b""}
    for name, data in wrong.items():
        (tmp_path / f"{name}.pth").write_bytes(data)
    torch.save({"features.0.weight": Evil()}, tmp_path / "evil.pth")
    torch.save(torch.zeros(3), tmp_path / "no_table.pth")
    torch.save({"features.0.weight": torch.zeros(3)}, tmp_path / "shape.pth")
    (tmp_path / "plain.safetensors").write_bytes(b"nothing")
    heads = weights / "lpips-v0.1-alex.pth"
    for path in sorted(tmp_path.iterdir()):
        with pytest.raises(EvaluationError, match=path.name):
            Lpips("alex", path, heads)
    assert capsys.readouterr().out == ""


@pytest.fixture
def network() -> dino.Dino:
    if dino.missing():
        pytest.skip(str(dino.missing()))
    return dino.Dino()


def test_dinov2_knows_the_same_cat_again(network):
    cat, cup = photo("chelsea")[:252:2, :452:2].copy(), photo("coffee")[:252:2, :452:2].copy()
    moved = np.roll(cat, 28, 1)
    assert network.perceptual(cat, cat, [None])[0] == pytest.approx(0, abs=1e-6)
    assert network.identity(cat, cat, [None])[0] == pytest.approx(1, abs=1e-6)
    assert network.perceptual(cat, cup, [None]) == network.perceptual(cup, cat, [None])
    assert network.identity(cat, moved, [None])[0] > network.identity(cat, cup, [None])[0]
    assert network.perceptual(cat, moved, [None])[0] < network.perceptual(cat, cup, [None])[0]


def test_without_dinov2_it_is_said(monkeypatch, tmp_path):
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path))
    assert models.path("dinov2-vits14") is None
    (tmp_path / "a.png").write_bytes(
        encode_picture(Picture(photo("coffee")[:40, :40].copy()), ".png")
    )
    pairs = find_pairs(tmp_path / "a.png", tmp_path / "a.png")
    assert "dinov2-identity" in {left.metric for left in measure(pairs, Choices()).lacking}
    with pytest.raises(EvaluationError, match="dinov2-identity cannot be measured"):
        measure(pairs, Choices(("dinov2-identity",)))
