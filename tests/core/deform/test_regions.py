"""What the artist says about regions, through to the moved surface; and parts that lie close."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.deform.deformer import Deformer
from objectmorpher_core.document.model import Handle, LiftedObject, Pose
from objectmorpher_core.document.pose import Base
from objectmorpher_core.document.rig import Rig, Seam
from objectmorpher_core.document.settings import DeformSettings
from tests import shapes
from tests.tree import over

EXACT = 1e-9
BAR = shapes.capsule()
LIFTED = shapes.lifted_surface(BAR.points, BAR.normals)
NODES = LIFTED.control_points.astype(np.float64)
MIDDLE = np.flatnonzero(np.abs(NODES[:, 0]) < 0.12).astype(np.int32)
LEFT = np.flatnonzero(NODES[:, 0] < 0.0).astype(np.int32)
RIGHT = np.flatnonzero(NODES[:, 0] >= 0.0).astype(np.int32)


def _handle(lifted: LiftedObject, at, move=(0.0, 0.0, 0.0), **more) -> Handle:
    means = lifted.gaussians.means.astype(np.float64)
    point = means[((means - at) ** 2).sum(1).argmin()]
    node = int(((lifted.control_points - point) ** 2).sum(1).argmin())
    return Handle(node, point, point + np.array(move), **more)


def _bent(rig: Rig | None, move=(-0.2, 0.45, 0.0)) -> tuple[Deformer, Pose]:
    """The bar with its left end held and its right end moved."""
    deformer = Deformer(LIFTED, DeformSettings(), rig)
    handles = (
        _handle(LIFTED, (-0.5, 0, 0), turn=np.zeros(3)),
        _handle(LIFTED, (0.5, 0, 0), move, turn=np.array([0, 0, 1.2])),
    )
    return deformer, deformer.solve(handles).pose


def _shape(points: F64) -> F64:
    return np.linalg.norm(points[:, None] - points[None], axis=2)


def test_a_rigid_body_keeps_its_shape_and_its_surface():
    _, free = _bent(None)
    deformer, pose = _bent(Rig(bodies=(MIDDLE,)))
    rest = _shape(NODES[MIDDLE])
    assert np.abs(_shape(free.points[MIDDLE]) - rest).max() > 0.005
    assert np.abs(_shape(pose.points[MIDDLE]) - rest).max() < EXACT
    inner = BAR.points[np.abs(BAR.points[:, 0]) < 0.03][::20]
    moved = deformer.skin_points(inner, pose).points
    assert np.abs(_shape(moved) - _shape(inner)).max() < 1e-6


@pytest.mark.parametrize(
    "rig", [Rig(held=MIDDLE), Rig(bodies=(MIDDLE,)), Rig(seams=(Seam(LEFT, RIGHT),))]
)
def test_a_deformer_with_another_rig_is_as_one_made_for_it(rig):
    made, pose = _bent(rig)
    other = Deformer(LIFTED, DeformSettings(), Rig(stiffness=np.full(len(NODES), 2.0)))
    handles = (
        _handle(LIFTED, (-0.5, 0, 0), turn=np.zeros(3)),
        _handle(LIFTED, (0.5, 0, 0), (-0.2, 0.45, 0.0), turn=np.array([0, 0, 1.2])),
    )
    other.solve(handles)
    changed = other.with_rig(rig)
    assert (changed.graph is other.graph) is (rig.seams == ())
    np.testing.assert_allclose(changed.solve(handles).pose.points, pose.points, atol=EXACT)
    assert made.graph.link_count == changed.graph.link_count


def test_frozen_control_points_stay():
    _, pose = _bent(Rig(held=MIDDLE))
    assert np.abs(pose.points[MIDDLE] - NODES[MIDDLE]).max() < EXACT
    _, free = _bent(None)
    assert np.abs(free.points[MIDDLE] - NODES[MIDDLE]).max() > 0.05


def _frozen(pose: Pose) -> Rig:
    """The middle is frozen where a pose has it."""
    return Rig(held=MIDDLE, shifts=pose.points[MIDDLE] - NODES[MIDDLE])


def _bending(move=(-0.2, 0.45, 0.0)) -> tuple[Handle, Handle]:
    left = _handle(LIFTED, (-0.5, 0, 0), turn=np.zeros(3))
    return left, _handle(LIFTED, (0.5, 0, 0), move, turn=np.array([0, 0, 1.2]))


def test_what_was_frozen_in_a_pose_stays_there_whatever_is_dragged():
    deformer, pose = _bent(None)
    frozen = deformer.with_rig(_frozen(pose))
    same = frozen.solve(_bending(), start=pose).pose
    assert np.abs(same.points - pose.points).max() < 1e-4, "freezing changes nothing"
    for start in (pose, None):
        handles = _bending((0.1, 0.1, 0.3))
        moved = frozen.solve(handles, start=start).pose
        assert np.abs(moved.points[MIDDLE] - pose.points[MIDDLE]).max() < EXACT
        assert np.abs(moved.points - pose.points).max() > 0.2
        met = frozen.skin_points(np.array([h.point for h in handles]), moved).points
        np.testing.assert_allclose(met, [h.target for h in handles], atol=1e-6)


def test_what_was_frozen_in_a_pose_stays_there_without_any_handle():
    deformer, pose = _bent(None)
    alone = deformer.with_rig(_frozen(pose)).solve(()).pose
    assert np.abs(alone.points[MIDDLE] - pose.points[MIDDLE]).max() < EXACT
    ends = np.abs(NODES[:, 0]) > 0.4
    assert np.abs(alone.points[ends] - NODES[ends]).max() > 0.05, "the ends follow it"
    inner = deformer.strain(alone).most[np.abs(NODES[:, 0]) > 0.25]
    assert np.abs(inner - 1).max() < 0.02, "and nothing strains them"


def test_a_handle_on_a_frozen_part_moves_nothing():
    deformer, pose = _bent(None)
    frozen = deformer.with_rig(_frozen(pose))
    inside = _handle(LIFTED, (0, 0.08, 0), (0.0, 0.5, 0.0))
    assert inside.control_point in MIDDLE
    left, right = _bending()
    with_it = frozen.solve((left, inside, right), start=pose).pose
    without = frozen.solve((left, right), start=pose).pose
    np.testing.assert_allclose(with_it.points, without.points, atol=EXACT)
    assert not frozen.influence((left, inside, right), 1, Base(), pose).any()
    shares = frozen.influence((left, inside, right), 2, Base(), pose)
    np.testing.assert_allclose(shares, frozen.influence((left, right), 1, Base(), pose))


def test_a_handle_beside_a_frozen_part_is_met_and_the_part_stays():
    deformer, pose = _bent(None)
    frozen = deformer.with_rig(_frozen(pose))
    left, right = _bending()
    means = LIFTED.gaussians.means.astype(np.float64)
    near = means[(means[:, 0] > 0.1) & (means[:, 0] < 0.16)]
    nodes = [deformer.nearest_control_point(point) for point in near]
    point, node = next((p, n) for p, n in zip(near, nodes, strict=True) if n not in MIDDLE)
    start = deformer.skin_points(point, pose).points[0]
    handle = Handle(node, point, start + (0.0, 0.03, 0.02))
    moved = frozen.solve((left, handle, right), start=pose).pose
    assert np.abs(moved.points[MIDDLE] - pose.points[MIDDLE]).max() < EXACT
    met = frozen.skin_points(point, moved).points[0]
    np.testing.assert_allclose(met, handle.target, atol=1e-5)


def test_a_limit_to_stretching_stops_handles_and_not_what_is_frozen():
    settings = DeformSettings(stretch_limit=1.6)
    deformer = Deformer(LIFTED, settings)
    pose = deformer.solve(_bending((-0.1, 0.15, 0.0))).pose
    frozen = deformer.with_rig(_frozen(pose))
    solution = frozen.solve(_bending((2.0, 0.5, 0.0)), start=pose)
    assert 0.0 < solution.share < 1.0
    assert np.abs(solution.pose.points[MIDDLE] - pose.points[MIDDLE]).max() < EXACT


def test_a_stiff_part_bends_less_and_a_soft_one_more():
    bends = []
    for factor in (0.05, 1.0, 20.0):
        stiffness = np.ones(len(NODES))
        stiffness[MIDDLE] = factor
        _, pose = _bent(Rig(stiffness=stiffness))
        inner = np.abs(NODES[:, 0]) < 0.08
        bends.append(float(np.ptp(_angles(pose, inner))))
    assert bends[0] > 1.3 * bends[1] > 1.3 * 1.3 * bends[2]


@pytest.mark.parametrize("factor", [0.3, 7.0])
def test_a_stiffness_whose_root_is_not_round_keeps_the_weights_symmetric(factor):
    stiffness = np.ones(len(NODES))
    stiffness[MIDDLE] = factor
    _, pose = _bent(Rig(stiffness=stiffness))
    assert np.isfinite(pose.points).all()


def _angles(pose: Pose, chosen: np.ndarray) -> F64:
    r = pose.rotations[chosen]
    return np.arctan2(r[:, 1, 0], r[:, 0, 0])


def test_a_cut_bar_is_two():
    deformer = Deformer(LIFTED, DeformSettings(), Rig(seams=(Seam(LEFT, RIGHT),)))
    assert deformer.graph.component_count == 2
    weights = deformer.graph.weights.toarray()
    assert not weights[np.ix_(LEFT, RIGHT)].any()
    handles = (
        _handle(LIFTED, (-0.5, 0, 0), is_pin=True), _handle(LIFTED, (-0.2, 0.08, 0), is_pin=True),
        _handle(LIFTED, (0.3, 0.08, 0), (0.0, 0.2, 0.0)),
    )  # fmt: skip
    pose = deformer.solve(handles).pose
    assert np.abs(pose.points[LEFT] - NODES[LEFT]).max() < 1e-6
    assert np.abs(pose.points[RIGHT] - NODES[RIGHT] - [0, 0.2, 0]).max() < 1e-6


def test_glue_joins_two_bars():
    points = np.concatenate([BAR.points, BAR.points + [1.3, 0, 0]])
    normals = np.concatenate([BAR.normals, BAR.normals])
    lifted = shapes.lifted_surface(points, normals, 600)
    nodes = lifted.control_points
    first = np.flatnonzero(np.abs(nodes[:, 0] - 0.45) < 0.06).astype(np.int32)
    second = np.flatnonzero(np.abs(nodes[:, 0] - 0.85) < 0.06).astype(np.int32)
    apart = Deformer(lifted, DeformSettings())
    joined = Deformer(lifted, DeformSettings(), Rig(seams=(Seam(first, second, True),)))
    assert (apart.graph.component_count, joined.graph.component_count) == (2, 1)
    pins = _handle(lifted, (-0.5, 0, 0), is_pin=True), _handle(lifted, (0, 0.08, 0), is_pin=True)
    pose = joined.solve((*pins, _handle(lifted, (1.8, 0, 0), (-0.3, 0.6, 0.0)))).pose
    gaps = np.linalg.norm(pose.points[first].mean(0) - pose.points[second].mean(0))
    rest = np.linalg.norm(nodes[first].mean(0) - nodes[second].mean(0))
    assert gaps == pytest.approx(rest, rel=0.2), "the glued ends stay together"


@pytest.mark.parametrize("stiffness", [0.5, 2.0])
def test_the_reach_of_the_links_is_a_setting(stiffness):
    usual = Deformer(LIFTED, DeformSettings()).graph
    other = Deformer(LIFTED, DeformSettings(stiffness=stiffness)).graph
    assert (other.link_count > usual.link_count) == (stiffness > 1)


def test_a_stretch_limit_stops_the_handles():
    pulls = []
    for limit in (None, 1.3):
        deformer = Deformer(LIFTED, DeformSettings(stretch_limit=limit))
        handles = (
            _handle(LIFTED, (-0.5, 0, 0), is_pin=True),
            _handle(LIFTED, (0.5, 0, 0), (0.9, 0.0, 0.0)),
        )
        solution = deformer.solve(handles)
        pulls.append((deformer.strain(solution.pose).most.max(), solution.share))
    assert pulls[0][0] > 1.5 and pulls[0][1] == 1.0
    assert 1.2 < pulls[1][0] <= 1.3
    assert 0.1 < pulls[1][1] < 0.9


# ---- parts that lie close together ----------------------------------------------------------


def _legs(gap: float) -> tuple[LiftedObject, np.ndarray]:
    """Two upright legs `gap` apart, each its own part; and which Gaussians are the second's."""
    leg = shapes.capsule(1.0, 0.08)
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    points, normals = leg.points @ turn.T, leg.normals @ turn.T
    points = np.concatenate([points, points + [0.16 + gap, 0, 0]])
    lifted = shapes.lifted_surface(points, np.concatenate([normals, normals]))
    return lifted, lifted.gaussians.means[:, 0] > 0.08 + gap / 2


