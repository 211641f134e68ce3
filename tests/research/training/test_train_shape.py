"""The shape network learns, goes on where it was stopped, and runs without torch."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch")

from objectmorpher_core.lift.crop import SIDE  # noqa: E402
from objectmorpher_core.models import registry  # noqa: E402
from objectmorpher_core.models.onnx_session import open_session  # noqa: E402
from objectmorpher_research.training import shape_data, train_shape  # noqa: E402
from objectmorpher_research.training.shape_data import batch_of, packed  # noqa: E402
from objectmorpher_research.training.shape_losses import losses  # noqa: E402
from objectmorpher_research.training.shape_net import (  # noqa: E402
    GRID,
    OUTPUTS,
    PLANES,
    WIDTH,
    ShapeNet,
)
from objectmorpher_research.training.shapes.families import FAMILIES  # noqa: E402
from objectmorpher_research.training.shapes.sample import make_sample  # noqa: E402

COUNT = 4


@pytest.fixture(scope="module")
def arrays():
    """Packed samples with made-up tokens: no weights are needed here."""
    found = packed([make_sample(seed, families=("boxes",)) for seed in range(COUNT)])
    rng = np.random.default_rng(0)
    for name in ("tokens", shape_data.MIRRORED):
        found[name] = rng.normal(size=(COUNT, WIDTH, GRID, GRID)).astype(np.float16)
    return found


def test_the_truth_has_no_loss_but_what_cannot_be_known(arrays):
    batch = batch_of(arrays)
    truth = torch.cat(
        [batch.front + 0.3, batch.thickness, batch.depth, batch.normal,
         40 * batch.edge - 20, torch.full_like(batch.mask, -7), torch.full_like(batch.mask, -7)], 1,
    )  # fmt: skip
    parts = losses(truth, batch)
    for name in ("front", "thickness", "depth", "slope", "edge"):
        assert abs(float(parts[name])) < 1e-4, name
    assert float(parts["normal"]) < 1e-3
    assert float(parts["agree"]) < 0.15  # bytes of normals, halves of depths, curves
    wrong = truth.clone()
    wrong[:, 0] *= -1
    assert float(losses(wrong, batch)["all"]) > float(parts["all"]) + 0.1


@pytest.mark.slow
def test_it_learns(arrays):
    torch.manual_seed(0)
    two = {name: array[:2] for name, array in arrays.items()}
    net, batch = ShapeNet(), batch_of(two, np.random.default_rng(0))
    optimiser = torch.optim.AdamW(net.parameters(), 2e-3)
    seen = []
    for _ in range(16):
        loss = losses(net(batch.planes, batch.tokens, batch.phase), batch)["all"]
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        seen.append(float(loss.detach()))
    assert seen[-1] < 0.6 * seen[0]


def test_a_worn_mask_is_at_most_a_little_off(arrays):
    rng = np.random.default_rng(0)
    for mask in arrays["mask"]:
        for _ in range(5):
            worn = shape_data._worn(mask, rng)
            assert (worn ^ mask).sum() < 0.3 * mask.sum()


def test_a_mirrored_sample_has_the_tokens_of_the_mirrored_crop(arrays):
    which = np.array([True, False] * (COUNT // 2))
    found = shape_data._mirrored(arrays, which)
    for k, is_mirrored in enumerate(which):
        own = shape_data.MIRRORED if is_mirrored else "tokens"
        assert np.array_equal(found["tokens"][k], arrays[own][k])
        step = -1 if is_mirrored else 1
        for name in ("rgb", "mask", "front", "edge"):
            assert np.array_equal(found[name][k], arrays[name][k][:, ::step]), name
        sideways = (found[name][k, ..., 0] for name in ("normal", "tangents"))
        assert np.array_equal(next(sideways), step * arrays["normal"][k][:, ::step, 0])
        assert np.array_equal(next(sideways), step * arrays["tangents"][k][0])


def test_samples_of_an_earlier_version_are_refused(arrays, tmp_path):
    earlier = {name: array for name, array in arrays.items() if name != shape_data.MIRRORED}
    np.savez(tmp_path / "00000000.npz", **earlier)
    with pytest.raises(ValueError, match="another folder"):
        next(shape_data.batches([tmp_path / "00000000.npz"], 1, np.random.default_rng(0)))


def test_stopped_and_resumed_it_is_where_it_was(arrays, tmp_path):
    folder = tmp_path / "samples"
    folder.mkdir()
    np.savez(folder / "00000000.npz", **arrays)
    plan = train_shape.TrainingPlan(samples=COUNT, passes=3, size=1)
    state = train_shape._State.resumed(tmp_path, plan)
    for batch in train_shape._endless([folder / "00000000.npz"], plan, 0):
        state.learn(batch)
        if state.step == 2:
            break
    state.save()
    again = train_shape._State.resumed(tmp_path, plan)
    assert again.step == 2 and len(again.history) == 2
    for name, value in state.net.state_dict().items():
        assert torch.equal(again.net.state_dict()[name], value)
    before = state.file.read_bytes()
    for other in (replace(plan, seed=1), replace(plan, passes=9), replace(plan, samples=32)):
        with pytest.raises(ValueError, match="begun with other options: give the same"):
            train_shape.train(tmp_path, replace(other, samples=32, size=1))
    assert state.file.read_bytes() == before and not (tmp_path / "unseen").exists()


def test_it_runs_without_torch(arrays, tmp_path):
    pytest.importorskip("onnx")
    from objectmorpher_research.training.export_shape import export

    torch.manual_seed(0)
    net, path = ShapeNet().eval(), tmp_path / "shape.onnx"
    export(net, path)
    assert path.stat().st_size < 6e6
    batch = batch_of(arrays)
    session = open_session(path)
    inputs = {"planes": batch.planes[:1].numpy(), "tokens": batch.tokens[:1].numpy()}
    found, flat = session.run(None, inputs)
    with torch.inference_mode():
        expected = net(batch.planes[:1], batch.tokens[:1]).numpy()
        odds = net.flat(batch.mask[:1], batch.tokens[:1]).numpy()
    assert np.abs(flat - odds).max() < 0.02
    assert found.shape[1] == OUTPUTS
    assert np.abs(found - expected).mean() < 2e-3 * max(1.0, np.abs(expected).mean())


def test_training_goes_on_from_exported_weights(tmp_path):
    pytest.importorskip("onnx")
    from objectmorpher_research.training.export_shape import MOST, export, weights_of

    torch.manual_seed(0)
    net, path = ShapeNet().train(), tmp_path / "shape.onnx"
    with torch.no_grad():  # no two weights are alike, as after training
        for weight in net.parameters():
            weight += 0.01 * torch.randn_like(weight)
        net(torch.rand(2, PLANES, SIDE, SIDE), torch.randn(2, WIDTH, GRID, GRID))
    export(net, path)
    again = weights_of(path, ShapeNet())
    for name, value in net.state_dict().items():
        if not value.is_floating_point():
            continue
        off = (again[name] - value).abs()
        if value.ndim < 2:
            assert torch.equal(again[name], value), name
            continue
        largest = value.abs().flatten(1).amax(1)
        spread = off.flatten(1).square().mean(1).sqrt()
        assert (spread <= 1.3 * largest / MOST / 12**0.5).all(), name
    state = train_shape._State.resumed(tmp_path, train_shape.TrainingPlan(), again)
    assert torch.equal(state.net.state_dict()["tokens.weight"], again["tokens.weight"])
    with pytest.raises(ValueError, match="all families"):
        train_shape.train(tmp_path, train_shape.TrainingPlan(held_out=("boxes",)), weights=path)
    other = ShapeNet()
    other.tokens = torch.nn.Conv2d(WIDTH, 8, 1)
    with pytest.raises(ValueError, match="another network"):
        weights_of(path, other)


def test_a_set_of_samples_has_the_families_asked_for(tmp_path, networks, monkeypatch):
    """Though others of the same seed are there."""
    monkeypatch.setattr(shape_data, "SHARD", 2)
    for families, takes in ((None, 1), (("rings",), 1), (("prints",), 2)):
        (tmp_path / shape_data.shard_name(2_000_000, families, takes)).write_bytes(b"others")
    (file,) = shape_data.write_shards(tmp_path, 2_000_000, 2, families=("prints",))
    found = np.load(file)
    assert found["family"].tolist() == ["prints"] * 2
    assert found["tokens"].shape == found[shape_data.MIRRORED].shape == (2, WIDTH, GRID, GRID)


def test_files_of_samples_have_one_name_only_if_they_hold_the_same():
    own = [*((name,) for name in FAMILIES), ("prints", "rings"), ("rings", "prints")]
    kinds = [(families, takes) for families in (None, *own) for takes in (1, 2, 3)]
    names = {shape_data.shard_name(seed, *kind) for seed in (0, 45_000_000) for kind in kinds}
    assert len(names) == 2 * len(kinds)
    assert shape_data.shard_name(32) == shape_data.shard_name(32, ()) == "00000032.npz"


@pytest.mark.slow
def test_one_command_trains_and_tells_how_well(arrays, tmp_path, monkeypatch, capsys):
    pytest.importorskip("onnx")
    from objectmorpher.cli.parser import main

    sets = (("samples", 0, 4), ("samples", 3 * train_shape.APART, 4),
            ("unseen", train_shape.UNSEEN, 1))  # fmt: skip
    for name, first, times in sets:
        (tmp_path / name).mkdir(exist_ok=True)
        several = {key: np.concatenate([array] * times) for key, array in arrays.items()}
        several["family"] = np.array(["boxes", "prints"] * (2 * times))
        np.savez(tmp_path / name / f"{first:08d}.npz", **several)
    monkeypatch.setattr(train_shape, "CHECKED", COUNT)
    words = ["train", "shape", "--folder", str(tmp_path)]
    assert main([*words, "--samples", "16", "--passes", "1"]) == 0
    told = json.loads((tmp_path / "shape.json").read_text(encoding="utf-8"))
    assert told["steps"] == 1
    weights = (tmp_path / "shape.onnx").read_bytes()
    assert told["sha256"] == hashlib.sha256(weights).hexdigest()
    for way in ("network", "relief", "inflation"):
        assert 0 < told["means"][way]["front"] < 2
    shipped = Path(registry.__file__).parent / "shape.onnx"
    going_on = [*words, "--start", str(shipped), "--samples", "16", "--passes", "1",
                "--also", "3:16", "-o", str(tmp_path / "next.onnx")]  # fmt: skip
    assert main(going_on) == 1
    assert "begun with other options" in capsys.readouterr().err
    (tmp_path / "checkpoint.pt").unlink()
    assert main(going_on) == 0
    told = json.loads((tmp_path / "next.json").read_text(encoding="utf-8"))
    assert told["steps"] == 2
    assert told["plan"]["also"] == [{"seed": 3, "samples": 16, "families": []}]
    assert (tmp_path / "next.onnx").read_bytes() != weights
    capsys.readouterr()
    for wrong, reason in (
        (["--also", "some"], "write SEED:N"),
        (["--also", "1:32:unicorns"], "no family 'unicorns'"),
        (["--also", "0:32"], "cannot have one seed"),
    ):
        assert main([*words, "--samples", "16", *wrong]) == 1
        assert reason in capsys.readouterr().err
    assert main([*words, "--samples", "4"]) == 1
    assert "fewer than" in capsys.readouterr().err
    assert main([*words, "--hold-out", "boxes,unicorns"]) == 1
    assert "no family 'unicorns'" in capsys.readouterr().err
    assert main([*words, "--start", str(tmp_path / "none.onnx")]) == 1
    assert "no file" in capsys.readouterr().err
