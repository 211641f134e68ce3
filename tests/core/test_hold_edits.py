"""What holds an object changes, and the object does not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from objectmorpher_core.deform.deformer import Deformer
from objectmorpher_core.document import edits, hold_edits
from objectmorpher_core.document.hold_edits import Stays, hold, set_stays
from objectmorpher_core.document.model import Document, EditObject, Handle
from objectmorpher_core.document.pose import Pose
from objectmorpher_core.document.rig import Rig
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.session.file import decode_session, encode_session
from tests import shapes
from tests.tree import quick

NODES = 60
SESSIONS = 800
PIXEL = 1 / 500  # diameters: of an object that is 500 px large
SAME = 0.05 * PIXEL
MET = 1e-6  # diameters


@cache
def opened(body: bool = False) -> tuple[Document, Deformer]:
    """A lifted object of few control points; four are one rigid body if it has a `body`."""
    scene = shapes.scene("ellipse")
    document = edits.resample(scene.document(), 0, NODES)
    item = document.objects[0]
    if body:
        near = np.argsort(
            ((item.lifted.control_points - item.lifted.control_points[9]) ** 2).sum(1)
        )
        item = replace(item, rig=Rig(bodies=(near[:4],)))
        document = document.with_object(0, item)
    return document, Deformer(item.lifted, item.deform, item.rig)


def seen(deformer: Deformer, pose: Pose | None) -> np.ndarray:
    """(M, 3) diameters: a motion of them across the picture is the same part of the object's."""
    return (deformer.points if pose is None else pose.points) / deformer.diameter


def solved(document: Document, deformer: Deformer, start: Pose | None = None) -> Document:
    item = document.objects[0]
    return edits.set_pose(document, 0, deformer.solve(item.handles, item.footing, start).pose)


def added(document: Document, deformer: Deformer, random, is_pin: bool = False) -> Document:
    """One handle more, on a point of the surface that has none; as the object is shown."""
    item = document.objects[0]
    taken = {h.control_point for h in item.handles}
    while True:
        point = item.lifted.gaussians.means[random.integers(len(item.lifted.gaussians))]
        if edits.nearest_control_point(item.lifted, point) not in taken:
            break
    place = point if item.pose is None else deformer.skin_points(point, item.pose).points[0]
    changed = edits.add_handle(document, 0, point, place, is_pin)
    return hold(changed, 0, deformer, (len(item.handles),))


def dragged(document: Document, deformer: Deformer, random) -> Document:
    """A random handle somewhere else, in two steps of a pointer."""
    h = int(random.integers(len(document.objects[0].handles)))
    for _ in range(2):
        item = document.objects[0]
        way = random.normal(size=3) * 0.06 * deformer.diameter
        document = edits.move_handle(document, 0, h, item.handles[h].target + way)
        start = item.pose or deformer.rest()
        document = solved(document, deformer, start)
    return document


def taken(document: Document, deformer: Deformer, h: int, target: np.ndarray) -> Document:
    """Handle `h` at `target`, in ten steps of a pointer."""
    begun = document.objects[0].handles[h].target
    for share in np.linspace(0.1, 1.0, 10):
        document = edits.move_handle(document, 0, h, begun + share * (target - begun))
        document = solved(document, deformer, document.objects[0].pose or deformer.rest())
    return document


def changed(document: Document, deformer: Deformer, random) -> Document:
    """Another set of handles, or of what holds still."""
    handles = document.objects[0].handles
    kind = random.integers(6)
    if kind < 2 or not handles:
        return added(document, deformer, random, is_pin=kind == 1)
    h = int(random.integers(len(handles)))
    if kind == 2:
        return hold(edits.remove_handle(document, 0, h), 0, deformer)
    if kind == 3:
        return hold(edits.soften_handle(document, 0, h, random.choice([0, 0.3, 2.0])), 0, deformer)
    if kind == 4:
        return hold(edits.set_pin(document, 0, h, not handles[h].is_pin), 0, deformer)
    return set_stays(document, 0, deformer, random.choice(list(Stays)))


def motion(document: Document, deformer: Deformer) -> float:
    """How far anything goes when a drag begins that has not moved yet, diameters."""
    item = document.objects[0]
    now = deformer.solve(item.handles, item.footing, item.pose or deformer.rest()).pose
    return float(np.abs(seen(deformer, now) - seen(deformer, item.pose)).max())