def test_moving_one_leg_leaves_the_leg_beside_it_where_it_is():
    lifted, is_second = _legs(0.04)
    deformer = Deformer(lifted, DeformSettings())
    assert 0.03 < deformer.graph.mean_spacing < 0.05
    drag = np.array([0.0, 0.0, 0.3])
    handles = (
        _handle(lifted, (0, 0.5, 0), is_pin=True), _handle(lifted, (0.2, 0.5, 0), is_pin=True),
        _handle(lifted, (0.2, -0.5, 0), is_pin=True), _handle(lifted, (0, -0.5, 0), drag),
    )  # fmt: skip
    pose = deformer.solve(handles).pose
    means = lifted.gaussians.means
    moved = np.linalg.norm(deformer.skin_gaussians(pose).points - means, axis=1)
    assert moved[is_second].max() < 0.01 * 0.3
    assert moved[~is_second].max() > 0.25
    papers = Deformer(lifted, DeformSettings(is_faithful=True))
    pose = papers.solve(handles).pose
    moved = np.linalg.norm(papers.skin_gaussians(pose).points - means, axis=1)
    assert moved[is_second].max() > 0.1 * 0.3, "the paper's rule drags it along"


# ---- garbage --------------------------------------------------------------------------------


def _odd_cloud(name: str) -> F64:
    rng = np.random.default_rng(0)
    if name == "line":
        return np.column_stack([np.linspace(0, 1, 60), np.zeros((60, 2))])
    if name == "plane":
        return shapes.sheet()
    if name == "coincident":
        return np.repeat(rng.normal(size=(12, 3)), 5, axis=0)
    if name == "four":
        return rng.normal(size=(4, 3))
    return np.concatenate([shapes.ball(100), [[500.0, 0, 0]]])  # one far away


