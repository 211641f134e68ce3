"""Other programs' LPIPS, SIFID's trunk, FID and KID agree with ours on the same weights and photos.

torchmetrics is here where `make test-models` ran. torchvision, torch-fidelity and lpips need one
another and are no part of this project: what needs them is skipped unless somebody installs them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from objectmorpher_research.evaluation.measures.fidelity import psnr, ssim
from objectmorpher_research.evaluation.measures.frechet import frechet_of_samples
from objectmorpher_research.evaluation.measures.inception import DEEPEST, Inception
from objectmorpher_research.evaluation.measures.inception import shapes as inception_shapes
from objectmorpher_research.evaluation.measures.inception_measures import (
    FidFeatures,
    resized_as_tensorflow,
)
from objectmorpher_research.evaluation.measures.lpips import Lpips
from objectmorpher_research.evaluation.measures.mmd import paired_kid, unbiased_mmd2
from objectmorpher_research.evaluation.measures.plain_convolutions import (
    ALEX_LAYERS,
    VGG_LAYERS,
    shapes,
)
from tests.photos import photo
from tests.research.evaluation.measures.random_weights import random_state

torch = pytest.importorskip("torch")
F32 = 1e-4  # relative, of sums of some thousand products
SIDE = 96  # px of the crops
LAYERS = {"alex": ALEX_LAYERS, "vgg": VGG_LAYERS}


@pytest.fixture(scope="module")
def crops() -> tuple[np.ndarray, np.ndarray]:
    """Two sets (16, H, W, 3): crops of photos, and the same ones changed."""
    random = np.random.default_rng(0)
    taken, changed = [], []
    for k in range(16):
        rgb = photo(("chelsea", "coffee", "flower")[k % 3])
        y, x = (random.integers(0, n - SIDE) for n in rgb.shape[:2])
        crop = rgb[y : y + SIDE, x : x + SIDE]
        taken.append(crop)
        noise = random.normal(0, 12, crop.shape)
        changed.append(np.clip(crop[:, ::-1] * 0.9 + noise, 0, 255).astype(np.uint8))
    return np.stack(taken), np.stack(changed)


class Embedding(torch.nn.Module):
    """What a measure of sets looks at."""

    def __init__(self, ours: Any) -> None:
        super().__init__()
        self.ours = ours

    def forward(self, images: Any) -> Any:
        pixels = images.permute(0, 2, 3, 1).numpy()
        return torch.from_numpy(np.stack([self.ours(rgb) for rgb in pixels]))


@pytest.fixture(scope="module")
def features() -> Any:
    """(48,) of a picture, a random projection."""
    mixed = np.random.default_rng(1).normal(size=(48, 12 * 12 * 3)) / 20

    def project(rgb: np.ndarray) -> np.ndarray:
        small = np.resize(rgb, (SIDE, SIDE, 3)).reshape(12, 8, 12, 8, 3).mean((1, 3)) / 255
        return mixed @ small.ravel()

    return project


@pytest.fixture(scope="module")
def embedded(crops, features) -> tuple[np.ndarray, np.ndarray]:
    """Both sets' features (16, d)."""
    x, y = (np.stack([features(rgb) for rgb in side]) for side in crops)
    return x, y


def as_batch(pictures: np.ndarray) -> Any:
    return torch.from_numpy(np.ascontiguousarray(pictures.transpose(0, 3, 1, 2)))


def test_kid_and_fid_of_torchmetrics_on_the_same_features(crops, features, embedded):
    fid = pytest.importorskip("torchmetrics.image.fid")
    kid = pytest.importorskip("torchmetrics.image.kid")
    x, y = embedded
    theirs = kid.KernelInceptionDistance(Embedding(features), subsets=1, subset_size=len(x))
    for side, is_real in zip(crops, (True, False), strict=True):
        theirs.update(as_batch(side), real=is_real)
    assert unbiased_mmd2(x, y) == pytest.approx(float(theirs.compute()[0]), rel=F32)

    def gaussian(samples: np.ndarray) -> tuple[Any, Any]:
        return torch.from_numpy(samples.mean(0)), torch.from_numpy(np.cov(samples, rowvar=False))

    few = 12  # features, fewer than samples: its root of a singular product is inexact
    x, y = x[:, :few], y[:, :few]
    expected = float(fid._compute_fid(*gaussian(x), *gaussian(y)))
    assert frechet_of_samples(x, y) == pytest.approx(expected, rel=1e-6)


def test_psnr_and_ssim_of_torchmetrics(crops):
    image = pytest.importorskip("torchmetrics.functional.image")
    a, b = crops[0][0], crops[1][0]
    first, second = (as_batch(p[None]).double() for p in (a, b))
    # Of its map only where the window lies inside the picture: its own mean takes in the rim.
    _, everywhere = image.structural_similarity_index_measure(
        first, second, data_range=255.0, sigma=1.5, return_full_image=True
    )
    inner = float(everywhere[..., 5:-5, 5:-5].mean())
    assert ssim(a, b, [None])[0] == pytest.approx(inner, rel=1e-6)
    found = image.peak_signal_noise_ratio(first, second, data_range=255.0)
    assert psnr(a, b, [None])[0] == pytest.approx(float(found), rel=F32)


