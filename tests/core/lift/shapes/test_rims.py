"""Plates and cups on saucers, whose outlines say how they lie."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from skimage import data

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.rotations import turn_matrix
from objectmorpher_core.compose import load
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.plate.plate import build_plate
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Placement, Prompt
from objectmorpher_core.lift import LiftSubject
from objectmorpher_core.lift.relief.fusion import fused
from objectmorpher_core.lift.relief.spreading import spread
from objectmorpher_core.lift.shapes import closed_ring, completed, laid, rims_of
from objectmorpher_core.lift.shapes.rims import Rim, at_edge
from objectmorpher_core.lift.shapes.solids import Mesh, RayGrid, drawn, ellipsoid, revolved, tube
from objectmorpher_core.pipeline import lift_mask, open_photo
from objectmorpher_core.segment.matting.matte import cut_out
from objectmorpher_research.training.shape_eval import score, surfaces_of
from tests.core.lift.shapes.test_recognition import AT, as_far, body_of, see
from tests.core.segment.truth_masks import truth_mask
from tests.shapes import png

UP = -turn_matrix(0, 45, 6)[:, 1]  # of a table, seen from above
DEGREE = np.cos(np.radians(1.0))
SEEN = 0.4  # x its lean, that a network sees of a thing


def _turned(profile: F64) -> Mesh:
    """A surface of revolution about UP; `profile` (n, 2): heights and radii."""
    return revolved(AT + profile[:, :1] * UP, profile[:, 1], UP, 96)


def _saucer() -> Mesh:
    return _turned(
        np.array([[-0.02, 1e-3], [-0.02, 0.2], [0.0, 0.34], [-0.02, 0.2], [-0.03, 1e-3]])
    )


def _cup() -> Mesh:
    return _turned(
        np.array([[-0.02, 1e-3], [-0.02, 0.1], [0.06, 0.15], [0.24, 0.17], [0.24, 1e-3]])
    )


def _both() -> Mesh:
    first, second = _saucer(), _cup()
    faces = np.concatenate([first.faces, second.faces + len(first.vertices)])
    return Mesh(np.concatenate([first.vertices, second.vertices]), faces)


def _laid(mesh: Mesh):
    """Rims, the body by them, and how much of its depth and which error are there without and with.

    The network sees less lean than there is.
    """
    seen, true = see(mesh)
    own = seen.mask
    at = np.column_stack([*np.nonzero(own), np.ones(own.sum())]).astype(np.float64)
    lean = at @ np.linalg.lstsq(at, seen.front[own].astype(np.float64))[0]
    front = seen.front.copy()
    front[own] -= (1 - SEEN) * (lean - lean.mean())
    seen = replace(seen, front=front)
    body, camera = body_of(seen)
    free = fused(body, seen, camera, 1.0, 1.0)
    rims = rims_of(seen, camera)
    pixels = np.where(own, 200, 40).astype(np.uint8)[..., None].repeat(3, 2)
    subject = LiftSubject(pixels, camera, own, cut_out(pixels, own))
    found = laid(free, rims, seen, subject, 1.0) if rims else free
    surfaces = [as_far(surfaces_of(each, own), true, own, camera) for each in (free, found)]
    depths = [np.ptp(each.front[own]) / np.ptp(true.front[own]) for each in surfaces]
    return rims, found, depths, [score(each, true, own).front for each in surfaces]


def test_a_plate_lies_as_its_rim_says() -> None:
    rims, found, (before, after), _ = _laid(_saucer())
    assert len(rims) == 1
    assert rims[0].normal @ UP > DEGREE
    assert found.up is not None and found.up @ UP > DEGREE
    assert before < 0.6
    assert abs(after - 1) < 0.05
    half = found.back.half(found.silhouette.cells.reshape(-1, 2)).reshape(found.silhouette.shape)
    deep = half[found.silhouette.inside].max()
    steps = np.hypot(*np.gradient(half, found.silhouette.cell))[found.silhouette.inside]
    assert deep > 0
    assert steps.max() < 12 * deep / found.silhouette.extent, "one arch, without waves or a wall"


def test_a_cup_stands_on_a_saucer_that_goes_on_behind_it() -> None:
    rims, found, _, (before, after) = _laid(_both())
    assert len(rims) == 2
    for rim, (height, radius) in zip(rims, ((0.0, 0.34), (0.24, 0.17)), strict=True):
        assert rim.normal @ UP > DEGREE
        wide = rim.radius / rim.centre[2] * (AT + height * UP)[2]
        assert abs(wide / radius - 1) < 0.05
    assert after < 0.5 * before
    assert found.behind is not None
    hidden = np.isfinite(found.behind.front)
    assert hidden.mean() > 0.03, "the cup hides a part of the saucer"
    outline, (_, camera) = found.silhouette, body_of(see(_both())[0])
    tangents = (outline.photo_xy(outline.cells) - [camera.cx, camera.cy]) / camera.focal
    first = (float(tangents[0, 0, 0]), float(tangents[0, 0, 1]))
    grid = RayGrid(first, outline.cell / camera.focal, outline.shape)
    alone = drawn(_saucer(), grid)
    both = hidden & (alone.near > 0)
    off = np.log(camera.focal - found.behind.front[both]) + np.log(alone.near[both])
    assert np.ptp(np.percentile(off, [2, 98])) < 0.06, "as far behind the cup as it is"
    assert (off - np.median(off)).std() < 0.02
    rows, columns = found.behind.beside[hidden][:, ::-1].T
    assert not hidden[rows, columns].any(), "its colours are from where it is seen"


def test_beside_a_cup_its_saucer_has_colours_of_its_own() -> None:
    _, found, _, _ = _laid(_both())
    outline, behind = found.silhouette, found.behind
    assert behind is not None
    surface, spacing = spread(found, 6000, 2.0, np.random.default_rng(0))
    dish = outline.inside & ~behind.stands
    away = cv2.distanceTransform((~behind.stands).astype(np.uint8), cv2.DIST_L2, 5) * outline.cell

    def cells(xy: F64) -> tuple[np.ndarray, ...]:
        at = np.rint(outline.grid_xy(xy)).astype(int)
        return tuple(np.clip(at, 0, np.array(outline.shape[::-1]) - 1).T[::-1])

    at = cells(surface.xy)
    beside = surface.is_front & dish[at] & (away[at] < spacing)
    assert beside.sum() > 50
    assert not surface.is_seen[beside].any(), "there the photo mixes it with the cup"
    assert dish[cells(surface.color_xy[beside])].all()
    clear = surface.is_front & dish[at] & (away[at] > 2 * spacing)
    assert surface.is_seen[clear].mean() > 0.9


@pytest.fixture(scope="module")
def cup_on_saucer():
    return see(_both())[0]


def _lips(seen, camera: Camera, aside: float, radius: float) -> tuple[Rim, Rim, Rim]:
    """A lip beside the saucer's axis: as it is, as first guessed, and as found by its edge."""
    across = np.cross(UP, [0.0, 0.0, 1.0])
    middle = AT + 0.24 * UP + aside * across / np.linalg.norm(across)
    true, lip = Rim(middle, UP, radius), Rim(AT + 0.24 * UP, UP, radius * 14 / 15)
    rows, columns = np.indices(seen.mask.shape) + 0.5
    tangents = np.stack([columns - camera.cx, rows - camera.cy], -1) / camera.focal
    grey = np.where(true.outside(tangents) < 0, 230, np.where(seen.mask, 120, 40))
    pixels = grey.astype(np.uint8)[..., None].repeat(3, 2)
    return true, lip, at_edge(Rim(AT, UP, 0.34), lip, pixels, seen.mask, camera)


