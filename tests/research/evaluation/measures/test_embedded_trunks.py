"""HED-VGG perceptual: the network is what it is said to be, and measures.

On random weights against a transcription; with the real ones, where the cache has them, by what
they were trained for: edges where people draw outlines.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import h5py
import numpy as np
import pytest

from objectmorpher_core import models
from objectmorpher_core.pictures.image import Picture, encode_picture
from objectmorpher_research.evaluation.error import EvaluationError
from objectmorpher_research.evaluation.measures import hed_vgg
from objectmorpher_research.evaluation.measures.hed_vgg import (
    HedVgg,
    read_arrays,
    read_hed_vgg,
    vgg_graph,
)
from objectmorpher_research.evaluation.metrics import Choices, measure
from objectmorpher_research.evaluation.pairs import find_pairs
from tests.photos import photo

pytestmark = pytest.mark.slow

F32 = 1e-4  # relative, of sums of some thousand products
SMALL = 96  # px
PHOTOS = ("chelsea", "coffee")


def noisy(rgb: np.ndarray, sigma: float) -> np.ndarray:
    noise = np.random.default_rng(0).normal(0, sigma, rgb.shape)
    return np.clip(rgb + noise, 0, 255).astype(np.uint8)


def random_vgg() -> dict[str, np.ndarray]:
    """As Keras's file has it: (rows, columns, in, out)."""
    random, found, before = np.random.default_rng(0), {}, 3
    for block, widths in enumerate(hed_vgg.BLOCKS, 1):
        for k, width in enumerate(widths):
            at = f"block{block}/layers/conv2d{f'_{k}' if k else ''}/vars"
            kernel = random.normal(size=(3, 3, before, width)) * (2 / (9 * before)) ** 0.5
            found[f"{at}/0"] = kernel.astype(np.float32)
            found[f"{at}/1"] = random.normal(size=width).astype(np.float32)
            before = width
    return found


def test_the_five_layers_are_those_of_a_vgg_in_pytorch():
    torch = pytest.importorskip("torch")
    arrays, rgb = random_vgg(), photo("chelsea")[:43, :58].copy()  # odd: poolings keep the rest
    found = HedVgg(arrays).layers(rgb)
    x = torch.tensor(rgb[..., ::-1].copy()).float() - torch.tensor(
        [104.00699, 116.66877, 122.67892]
    )
    x = x.permute(2, 0, 1)[None]
    for block, ours in enumerate(found, 1):
        if block > 1:
            x = torch.nn.MaxPool2d(2, ceil_mode=True)(x)
        for k in range(len(hed_vgg.BLOCKS[block - 1])):
            at = f"block{block}/layers/conv2d{f'_{k}' if k else ''}/vars"
            kernel = torch.tensor(arrays[f"{at}/0"]).permute(3, 2, 0, 1)
            x = torch.relu(
                torch.nn.functional.conv2d(x, kernel, torch.tensor(arrays[f"{at}/1"]), padding=1)
            )
        assert ours.shape == tuple(x.shape[1:])
        assert ours == pytest.approx(x[0].numpy(), abs=F32 * float(x.max()))


def test_the_distance_is_what_is_defined():
    """One minus the cosine at a place, its mean over places, their mean over the five layers."""
    network = HedVgg(random_vgg())
    a = photo("chelsea")[:60, :70].copy()
    b = 255 - a
    apart = []
    for x, y in zip(network.layers(a), network.layers(b), strict=True):
        lengths = np.linalg.norm(x, axis=0) * np.linalg.norm(y, axis=0)
        apart.append((1 - (x.astype(np.float64) * y).sum(0) / lengths).mean())
    assert network(a, b, [None])[0] == pytest.approx(np.mean(apart), rel=1e-3)
    assert network(a, a, [None]) == (0,)
    assert network(a, b, [None]) == pytest.approx(network(b, a, [None]))
    assert 0 < network(a, b, [None])[0] <= 1
    black = np.zeros_like(a)  # where nothing is seen in either nothing differs
    assert network(black, black, [None]) == (0,)


def test_a_region_hardly_sees_what_happens_far_from_it():
    network = HedVgg(random_vgg())
    a = photo("chelsea")[:120, :200].copy()
    b = a.copy()
    b[:, 170:] = 0
    far = np.zeros(a.shape[:2])
    far[:, :10] = 1
    near, distant, whole = network(a, b, [1 - far, far, np.ones_like(far)])
    assert distant < near / 10
    assert whole == pytest.approx(network(a, b, [None])[0], rel=1e-6)


def test_weights_that_lack_a_layer_are_one_sentence():
    arrays = random_vgg()
    del arrays["block3/layers/conv2d_1/vars/1"]
    with pytest.raises(EvaluationError, match="lack block3/layers/conv2d_1/vars"):
        vgg_graph(arrays)