def test_both_estimators_of_torch_fidelity(embedded):
    mmd2 = pytest.importorskip("torch_fidelity.metric_kid").mmd2
    x, y = embedded

    def kernel(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (a @ b.T / a.shape[1] + 1) ** 3

    kernels = kernel(x, x), kernel(x, y), kernel(y, y)
    assert unbiased_mmd2(x, y) == pytest.approx(mmd2(*kernels), rel=1e-9)
    paired = mmd2(*kernels, mmd_est="u-statistic")
    assert paired_kid(x, y).value == pytest.approx(paired, rel=1e-9)


@pytest.fixture(scope="module")
def heads(tmp_path_factory) -> dict[str, Path]:
    """LPIPS's own heads out of torchmetrics' package."""
    package = pytest.importorskip("torchmetrics.functional.image.lpips")
    folder = Path(str(package.__file__)).parent / "lpips_models"
    return {net: folder / f"{net}.pth" for net in LAYERS}


@pytest.mark.parametrize("net", ["alex", "vgg"])
def test_lpips_of_torchmetrics_and_of_its_authors(crops, heads, tmp_path, net):
    pytest.importorskip("torchvision.models")
    others = pytest.importorskip("torchmetrics.functional.image.lpips")
    state = random_state(shapes(LAYERS[net]))
    torch.save(state, tmp_path / "trunk.pth")
    a, b = crops[0][0], crops[1][0]
    ours = Lpips(net, tmp_path / "trunk.pth", heads[net])(a, b, [None])[0]
    first, second = (as_batch(p[None]) / 127.5 - 1 for p in (a, b))
    theirs = others._LPIPS(net=net, pnet_rand=True, model_path=str(heads[net]))
    take_convolutions(theirs.net, state)
    with torch.no_grad():
        assert ours == pytest.approx(float(theirs(first, second)), rel=F32)
        authors = pytest.importorskip("lpips").LPIPS(
            net=net, pnet_rand=True, model_path=str(heads[net]), verbose=False
        )
        take_convolutions(authors.net, state)
        assert ours == pytest.approx(float(authors(first, second)), rel=F32)


def take_convolutions(net: Any, state: dict[str, Any]) -> None:
    """Puts torchvision's `features.N.weight` into slices, whose names end in the same N."""
    wanted = net.state_dict()
    by_layer = {name.split(".", 1)[1]: name for name in wanted}
    assert len(by_layer) == len(wanted) == len(state)
    net.load_state_dict({by_layer[n.removeprefix("features.")]: t for n, t in state.items()})


@pytest.fixture(scope="module")
def inception_state() -> dict[str, Any]:
    return random_state(inception_shapes(DEEPEST))


def test_the_inception_of_torchvision(crops, inception_state):
    """Every block: what its own modules give, up to each depth that is measured."""
    vision = pytest.importorskip("torchvision.models")
    theirs = vision.inception_v3(weights=None, aux_logits=True, init_weights=False).eval()
    lacking, unknown = theirs.load_state_dict(inception_state, strict=False)
    assert not unknown
    assert all(n.startswith(("AuxLogits", "fc")) or "batches" in n for n in lacking)
    seen: dict[str, Any] = {}
    for name, module in theirs.named_children():
        module.register_forward_hook(lambda _, __, out, name=name: seen.update({name: out}))
    pixels = as_batch(crops[0][:1]).float() / 127.5 - 1
    pixels = torch.nn.functional.interpolate(pixels, size=(299, 299))
    with torch.no_grad():
        theirs._forward(pixels)
        for channels, block in (
            (64, "Conv2d_2b_3x3"), (192, "Conv2d_4a_3x3"), (768, "Mixed_6e"), (2048, "Mixed_7c"),
        ):  # fmt: skip
            ours = Inception(inception_state, channels, is_fid=False)(pixels)
            expected = seen[block]
            assert ours.shape == expected.shape
            assert float((ours - expected).abs().max() / expected.abs().max()) < F32


def test_the_inception_of_torch_fidelity(crops, inception_state, tmp_path):
    """Resize, normalisation, the pools that differ, and the mean over places."""
    theirs = pytest.importorskip("torch_fidelity.feature_extractor_inceptionv3")
    whole = {
        **inception_state,
        "fc.weight": torch.zeros(1008, DEEPEST),
        "fc.bias": torch.zeros(1008),
    }
    torch.save(whole, tmp_path / "weights.pth")
    extractor = theirs.FeatureExtractorInceptionV3(
        "inception", ["2048"], feature_extractor_weights_path=str(tmp_path / "weights.pth")
    )
    ours = FidFeatures(tmp_path / "weights.pth")
    for picture in (crops[0][0], photo("coffee")[:350, :410]):
        with torch.no_grad():
            expected = extractor(as_batch(picture[None]))[0][0].numpy()
        assert ours(picture) == pytest.approx(expected, abs=F32 * float(expected.max()))
    resized = pytest.importorskip("torch_fidelity.interpolate_compat_tensorflow")
    batch = as_batch(crops[0][:1]).float()
    expected = resized.interpolate_bilinear_2d_like_tensorflow1x(
        batch, size=(299, 299), align_corners=False
    )
    found = resized_as_tensorflow(crops[0][0].astype(np.float32), 299)
    assert found == pytest.approx(expected[0].permute(1, 2, 0).numpy(), abs=255 * F32)
