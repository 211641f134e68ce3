"""Handles lie where their azimuth says, and the network that ships says it."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_recognition import AT, TANGENTS, WIDTH, body_of, see

from objectmorpher_core import models
from objectmorpher_core.base.arrays import Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.rotations import turn_matrix
from objectmorpher_core.lift.crop import Crop
from objectmorpher_core.lift.relief.body import ReliefBody
from objectmorpher_core.lift.relief.fusion import fused
from objectmorpher_core.lift.shapes import completed, recognised, rod_look
from objectmorpher_core.lift.shapes.evidence import Evidence
from objectmorpher_core.lift.shapes.rods import RodView
from objectmorpher_core.lift.shapes.solids import Mesh, RayGrid, drawn, revolved, tube
from objectmorpher_core.models import registry
from objectmorpher_research.training.rods.sample import RodSample, make_sample
from objectmorpher_research.training.shape_eval import Surfaces, surfaces_of
from tests.tree import quick

PAGE = Path(__file__).parents[4] / "docs" / "lifting" / "README.md"
AXIS = turn_matrix(0, -15, 3)[:, 1]
RADIUS = 0.15
OFF = 0.12  # crop units
UNSEEN = range(70_000_000, 70_000_016)  # not trained on


def _can(radius: float) -> Mesh:
    steps = np.linspace(-0.2, 0.2, 12)
    return revolved(AT + steps[:, None] * AXIS, np.full(12, radius), AXIS, 96)


def mug(azimuth: float, side: int) -> Mesh:
    """A can with a ring in a plane through its axis, on the right (1) or on the left (-1)."""
    view = AT / np.linalg.norm(AT)
    front = AXIS * (AXIS @ view) - view
    front /= np.linalg.norm(front)
    way = side * np.cos(azimuth) * np.cross(front, AXIS) + np.sin(azimuth) * front
    can = _can(RADIUS)
    ring = tube(AT + RADIUS * way, np.cross(AXIS, way), np.array([0.11, 0.022, 0.022]), 96)
    faces = np.concatenate([can.faces, ring.faces + len(can.vertices)])
    return Mesh(np.concatenate([can.vertices, ring.vertices]), faces, can.axes)


@pytest.mark.parametrize(("degrees", "side"), quick([(-30, 1), (0, -1), (30, -1), (30, 1)], 2))
def test_a_handle_lies_where_its_azimuth_says(degrees: int, side: int) -> None:
    """Also where the network that sees depth is far off there."""
    azimuth, views = float(np.radians(degrees)), list[RodView]()

    def known(view: RodView) -> float:
        views.append(view)
        return azimuth

    seen, true = see(mug(azimuth, side))
    out = seen.mask & ~_can_mask(seen.mask)
    seen = replace(seen, front=seen.front + np.float32(OFF) * out)
    found = recognised(seen, "round")
    assert found is not None
    body, camera = body_of(seen)
    free = fused(body, seen, camera, 1.0, 1.0)
    whole = completed(free, found, camera, 1.0, 1.0, known)
    (view,) = views
    assert np.sign(view.crop.tangents[0] - AT[0] / AT[2]) == side
    up = -np.sign(AXIS[1]) * AXIS
    assert abs(np.degrees(view.lean - np.arcsin(-up @ AT / np.linalg.norm(AT)))) < 4
    off = [_off(each, true, seen.mask, out, camera.focal) for each in (free, whole)]
    extent = body.silhouette.extent
    assert off[1][0] < min(0.2 * off[0][0], 0.04 * extent)
    assert off[1][1] < 0.02 * extent


def test_of_which_the_azimuth_is_unknown_stays_as_it_was() -> None:
    seen, _ = see(mug(0.3, 1))
    found = recognised(seen, "round")
    assert found is not None
    body, camera = body_of(seen)
    before, after = (
        completed(body, found, camera, 1.0, 1.0, *how) for how in ((), (lambda _: None,))
    )
    assert np.array_equal(before.middle, after.middle)
    assert np.array_equal(before.front.square, after.front.square)


def test_fields_are_contiguous_with_the_handle_and_without() -> None:
    """For other arrays the misfit's kernel is compiled anew, which takes seconds."""
    whole = Evidence.of(see(mug(0.3, 1))[0])
    core = whole.core()
    assert core.mask.sum() < whole.mask.sum()
    for one in (whole, core):
        fields = [value for value in vars(one).values() if isinstance(value, np.ndarray)]
        assert len(fields) == 10 and all(field.flags.c_contiguous for field in fields)


