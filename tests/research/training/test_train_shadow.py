"""Shadow scenes are what they say, and the network learns from them and runs without torch."""

from __future__ import annotations

import multiprocessing
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from scipy.special import expit

torch = pytest.importorskip("torch", reason="training needs torch")

from objectmorpher_core.compose.shadow.shadow_look import (  # noqa: E402
    CELLS,
    PLANES,
    SIDE,
    THING,
    enlarged,
    shrunk,
)
from objectmorpher_core.models.onnx_session import open_session  # noqa: E402
from objectmorpher_research.training import train_shadow  # noqa: E402
from objectmorpher_research.training.export_shape import weights_of  # noqa: E402
from objectmorpher_research.training.rod_net import RodNet  # noqa: E402
from objectmorpher_research.training.shadow_net import ShadowNet  # noqa: E402
from objectmorpher_research.training.shadows import samples, scenes, solids  # noqa: E402
from objectmorpher_research.training.shadows.grounds import (  # noqa: E402
    WAYS,
    Grounds,
    any_texture,
    photographs,
)

COUNT = 6


@pytest.fixture(scope="module")
def made() -> list[scenes.SceneGeometry]:
    shapes = solids.silhouettes(8, 0)
    return [scenes.make_geometry(np.random.default_rng(k), shapes) for k in range(COUNT)]


@pytest.fixture(scope="module")
def drawn(made) -> list[samples.ShadowSample]:
    rng = np.random.default_rng(0)
    grounds = Grounds(rng, 6)
    return [samples.make_sample(rng, scene, made[k - 1], grounds) for k, scene in enumerate(made)]


@pytest.mark.parametrize("kind", solids.ANY_SOLID)
def test_a_ray_meets_a_solid_where_the_solid_is(kind):
    """Where a ray is in the solid is asked of points along it, one by one."""
    rng = np.random.default_rng(kind)
    away = np.linspace(0, 8, 4001)
    for _ in range(40):
        parts = solids.Parts()
        parts.add(kind, rng.normal(0, 0.3, 3), rng.uniform(0.2, 1, 3), solids.any_turn(rng, 1.0))
        arrays = parts.arrays()
        origin, way = np.array([0.0, 0.0, -4.0]), np.append(rng.normal(0, 0.1, 2), 1.0)
        found = solids.hit(
            kind, arrays.into[0], arrays.middle[0], np.ones((1, 1), bool), origin, way
        )
        x, y, z = ((origin + away[:, None] * way - arrays.middle[0]) @ arrays.into[0].T).T
        wide = np.hypot(x, z)
        inside = {
            solids.ELLIPSOID: wide**2 + y**2 < 1,
            solids.BOX: np.maximum(np.maximum(abs(x), abs(y)), abs(z)) < 1,
            solids.CYLINDER: (wide < 1) & (abs(y) < 1),
            solids.CONE: (wide < (1 - y) / 2) & (abs(y) < 1),
        }[kind]
        if not inside.any():
            assert found > 8 or inside.sum() < 2
            continue
        assert abs(found - away[np.argmax(inside)]) < 0.005


def test_a_thing_only_takes_light_and_only_beside_itself(made):
    for scene in made:
        light = scene.light
        assert np.isfinite(light).all()
        assert (light >= 0).all()
        assert (light[..., 0] <= light[..., 1] + 1e-6).all()
        mask = scene.what == scenes.THING_SEEN
        rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
        longer = max(np.ptp(rows), np.ptp(columns)) + 1
        assert abs(longer / scenes.FINE - THING / SIDE) < 0.06
        middle = (rows[0] + rows[-1] + 1) / 2, (columns[0] + columns[-1] + 1) / 2
        np.testing.assert_allclose(middle, scenes.FINE / 2, atol=0.05 * scenes.FINE)


def test_scenes_are_kept(made):
    for kept, scene in zip(scenes.unpacked(scenes.packed(made)), made, strict=True):
        assert np.array_equal(kept.what, scene.what)
        assert np.array_equal(kept.place, scene.place)
        np.testing.assert_allclose(kept.light, scene.light, atol=2e-3)