def test_a_lip_is_where_the_photo_has_its_edge_also_off_the_saucers_middle(cup_on_saucer) -> None:
    seen = cup_on_saucer
    _, camera = body_of(seen)
    true, lip, found = _lips(seen, camera, 0.02, 0.15)
    rows, columns = np.indices(seen.mask.shape) + 0.5
    tangents = np.stack([columns - camera.cx, rows - camera.cy], -1) / camera.focal
    on_lip = tangents[np.abs(true.outside(tangents) * true.centre[2]) < 0.005 * true.radius]

    def off(rim: Rim) -> float:
        return float(np.abs(rim.outside(on_lip)).max() * rim.centre[2] / rim.radius)

    assert off(found) < min(0.08, 0.4 * off(lip))
    assert found.normal @ UP > np.cos(np.radians(6.0))


def test_lips_are_no_half_pixel_beside_their_edges(cup_on_saucer) -> None:
    _, camera = body_of(cup_on_saucer)
    shifts = []
    for aside in (-0.02, -0.01, 0.01, 0.02):
        for radius in (0.12, 0.15, 0.17):
            true, _, found = _lips(cup_on_saucer, camera, aside, radius)
            ends = [rim.centre[:2] / rim.centre[2] * camera.focal for rim in (found, true)]
            shifts.append(ends[0] - ends[1])
    assert np.abs(np.mean(shifts, 0)).max() < 0.3  # px


