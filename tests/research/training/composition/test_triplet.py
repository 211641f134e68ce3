"""A pair becomes a triplet: lifted from B, found in A, drawn there; what is no good is rejected."""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.lift import LiftError, LiftSubject
from objectmorpher_core.lift.workers.file import FOLDER
from objectmorpher_research.training.composition import TrainingError, pose_sources
from objectmorpher_research.training.composition.made_pairs import turn_of, write_made_pairs
from objectmorpher_research.training.composition.pose_sources import Two, carried, matched
from objectmorpher_research.training.composition.sources import SourceReading, find_pairs
from objectmorpher_research.training.composition.triplet import (
    Rejected,
    TripletLimits,
    TripletPlan,
    how_from,
    make_triplet,
)
from tests import shapes
from tests.tree import over

pytestmark = pytest.mark.usefixtures("lifted_once")

HOW = TripletPlan(lifter="relief", inpainter="telea", gaussians=3000)
WORKER = """
import json, sys
folder = sys.argv[1]
json.dump({told}, open(folder + "/pose.json", "w"))
"""


def two_pictures(at, name="ellipse", move=0):
    """The same object twice, in A `move` px to the right and over another ground."""
    inside = shapes.mask(name)
    there = np.roll(inside, move, axis=1)
    b = shapes.picture(inside)
    a = np.where(there[..., None], np.roll(b, move, axis=1), np.uint8(90))
    at.mkdir(exist_ok=True)
    for letter, pixels, mask in (("b", b, inside), ("a", a, there)):
        (at / f"thing-{letter}.png").write_bytes(shapes.png(pixels))
        (at / f"thing-{letter}.mask.png").write_bytes(shapes.mask_png(mask))
    return find_pairs(at, SourceReading(both_ways=False))[0]


def worker(tmp_path, monkeypatch, told) -> str:
    """A source of poses that tells always the same."""
    folder = tmp_path / "workers"
    folder.mkdir(exist_ok=True)
    (folder / "run.py").write_text(WORKER.format(told=repr(told)))
    command = json.dumps([sys.executable, "{here}/run.py"])
    (folder / "known.toml").write_text(f'name = "known"\ncommand = {command}\n')
    monkeypatch.setenv(FOLDER, str(folder))
    return "known"


def same(depth=1.0):
    return {"version": 1, "a_from_b": np.eye(4).tolist(), "depth_b": depth}


@pytest.mark.slow
def test_what_did_not_move_is_drawn_where_it_was(tmp_path, monkeypatch):
    pair = two_pictures(tmp_path / "pair")
    poses = worker(tmp_path, monkeypatch, same())
    made = make_triplet(pair, replace(HOW, poses=poses))
    assert made.facts["iou"] > 0.97 and made.facts["turn"] < 2 and made.facts["seen"] > 0.9
    inside = made.alpha > 250
    error = np.abs(made.coarse.astype(int) - made.b)[inside].mean()
    assert error < 4
    outside = made.alpha == 0
    away = np.abs(made.coarse.astype(int) - made.a)[outside]
    assert away.mean() < 3  # the plate: A without its object, flat here
    again = make_triplet(pair, replace(HOW, poses=poses))
    assert np.array_equal(again.coarse, made.coarse)
    json.dumps(made.facts)


def test_what_a_source_knows_is_in_its_own_units(tmp_path, monkeypatch):
    pair = two_pictures(tmp_path / "pair", move=12)
    camera = Camera.from_fov(160, 120)
    told = same(depth=5.0)
    told["a_from_b"][0][3] = 12 / camera.focal * 5.0  # 12 px at that depth
    made = make_triplet(pair, replace(HOW, poses=worker(tmp_path, monkeypatch, told)))
    assert made.facts["iou"] > 0.96
    rows, columns = np.nonzero(made.alpha > 128)
    meant = np.nonzero(np.roll(shapes.mask("ellipse"), 12, axis=1))
    assert abs(columns.mean() - meant[1].mean()) < 1 and abs(rows.mean() - meant[0].mean()) < 1


@over("told", [
    {"version": 2}, {"version": 1, "a_from_b": [[1]], "depth_b": 1}, same(depth=-1.0),
    {"version": 1, "a_from_b": np.diag([1, 1, -1, 1]).tolist(), "depth_b": 1.0},
])  # fmt: skip
def test_a_pose_that_is_none_rejects_the_pair(tmp_path, monkeypatch, told):
    pair = two_pictures(tmp_path / "pair")
    with pytest.raises(Rejected, match="the pose of the worker known is of no use"):
        make_triplet(pair, replace(HOW, poses=worker(tmp_path, monkeypatch, told)))


