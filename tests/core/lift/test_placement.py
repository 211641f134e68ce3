"""Registration: where an object from elsewhere stands in the photo."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.progress import Cancelled
from objectmorpher_core.base.rotations import (
    matrices_from_quats,
    matrix_from_vector,
    quats_from_matrices,
)
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.registration.placement import (
    NOISE,
    Hints,
    Registrar,
    Registration,
    register,
)
from objectmorpher_core.lift.registration.search import angles, spread_rotations
from objectmorpher_core.lift.registration.sketch import (
    COLOR,
    COVERAGE,
    even_surfels,
    own_frame,
    sketch,
)
from objectmorpher_core.lift.registration.view import Stance, Target, towards
from tests import shapes
from tests.core.lift import registered

TURN = 1.5  # degrees: half a pixel at the rim of an object of a hundred px is one degree
PIXELS = 1.0  # px, of the centre's picture
SIZE = 0.02  # relative, of the object's size in the picture
SAME = 1e-9


def _turned(gaussians: Gaussians, matrix: np.ndarray) -> Gaussians:
    """The same object in another frame: `matrix` (4, 4), a similarity."""
    scale = float(np.cbrt(np.linalg.det(matrix[:3, :3])))
    turn = matrix[:3, :3] / scale
    axes = turn @ matrices_from_quats(gaussians.quats.astype(np.float64))
    means = gaussians.means @ matrix[:3, :3].T + matrix[:3, 3]
    return replace(
        gaussians, means=means.astype(np.float32), scales=gaussians.scales * np.float32(scale),
        quats=quats_from_matrices(axes).astype(np.float32),
    )  # fmt: skip


slow = pytest.mark.slow


@cache
def _found() -> Registration:
    return register(*_known())


def _known() -> tuple[Gaussians, Target]:
    gaussians, scene = registered.known_bracket()
    return gaussians, scene.target


def test_the_pose_of_a_known_object_is_found():
    scene, found = registered.known_bracket()[1], _found()
    best = found.best
    assert registered.turn_error(best.world_from_object, scene.world_from_object) < TURN
    centres = [scene.camera.project(m.world_from_object[:3, 3]) for m in (best, scene)]
    assert np.abs(centres[0] - centres[1]).max() < PIXELS
    size = np.cbrt(np.linalg.det(best.world_from_object[:3, :3])) / best.world_from_object[2, 3]
    assert size * scene.world_from_object[2, 3] == pytest.approx(1, abs=SIZE)
    assert best.iou > 0.95 and best.colour_error < 0.06
    assert best.score == pytest.approx(best.iou - best.colour_error)
    assert not found.is_ambiguous and found.reason == ""


@slow
def test_unknown_focal_lengths_and_poses_are_found_within_three_degrees():
    errors, overlaps = [], []
    for seed in range(6):
        body = registered.bracket() if seed % 2 else registered.ball(is_patterned=True)
        fov = 25.0 + 8.0 * seed
        camera = Camera.from_fov(registered.WIDTH, registered.HEIGHT, fov)
        matrix = registered.pose(seed)
        matrix[:3, 3] = camera.unproject(np.array([110.0, 95.0]), camera.focal / 120.0)
        scene = registered.photo(body, matrix, camera)
        told = Target(scene.pixels, scene.mask, Camera.from_fov(camera.width, camera.height))
        found = register(registered.gaussians(body), told, Hints(is_focal_free=True))
        errors.append(registered.turn_error(found.best.world_from_object, matrix))
        overlaps.append(found.best.iou)
    assert np.median(errors) <= 3.0 and max(errors) < 8.0
    assert np.median(overlaps) >= 0.97


@slow
def test_a_focal_length_that_is_only_a_guess_is_corrected():
    wide = Camera.from_fov(registered.WIDTH, registered.HEIGHT, 75)
    matrix = registered.pose(3)
    matrix[:3, 3] = [0.05, 0.0, 1.35]
    scene = registered.photo(registered.bracket(), matrix, wide)
    told = Camera.from_fov(registered.WIDTH, registered.HEIGHT, 45)
    target = Target(scene.pixels, scene.mask, told)
    gaussians = registered.known_bracket()[0]
    free = register(gaussians, target, Hints(is_focal_free=True)).best
    held = Registrar(gaussians, target).improved(replace(free, camera=told))
    assert abs(np.log(free.camera.focal / wide.focal)) < 0.5 * np.log(told.focal / wide.focal)
    assert registered.turn_error(free.world_from_object, matrix) < 3.0
    assert free.score > held.score


@slow
def test_neither_the_frame_nor_the_scale_of_the_file_matters():
    gaussians, scene = registered.known_bracket()
    matrix = 7.0 * np.eye(4)
    matrix[:3, :3] = 7.0 * shapes.rotation(8)
    matrix[:3, 3], matrix[3, 3] = [30.0, -4.0, 11.0], 1.0
    best = register(_turned(gaussians, matrix), scene.target).best
    found = best.world_from_object @ matrix
    assert registered.turn_error(found, scene.world_from_object) < TURN
    assert np.cbrt(np.linalg.det(found[:3, :3])) / found[2, 3] == pytest.approx(
        1 / scene.world_from_object[2, 3], rel=SIZE
    )


@slow
def test_a_photo_of_twice_the_size_gives_the_same_pose():
    gaussians, scene = registered.known_bracket()
    large = Target(
        scene.pixels.repeat(2, 0).repeat(2, 1), scene.mask.repeat(2, 0).repeat(2, 1),
        scene.camera.windowed(0, 0, 2 * registered.WIDTH, 2 * registered.HEIGHT, 2.0),
    )  # fmt: skip
    first, second = _found().best, register(gaussians, large).best
    assert registered.turn_error(first.world_from_object, second.world_from_object) < 0.5
    assert first.score == pytest.approx(second.score, abs=NOISE)


@slow
def test_what_is_shifted_in_the_photo_is_shifted_in_the_world():
    gaussians, scene = registered.known_bracket()
    shift = 17  # px
    camera = replace(scene.camera, cx=scene.camera.cx + shift)  # the same rays, the frame moved
    target = Target(np.roll(scene.pixels, shift, 1), np.roll(scene.mask, shift, 1), camera)
    first, second = _found().best, register(gaussians, target).best
    assert np.abs(first.world_from_object - second.world_from_object).max() < 0.01


@pytest.mark.slow
def test_two_runs_give_the_same_pose():
    first, second = _found(), register(*_known())
    assert len(first.proposals) == len(second.proposals)
    for a, b in zip(first.proposals, second.proposals, strict=True):
        assert np.array_equal(a.world_from_object, b.world_from_object) and a.score == b.score


def test_up_to_three_poses_are_proposed_best_first_and_all_differ():
    proposals = _found().proposals
    assert 2 <= len(proposals) <= 3
    scores = [p.score for p in proposals]
    assert scores == sorted(scores, reverse=True)
    for k, first in enumerate(proposals):
        for second in proposals[k + 1 :]:
            error = registered.turn_error(first.world_from_object, second.world_from_object)
            assert error > 9.0


@pytest.mark.parametrize("body", [registered.cylinder, pytest.param(registered.ball, marks=slow)])
def test_a_symmetric_object_is_called_ambiguous(body):
    scene = registered.photo(body(), registered.pose(6))
    found = register(registered.gaussians(body()), scene.target)
    assert found.is_ambiguous
    assert "looks the same" in found.reason
    assert found.best.iou > 0.95


@slow
def test_a_patterned_ball_is_not_ambiguous():
    body = registered.ball(is_patterned=True)
    scene = registered.photo(body, registered.pose(6))
    found = register(registered.gaussians(body), scene.target)
    assert not found.is_ambiguous
    assert registered.turn_error(found.best.world_from_object, scene.world_from_object) < TURN


@slow
def test_of_poses_that_look_the_same_the_upright_one_comes_first():
    matrix = registered.pose(0)
    matrix[:3, :3] = matrix_from_vector(np.array([0.5, 0.0, 0.2]))  # nearly upright; y is down
    scene = registered.photo(registered.cylinder(), matrix)
    gaussians = registered.gaussians(registered.cylinder())
    for up in (-1.0, 1.0):
        best = register(gaussians, scene.target, Hints(up=(0.0, up, 0.0))).best
        assert up * best.world_from_object[1, 1] < 0, "its up is the picture's"


def test_improving_never_lowers_the_score():
    gaussians, scene = registered.known_bracket()
    registrar = Registrar(gaussians, scene.target)
    rng = np.random.default_rng(0)
    for size in (0.02, 0.1, 0.4, 1.5):
        start = scene.world_from_object.copy()
        start[:3, :3] = matrix_from_vector(rng.normal(size=3) * size) @ start[:3, :3]
        start[:2, 3] += rng.normal(size=2) * 0.1 * size
        before = registrar.rated(start)
        after = registrar.improved(before)
        assert after.score >= before.score
        assert after.score == pytest.approx(
            registrar.rated(after.world_from_object).score, abs=1e-6
        )


@slow
def test_a_good_pose_that_is_given_is_never_replaced_by_a_worse_one():
    gaussians, scene = registered.known_bracket()
    registrar = Registrar(gaussians, scene.target)
    given = registrar.rated(scene.world_from_object)
    found = registrar.propose(Hints(start=scene.world_from_object))
    assert found.best.score >= given.score


@slow
def test_a_hidden_part_beyond_the_photo_does_not_hinder():
    camera = replace(registered.CAMERA, width=150)  # cut off at the right
    scene = registered.photo(registered.bracket(), registered.pose(3, x=20), camera)
    assert scene.mask[:, -1].any()
    best = register(registered.known_bracket()[0], scene.target).best
    assert registered.turn_error(best.world_from_object, scene.world_from_object) < 4.0


@pytest.mark.parametrize(
    ("mask", "sentence"),
    [
        (np.zeros((40, 60), bool), "the mask has 0 pixels"),
        (np.ones((3, 4), bool), "mask is"),
    ],
)
def test_a_mask_that_tells_no_pose_is_refused_in_one_sentence(mask, sentence):
    with pytest.raises(LiftError, match=sentence):
        Target(np.zeros((40, 60, 3), np.uint8), mask, Camera.from_fov(60, 40))


def test_an_object_without_extent_is_refused_in_one_sentence():
    scene = registered.known_bracket()[1]
    points = shapes.gaussians_at(np.zeros((50, 3)))
    with pytest.raises(LiftError, match="single point"):
        register(points, scene.target)
    with pytest.raises(LiftError, match="too few"):
        register(shapes.gaussians_at(np.array([[0.0, 0, 0], [1, 0, 0]])), scene.target)


@pytest.mark.parametrize("calls", [1, 4, 20])
def test_it_stops_when_it_is_told_to(calls):
    gaussians, scene = registered.known_bracket()
    told = []

    def stop(fraction: float, note: str) -> None:
        told.append(fraction)
        if len(told) == calls:
            raise Cancelled

    with pytest.raises(Cancelled):
        register(gaussians, scene.target, progress=stop)
    assert len(told) == calls and told == sorted(told)


# ---- the parts --------------------------------------------------------------------------------


def test_rotations_are_spread_evenly():
    turns = spread_rotations(3600)
    assert np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max() < SAME
    farthest = max(
        float(angles(turn, turns).min()) for turn in shapes.rotations(300, seed=1)
    )  # fmt: skip
    assert np.degrees(farthest) < 15.0, "no rotation is farther than that from one that is tried"


def test_the_turn_towards_a_ray_takes_the_axis_there():
    for ray in ([0.4, -0.3, 1.0], [0.0, 0.0, 1.0], [-2.0, 1.0, 1.0]):
        turn = towards(np.array(ray))
        assert np.abs(turn @ turn.T - np.eye(3)).max() < SAME
        assert np.abs(turn[:, 2] - np.array(ray) / np.linalg.norm(ray)).max() < SAME


def test_a_stance_is_a_pose_in_other_words():
    matrix = registered.pose(7, x=30, y=20)
    matrix[:3, :3] *= 2.5
    back = Stance.of(matrix, registered.CAMERA).matrix(registered.CAMERA)
    ratio = back[2, 3] / matrix[2, 3]  # its own size is 1
    assert ratio == pytest.approx(1 / 2.5)
    assert np.abs(back[:3] - matrix[:3] * ratio).max() < SAME


@pytest.mark.parametrize("count", [800, 8000])
def test_a_sketch_has_the_silhouette_and_the_colours_of_the_object(count):
    gaussians, scene = registered.known_bracket()
    frame = own_frame(gaussians)
    surfels = even_surfels(gaussians, frame, (count,))[0]
    assert 0.7 * count < len(surfels) < 1.4 * count
    drawn = sketch(surfels, scene.world_from_object @ np.linalg.inv(frame), scene.camera)
    inside = drawn[..., COVERAGE] > 0.5
    iou = (inside & scene.mask).sum() / (inside | scene.mask).sum()
    assert iou > (0.97 if count == 8000 else 0.93)
    both = inside & scene.mask
    seen = scene.pixels[both] / 255 / np.array([0.9, 0.85, 0.75])
    error = np.abs(drawn[both][:, COLOR : COLOR + 3] - seen).mean()
    assert error < (0.05 if count == 8000 else 0.10)


def test_the_nearer_of_two_surfaces_is_seen():
    points = shapes.sheet(40, 30)
    near, far = points + [0, 0, -0.3], points + [0, 0, 0.3]
    both = np.concatenate([near, far])
    colors = np.repeat([[1.0, 0, 0], [0, 0, 1.0]], len(points), 0)
    gaussians = replace(shapes.gaussians_at(both, 0.02), colors=colors.astype(np.float32))
    surfels = even_surfels(gaussians, np.eye(4), (3000,))[0]
    pose = np.eye(4)
    pose[2, 3] = 2.5
    drawn = sketch(surfels, pose, registered.CAMERA)
    middle = drawn[registered.HEIGHT // 2, registered.WIDTH // 2]
    assert middle[COVERAGE] > 0.95
    assert middle[COLOR] > 0.98 and middle[COLOR + 2] < 0.02