def test_what_stands_beside_a_cup_is_whole_where_both_have_moved() -> None:
    """On a photo: the cup's handle and the spoon reach over the line where cup and saucer meet."""
    photo, mask = open_photo(png(data.coffee()), "coffee.png"), truth_mask("coffee")
    document = edits.set_mask(edits.add_object(photo), 0, mask, Prompt())
    pixels, camera = photo.photo.pixels, photo.photo.camera
    document = edits.set_lifted(document, 0, *lift_mask(pixels, camera, mask, "relief"))
    document = edits.set_plate(document, build_plate(pixels, mask, load("telea")))
    moved = edits.set_placement(document, 0, Placement(move=(-8.0, -5.0)))
    shown, true = composite(moved).pixels.astype(np.float32), pixels.astype(np.float32)
    # It is not as far away everywhere: each place is looked for some px around where it came.
    shifts = [(5 + dy, 8 + dx) for dy in range(-3, 4) for dx in range(-5, 6)]
    off = np.min(
        [cv2.blur(np.abs(np.roll(shown, s, (0, 1)) - true).mean(-1), (5, 5)) for s in shifts], 0
    )
    inner = cv2.erode(mask.astype(np.uint8), np.ones((13, 13), np.uint8)) > 0
    assert (off[inner] > 18).mean() < 0.007


def test_an_egg_has_no_rim() -> None:
    axes = turn_matrix(0, 0, 20) * np.array([0.34, 0.2, 0.2])
    rims, _, _, _ = _laid(ellipsoid(AT, axes))
    assert rims == []


@pytest.mark.parametrize("lean", [25.0, 35.0, 42.0])
def test_a_ring_that_hides_its_hole_is_no_plate(lean: float) -> None:
    axis, sizes = -turn_matrix(25, lean, 6)[:, 1], np.array([0.22, 0.14, 0.14])
    seen, true = see(tube(AT, axis, sizes, 96))
    body, camera = body_of(seen)
    rims = rims_of(seen, camera)
    assert rims, "its outline is nearly a plate's"
    found = closed_ring(seen, rims[0])
    assert found is not None and found.mesh is not None
    assert abs(found.mesh.axes[0] @ axis) > np.cos(np.radians(6.0))
    whole = completed(fused(body, seen, camera, 1.0, 1.0), found, camera, 1.0, 1.0)
    error = score(as_far(surfaces_of(whole, seen.mask), true, seen.mask, camera), true, seen.mask)
    assert error.front < 0.05
    assert error.thickness < 0.12


def test_plates_and_cups_are_no_rings() -> None:
    for mesh in (_saucer(), _cup(), _both()):
        seen, _ = see(mesh)
        rims = rims_of(seen, body_of(seen)[1])
        assert all(closed_ring(seen, rim) is None for rim in [*rims, Rim(AT, UP, 0.34)])
