"""Made-up objects: what their samples say about shape is true."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64
from objectmorpher_research.training.shapes import materials
from objectmorpher_research.training.shapes.distance import distance, lowest, trace
from objectmorpher_research.training.shapes.families import FAMILIES, FURTHER
from objectmorpher_research.training.shapes.sample import Sample, make_sample
from objectmorpher_research.training.shapes.solid import THINNEST, PrimitiveBuilder, Solid, turned
from tests.tree import over

ALL = FAMILIES | FURTHER
SIDE = 56  # px of samples here
SEEDS = range(4)
CLOSE = 2e-3  # of distances along rays


@pytest.fixture(scope="module")
def samples() -> dict[str, list[Sample]]:
    return {name: [make_sample(s, SIDE, (name,)) for s in SEEDS] for name in ALL}


@over("name", ALL)
def test_one_seed_makes_one_sample(name: str, samples: dict[str, list[Sample]]) -> None:
    again = make_sample(3, SIDE, (name,))
    for field in ("rgb", "mask", "front", "thickness", "depth", "normal", "edge", "part"):
        np.testing.assert_array_equal(getattr(again, field), getattr(samples[name][3], field))
    assert (samples[name][2].rgb != samples[name][3].rgb).any()


@over("name", ALL)
def test_the_object_is_seen_and_measured(name: str, samples: dict[str, list[Sample]]) -> None:
    for seed, sample in zip(SEEDS, samples[name], strict=True):
        mask = sample.mask
        assert sample.family == name
        assert mask.mean() > 0.015, seed  # at least 0.04, of which the photo's frame cuts half
        assert (sample.part[mask] >= 0).all() and (sample.part[~mask] == -1).all()
        assert (sample.thickness[mask] > 0).mean() > 0.98  # but for rays that graze
        assert (sample.thickness <= sample.depth + 1e-4).all()
        assert sample.depth.max() < 3
        assert abs(sample.front[mask].mean()) < 0.01
        for field in (sample.front, sample.thickness, sample.depth, sample.edge):
            assert not field[~mask].any()
        np.testing.assert_allclose(np.linalg.norm(sample.normal[mask], axis=1), 1, atol=1e-3)
        rays = _rays(sample)
        assert ((sample.normal * rays).sum(-1)[mask] < 1e-3).all()  # towards the camera


@over("name", ALL)
def test_normals_are_those_of_the_front(name: str, samples: dict[str, list[Sample]]) -> None:
    angles = np.concatenate([_angles(sample) for sample in samples[name]])
    assert len(angles) > 50
    assert np.median(angles) < 12


def _rays(sample: Sample) -> F64:
    """(s, s, 3) unit rays of the crop's pixels, camera axes."""
    side, (x0, y0, width) = len(sample.mask), sample.tangents.astype(float)
    steps = ((np.arange(side) + 0.5) / side - 0.5) * width
    x, y = np.meshgrid(x0 + steps, y0 + steps)
    rays = np.stack([x, y, np.ones_like(x)], -1)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def _angles(sample: Sample) -> F64:
    """(n,) degrees between the normals and those of the front, where it is smooth."""
    rays, mask = _rays(sample), sample.mask
    middle = np.hypot(np.linalg.norm(sample.tangents[:2].astype(float)), 1.0)
    away = middle / float(sample.tangents[2]) - sample.front  # crop units
    places = rays * away[..., None]
    right, down = (np.roll(places, -1, a) - np.roll(places, 1, a) for a in (1, 0))
    found = np.cross(down, right)
    found /= np.linalg.norm(found, axis=-1, keepdims=True) + 1e-12
    same = mask.copy()
    for axis in (0, 1):
        for step in (1, -1):
            same &= np.roll(sample.part, step, axis) == sample.part
            same &= (np.roll(sample.normal, step, axis) * sample.normal).sum(-1) > 0.9
    same &= (sample.normal * rays).sum(-1) < -0.3
    same[[0, -1]] = same[:, [0, -1]] = False
    cosine = (found * sample.normal).sum(-1)[same]
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def _trace(solid: Solid, places: F64, way: F64) -> F64:
    """(n, 16) what rays from places (n, 3), in direction `way` (3,), meet."""
    out = np.zeros((len(places), 16))
    for row, place in zip(out, places, strict=True):
        trace(way[None], place, solid, np.zeros((0, 3)), -99.0, 0, 1, row[None])
    return out


