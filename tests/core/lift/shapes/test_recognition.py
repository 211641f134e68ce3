"""Explicit shapes, found in what is seen of them, where the truth about them is known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from scipy.spatial import ConvexHull, KDTree
from skimage.data import coffee

from objectmorpher_core.base.arrays import Mask, Pixels
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.rotations import turn_matrix
from objectmorpher_core.document.model import LiftSettings
from objectmorpher_core.lift.crop import SIDE, Crop, rays
from objectmorpher_core.lift.relief.body import ReliefBody
from objectmorpher_core.lift.relief.fusion import fused
from objectmorpher_core.lift.relief.lifter import _world_normals
from objectmorpher_core.lift.relief.plain_solid import IN_LINE, INSET, PlainSolid
from objectmorpher_core.lift.relief.shape_look import SeenShape
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.lift.relief.spreading import spread
from objectmorpher_core.lift.shapes import (
    completed,
    flattened,
    looks_drawn,
    recognised,
    rounded,
)
from objectmorpher_core.lift.shapes.solids import (
    Mesh,
    RayGrid,
    box,
    drawn,
    ellipsoid,
    face_normals,
    revolved,
    sheet,
    tube,
)
from objectmorpher_core.segment.matting.matte import cut_out
from objectmorpher_research.training.shape_eval import Surfaces, camera_of, score, surfaces_of
from tests.tree import quick

WIDTH = 0.8  # tangents, of the crop
TANGENTS = np.array([0.05, 0.1, WIDTH], np.float32)
AT = np.array([0.06, 0.12, 1.2])
UNSURE = 0.03  # crop units: as the network is


def _box() -> Mesh:
    return box(AT, turn_matrix(35, -20, 5).T, np.array([0.22, 0.3, 0.15]))


def _ball() -> Mesh:
    return ellipsoid(AT, 0.33 * np.eye(3))


def _can() -> Mesh:
    axis = turn_matrix(0, -25, 8)[:, 1]
    steps = np.linspace(-0.3, 0.3, 12)
    return revolved(AT + steps[:, None] * axis, np.full(12, 0.2), axis)


def _leaf() -> Mesh:
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    outline = np.column_stack([0.16 * np.cos(turn) + 0.05, 0.3 * np.sin(turn) + 0.1, 1 + 0 * turn])
    return sheet(outline, outline @ np.array([0.25, -0.2, 0.8]), 0.01)


def _vase() -> Mesh:
    axis = turn_matrix(0, -30, -12)[:, 1]
    steps = np.linspace(-0.32, 0.32, 20)
    return revolved(AT + steps[:, None] * axis, 0.15 + 0.07 * np.sin(9 * steps), axis)


def _lamp() -> Mesh:
    """Its shade ends in a step, which few places on the axis would even out."""
    axis = turn_matrix(0, -15, 4)[:, 1]
    steps = np.array([-0.34, -0.06, -0.06, 0.32])
    radii = np.array([0.11, 0.2, 0.06, 0.14])
    return revolved(AT + steps[:, None] * axis, radii, axis)


def _goblet() -> Mesh:
    """Its foot on a thin stem is no handle."""
    axis = turn_matrix(0, -20, 0)[:, 1]
    steps = np.array([-0.34, -0.2, -0.1, -0.06, 0.2, 0.26, 0.28])
    radii = np.array([0.17, 0.18, 0.1, 0.025, 0.025, 0.14, 0.14])
    return revolved(AT + steps[:, None] * axis, radii, axis)


def _doughnut() -> Mesh:
    return tube(AT, turn_matrix(20, -50, 0)[:, 1], np.array([0.22, 0.1, 0.08]), 96)


MADE = {
    "box": _box, "ball": _ball, "can": _can, "leaf": _leaf, "vase": _vase, "doughnut": _doughnut,
    "lamp": _lamp, "goblet": _goblet,
}  # fmt: skip
FIVE_DEGREES = np.cos(np.radians(5.0))
KINDS = {"box": "box", "leaf": "flat"}  # the others are round


@cache
def seen_of(name: str) -> tuple[SeenShape, Surfaces]:
    seen, true = see(MADE[name]())
    return replace(seen, flatness=4.0 if KINDS.get(name) == "flat" else -4.0), true


def see(mesh: Mesh) -> tuple[SeenShape, Surfaces]:
    """What a network that is right would see of a mesh, and its surfaces in px of the crop."""
    crop = Crop(0, 0, SIDE, TANGENTS)
    first = TANGENTS[:2] + (0.5 / SIDE - 0.5) * WIDTH
    found = drawn(mesh, RayGrid((float(first[0]), float(first[1])), WIDTH / SIDE, (SIDE, SIDE)))
    mask, ways = found.near > 0, rays(TANGENTS)
    near, far = (1 / np.where(mask, side, 1.0) / ways[..., 2] for side in (found.near, found.far))
    unit = crop.away / near[mask].mean()  # crop units to a unit of the mesh
    normals = face_normals(mesh)[found.face]
    normals *= -np.sign((normals * ways).sum(-1, keepdims=True))
    fields = [np.where(mask, field * unit, 0.0).astype(np.float32) for field in (near, far - near)]
    front = np.where(mask, crop.away - fields[0], 0.0).astype(np.float32)
    even = np.full(mask.shape, UNSURE, np.float32)
    own = (fields[1], fields[1], normals.astype(np.float32), 0 * even, even, even)
    forward = SIDE * ways[..., 2]
    true = Surfaces(-forward * fields[0], forward * fields[1])
    return SeenShape(crop, mask, front, *own), true


def body_of(seen: SeenShape) -> tuple[ReliefBody, Camera]:
    camera = camera_of(TANGENTS, SIDE)
    return ReliefBody.of(ReliefSilhouette.of(seen.mask), camera, LiftSettings()), camera


def as_far(found: Surfaces, true: Surfaces, mask: Mask, camera: Camera) -> Surfaces:
    """`found` enlarged about the camera until it is as far away: nobody knows how far that is."""
    front = found.front - camera.focal
    scale = float(true.front[mask].mean() / front[mask].mean())
    return Surfaces(scale * front, scale * found.thickness)


@pytest.mark.parametrize("name", quick(MADE, 4))
def test_a_shape_is_recognised_and_completed(name: str) -> None:
    """Its far side, too, which neither silhouette nor network knows."""
    seen, true = seen_of(name)
    found = recognised(seen)
    assert found is not None
    assert found.kind == KINDS.get(name, "round")
    assert found.weight > 0.7
    body, camera = body_of(seen)
    whole = completed(fused(body, seen, camera, 1.0, 1.0), found, camera, 1.0, 1.0)
    assert whole.kind == KINDS.get(name, "round")
    if name in ("ball", "leaf"):
        assert found.up is None
    else:
        assert whole.up is not None and whole.up[1] < 0, "up"
        assert np.abs(MADE[name]().axes @ whole.up).max() > FIVE_DEGREES
    before, after = (
        score(as_far(surfaces_of(each, seen.mask), true, seen.mask, camera), true, seen.mask)
        for each in (body, whole)
    )
    if name != "leaf":  # which is thinner than any error is to be measured in
        assert after.front < max(0.5 * before.front, 0.05)
        assert after.thickness < max(0.5 * before.thickness, 0.05)
    else:
        thick = surfaces_of(whole, seen.mask).thickness[seen.mask]
        assert thick.max() < 0.04 * body.silhouette.extent
        assert thick.max() < 1.05 * thick.min(), "it has an edge"


def test_a_shape_rights_what_a_network_sees_lean() -> None:
    """Of the far side of a can, and of its near one, a tenth of its size to a side is wrong."""
    seen, true = seen_of("can")
    across = np.broadcast_to(np.linspace(-0.2, 0.2, SIDE, dtype=np.float32), seen.mask.shape)
    leaning = replace(seen, front=seen.front + across, front_error=0 * across + 0.1)
    found = recognised(leaning)
    assert found is not None
    assert found.kind == "round"
    body, camera = body_of(leaning)
    free = fused(body, leaning, camera, 1.0, 1.0)
    whole = completed(free, found, camera, 1.0, 1.0)
    before, after = (
        score(surfaces_of(each, seen.mask), true, seen.mask).front for each in (free, whole)
    )
    assert after < 0.5 * before


def test_a_lid_seen_nearly_edge_on_reaches_its_far_rim() -> None:
    """The network sees its near rim only; across it that is hardly wrong, along the rays it is."""
    axis = turn_matrix(0, 12, 0)[:, 1]
    steps = np.linspace(-0.25, 0.25, 12)
    seen, true = see(revolved(AT + steps[:, None] * axis, np.full(12, 0.28), axis))
    lid = seen.mask & (np.abs(seen.normal @ axis) > 0.9)
    rim = float(np.quantile(seen.front[lid], 0.9))
    blurred = replace(seen, front=np.where(lid, np.maximum(seen.front, rim), seen.front))
    found = recognised(blurred, "round")
    assert found is not None
    body, camera = body_of(blurred)
    whole = completed(fused(body, blurred, camera, 1.0, 1.0), found, camera, 1.0, 1.0)
    own = as_far(surfaces_of(whole, seen.mask), true, seen.mask & ~lid, camera)
    deep = float(np.ptp(true.front[lid]))
    assert np.abs(own.front - true.front)[lid].mean() < 0.15 * deep


def test_a_box_that_is_said_of_what_is_none_lies_about_it() -> None:
    """Of a vase the outline is that of boxes many times as deep as it is."""
    seen, true = seen_of("lamp")
    found = recognised(seen, "box")
    assert found is not None
    assert found.likeness < 0.3
    own = recognised(seen, "round")
    assert own is not None
    assert own.likeness > 0.7
    body, camera = body_of(seen)
    whole = completed(fused(body, seen, camera, 1.0, 1.0), found, camera, 1.0, 1.0)
    assert whole.solid is None
    assert whole.likeness == found.likeness
    thick = surfaces_of(whole, seen.mask).thickness[seen.mask]
    assert thick.max() < 2 * true.thickness[seen.mask].max()


def test_the_artist_says_what_it_is() -> None:
    seen, _ = seen_of("ball")
    for kind in ("flat", "box", "round"):
        found = recognised(seen, kind)
        assert found is not None
        assert (found.kind, found.weight) == (kind, 1.0)
    assert recognised(seen, "free") is None


@pytest.mark.parametrize("seed", quick(range(8), 3))
def test_a_drawing_is_a_sheet_and_nothing_that_light_falls_on(seed: int) -> None:
    rng = np.random.default_rng(seed)
    side, mask = 300, np.zeros((300, 300), np.uint8)
    bodies = [(*rng.integers(110, 190, 2), *rng.integers(40, 100, 2)) for _ in range(4)]
    paint, ink = np.full((side, side, 3), 255, np.uint8), rng.integers(0, 60, 3)
    for tones, grown in ((ink, 6), (None, 0)):  # the contour lies around them all
        for x, y, across, down in bodies:
            axes = int(across + grown), int(down + grown)
            tone = rng.integers(60, 230, 3) if tones is None else tones
            cv2.ellipse(paint, (int(x), int(y)), axes, 0, 0, 360, [int(c) for c in tone], -1)
            cv2.ellipse(mask, (int(x), int(y)), axes, 0, 0, 360, 1, -1)
    up, left = np.mgrid[-1 : 1 : side * 1j, -1 : 1 : side * 1j]
    light = np.clip(1 - 0.3 * up - 0.3 * left - 0.3 * (up**2 + left**2), 0, 1)[..., None]

    def is_drawn(picture: Pixels) -> bool:
        saved = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 92])[1]
        return looks_drawn(cut_out(cv2.imdecode(saved, cv2.IMREAD_COLOR), mask > 0))

    assert is_drawn(paint)
    assert not is_drawn((light * paint).astype(np.uint8)), "the same in light"
    assert not is_drawn((0.1 * paint * light).astype(np.uint8)), "nor almost in the dark"
    photo = coffee()[:side, 100 : 100 + side]
    assert not is_drawn(np.ascontiguousarray(photo))
    assert not is_drawn(np.full_like(paint, 254)), "what is overexposed may be anything"


def test_a_drawn_ball_is_flat_and_a_box_of_three_colours_still_a_box() -> None:
    ball, _ = seen_of("ball")
    found = recognised(ball, is_drawing=True)
    assert found is not None and found.kind == "flat"
    thin, thick = (
        surfaces_of(completed(body, shape, camera, 1.0, 1.0), ball.mask).thickness[ball.mask].max()
        for body, camera in [body_of(ball)]
        for shape in (found, recognised(ball, "flat"))
        if shape is not None
    )
    assert thin < 0.5 * thick, "paper is thinner than a board"
    solid, _ = seen_of("box")
    found = recognised(solid, is_drawing=True)
    assert found is not None and found.kind == "box"


def test_without_trust_or_a_network_a_sheet_and_a_tube_are_still_made() -> None:
    seen, _ = seen_of("can")
    body, camera = body_of(seen)
    found = recognised(seen)
    assert found is not None
    untouched = completed(body, found, camera, 1.0, 0.0)
    places = body.silhouette.photo_xy(np.argwhere(body.silhouette.inside)[:, ::-1].astype(float))
    for side in (1.0, -1.0):
        np.testing.assert_allclose(
            untouched.height(places, side), body.height(places, side), atol=1e-6
        )
    extent = body.silhouette.extent
    thin, tube = (
        surfaces_of(make(body, 1.0), seen.mask).thickness[seen.mask]
        for make in (flattened, rounded)
    )
    assert thin.max() < 0.04 * extent
    width = np.ptp(np.flatnonzero(seen.mask.any(0)))
    assert 0.85 * width < tube.max() < 1.15 * width, "as deep as it is wide"


def test_what_sticks_out_stays_as_it_was() -> None:
    """A handle is no part of the ball, which goes on behind it."""
    seen, _ = seen_of("ball")
    mask = seen.mask.copy()
    rows, columns = np.nonzero(mask)
    middle, right = int(rows.mean()), int(columns.max())
    mask[middle - 6 : middle + 6, right - 2 : min(right + 40, SIDE - 4)] = True
    stretched = {
        name: np.where(mask & ~seen.mask, value[middle, right - 3], value)
        for name, value in (("front", seen.front), ("depth", seen.depth))
    }
    other = replace(seen, mask=mask, thickness=stretched["depth"], **stretched)
    found = recognised(other, "round")
    assert found is not None
    body, camera = body_of(other)
    body = fused(body, other, camera, 1.0, 1.0)
    whole = completed(body, found, camera, 1.0, 1.0)
    xy = np.array([[min(right + 36, SIDE - 8) - 0.5, middle + 0.5]])
    before, after = (each.height(xy, 1.0) - each.height(xy, -1.0) for each in (body, whole))
    assert abs(after - before)[0] < 0.05 * body.silhouette.extent


TURNS = [(35.0, -20.0, 5.0), (-25.0, 10.0, 0.0), (50.0, -8.0, -12.0)]


def _misled(seen: SeenShape) -> SeenShape:
    """As a network errs: the front leans by a tenth of the size, and is round at the rim."""
    across = np.broadcast_to(np.linspace(-0.1, 0.1, SIDE, dtype=np.float32), seen.mask.shape)
    away = cv2.distanceTransform(seen.mask.astype(np.uint8), cv2.DIST_L2, 5)
    round_off = 0.05 * np.exp(-away / 6).astype(np.float32)
    return replace(seen, front=seen.front + across - round_off, front_error=seen.front_error + 0.05)


@pytest.mark.parametrize("turn", TURNS)
def test_a_box_is_as_its_outline_says_where_the_network_errs(turn) -> None:
    mesh = box(AT, turn_matrix(*turn).T, np.array([0.22, 0.3, 0.15]))
    seen, _ = see(mesh)
    found = recognised(_misled(seen))
    assert found is not None and found.mesh is not None
    assert found.kind == "box"
    true, own = (m.vertices[:, :2] / m.vertices[:, 2:] * SIDE / WIDTH for m in (mesh, found.mesh))
    corners = true[ConvexHull(true).vertices]
    away, _ = KDTree(own).query(corners)
    assert away.max() < 1.5, "px, of its corners in the picture"
    aligned = np.abs(found.mesh.axes @ mesh.axes.T).max(1)
    assert aligned.min() > np.cos(np.radians(6.0))


@cache
def box_body(turn: tuple[float, float, float]) -> tuple[ReliefBody, PlainSolid, Camera]:
    """The body of a box that is recognised, as it is turned."""
    seen, _ = see(box(AT, turn_matrix(*turn).T, np.array([0.22, 0.3, 0.15])))
    body, camera = body_of(seen)
    found = recognised(seen)
    assert found is not None
    body = completed(fused(body, seen, camera, 1.0, 1.0), found, camera, 1.0, 1.0)
    assert body.solid is not None
    return body, body.solid, camera


@pytest.mark.parametrize("turn", TURNS)
def test_the_hidden_sides_of_a_box_lie_on_it_and_have_no_gaps(turn) -> None:
    body, solid, camera = box_body(turn)
    surface, spacing = spread(body, 3000, 2.0, np.random.default_rng(0))
    depth = camera.focal - surface.height
    places = camera.unproject(surface.xy, depth)
    sides = np.unique(np.round(solid.normals, 6), axis=0)
    assert len(sides) == 6
    far = (solid.vertices @ sides.T).max(0)  # of each side, along its normal
    beyond = places @ sides.T - far
    hidden = ~surface.is_seen & ~surface.is_brim
    off = np.abs(beyond[hidden].max(1))  # 0 on the box
    assert np.percentile(off, 99) < 0.25 * spacing
    tree = KDTree(places[hidden])
    rng = np.random.default_rng(1)
    for side, edge in zip(sides, far, strict=True):
        on_it = solid.vertices[np.abs(solid.vertices @ side - edge) < 1e-6 * camera.focal]
        if side @ on_it.mean(0) < 0.2 * np.linalg.norm(on_it.mean(0)):
            continue  # the photo shows it, or nearly
        anywhere = rng.dirichlet(np.ones(4), 500) @ on_it
        assert tree.query(anywhere)[0].max() < 1.5 * spacing
    whole = replace(body, solid=None)
    assert abs(len(surface.xy) / len(spread(whole, 3000, 2.0, rng)[0].xy) - 1) < 0.15
    assert body.nearer(np.zeros(body.silhouette.shape)).solid is None, "what is moved is no box"


@pytest.mark.parametrize("turn", TURNS)
def test_rows_beside_a_box_s_edges_are_straight_and_nothing_sticks_out_of_them(turn) -> None:
    body, solid, camera = box_body(turn)
    surface, spacing = spread(body, 3000, 2.0, np.random.default_rng(0))
    points = np.column_stack([surface.xy, surface.height])[surface.is_seen & ~surface.is_brim]
    places = camera.unproject(points[:, :2], camera.focal - points[:, 2])
    normals = solid.normals
    beyond = places @ normals.T - (normals * solid.vertices[solid.faces[:, 0]]).sum(1)
    shown, looked_at = solid.is_seen & ~solid.is_hidden, 0
    for (a, b), (one, other) in _edges(solid):
        if not (shown[one] and shown[other]):
            continue
        way, length = (b - a) / np.linalg.norm(b - a), float(np.linalg.norm(b - a))
        along = (places - a) @ way
        away = np.linalg.norm(places - a - along[:, None] * way, axis=1)
        for face in (one, other):
            own = (np.abs(beyond[:, face]) < 0.01 * spacing) & (along > spacing)
            own &= along < length - spacing
            if not own.any():
                continue  # it is a sliver
            assert away[own].min() > 0.99 * INSET * spacing
            row = own & (away < 1.01 * INSET * spacing)
            gaps = np.linalg.norm(np.diff(points[row][np.argsort(along[row])], axis=0), axis=1)
            assert gaps.max() < 1.2 * IN_LINE * spacing
            looked_at += 1
    assert looked_at >= 2


def _edges(solid: PlainSolid) -> list[tuple[np.ndarray, tuple[int, int]]]:
    """The ends (2, 3) of each edge between two sides, and a face of each."""
    found = []
    for one, corners in enumerate(solid.faces):
        for other in range(one):
            both = np.intersect1d(corners, solid.faces[other])
            if len(both) == 2 and abs(solid.normals[one] @ solid.normals[other]) < 0.1:
                found.append((solid.vertices[both], (one, other)))
    return found


def test_normals_of_a_solid_are_turned_into_relief_coordinates_and_back() -> None:
    mesh, camera = _box(), camera_of(TANGENTS, SIDE)
    solid = PlainSolid(200 * mesh.vertices, mesh.faces, camera, np.ones((2, 2), bool))
    places, face = solid.scattered(0.01, np.random.default_rng(0))
    xy, height = solid.relief(places)
    np.testing.assert_allclose(camera.unproject(xy, camera.focal - height), places, atol=1e-6)
    normals = solid.normals[face]
    ray = (xy - [camera.cx, camera.cy]) / camera.focal
    own = solid.relief_normals(places, normals)
    back = _world_normals(own, ray, camera.focal - height, 1.0, camera.focal)
    np.testing.assert_allclose(back, normals, atol=1e-9)