@over("name", ["line", "plane", "coincident", "four", "outlier"])
@over("mode", ["default", "faithful"])
def test_odd_clouds_have_a_defined_result(name, mode):
    cloud = _odd_cloud(name)
    lifted = shapes.lifted_cloud(cloud, shapes.even(cloud, 64))
    deformer = Deformer(lifted, DeformSettings(is_faithful=mode == "faithful"))
    first, second = lifted.control_points[[0, 1]].astype(np.float64)
    handles = Handle(0, first, first), Handle(1, second, second + [0.0, 0.1, 0.2])
    pose = deformer.solve(handles).pose
    assert np.isfinite(pose.points).all()
    assert np.abs(np.linalg.det(pose.rotations) - 1).max() < EXACT
    skinned = deformer.skin_gaussians(pose)
    assert np.isfinite(skinned.points).all() and np.isfinite(skinned.linear).all()


@pytest.mark.parametrize("turn", [None, np.zeros(3)])
def test_handles_on_one_point_with_two_targets_meet_in_the_middle(turn):
    deformer = Deformer(LIFTED, DeformSettings())
    pin = _handle(LIFTED, (-0.5, 0, 0), is_pin=True)
    up = _handle(LIFTED, (0.5, 0, 0), (0.0, 0.2, 0.0), turn=turn)
    down = _handle(LIFTED, (0.5, 0, 0), (0.0, -0.2, 0.0), turn=turn)
    pose = deformer.solve((pin, up, down)).pose
    reached = deformer.skin_points(up.point, pose).points[0]
    assert np.abs(reached - up.point).max() < 0.02
    assert np.isfinite(pose.points).all()
    assert np.abs(pose.points - NODES).max() < 0.1


def test_values_that_are_no_numbers_are_refused():
    broken = NODES.copy()
    broken[3, 1] = np.nan
    with pytest.raises(ValueError, match="not finite"):
        Deformer(shapes.lifted_cloud(BAR.points[:300], broken), DeformSettings())
    deformer = Deformer(LIFTED, DeformSettings())
    handles = _handle(LIFTED, (-0.5, 0, 0)), _handle(LIFTED, (0.5, 0, 0), (np.nan, 0, 0))
    with pytest.raises(ValueError, match="not finite"):
        deformer.solve(handles)


@pytest.mark.slow
def test_five_million_gaussians_deform():
    from objectmorpher_research.bench.bodies import five_limbs, limb_handles

    lifted = five_limbs(5_000_000, 512)
    deformer = Deformer(lifted, DeformSettings())
    assert deformer.graph.component_count == 1
    handles = limb_handles(lifted, 30.0)
    skinned = deformer.skin_gaussians(deformer.solve(handles).pose)
    assert np.isfinite(skinned.points).all()
    assert len(skinned.linear) == len(lifted.gaussians)