def test_a_ball_is_met_where_it_is() -> None:
    built = PrimitiveBuilder()
    built.part(0)
    built.ellipsoid([5, 7, 1], [2, 2, 2])
    solid = built.finish()
    radius = solid.numbers[0, 0]
    assert 0.95 < radius < 1
    x = np.linspace(-0.9, 0.9, 13) * radius
    out = _trace(solid, np.stack([x, 0.2 * x, np.full(13, -3.0)], 1), np.array([0.0, 0, 1]))
    half = np.sqrt(radius**2 - 1.04 * x**2)
    np.testing.assert_allclose(out[:, 0], 3 - half, atol=CLOSE)
    np.testing.assert_allclose(out[:, 1], 3 + half, atol=2 * CLOSE)
    np.testing.assert_allclose(out[:, 2], 3 + half, atol=CLOSE)
    normal = np.stack([x, 0.2 * x, -half], 1) / radius
    np.testing.assert_allclose(out[:, 4:7], normal, atol=5e-3)
    assert lowest(solid, 96) == pytest.approx(-radius, abs=0.02)


def test_a_part_behind_is_no_thickness_and_a_cavity_is_filled() -> None:
    built = PrimitiveBuilder()
    built.part(0)
    built.box([0, 0, -1], [1, 1, 0.1])
    built.part(1)
    built.box([0, 0, 1], [1, 1, 0.5])
    built.box([0, 0, 1], [0.5, 0.5, 0.4], cavity=True)
    built.box([0.8, 0.8, 1], [0.1, 0.1, 2.0], cut=True)
    solid = built.finish()
    scale = solid.numbers[0, 0]
    hits = np.array([[0.0, 0, -3], [0.8 * scale, 0.8 * scale, -3]])
    front, through = _trace(solid, hits, np.array([0.0, 0, 1]))
    for row in (front, through):
        assert row[1] - row[0] == pytest.approx(0.2 * scale, abs=2 * CLOSE)
    assert front[2] - front[0] == pytest.approx(2.6 * scale, abs=CLOSE)
    assert through[2] - through[0] == pytest.approx(0.2 * scale, abs=CLOSE)  # a hole behind
    back = _trace(solid, np.array([[0.0, 0, 3]]), np.array([0.0, 0, -1]))[0]
    assert back[1] - back[0] == pytest.approx(1.0 * scale, abs=2 * CLOSE)


def test_a_lathe_is_solid_on_its_axis() -> None:
    built = PrimitiveBuilder()
    built.part(0)
    built.lathe([0, 0, 0], np.array([[0.0, -1], [0.5, -1], [0.5, 1], [0, 1]]))
    solid = built.finish()
    radius, high = solid.outlines[1, 0], solid.outlines[2, 1]
    d, _ = distance(0.0, 0.0, 0.0, solid, False)
    assert d == pytest.approx(-radius, rel=1e-6)
    down = _trace(solid, np.array([[0.0, 3, 0]]), np.array([0.0, -1, 0]))[0]
    assert down[0] == pytest.approx(3 - high, abs=CLOSE)
    assert down[1] == pytest.approx(3 + high, abs=2 * CLOSE)


def test_part_of_a_ring_has_its_middle_before() -> None:
    built = PrimitiveBuilder()
    built.part(0)
    built.ring([0, 0, 0], 1.0, 0.1, 0.5)
    solid = built.finish()
    turn, shift = solid.frames[0, :, :3], solid.frames[0, :, 3]
    large, small = solid.numbers[0, :2]
    for angle, is_there in ((0.0, True), (0.45, True), (-0.45, True), (0.8, False), (3.0, False)):
        place = turn.T @ (large * np.array([np.sin(angle), 0, np.cos(angle)]) - shift)
        d, _ = distance(*place, solid, False)
        assert (d < -0.9 * small) if is_there else (d > 0.05)