def test_what_should_be_found_is_on_the_ground_that_is_seen(drawn):
    assert {True, False} == {bool(s.dark.any()) for s in drawn}
    for sample in drawn:
        assert sample.planes.shape == (PLANES, SIDE, SIDE)
        assert np.isfinite(sample.planes).all()
        assert not sample.weight[sample.planes[3] > 0.5].any()
        if sample.label == 1:
            shade = (sample.dark * sample.weight).sum()
            assert shade > samples.DARK * samples.LARGE * 0.5 * sample.planes[3].sum()
        if not sample.dark.any():
            assert sample.label == 0


def test_textures_are_of_all_kinds_and_in_range():
    rng = np.random.default_rng(2)
    assert sum(share for _, share in WAYS) == pytest.approx(1)
    found = [any_texture(rng, photographs()) for _ in range(60)]
    for texture in found:
        assert np.isfinite(texture).all()
        assert texture.min() >= 0
        assert texture.max() <= 1
    busy = [float(np.log(texture + 0.02).std()) for texture in found]
    assert min(busy) < 0.15  # plain
    assert max(busy) > 0.5


def test_grounds_are_parts_of_a_folders_pictures(tmp_path):
    for name, colour in (("red.png", (250, 5, 5)), ("in/blue.jpg", (5, 5, 250))):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        Image.new("RGB", (90, 60), colour).save(tmp_path / name)
    shown = photographs(tmp_path)
    assert [image.shape for image in shown] == [(60, 90, 3)] * 2
    assert sorted(int(image.mean((0, 1)).argmax()) for image in shown) == [0, 2]
    assert Grounds(np.random.default_rng(0), 2, tmp_path).photographs is shown
    (tmp_path / "none").mkdir()
    for size in ((1, 1), (47, 90), (5000, 200), (3000, 1)):  # too small, or once they are reduced
        Image.new("RGB", size).save(tmp_path / "none" / f"{size[0]}.png")
        with pytest.raises(ValueError, match=r"no pictures .* of at least 48 px"):
            photographs.__wrapped__(tmp_path / "none")
    Image.new("RGB", (48, 48)).save(tmp_path / "none" / "just.png")
    shown = photographs.__wrapped__(tmp_path / "none")
    assert [image.shape for image in shown] == [(48, 48, 3)]
    assert Grounds(np.random.default_rng(0), 12, tmp_path / "none").photographs
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match="no pictures"):
        photographs(tmp_path / "empty")


def test_who_makes_samples_and_dies_is_not_waited_for(tmp_path):
    apart = multiprocessing.get_context("fork")
    ready = apart.Queue(4)
    (tmp_path / "scenes.npz").write_bytes(b"PK no")
    rng = np.random.default_rng(0)
    maker = apart.Process(target=train_shadow._read, args=(rng, [tmp_path / "scenes.npz"]))
    maker.start()
    with pytest.raises(RuntimeError, match="a process that makes samples has ended"):
        train_shadow._take(train_shadow.SampleRing(8), ready, [maker])
    assert maker.exitcode == 1


def test_some_samples_are_seen_from_nearer_and_none_from_farther_away(drawn):
    longer = []
    for sample in drawn:
        is_thing = sample.planes[3] > 0.5
        rows, columns = np.flatnonzero(is_thing.any(1)), np.flatnonzero(is_thing.any(0))
        longer.append((max(np.ptp(rows), np.ptp(columns)) + 1) / THING)
    assert min(longer) > 0.9
    assert any(one < 1.1 for one in longer)
    assert any(1.2 < one < samples.NEAREST + 0.1 for one in longer)