@pytest.mark.parametrize(
    ("body", "sessions"), quick([(False, 50), (True, 15), (False, SESSIONS), (True, 100)], 2)
)
def test_in_random_sessions_nothing_moves_but_what_is_dragged(body: bool, sessions: int):
    random = np.random.default_rng(4)
    most = []
    for _ in range(sessions):
        document, deformer = opened(body)
        document = added(document, deformer, random)
        document = dragged(document, deformer, random)
        for _ in range(random.integers(1, 4)):
            before = document.objects[0].pose
            document = changed(document, deformer, random)
            assert document.objects[0].pose is before
        most.append(motion(document, deformer))
    assert max(most) < SAME, (int(np.argmax(most)), max(most) / PIXEL)


@pytest.mark.parametrize("seeds", quick([6, 40], 1))
def test_handles_are_met_from_any_pose_and_the_way_back_is_the_same(seeds: int):
    random = np.random.default_rng(1)
    for _ in range(seeds):
        document, deformer = opened()
        document = dragged(added(document, deformer, random), deformer, random)
        document = changed(added(document, deformer, random), deformer, random)
        before = document.objects[0]
        hard = [h for h, own in enumerate(before.handles) if own.softness == 0]
        if not hard:
            continue
        h = hard[-1]
        target = before.handles[h].target
        there = taken(document, deformer, h, target + 0.05 * deformer.diameter)
        for own in (there.objects[0].handles[h] for h in hard):
            reached = deformer.skin_points(own.point, there.objects[0].pose).points[0]
            assert np.abs(reached - own.target).max() < MET * deformer.diameter
        back = taken(there, deformer, h, target)
        gap = np.abs(seen(deformer, back.objects[0].pose) - seen(deformer, before.pose)).max()
        assert gap < 5 * SAME  # the solves of twenty frames end somewhere near the minimum


def test_an_object_keeps_its_own_shape_and_takes_it_again():
    """What holds it now needs no strain of its own: dragged home, it is as in the photo."""
    random = np.random.default_rng(2)
    document, deformer = opened()
    home = added(document, deformer, random)
    target = home.objects[0].handles[0].target
    document = dragged(home, deformer, random)
    document = added(document, deformer, random, is_pin=True)
    document = hold(edits.remove_handle(document, 0, 1), 0, deformer)
    pose = taken(document, deformer, 0, target).objects[0].pose
    assert np.abs(seen(deformer, pose) - seen(deformer, None)).max() < SAME


def test_the_far_side_stays_but_near_a_new_handle_and_all_else_if_so_wanted():
    random = np.random.default_rng(3)
    document, deformer = opened()
    one = dragged(added(document, deformer, random), deformer, random)
    first = deformer.anchors(one.objects[0].handles)
    point = deformer.points[first[0]]
    place = one.objects[0].pose.points[first[0]]
    two = hold(edits.add_handle(one, 0, point, place), 0, deformer, (1,))
    kept = two.objects[0].base.anchors
    assert set(kept) < set(first)
    near = deformer.graph.distances_from(int(first[0]))[kept] / deformer.diameter
    assert near.min() > hold_edits.RELEASED
    around = set_stays(two, 0, deformer, Stays.ELSE)
    moved = dragged(around, deformer, random).objects[0]
    still = moved.base.anchors
    assert len(still) > NODES / 3
    before = two.objects[0].pose.points[still]
    np.testing.assert_allclose(moved.pose.points[still], before, atol=MET)


def test_a_session_keeps_it_and_older_ones_have_none():
    random = np.random.default_rng(5)
    document, deformer = opened()
    document = added(dragged(added(document, deformer, random), deformer, random), deformer, random)
    data = encode_session(document)
    again = decode_session(data)
    assert encode_session(again) == data
    one, other = (
        solved(dragged(d, deformer, np.random.default_rng(6)), deformer) for d in (document, again)
    )
    assert np.array_equal(one.objects[0].pose.points, other.objects[0].pose.points)
    assert EditObject("new").base.is_usual


def test_the_ablations_move_the_object_from_rest():
    document, _ = opened()
    random = np.random.default_rng(7)
    for settings in (DeformSettings(mode="laplacian"), DeformSettings(is_faithful=True)):
        deformer = Deformer(document.objects[0].lifted, settings)
        item = dragged(added(document, deformer, random), deformer, random).objects[0]
        own: tuple[Handle, ...] = item.handles
        _, base = deformer.held(own, item.pose, deformer.anchors(own))
        from_base, from_rest = deformer.solve(own, base).pose, deformer.solve(own).pose
        assert np.abs(from_base.points - from_rest.points).max() < MET
