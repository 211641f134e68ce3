"""Made-up handles lie as they say, and a network learns from them and runs without torch."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch")

from objectmorpher_core.lift.crop import SIDE  # noqa: E402
from objectmorpher_core.lift.shapes.rod_look import GRID, UNIT, planes_of  # noqa: E402
from objectmorpher_core.models.onnx_session import open_session  # noqa: E402
from objectmorpher_research.training import train_rods  # noqa: E402
from objectmorpher_research.training.rod_net import RodCommittee  # noqa: E402
from objectmorpher_research.training.rods import sample as rods  # noqa: E402
from objectmorpher_research.training.rods.vessels import make_vessel  # noqa: E402
from objectmorpher_research.training.shape_net import WIDTH  # noqa: E402
from objectmorpher_research.training.shapes.distance import trace  # noqa: E402

pytestmark = pytest.mark.slow

COUNT = 64


def test_the_azimuth_is_that_of_the_handle():
    """What the camera sees of the handle lies, on average, in the plane through the axis."""
    seen = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        built = make_vessel(rng)
        solid, eye = built.finish(), rods._aim(rng, rods._any_turn)
        rays, _ = rods._rays(eye, 64)
        out = np.zeros((len(rays), 16))
        trace(rays, eye.at, solid, np.zeros((0, 3)), rods.NO_GROUND, 0, len(rays), out)
        handle = (out[:, 0] > 0) & (out[:, 3] == len(solid.parts) - 1)
        if handle.sum() < 20:
            continue
        axis = -built.ball[0] / built.ball[1] * [1, 0, 1]
        points = (eye.at + out[handle, :1] * rays[handle] - axis) @ eye.axes.T
        azimuth, lean = rods._angles(eye, axis)
        up = eye.axes[:, 1]
        way = np.cos(azimuth) * np.cross(up, _front(eye, axis)) + np.sin(azimuth) * _front(
            eye, axis
        )
        mirrored = 2 * np.sin(azimuth) * _front(eye, axis) - way
        off = [np.abs(points @ np.cross(up, each)).mean() for each in (way, mirrored)]
        assert min(off) < 0.15, "the plane holds the handle"
        assert np.degrees(lean) == pytest.approx(np.degrees(np.arcsin(-up @ _view(eye, axis))))
        seen += 1
    assert seen > 6


def _view(eye, at):
    view = eye.axes @ (at - eye.at)
    return view / np.linalg.norm(view)


def _front(eye, at):
    up, view = eye.axes[:, 1], _view(eye, at)
    front = up * (up @ view) - view
    return front / np.linalg.norm(front)


def test_samples_show_a_handle_of_a_vessel():
    for seed in range(4):
        one = rods.make_sample(seed)
        assert one.rgb.shape == (SIDE, SIDE, 3)
        assert not (one.rod & ~one.mask).any()
        assert 0.01 < one.rod.mean() < 0.6
        assert abs(np.degrees(one.azimuth)) < 90
        again = rods.make_sample(seed)
        assert np.array_equal(one.rgb, again.rgb)
        planes = planes_of(one.mask, one.rod)
        assert planes.shape == (2, GRID, GRID)
        np.testing.assert_allclose(
            planes.mean((1, 2)), [one.mask.mean(), one.rod.mean()], atol=1e-5
        )


def test_it_learns_and_runs_without_torch(tmp_path):
    """Azimuths that are plain in the tokens are found in tokens that were not learned from."""
    rng = np.random.default_rng(0)

    def made(count: int) -> train_rods.RodData:
        angles = rng.uniform(-1, 1, (count, 2)).astype(np.float32)
        tokens = rng.normal(0, 0.3, (count, WIDTH, GRID, GRID)).astype(np.float16)
        tokens[:, :8] += angles[:, 0, None, None, None].astype(np.float16)
        planes = rng.random((count, 2, GRID, GRID)).astype(np.float32)
        arrays = {"tokens": tokens, "planes": planes, "angles": angles}
        return train_rods.data_of([arrays])

    data, other = made(COUNT), made(COUNT)
    plan = train_rods.RodPlan(steps=60, size=16)
    net = RodCommittee([train_rods.learn(data, plan, seed) for seed in (0, 1)]).eval()
    spread = float(np.degrees(UNIT * other.angles[:, 0].numpy().std()))
    off = train_rods.figures(net, other)
    assert off["rms of 100%"] < 0.6 * spread
    file = tmp_path / "rods.onnx"
    train_rods.export(net, file)
    wanted = {
        "tokens": other.tokens[:1].float().numpy(), "planes": other.planes[:1].numpy(),
        "lean": other.angles[:1, 1].numpy(),
    }  # fmt: skip
    found = open_session(file.read_bytes()).run(None, wanted)
    with torch.no_grad():
        own = net(*(torch.from_numpy(value) for value in wanted.values()))
    for one, same in zip(found, own, strict=True):
        np.testing.assert_allclose(one, same.numpy(), atol=0.02)
