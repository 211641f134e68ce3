"""Inception's blocks, SIFID and FID's features on random weights, against a transcription."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objectmorpher_research.evaluation.measures.inception import DEEPEST, PARTS, Inception
from objectmorpher_research.evaluation.measures.inception import shapes as inception_shapes
from objectmorpher_research.evaluation.measures.inception_measures import (
    FidFeatures,
    Sifid,
    resized_as_tensorflow,
)
from tests.photos import photo
from tests.research.evaluation.measures.random_weights import random_state

pytestmark = pytest.mark.slow

torch = pytest.importorskip("torch")
nn = torch.nn
F32 = 1e-4  # relative, of sums of some thousand products


@pytest.fixture(scope="module")
def state():
    return random_state(inception_shapes(DEEPEST))


@pytest.fixture(scope="module")
def weights(state, tmp_path_factory) -> Path:
    """The file of them; the same names serve both Inceptions."""
    path = tmp_path_factory.mktemp("weights") / "inception.pth"
    torch.save(state, path)
    return path


@pytest.fixture(scope="module")
def pair() -> tuple[np.ndarray, np.ndarray]:
    cat = photo("chelsea")[40:180, 80:248].copy()
    return cat, np.ascontiguousarray(255 - cat[:, ::-1])


def test_inception_has_the_published_widths():
    convolutions = PARTS[DEEPEST]
    assert len(convolutions) == 94  # of Inception-v3 without the auxiliary head
    count = sum(np.prod(s) for n, s in inception_shapes(DEEPEST).items() if "running" not in n)
    assert count == 21_785_568  # torchvision's 27,161,264 less fc 2,049,000 and AuxLogits 3,326,696


# Sides and channels after each block for 299 px, as the paper's table 1 and TensorFlow's slim tell.
PUBLISHED = {
    "Conv2d_1a_3x3": (149, 32), "Conv2d_2a_3x3": (147, 32), "Conv2d_2b_3x3": (147, 64),
    "Conv2d_3b_1x1": (73, 80), "Conv2d_4a_3x3": (71, 192),
    "Mixed_5b": (35, 256), "Mixed_5c": (35, 288), "Mixed_5d": (35, 288),
    "Mixed_6a": (17, 768), "Mixed_6b": (17, 768), "Mixed_6c": (17, 768), "Mixed_6d": (17, 768),
    "Mixed_6e": (17, 768), "Mixed_7a": (8, 1280), "Mixed_7b": (8, 2048), "Mixed_7c": (8, 2048),
}  # fmt: skip
# Branches of a kind of block: the layers of each, by the ends of their names; "|" splits in two.
SPLIT_A = ("1x1", "5x5_1 5x5_2", "3x3dbl_1 3x3dbl_2 3x3dbl_3", "_pool")
SPLIT_C = ("1x1", "7x7_1 7x7_2 7x7_3", "7x7dbl_1 7x7dbl_2 7x7dbl_3 7x7dbl_4 7x7dbl_5", "_pool")
SPLIT_E = ("1x1", "3x3_1 3x3_2a|3x3_2b", "3x3dbl_1 3x3dbl_2 3x3dbl_3a|3x3dbl_3b", "_pool")
SPLITS = {
    **dict.fromkeys(("Mixed_5b", "Mixed_5c", "Mixed_5d"), SPLIT_A),
    "Mixed_6a": ("3x3", "3x3dbl_1 3x3dbl_2 3x3dbl_3", "largest"),
    **dict.fromkeys(("Mixed_6b", "Mixed_6c", "Mixed_6d", "Mixed_6e"), SPLIT_C),
    "Mixed_7a": ("3x3_1 3x3_2", "7x7x3_1 7x7x3_2 7x7x3_3 7x7x3_4", "largest"),
    **dict.fromkeys(("Mixed_7b", "Mixed_7c"), SPLIT_E),
}
HALVING = ("Conv2d_1a_3x3", "Mixed_6a.branch3x3", "Mixed_6a.branch3x3dbl_3",
    "Mixed_7a.branch3x3_2", "Mixed_7a.branch7x7x3_4")  # fmt: skip
UNPADDED = (*HALVING, "Conv2d_2a_3x3", "Conv2d_4a_3x3")


def transcribed_layer(state, x, name):
    """Convolution, batch normalisation by its formula, rectifier; padded by the filters' size."""
    weight = state[f"{name}.conv.weight"]
    conv = nn.Conv2d(
        *weight.shape[1::-1], weight.shape[2:], stride=2 if name in HALVING else 1, bias=False,
        padding=0 if name in UNPADDED else tuple(n // 2 for n in weight.shape[2:]),
    )  # fmt: skip
    conv.weight.data = weight
    shift, scale, mean, variance = (
        state[f"{name}.bn.{of}"][:, None, None]
        for of in ("bias", "weight", "running_mean", "running_var")
    )
    return torch.relu((conv(x) - mean) / (variance + 0.001).sqrt() * scale + shift)


def transcribed_inception(state, x, is_fid):
    """{block: (n, channels, h, w)}: the whole network as a table of branches."""
    found = {}
    for name in PUBLISHED:
        if name in ("Conv2d_3b_1x1", "Mixed_5b"):
            x = nn.MaxPool2d(3, 2)(x)
        if name not in SPLITS:
            found[name] = x = transcribed_layer(state, x, name)
            continue
        parts = []
        for branch in SPLITS[name]:
            if branch == "largest":
                parts.append(nn.MaxPool2d(3, 2)(x))
                continue
            if branch == "_pool":
                windows = nn.functional.pad(x, (1, 1, 1, 1)).unfold(2, 3, 1).unfold(3, 3, 1)
                pooled = windows.mean((4, 5))
                if is_fid and name == "Mixed_7c":  # not negative: a padded zero is never above
                    pooled = windows.amax((4, 5))
                elif is_fid:  # of the pixels that are there, four in a corner
                    inside = nn.functional.pad(torch.ones_like(x), (1, 1, 1, 1))
                    pooled /= inside.unfold(2, 3, 1).unfold(3, 3, 1).mean((4, 5))
                parts.append(transcribed_layer(state, pooled, f"{name}.branch_pool"))
                continue
            *before, last = branch.split(" ")
            inner = x
            for layer in before:
                inner = transcribed_layer(state, inner, f"{name}.branch{layer}")
            for end in last.split("|"):
                parts.append(transcribed_layer(state, inner, f"{name}.branch{end}"))
        found[name] = x = torch.cat(parts, 1)
    return found


def test_every_block_of_the_transcribed_inception_has_the_published_size(state):
    with torch.no_grad():
        found = transcribed_inception(state, torch.zeros(1, 3, 299, 299), is_fid=False)
    assert {name: (x.shape[3], x.shape[1]) for name, x in found.items()} == PUBLISHED


@pytest.mark.parametrize("is_fid", [False, True])
def test_inception_is_what_was_published(state, pair, is_fid):
    pixels = torch.tensor(pair[0].transpose(2, 0, 1)[None] / 127.5 - 1).float()
    ends = {64: "Conv2d_2b_3x3", 192: "Conv2d_4a_3x3", 768: "Mixed_6e", DEEPEST: "Mixed_7c"}
    with torch.no_grad():
        found = transcribed_inception(state, pixels, is_fid)
        other = transcribed_inception(state, pixels, not is_fid)
        for channels, block in ends.items():
            ours, size = Inception(state, channels, is_fid)(pixels), float(found[block].max())
            assert float((ours - found[block]).abs().max()) < F32 * size
            if channels >= 768:  # the two Inceptions are told apart
                assert float((ours - other[block]).abs().max()) > 100 * F32 * size


@pytest.mark.filterwarnings("ignore:Matrix is singular")  # random features: many are alike
def test_sifid_is_what_singan_defines(state, weights, pair):
    from scipy.linalg import sqrtm

    a, b = pair
    found = []
    with torch.no_grad():
        for rgb in (a, b):
            x = 2 * torch.tensor(rgb.transpose(2, 0, 1)[None]).float() / 255 - 1
            places = (
                transcribed_inception(state, x, is_fid=False)["Conv2d_4a_3x3"][0]
                .reshape(192, -1)
                .T.double()
                .numpy()
            )
            found.append((places.mean(0), np.cov(places, rowvar=False)))
    (m1, s1), (m2, s2) = found
    expected = ((m1 - m2) ** 2).sum() + np.trace(s1 + s2 - 2 * np.real(sqrtm(s1 @ s2)))
    sifid = Sifid(weights, 192)
    assert sifid(a, b, [None])[0] == pytest.approx(expected, rel=1e-3)  # scipy's root, singular
    assert sifid(b, a, [None])[0] == pytest.approx(expected, rel=1e-3)
    assert sifid(a, a, [None])[0] == pytest.approx(0, abs=1e-6 * expected)
    assert np.isnan(sifid(a, b, [np.zeros(a.shape[:2])])[0])


@pytest.mark.parametrize("channels", [64, 768])
def test_other_depths_of_sifid(weights, pair, channels):
    sifid = Sifid(weights, channels)
    assert sifid(*pair, [None])[0] > 0


def test_fid_features_are_one_row_and_the_old_resize_keeps_a_picture_of_its_size(weights, pair):
    found = FidFeatures(weights)(pair[0])
    assert found.shape == (DEEPEST,) and np.isfinite(found).all() and found.min() >= 0
    square = photo("chelsea")[:299, :299].astype(np.float32)
    assert np.array_equal(resized_as_tensorflow(square, 299), square)
    ramp = np.repeat(np.arange(598, dtype=np.float32)[None, :, None], 598, 0).repeat(3, 2)
    assert np.array_equal(resized_as_tensorflow(ramp, 299)[5, :, 0], np.arange(0, 598, 2))
