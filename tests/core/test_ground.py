"""The ground under an object, and objects that are held, on it and off it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.rotations import (
    CAMERA_GIMBAL,
    matrix_from_vector,
    turn_about,
    turn_matrix,
    turn_of,
    vector_from_matrix,
)
from objectmorpher_core.document.model import Document, EditObject, LiftedObject, Placement
from objectmorpher_core.document.placement import (
    GroundError,
    HeldPoint,
    blended,
    centre_of,
    foot_of,
    gimbal_of,
    ground_under,
    grown,
    is_in_place,
    placement_of,
    scaled,
    spun,
    turned,
    with_centre,
)
from objectmorpher_core.document.visitor_edits import ground_for
from tests import shapes
from tests.tree import over

EXACT = 1e-9
PLANE = 1e-6  # object diameters
horizons = pytest.mark.parametrize("horizon", [20.0, 60.0, -200.0])


@pytest.fixture(scope="module")
def scene() -> shapes.Scene:
    return shapes.scene("ellipse", 300)


def _points(scene: shapes.Scene) -> np.ndarray:
    return scene.lifted.world_points(scene.lifted.body.means)


def _hold(scene: shapes.Scene, horizon: float) -> HeldPoint:
    ground = ground_under(_points(scene), scene.camera, horizon)
    contact = ground.lowest(_points(scene))
    return HeldPoint(Placement(), scene.lifted, scene.camera, contact, ground)


@horizons
def test_the_object_stands_on_its_ground(scene, horizon):
    ground = ground_under(_points(scene), scene.camera, horizon)
    below = ground.below(_points(scene))
    assert below.max() == pytest.approx(0, abs=EXACT)
    assert np.linalg.norm(ground.normal) == pytest.approx(1)
    assert ground.normal[1] > 0, "down"


@horizons
def test_the_ground_vanishes_at_the_horizon(scene, horizon):
    ground = ground_under(_points(scene), scene.camera, horizon)
    for x in (-50.0, 80.0, 400.0):
        ray = scene.camera.unproject(np.array([x, horizon]), 1.0)
        assert ray @ ground.normal == pytest.approx(0, abs=EXACT)
        far = ground.at_depth(scene.camera, x, 30 * ground.height)
        assert scene.camera.project(far)[1] > horizon


@horizons
@over("delta", [(0, 0), (30, 8), (-60, 40), (10, -300)])
@over("away", [0.0, 0.7, -0.2])
def test_the_contact_stays_on_the_plane(scene, horizon, delta, away):
    hold = _hold(scene, horizon)
    placement = hold.moved(np.array(delta, float), away)
    motion = placement.matrix(scene.lifted, scene.camera)
    contact = motion[:3, :3] @ hold.point + motion[:3, 3]
    assert hold.ground is not None
    assert abs(hold.ground.below(contact)) < PLANE * hold.unit


@horizons
def test_the_contact_follows_the_pointer(scene, horizon):
    hold = _hold(scene, horizon)
    placement = hold.moved(np.array([25.0, 6.0]))
    seen = scene.puppet.picture_of(scene.lifted.object_points(hold.point), None, placement)
    np.testing.assert_allclose(seen, hold.xy + [25.0, 6.0], atol=PLANE)


def test_its_size_in_the_picture_goes_with_one_over_the_depth(scene):
    hold = _hold(scene, 20.0)
    offsets = np.array([[-0.3, 0.0, 0.0], [0.3, 0.0, 0.0]]) * hold.unit  # at the centre's depth
    sizes, depths = [], []
    for away in (0.0, 0.5, 2.0):
        placement = hold.moved(np.zeros(2), away)
        centre = centre_of(placement, scene.lifted, scene.camera)
        left, right = scene.camera.project(centre + offsets)
        sizes.append(right[0] - left[0])
        depths.append(centre[2])
    np.testing.assert_allclose(np.array(sizes) * depths, sizes[0] * depths[0], rtol=1e-9)
    assert depths[2] - depths[0] == pytest.approx(2.0 * hold.unit)


def test_a_contact_above_the_horizon_is_refused(scene):
    lowest = scene.camera.project(_points(scene))[:, 1].max()
    with pytest.raises(GroundError, match="horizon"):
        ground_under(_points(scene), scene.camera, float(lowest) + 3.0)


def test_standing_moves_the_lowest_point_onto_the_plane(scene):
    ground = ground_under(_points(scene), scene.camera, 20.0)
    offsets = (_points(scene) - scene.lifted.centre) @ turn_matrix(30, 40, 50).T
    centre = ground.stood(scene.lifted.centre + [0.1, -0.4, 0.2], offsets)
    assert ground.below(centre + offsets).max() == pytest.approx(0, abs=EXACT)


@pytest.mark.parametrize("away", [0.0, 0.8, -0.3])
def test_a_point_that_is_held_goes_where_it_is_taken(scene, away):
    placement = Placement((7.0, 3.0), 0.4, (30.0, 10.0, -20.0), 1.3)
    matrix = placement.matrix(scene.lifted, scene.camera)
    rest = _points(scene)[17]
    hold = HeldPoint(placement, scene.lifted, scene.camera, matrix[:3, :3] @ rest + matrix[:3, 3])
    later = hold.moved(np.array([21.0, -13.0]), away)
    seen = scene.puppet.picture_of(scene.lifted.object_points(rest), None, later)
    np.testing.assert_allclose(seen, hold.xy + [21.0, -13.0], atol=PLANE)
    assert later.depth == pytest.approx(0.4 + away)
    assert (later.turn, later.scale) == (placement.turn, placement.scale)


def test_the_centre_goes_where_it_is_put(scene):
    centre = np.array([0.3, -0.2, 4.0])
    placement = with_centre(Placement(turn=(5, 6, 7)), centre, scene.lifted, scene.camera)
    np.testing.assert_allclose(centre_of(placement, scene.lifted, scene.camera), centre)


def test_a_tilted_camera_has_a_tilted_ground():
    """With the horizon at the top of the photo the camera looks down, and the ground rises."""
    camera = Camera.from_fov(160, 120)
    points = camera.unproject(np.array([[80.0, 100.0]]), np.array([3.0]))
    ground = ground_under(points, camera, 0.0)
    assert ground.normal[2] > 0


@pytest.mark.parametrize("turn", [(0, 0, 0), (30, -40, 170), (-170, 89, 12), (120, -89.9, -60)])
def test_a_turn_is_found_from_its_matrix(turn):
    assert turn_of(turn_matrix(*turn)) == pytest.approx(turn, abs=1e-6)


@pytest.mark.parametrize("pitch", [90.0, -90.0])
def test_at_right_angles_the_turn_is_the_same_with_no_roll(pitch):
    matrix = turn_matrix(25, pitch, 10)
    np.testing.assert_allclose(turn_matrix(*turn_of(matrix)), matrix, atol=1e-7)


DOWN = np.array([0.0, 1.0, 0.0])


@pytest.mark.parametrize("turn", [(25.0, 0.0, 0.0), (0.0, -20.0, 0.0), (-30.0, 10.0, 15.0)])
def test_the_foot_of_what_stands_stays_where_it_touches(scene, turn):
    """From another start, too; what does not stand turns about its centre."""
    points = _points(scene)
    lowest = points[points[:, 1] > points[:, 1].max() - 0.04 * np.ptp(points[:, 1])]
    foot = 0.5 * (lowest.min(0) + lowest.max(0))
    start = Placement(move=(12.0, -5.0), depth=0.2, turn=(10.0, 40.0, 0.0), scale=1.2)
    lifted, free = (replace(scene.lifted, stands=stands) for stands in (True, False))
    now = turned(start, turn, points, lifted, scene.camera, DOWN)
    assert now.turn == turn and now.scale == start.scale
    floating = turned(start, turn, points, free, scene.camera, DOWN)
    assert floating == replace(start, turn=turn)
    before, kept, moved = (
        place.matrix(scene.lifted, scene.camera) @ [*foot, 1.0] for place in (start, now, floating)
    )
    size = scene.lifted.diameter * scene.lifted.scale
    assert np.linalg.norm(kept - before) < PLANE * size
    assert np.linalg.norm(moved - before) > 0.05 * size


def _dish(height: float, base: float, tilt: float, towards: float) -> np.ndarray:
    """(N, 3) a round dish, one unit wide, that is `base` units wide where it stands.

    It is taken to be tilted by `tilt` degrees, one direction of many.
    """
    rng = np.random.default_rng(0)
    radius, angle = 0.5 * np.sqrt(rng.random(2000)), rng.uniform(0, 2 * np.pi, 2000)
    rise = height * np.clip((radius - base / 2) / (0.5 - base / 2), 0, None)
    points = np.column_stack([radius * np.cos(angle), -rise, radius * np.sin(angle)])
    axis = np.array([np.cos(towards), 0.0, np.sin(towards)])
    return points @ matrix_from_vector(np.radians(tilt) * axis).T + [0, 0, 3]


@over("tilt", [0.0, 3.0, 8.0, 14.0, 20.0])
@over("base", [0.35, 0.6])
@over("height", [0.15, 0.3])
def test_what_is_shallow_stays_where_it_is_however_wrong_its_tilt_is(scene, height, base, tilt):
    """It lies on one side of its rim then, which it would not turn about."""
    lifted = replace(scene.lifted, stands=True)
    for towards in np.radians(np.arange(0, 360, 40)):
        points = _dish(height, base, tilt, towards)
        foot = foot_of(Placement(), points, lifted, scene.camera, DOWN)
        middle = 0.5 * (points.min(0) + points.max(0))
        assert np.hypot(*(foot - middle)[[0, 2]]) < 0.15
        assert foot[1] > points[:, 1].max() - 0.04 * np.ptp(points[:, 1])


@over("tilt", [0.0, 3.0, 8.0])
def test_what_is_tall_stands_on_its_contact_also_where_it_leans(scene, tilt):
    lifted = replace(scene.lifted, stands=True)
    for towards in np.radians(np.arange(0, 360, 40)):
        points = _dish(2.0, 0.35, tilt, towards)
        lowest = points[points[:, 1] > points[:, 1].max() - 0.04 * np.ptp(points[:, 1])]
        foot = foot_of(Placement(), points, lifted, scene.camera, DOWN)
        np.testing.assert_allclose(foot, 0.5 * (lowest.min(0) + lowest.max(0)), atol=EXACT)


@over("stands", [True, False])
def test_a_roll_is_about_the_middle_and_leaves_the_position(scene, stands):
    """Away from the middle of the photo, where near parts are seen larger, and from its foot."""
    lifted = replace(scene.lifted, stands=stands)
    start = Placement(move=(60.0, 45.0), turn=(35.0, 10.0, 0.0))
    rolled = (*start.turn[:2], 90.0)
    assert turned(start, rolled, _points(scene), lifted, scene.camera, DOWN) == replace(
        start, turn=rolled
    )


def _in_smaller_units(lifted: LiftedObject, times: float) -> LiftedObject:
    """The same object in the same place, of which the frame counts so many times as many."""
    own, world = lifted.gaussians, lifted.world_from_object.copy()
    world[:3, :3] /= times
    return replace(
        lifted, gaussians=replace(own, means=own.means * times, scales=own.scales * times),
        control_points=lifted.control_points * times, world_from_object=world,
        spacing=lifted.spacing * times,
    )  # fmt: skip


@over("stands", [True, False])
@over("times", [1.0, 0.01, 100.0])
def test_a_place_is_in_place_whatever_the_rounding_of_how_it_was_computed(scene, stands, times):
    document, camera = scene.document(), scene.camera
    lifted = _in_smaller_units(replace(scene.lifted, stands=stands), times)
    thing = replace(document.objects[0], lifted=lifted)
    down = gimbal_of(thing, document).down
    for turn in ((20.0, 0.0, 0.0), (-31.0, 7.0, 3.0)):
        about_its_foot = turned(Placement(), turn, _points(scene), lifted, camera, down)
        for place in (about_its_foot, Placement(turn=turn)):
            for off, is_still in ((0.0, True), (1e-9, True), (0.05, False)):
                motion = place.matrix(lifted, camera)
                motion[:3, :3] *= 1 + off
                motion[:3, 3] += lifted.diameter * lifted.scale * off
                computed = replace(thing, placement=placement_of(motion, lifted, camera))
                assert is_in_place(computed, document) == is_still, (place, off)
    aside = replace(thing, placement=Placement(move=(0.5, 0.0)))
    assert not is_in_place(aside, document) and is_in_place(thing, document)


UPS = [(0.0, -1.0, 0.0), (0.1, -0.6, -float(np.sqrt(1 - 0.37)))]


@over("up", UPS)
@over("degrees", [25.0, -35.0, 170.0])
@over("turn", [(0.0, 0.0, 0.0), (12.0, -8.0, 30.0)])
def test_a_spin_turns_what_stands_on_its_foot_about_its_upright(scene, up, degrees, turn):
    document = scene.document()
    lifted = replace(scene.lifted, up=up, stands=True)
    thing = replace(document.objects[0], lifted=lifted)
    start = Placement((4.0, -3.0), 0.2, turn, 1.2)
    before = start.matrix(lifted, scene.camera)
    after = spun(start, degrees, thing, document).matrix(lifted, scene.camera)
    points, down = _points(scene), -np.array(up)
    depth = points @ down
    own = points[depth > depth.max() - 0.04 * np.ptp(depth)]
    foot = 0.5 * (own.min(0) + own.max(0))
    np.testing.assert_allclose(*([*m[:3] @ [*foot, 1.0]] for m in (before, after)), atol=EXACT)
    in_place = replace(thing, placement=spun(Placement(turn=turn), degrees, thing, document))
    assert is_in_place(in_place, document) == (turn == (0.0, 0.0, 0.0))
    x, y = in_place.placement.move
    moved = replace(in_place.placement, move=(x + 0.5, y))
    assert not is_in_place(replace(in_place, placement=moved), document)
    np.testing.assert_allclose(after[:3, :3] @ down, before[:3, :3] @ down, atol=EXACT)
    spin = np.linalg.inv(before[:3, :3]) @ after[:3, :3]
    assert np.degrees(turn_about(vector_from_matrix(spin), down)) == pytest.approx(degrees)


def test_a_thing_stands_as_told_as_its_shape_says_as_its_neighbour_does_or_by_the_horizon(scene):
    document = scene.document()
    thing = document.objects[0]
    assert gimbal_of(thing, document) is CAMERA_GIMBAL
    document = replace(document, horizon=20.0)
    ground = ground_under(_points(scene), scene.camera, 20.0)
    np.testing.assert_allclose(gimbal_of(thing, document).down, ground.normal)
    plate = replace(thing, lifted=replace(scene.lifted, up=UPS[1]))
    document = replace(document, objects=(thing, plate))
    for own in (thing, plate):
        np.testing.assert_allclose(gimbal_of(own, document).down, -np.array(UPS[1]))
    told = gimbal_of(replace(plate, seen_from=30.0), document).down
    way = scene.lifted.centre / np.linalg.norm(scene.lifted.centre)
    assert np.degrees(np.arcsin(told @ way)) == pytest.approx(30.0, abs=1.0)


@over("stands", [True, False])
@over("up", UPS)
def test_what_stands_grows_from_its_foot_and_all_else_from_its_centre(scene, up, stands):
    lifted, points = replace(scene.lifted, up=up, stands=stands), _points(scene)
    start = Placement((4.0, -3.0), 0.2, (12.0, -8.0, 30.0), 1.2)
    standing = (points, lifted, scene.camera, -np.array(up))
    larger = scaled(start, 1.9, *standing)
    assert (larger.turn, larger.scale) == (start.turn, 1.9)
    feet = [foot_of(own, *standing) for own in (start, larger)]
    np.testing.assert_allclose(*feet, atol=EXACT)
    if not stands:
        np.testing.assert_allclose(feet[0], centre_of(start, lifted, scene.camera), atol=EXACT)
        assert larger == replace(start, scale=1.9)


def test_the_ground_lies_as_the_object_stands(scene):
    """Whatever the horizon is; a contact that is moved over it stays on it, in every direction."""
    document = replace(scene.document(), horizon=20.0)
    thing = document.objects[0]
    thing = replace(thing, lifted=replace(scene.lifted, up=UPS[1], stands=True))
    ground = ground_for(document.with_object(0, thing), thing)
    assert ground is not None
    np.testing.assert_allclose(ground.normal, -np.array(UPS[1]))
    assert ground.below(_points(scene)).max() == pytest.approx(0, abs=EXACT)
    hold = replace(_hold(scene, 20.0), point=ground.lowest(_points(scene)), ground=ground)
    for delta, away in (((30, 8), 0.0), ((-60, 40), 0.7), ((10, -30), -0.2)):
        motion = hold.moved(np.array(delta, float), away).matrix(scene.lifted, scene.camera)
        assert abs(ground.below(motion[:3, :3] @ hold.point + motion[:3, 3])) < PLANE * hold.unit


def _told(
    scene: shapes.Scene, up: tuple[float, float, float] | None
) -> tuple[Document, EditObject]:
    document = scene.document()
    lifted = replace(scene.lifted, up=up, stands=True)
    thing = replace(document.objects[0], lifted=lifted)
    return document.with_object(0, thing), thing


def _way(start: Placement, end: Placement, thing: EditObject, document: Document) -> list[F64]:
    """The rotations of the way from one placement to another, in 21 moments."""
    shares = np.linspace(0, 1, 21)
    found = [blended(start, end, float(share), thing, document) for share in shares]
    return [turn_matrix(*place.turn) for place in found]


def _angle(before: F64, after: F64) -> float:
    """Degrees."""
    return float(np.degrees(np.linalg.norm(vector_from_matrix(after @ before.T))))


@over("up", [None, *UPS])
def test_between_two_turns_a_thing_goes_no_long_way_round(scene, up):
    """Whatever they are: each way is met at its ends, and has no jump."""
    document, thing = _told(scene, up)
    rng = np.random.default_rng(0)
    pairs = [((170.0, 0.0, 0.0), (190.0, 0.0, 0.0)), ((170.0, 0.0, 0.0), (-170.0, 0.0, 0.0)),
             ((90.0, 0.0, 0.0), (-90.0, 10.0, 0.0)), ((0.0, 85.0, 0.0), (170.0, 85.0, 170.0)),
             *((tuple(a), tuple(b)) for a, b in rng.uniform(-180, 180, (16, 2, 3)))]  # fmt: skip
    for start, end in pairs:
        way = _way(Placement(turn=start), Placement(turn=end), thing, document)
        np.testing.assert_allclose(way[0], turn_matrix(*start), atol=1e-9)
        np.testing.assert_allclose(way[-1], turn_matrix(*end), atol=1e-9)
        steps = [_angle(a, b) for a, b in pairwise(way)]
        shortest = _angle(way[0], way[-1])
        assert sum(steps) < 1.6 * shortest + 0.5, (start, end)
        assert max(steps) < 8 * shortest / 20 + 0.1, (start, end)


@over("up", [None, *UPS])
@over("ends", [(170.0, 190.0), (190.0, 170.0), (90.0, 180.0), (180.0, 270.0), (0.5, 120.0)])
def test_between_two_spins_a_thing_stands_and_its_foot_stays(scene, up, ends):
    """Half-way it is spun by half the angle; and larger things grow there, as they do in one go."""
    document, thing = _told(scene, up)
    lifted, camera = thing.lifted, scene.camera
    assert lifted is not None
    start, end = (spun(Placement(depth=0.1), degrees, thing, document) for degrees in ends)
    end = grown(end, 1.4, thing, document)
    half = spun(Placement(depth=0.1), 0.5 * sum(ends), thing, document)
    expected = grown(half, 1.4**0.5, thing, document).matrix(lifted, camera)
    found = blended(start, end, 0.5, thing, document).matrix(lifted, camera)
    np.testing.assert_allclose(found, expected, atol=1e-9)


@over("stands", [True, False])
def test_what_is_turned_about_its_middle_goes_by_it(scene, stands):
    """Its angles and its move are in the middle between those of both ends."""
    document, thing = _told(scene, None)
    thing = replace(thing, lifted=replace(scene.lifted, stands=stands))
    start, end = Placement((3.0, 2.0), 0.1, (20.0, 0.0, 0.0)), Placement((3.0, 2.0), 0.1)
    end = replace(end, turn=(-40.0, 30.0, 80.0), scale=4.0)
    found = blended(start, end, 0.5, thing, document)
    assert found == Placement((3.0, 2.0), 0.1, (-10.0, 15.0, 40.0), 2.0)
    away = replace(start, move=(13.0, -6.0), depth=0.3)
    found = blended(start, away, 0.5, thing, document)
    assert found.move == (8.0, -2.0) and found.depth == pytest.approx(0.2)
    assert (found.turn, found.scale) == (start.turn, 1.0)


def _bowl(height: float, askew: float) -> F64:
    """(N, 3) world, y down: a bowl of radius 1, `height` deep, that leans by `askew` degrees."""
    radius, angle = np.meshgrid(np.linspace(0, 1, 25), np.linspace(0, 2 * np.pi, 73)[:-1])
    deep = height * (1 - radius**2)
    own = np.stack([radius * np.cos(angle), deep, radius * np.sin(angle)], -1).reshape(-1, 3)
    return own @ turn_matrix(0.0, 0.0, askew).T + [0.4, 0.5, 5.0]


@over("askew", [0.0, 15.0, -25.0])
def test_a_shallow_thing_stands_on_all_that_it_covers(scene, askew):
    """Lifted askew, it has its lowest points at one side, about which it would swing away."""
    points, lifted = _bowl(0.3, askew), replace(scene.lifted, stands=True)
    foot = foot_of(Placement(), points, lifted, scene.camera, DOWN)
    middle = 0.5 * (points.min(0) + points.max(0))
    np.testing.assert_allclose(foot[[0, 2]], middle[[0, 2]], atol=0.05)
    assert points[:, 1].max() - foot[1] < 0.05 * np.ptp(points[:, 1])


def test_a_tall_thing_stands_on_its_own_foot_at_one_side(scene):
    points = np.concatenate([_bowl(0.3, 0.0), [[1.3, y, 5.0] for y in np.linspace(0.5, 4.0, 50)]])
    lifted = replace(scene.lifted, stands=True)
    foot = foot_of(Placement(), points, lifted, scene.camera, DOWN)
    np.testing.assert_allclose(foot[[0, 2]], [1.3, 5.0], atol=1e-9)