def test_from_nearer_the_thing_stays_in_the_middle():
    cover = np.zeros((3 * CELLS, 3 * CELLS), np.float32)
    cover[CELLS : 2 * CELLS, CELLS + 20 : 2 * CELLS - 20] = 1
    near = shrunk(enlarged((cover,), 1.5)[0]) > 0.5
    rows, columns = np.flatnonzero(near.any(1)), np.flatnonzero(near.any(0))
    assert abs(len(rows) - 1.5 * THING) <= 1
    assert abs(len(columns) - 1.5 * (CELLS - 40) / 2) <= 1
    assert abs(rows.mean() - (SIDE - 1) / 2) <= 0.5
    assert abs(columns.mean() - (SIDE - 1) / 2) <= 0.5


def test_training_goes_on_from_exported_weights(drawn, tmp_path):
    """Weights are kept in bytes: what is seen with them again is a little off."""
    ring = train_shadow.SampleRing(len(drawn))
    ring.add(*train_shadow.arrays_of(drawn))
    plan, rng = train_shadow.ShadowPlan(steps=60, size=4), np.random.default_rng(3)
    state = train_shadow.ShadowState(tmp_path / "first.pt", plan)
    for _ in range(12):
        state.learn(*ring.drawn(rng, 4))
    first, file = state.trained(), tmp_path / "shadow.onnx"
    train_shadow.export(first, file)
    start = weights_of(file, ShadowNet())
    state = train_shadow.ShadowState(tmp_path / "shadow.pt", plan, start)
    net = state.trained()
    planes = torch.from_numpy(np.stack([s.planes for s in drawn]))
    with torch.no_grad():
        for own, kept in zip(first(planes), net(planes), strict=True):
            assert float((own - kept).abs().mean()) < 0.05 * float(own.std())
    state.learn(*ring.drawn(rng, 4))
    state.learn(*ring.drawn(rng, 4))
    for name, weight in state.trained().named_parameters():
        assert not torch.equal(state.mean[name], start[name])
        assert torch.allclose(2 * weight, state.mean[name] + start[name], atol=1e-6), name
    with pytest.raises(ValueError, match="another network"):
        weights_of(file, RodNet())


def test_it_learns_and_runs_without_torch(drawn, tmp_path):
    ring = train_shadow.SampleRing(len(drawn))
    ring.add(*train_shadow.arrays_of(drawn))
    plan = train_shadow.ShadowPlan(steps=60, size=4)
    state = train_shadow.ShadowState(tmp_path / "shadow.pt", plan)
    rng = np.random.default_rng(0)
    before = state.learn(*ring.drawn(rng, 4))
    for _ in range(20):
        after = state.learn(*ring.drawn(rng, 4))
    assert float(after.shade.detach()) < 0.7 * float(before.shade.detach())
    state.save()
    assert train_shadow.ShadowState(state.file, plan).step == state.step == 21
    before = state.file.read_bytes()
    for other in (replace(plan, steps=61), replace(plan, seed=1), replace(plan, scenes=1)):
        with pytest.raises(ValueError, match="begun with other options: give the same"):
            train_shadow.train(tmp_path, other)
    assert state.file.read_bytes() == before and not (tmp_path / "scenes").exists()
    net, file = state.trained(), tmp_path / "shadow.onnx"
    train_shadow.export(net, file)
    planes = np.stack([s.planes for s in drawn[:1]])
    found = open_session(file.read_bytes()).run(None, {"planes": planes})
    with torch.no_grad():
        wanted = net(torch.from_numpy(planes))
    for one, other in zip(found, wanted, strict=True):
        # probabilities: of log odds 0.05 off at most in the middle, where they decide
        np.testing.assert_allclose(expit(one), torch.sigmoid(other).numpy(), atol=0.0125)


def test_samples_that_count_for_nothing_have_no_verdict():
    net = ShadowNet().eval()
    planes = torch.zeros(3, PLANES, SIDE, SIDE)
    fields = torch.zeros(3, 2, SIDE, SIDE)
    labels = torch.tensor([1.0, 0.0, float("nan")])
    parts = train_shadow.losses(net, planes, fields, labels)
    assert float(parts.shade.detach()) == 0
    assert np.isfinite(float(parts.verdict.detach()))