def test_what_is_no_good_is_rejected_with_a_reason(tmp_path, monkeypatch):
    pair = two_pictures(tmp_path / "pair")
    how = replace(HOW, poses=worker(tmp_path, monkeypatch, same()))
    with pytest.raises(Rejected, match="its makers"):
        make_triplet(replace(pair, problem="its makers do not like it"), how)
    for limits, words in (
        (TripletLimits(least_area=0.5), "covers .* of picture B"),
        (TripletLimits(least_iou=1.01), "the outlines agree by"),
        (TripletLimits(least_seen=1.01), "B shows only"),
        (TripletLimits(most_colour_error=-1.0), "colours are off"),
    ):
        with pytest.raises(Rejected, match=words) as raised:
            make_triplet(pair, replace(how, limits=limits))
        assert "area" in raised.value.facts and raised.value.facts["seconds"] > 0
    with pytest.raises(Rejected, match="cannot be read"):
        make_triplet(replace(pair, mask_a=str(tmp_path / "none.png")), how)
    assert how_from(json.loads(json.dumps({**vars(how), "limits": vars(how.limits)}))) == how


def test_another_thing_is_rejected(tmp_path, monkeypatch):
    one, other = two_pictures(tmp_path / "one"), two_pictures(tmp_path / "other", "thin")
    mixed = replace(one, a=other.a, mask_a=other.mask_a)
    how = replace(HOW, poses=worker(tmp_path, monkeypatch, same()))
    with pytest.raises(Rejected, match=r"the outlines agree by \d+%, not 75%"):
        make_triplet(mixed, how)


def test_the_start_of_the_search_keeps_the_object_as_it_is_seen():
    scene = shapes.scene("ellipse")
    there = np.roll(scene.mask, 20, axis=1)
    b, a = (LiftSubject(scene.pixels, scene.camera, m, scene.matte) for m in (scene.mask, there))
    motion = carried(Two(b, a, scene.lifted))
    linear = motion[:3, :3]
    assert np.allclose(linear @ linear.T, np.eye(3)) and np.linalg.det(linear) > 0
    centre = motion[:3, :3] @ scene.lifted.centre + motion[:3, 3]
    moved = scene.camera.project(centre) - scene.camera.project(scene.lifted.centre)
    assert abs(moved[0] - 20) < 3 and abs(moved[1]) < 3


def test_details_that_both_pictures_show_are_points_of_the_object():
    scene = shapes.scene("ellipse")
    rng = np.random.default_rng(0)
    spots = cv2.GaussianBlur(rng.random((*scene.mask.shape, 3)), (0, 0), 1.5)
    spotted = np.rint(255 * (0.5 + 3 * (spots - 0.5)).clip(0, 1)).astype(np.uint8)
    darker = np.rint(0.6 * np.roll(spotted, 20, axis=1)).astype(np.uint8)
    b = LiftSubject(spotted, scene.camera, scene.mask, scene.matte)
    a = LiftSubject(darker, scene.camera, np.roll(scene.mask, 20, axis=1), scene.matte)
    two = Two(b, a, scene.lifted)
    depth = np.full(scene.mask.shape, np.float32(scene.lifted.centre[2]))
    depth[: len(depth) // 2] = np.inf  # where nothing was lifted
    matches = matched(two, depth)
    assert len(matches) >= 8
    at = scene.camera.project(scene.lifted.world_points(matches.points))
    gaps = np.linalg.norm(at + [20, 0] - matches.seen, axis=1)
    assert np.median(gaps) < 0.5
    assert (at[:, 1] >= len(depth) // 2).all()


def test_unknown_sources_and_those_that_cannot_run_are_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER, str(tmp_path))
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path))
    with pytest.raises(TrainingError, match="there is no source of poses 'mine'"):
        pose_sources.load("mine")
    with pytest.raises(TrainingError, match=r"cupid|torch"):
        pose_sources.load("cupid")
    with pytest.raises((TrainingError, LiftError), match="there is no lifter"):
        replace(HOW, lifter="nobody").check()


@pytest.mark.slow
def test_a_made_up_object_is_found_again_from_another_side(tmp_path):
    write_made_pairs(tmp_path, 2, 160)
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    write_made_pairs(tmp_path, 2, 160)
    assert before == {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    pair = find_pairs(tmp_path)[2]
    made = make_triplet(pair, HOW)
    assert made.facts["iou"] > 0.85 and made.facts["seen"] > 0.6
    assert 3 < made.facts["turn"] < 80
    assert made.coarse.shape == made.a.shape == (160, 160, 3)


@pytest.mark.slow
def test_a_jar_is_turned_by_what_is_on_it(tmp_path):
    write_made_pairs(tmp_path, 3, 320)
    pair = find_pairs(tmp_path)[4]
    assert pair.name.startswith("made-0-00002")
    made = make_triplet(pair, HOW)  # its outline is the same from all sides
    assert abs(made.facts["turn"] - turn_of(2)) < 8