@pytest.mark.parametrize("corner", [(400.0, -90.0), (-90.0, 400.0), (30.0, 40.0)])
def test_a_crop_beside_the_photo_is_black(corner: tuple[float, float]) -> None:
    camera, photo = Camera.from_fov(60, 80), np.full((80, 60, 3), 200, np.uint8)
    crop = Crop.at(*corner, 50.0, camera)
    seen, mask = crop.seen(photo), crop.seen_mask(np.ones((80, 60), bool))
    assert mask.any() == (corner == (30.0, 40.0))
    assert mask.any() or not seen.any()
    assert Crop.at(*corner, 0.2, camera).side == 1


@pytest.fixture(scope="module")
def handles() -> list[RodSample]:
    if models.path(registry.TOKENS) is None:
        pytest.skip(f"{registry.TOKENS} is not here")
    return [make_sample(seed) for seed in UNSEEN]


@pytest.fixture(scope="module")
def handle() -> RodSample:
    if models.path(registry.TOKENS) is None:
        pytest.skip(f"{registry.TOKENS} is not here")
    return make_sample(UNSEEN[0])


@pytest.mark.slow
def test_the_network_sees_how_handles_lie(handles: list[RodSample]) -> None:
    """On handles that it was not trained on; where it is sure it is nearer."""
    looks = np.array([rod_look.look(one.rgb, one.mask, one.rod, one.lean) for one in handles])
    azimuths = np.array([one.azimuth for one in handles])
    off = np.abs(looks[:, 0] - azimuths)
    unknown = np.abs(np.median(azimuths) - azimuths)
    assert np.median(off) < 0.6 * np.median(unknown)
    sure = looks[:, 1] < np.median(looks[:, 1])
    assert off[sure].mean() < off.mean()


def test_a_mirror_image_lies_the_same_way(handle: RodSample) -> None:
    rgb, mask, rod = handle.rgb, handle.mask, handle.rod
    found, mirrored = (
        rod_look.look(rgb[:, ::way], mask[:, ::way], rod[:, ::way], handle.lean) for way in (1, -1)
    )
    assert found == mirrored


def test_the_weights_are_those_of_the_page() -> None:
    digest = hashlib.sha256(registry.rod_network()).hexdigest()
    assert digest in PAGE.read_text("utf-8")


def _can_mask(mask: Mask) -> Mask:
    """Where the can of a `mug` is seen, and a little beside it."""
    first = TANGENTS[:2] + (0.5 / len(mask) - 0.5) * WIDTH
    grid = RayGrid((float(first[0]), float(first[1])), WIDTH / len(mask), mask.shape)
    return drawn(_can(1.03 * RADIUS), grid).near > 0


def _off(
    body: ReliefBody, true: Surfaces, mask: Mask, out: Mask, focal: float
) -> tuple[float, float]:
    """Medians of errors, px, of the front and of the thickness where it is `out` of the can."""
    found = surfaces_of(body, mask)
    can = mask & ~out
    scale = float(np.median(true.front[can] / (found.front[can] - focal)))
    front = scale * (found.front[out] - focal) - true.front[out]
    thick = scale * found.thickness[out] - true.thickness[out]
    return float(np.median(np.abs(front))), float(np.median(np.abs(thick)))