@pytest.mark.parametrize("bend", [0.0, 0.8, -0.8])
def test_a_bent_sheet_lies_on_its_circle(bend: float) -> None:
    built = PrimitiveBuilder()
    built.part(0)
    built.sheet([0, 0, 0], [1.2, 0.7], 0.001, (0.0, 0.0, 0.0, 0.0), bend)
    solid = built.finish()
    turn, shift = solid.frames[0, :, :3], solid.frames[0, :, 3]
    half, thick, bent = solid.numbers[0, 0], solid.numbers[0, 2], solid.numbers[0, 7]
    assert thick == THINNEST
    for along in np.linspace(-0.9, 0.9, 7) * half:
        x, z = (
            (np.sin(along * bent) / bent, (1 - np.cos(along * bent)) / bent) if bend else (along, 0)
        )
        d, _ = distance(*(turn.T @ (np.array([x, 0, z]) - shift)), solid, False)
        assert d == pytest.approx(-thick, abs=1e-6)


def _without_balls(solid: Solid) -> Solid:
    """The same; its balls hold everything."""
    bounds, balls = np.zeros_like(solid.bounds), np.zeros_like(solid.balls)
    bounds[:, 3] = balls[:, 3] = 50
    return solid._replace(bounds=bounds, balls=balls)


@over("name", ALL)
def test_balls_hold_their_parts(name: str) -> None:
    for seed in range(8):
        rng = np.random.default_rng([seed, 5])
        solid = ALL[name](rng).finish()
        assert np.linalg.norm(solid.bounds[:, :3], axis=1).max() < 1.1
        slow = _without_balls(solid)
        for part, bound in enumerate(solid.bounds):
            alone = slow._replace(parts=slow.parts[part : part + 1])
            for way in rng.normal(size=(10, 3)):
                place = bound[:3] + way / np.linalg.norm(way) * bound[3] * rng.uniform(1, 1.5)
                assert distance(*place, alone, False)[0] > 0


@over("name", ALL)
def test_balls_only_save_time(name: str) -> None:
    """What they let pass by would have changed nothing, nor may a ray step over a surface."""
    for seed in range(4):
        rng = np.random.default_rng([seed, 6])
        solid = ALL[name](rng).finish()
        slow = _without_balls(solid)
        for place in rng.uniform(-1, 1, (60, 3)):
            quick, whole = (distance(*place, s, False)[0] for s in (solid, slow))
            assert (quick <= 0) == (whole <= 0)
            if abs(quick - whole) > 1e-9:  # far away, where balls stand for parts
                assert quick > 0.02 and whole > 0.02


def test_a_tilted_box_is_found_by_its_own_axes() -> None:
    built = PrimitiveBuilder()
    turn = turned(0.4, -0.7, 0.2)
    built.part(0)
    built.box([0, 0, 0], [1, 0.5, 0.2], 0.05, turn)
    solid = built.finish()
    half = solid.numbers[0, :3]
    for axis in range(3):
        for sign in (1, -1):
            d, _ = distance(*(sign * half[axis] * turn[:, axis]), solid, False)
            assert d == pytest.approx(0, abs=1e-9)


def test_a_part_begins_with_something_that_is_there() -> None:
    built = PrimitiveBuilder()
    built.part(0)
    built.box([0, 0, 0], [1, 1, 1], cut=True)
    with pytest.raises(ValueError, match="begins with something"):
        built.finish()


def test_a_flat_ellipsoid_is_as_thick_as_it_is() -> None:
    """Its slope says nothing about distances inside: rays once left it far too late."""
    built = PrimitiveBuilder()
    built.part(0)
    built.ellipsoid([0, 0, 0], [1, 0.7, 0.02])
    solid = built.finish()
    half = solid.numbers[0, :3]
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-0.6, 0.6, 15), np.linspace(-0.6, 0.6, 15)))
    places = np.stack([x * half[0], y * half[1], np.full(len(x), 2.0)], 1)
    out = _trace(solid, places, np.array([0.0, 0, -1]))
    thick = 2 * half[2] * np.sqrt(1 - x**2 - y**2)
    np.testing.assert_allclose(out[:, 1] - out[:, 0], thick, atol=1.5e-3)


def test_a_picture_is_looked_up_at_more_places_than_opencv_takes_at_once():
    """A flat thing that fills its crop shows its picture in 66,000 pixels."""
    rng = np.random.default_rng(0)
    picture = rng.random((20, 30, 3)).astype(np.float32)
    at = rng.uniform(-3, 3, (70_000, 2))
    whole = materials._looked_up(picture, at)
    parts = [materials._looked_up(picture, at[k : k + 1000]) for k in range(0, len(at), 1000)]
    assert np.array_equal(whole, np.concatenate(parts))
