"""What is flat is learned from tokens, and seen of things that were never trained on."""

from __future__ import annotations

import hashlib
import json

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch")

from objectmorpher.cli.parser import main  # noqa: E402
from objectmorpher_core.lift.crop import SIDE, Crop  # noqa: E402
from objectmorpher_core.lift.relief.shape_look import ShapeModel  # noqa: E402
from objectmorpher_core.lift.shapes import recognised  # noqa: E402
from objectmorpher_core.models import registry  # noqa: E402
from objectmorpher_research.training import flatness, shape_data  # noqa: E402
from objectmorpher_research.training.flatness import GRID, WIDTH, FlatNet, FlatSamples  # noqa: E402
from objectmorpher_research.training.shapes.sample import (  # noqa: E402
    Sample,
    make_sample,
    make_takes,
)

ROUND = ("creatures", "figures", "busts", "lathe", "rings", "superquadrics")


def test_only_tokens_within_the_mask_count():
    rng = np.random.default_rng(0)
    tokens = torch.from_numpy(rng.normal(size=(1, WIDTH, GRID, GRID)).astype(np.float32))
    mask = torch.zeros(1, 1, SIDE, SIDE)
    mask[..., 28:70, 42:98] = 1
    found = flatness.pooled(mask, tokens)[0].numpy()
    own = tokens[0, :, 2:5, 3:7].numpy().reshape(WIDTH, -1)
    assert np.abs(found - np.concatenate([own.mean(1), own.std(1)])).max() < 1e-4
    tokens[..., 10:, :] = 9
    assert np.array_equal(flatness.pooled(mask, tokens)[0].numpy(), found)


def test_it_learns_what_tells_both_kinds_apart():
    def made(seed: int) -> FlatSamples:
        rng = np.random.default_rng(seed)
        is_flat = torch.from_numpy((rng.random(400) < 0.4).astype(np.float32))
        seen = torch.from_numpy(rng.normal(size=(400, 2, 2 * WIDTH)).astype(np.float32))
        seen[:, :, :40] += 1.5 * is_flat[:, None, None]
        return FlatSamples(seen, is_flat)

    net, again, other = FlatNet(), FlatNet(), made(1)
    for each in (net, again):
        flatness.fit(each, made(0))
    assert all(torch.equal(a, b) for a, b in zip(net.parameters(), again.parameters(), strict=True))
    found = flatness.found(net, other, 0.0)
    assert found["found"] > 0.95 * found["flat"] and found["mistaken"] < 0.05 * found["solid"]
    with pytest.raises(ValueError, match="too few"):
        flatness.fit(net, FlatSamples(other.seen, torch.ones(400)))


def test_trained_further_it_keeps_what_it_knows_and_learns_what_is_new():
    """Two kinds of things are told apart by two signs; each set of samples shows one of them."""

    def made(seed: int, sign: slice) -> FlatSamples:
        rng = np.random.default_rng(seed)
        is_flat = torch.from_numpy((rng.random(400) < 0.5).astype(np.float32))
        seen = torch.from_numpy(rng.normal(size=(400, 2, 2 * WIDTH)).astype(np.float32))
        seen[:, :, sign] += 1.5 * (2 * is_flat[:, None, None] - 1)
        return FlatSamples(seen, is_flat)

    def right(net: FlatNet, samples: FlatSamples) -> float:
        found = flatness.found(net, samples, 0.0)
        return (found["found"] + found["solid"] - found["mistaken"]) / len(samples.is_flat)

    net, first, second = FlatNet(), slice(0, 40), slice(100, 140)
    flatness.fit(net, made(0, first))
    assert right(net, made(1, second)) < 0.7
    flatness.tune(net, made(2, second))
    assert right(net, made(1, second)) > 0.9 and right(net, made(3, first)) > 0.9
    with pytest.raises(ValueError, match="too few"):
        flatness.tune(net, FlatSamples(torch.zeros(4, 2, 2 * WIDTH), torch.ones(4)))


def test_a_thing_that_is_photographed_again_stands_as_it_stood():
    takes = make_takes(46_000_003, 3, families=("padded",))
    for take in takes[1:]:  # some are cut
        both = take.mask & takes[0].mask
        assert both.sum() > 0.3 * take.mask.sum()
        assert np.array_equal(take.normal[both], takes[0].normal[both])
        assert (take.rgb[both] != takes[0].rgb[both]).mean() > 0.5
    assert make_sample(46_000_003, families=("padded",)).rgb.tobytes() == takes[0].rgb.tobytes()


def test_padded_things_are_round():
    """But for bowls, of which a ray meets one wall."""
    deep = []
    for k in range(12):
        sample = make_sample(46_000_100 + k, families=("padded",))
        deep.append(np.median(sample.depth[sample.mask]) / np.sqrt(sample.mask.mean()))
    assert np.median(deep) > 2 * flatness.SOLID


@pytest.fixture(scope="module")
def shipped() -> ShapeModel:
    return ShapeModel(registry.shape_network())


@pytest.mark.slow
def test_flat_things_are_seen_to_be_flat_and_round_ones_are_not(networks, shipped):
    """Of 12 prints and 12 round things that no network was trained on."""

    def count(first: int, families: tuple[str, ...]) -> int:
        made = [make_sample(first + k, families=families) for k in range(12)]
        kinds = [_kind(shipped, sample) for sample in made]
        return kinds.count("flat")

    assert count(90_000_000, ("prints",)) >= 9
    assert count(91_000_000, ROUND) == 0


def test_where_no_shape_fits_at_all_it_is_free(networks, shipped):
    """Of a thin chair every surface of revolution is farther off than none."""
    families = (*ROUND[:4], "boxes", "furniture", "rings", "vehicles", "superquadrics",
                "extrusions")  # fmt: skip
    assert _kind(shipped, make_sample(71_000_329, families=families)) == "free"


def _kind(network: ShapeModel, sample: Sample) -> str:
    seen = network.look(sample.rgb, sample.mask, Crop(0, 0, SIDE, sample.tangents))
    found = recognised(seen)
    return "free" if found is None else found.kind


@pytest.mark.slow
def test_one_command_trains_it_further_and_leaves_the_surfaces(networks, tmp_path, monkeypatch):
    pytest.importorskip("onnx")
    monkeypatch.setattr(shape_data, "SHARD", 2)
    words = ["train", "flat", "--folder", str(tmp_path), "--things", "6"]
    assert main(words) == 0
    told = json.loads((tmp_path / "shape.json").read_text(encoding="utf-8"))
    weights = (tmp_path / "shape.onnx").read_bytes()
    assert told["sha256"] == hashlib.sha256(weights).hexdigest()
    assert told["flat"] == 6 and 6 <= told["solid"] <= 12  # of each thing three photos
    assert told["found"]["prints"]["things"] == 2
    sample = make_sample(90_000_000, families=("prints",))
    crop = Crop(0, 0, SIDE, sample.tangents)
    before, after = (
        ShapeModel(data).look(sample.rgb, sample.mask, crop)
        for data in (registry.shape_network(), weights)
    )
    assert before.flatness != after.flatness
    for name in ("front", "thickness", "depth", "normal", "edge", "front_error", "depth_error"):
        assert np.array_equal(getattr(before, name), getattr(after, name)), name
    assert main([*words[:-1], "2"]) == 1