def test_kerass_file_gives_every_array_by_its_path(tmp_path):
    arrays = random_vgg()
    with h5py.File(tmp_path / "hed.weights.h5", "w") as file:
        for name, values in arrays.items():
            file[name] = values
        file["block1/layers/conv2d"].attrs["name"] = "block1_conv1"
    found = read_arrays(tmp_path / "hed.weights.h5")
    assert set(found) == set(arrays)
    assert all(np.array_equal(found[name], values) for name, values in arrays.items())


@pytest.mark.parametrize("share", [0, 0.01, 0.5, 0.99])
def test_weights_that_are_cut_off_are_one_sentence(tmp_path, share):
    path = tmp_path / "cut.h5"
    with h5py.File(path, "w") as file:
        file["block1/layers/conv2d/vars/0"] = np.ones((3, 3, 3, 64), np.float32)
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * share)])
    with pytest.raises(EvaluationError, match=r"cut\.h5 is damaged, or no HDF5 file"):
        read_arrays(path)


@pytest.fixture(scope="module")
def real_hed() -> HedVgg:
    path = models.path(hed_vgg.WEIGHT)
    if path is None:
        pytest.skip("hed-vgg is not in the cache")
    return read_hed_vgg(path)


def test_the_real_network_still_finds_edges(real_hed):
    """Its side outputs and their sum, which the measure does not use, are still HED's."""
    path = models.path(hed_vgg.WEIGHT)
    assert path is not None
    arrays = read_arrays(path)
    rgb = np.full((128, 160, 3), 40, np.uint8)
    cv2.circle(rgb, (80, 64), 40, (200, 190, 170), -1)
    rgb = noisy(rgb, 6)
    total = np.zeros(rgb.shape[:2])
    fuse = arrays["fuse/vars/0"].ravel()
    for k, layer in enumerate(real_hed.layers(rgb)):
        weights, bias = arrays[f"dsn{k + 1}/vars/0"].ravel(), arrays[f"dsn{k + 1}/vars/1"][0]
        side = np.tensordot(weights, layer, 1) + bias
        total += fuse[k] * cv2.resize(side, (160, 128), interpolation=cv2.INTER_LINEAR)
    edge = 1 / (1 + np.exp(-(total + arrays["fuse/vars/1"][0])))
    y, x = np.mgrid[:128, :160]
    from_outline = np.abs(np.hypot(x - 80, y - 64) - 40)
    assert edge[from_outline < 1].mean() > 0.5
    assert edge[from_outline > 12].mean() < 0.05


def test_more_noise_is_farther_and_another_photo_farthest(real_hed):
    cat, cup = (photo(name)[40:136, 60:188].copy() for name in ("chelsea", "coffee"))
    far = [real_hed(cat, other, [None])[0] for other in (noisy(cat, 4), noisy(cat, 25), cup)]
    assert 0 < far[0] < far[1] < far[2] < 1


Folders = Callable[[str, list[np.ndarray]], Any]


@pytest.fixture
def folder(tmp_path) -> Folders:
    def write(name: str, pictures: list[np.ndarray]) -> Any:
        (tmp_path / name).mkdir()
        for k, rgb in enumerate(pictures):
            (tmp_path / name / f"{k}.png").write_bytes(encode_picture(Picture(rgb), ".png"))
        return tmp_path / name

    return write


def test_it_is_measured_beside_the_others(real_hed, folder):
    crops = [photo(n)[y : y + SMALL, 40 : 40 + SMALL].copy() for n in PHOTOS for y in (0, 60, 120)]
    a, b = folder("a", crops), folder("b", [noisy(rgb, 30) for rgb in crops])
    names = ("hed-vgg-perceptual", "psnr")
    results = measure(find_pairs(a, b), Choices(names))
    found = {score.metric: score.estimate.value for score in results.scores}
    assert set(found) == set(names) and found["hed-vgg-perceptual"] > 0
    assert set(results.weights.values()) == {models.weight(hed_vgg.WEIGHT).sha256}
    same = {s.metric: s.estimate.value for s in measure(find_pairs(a, a), Choices(names)).scores}
    assert same["hed-vgg-perceptual"] == 0


def test_without_their_weights_it_is_said(monkeypatch, tmp_path, folder):
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "nothing"))
    a = folder("a", [photo("coffee")[:40, :40].copy()] * 2)
    lacking = {left.metric: left.reason for left in measure(find_pairs(a, a), Choices()).lacking}
    assert "objectmorpher models get hed-vgg" in lacking["hed-vgg-perceptual"]
    assert "alexnet-owt-7be5be79.pth in " in lacking["lpips-alex"]
    with pytest.raises(EvaluationError, match="hed-vgg-perceptual cannot be measured"):
        measure(find_pairs(a, a), Choices(("hed-vgg-perceptual",)))
