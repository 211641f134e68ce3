"""The GPU projects Gaussians as the processor does (`raster/projection.py`)."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F32
from objectmorpher_core.deform.jacobians import LEAST_STRETCH, MOST_STRETCH
from objectmorpher_core.document.model import Placement
from objectmorpher_core.raster import rules as p
from objectmorpher_core.raster.binning import depth_order
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.raster.projection import project
from objectmorpher_core.raster.rules import RULES
from tests import shapes
from tests.app.render.pictures import bent
from tests.tree import over

pytest_plugins = ["tests.app.render.gpu"]  # the fixtures

# The columns in the order in which the GPU writes them; what it keeps as
# what is missing to 1, or goes beyond it, is converted by `by_processor`.
COLUMNS = (
    p.CX, p.CY, p.QXX, p.TILT, p.RYY, p.WEIGHT, p.CUT, p.FRONT, None, None, None, None,
    p.RED, p.GREEN, p.BLUE, p.SEEN, p.Z, p.ZX, p.ZY, p.MAGNIFIED, p.SX, p.SY, p.PHOTO, p.BODY,
    p.AXX, p.AXY, p.AYX, p.AYY, p.MATTED, p.SOLID, p.ASIDE,
)  # fmt: skip
USED = [k for k, column in enumerate(COLUMNS) if column is not None]
AXES, EXTENT_SLACK = slice(8, 12), 0.02  # px, see splat_project.vert
F32_ROUNDING = 1e-4  # relative, of matrices that are inverted
NEARLY_NOTHING = 1e-6  # what is left of a difference that is 0


@pytest.fixture(scope="module")
def project_pass(context):
    from objectmorpher.render.gpu_memory import Uploads
    from objectmorpher.render.project_pass import ProjectPass

    context.framebuffer([context.texture((1, 1), 4)]).use()
    return ProjectPass(context, Uploads())


def by_gpu(project_pass, splats: PosedSplats, camera, order=None) -> F32:
    instances = project_pass.draw(splats, camera, shapes.camera(), order)
    width = len(COLUMNS) if order is None else 16
    return np.frombuffer(instances.read(), np.float32).reshape(-1, width)


def by_processor(splats: PosedSplats, camera) -> F32:
    rows = project(splats, camera, shapes.camera())
    for column in (p.SEEN, p.MATTED):
        rows[:, column] = 1 - rows[:, column]
    rows[:, p.MAGNIFIED] = np.maximum(rows[:, p.MAGNIFIED] / RULES.sharp - 1, 0)
    return rows


def compare(project_pass, splats: PosedSplats, camera) -> None:
    gpu, processor = by_gpu(project_pass, splats, camera), by_processor(splats, camera)
    weights = gpu[:, COLUMNS.index(p.WEIGHT)], processor[:, p.WEIGHT]
    # Backs begin at grazing: walls, which are there exactly at rest, are just shown or just not.
    shown = np.maximum(*weights) > NEARLY_NOTHING
    assert (np.minimum(*weights)[shown] > 0).all()
    for k in USED:
        column = COLUMNS[k]
        size = np.abs(processor[shown][:, column]).max()
        np.testing.assert_allclose(
            gpu[shown][:, k], processor[shown][:, column], rtol=1e-3,
            atol=F32_ROUNDING * size + NEARLY_NOTHING,
        )  # fmt: skip
    a, b = gpu[shown][:, AXES][:, :2], gpu[shown][:, AXES][:, 2:]
    extent = np.sqrt(a * a + b * b)
    expected = processor[shown][:, [p.EX, p.EY]]
    assert (extent >= expected * (1 - F32_ROUNDING)).all()
    assert (extent <= expected * (1 + F32_ROUNDING) + EXTENT_SLACK * 2**0.5).all()


@over("zoom", [0.4, 1.0, 6.0])
@over("placement", [Placement(), Placement(turn=(30.0, 50.0, 10.0), scale=1.5)])
@over("largeness", [None, 0.5, 2.0])
def test_the_gpu_projects_as_the_processor_does(project_pass, largeness, placement, zoom):
    scene, pose = bent("star", 1200, largeness or 0.5)
    splats = scene.puppet.posed(pose if largeness else None, placement)
    camera = scene.camera.windowed(20, 10, 160, 120, zoom)
    compare(project_pass, splats, camera)


@pytest.mark.parametrize("splatting", ["surface", "mip", "classic"])
def test_so_it_does_with_motions_that_are_given(project_pass, splatting):
    splats, _ = shapes.random_splats(0, splatting)
    visible = splats.means[:, 2] > 0.5  # nearer ones have entries of any size
    assert visible.sum() > 100
    gpu, processor = (
        by_gpu(project_pass, splats, shapes.camera()),
        by_processor(splats, shapes.camera()),
    )
    visible &= processor[:, p.WEIGHT] > 0
    for k in USED:
        np.testing.assert_allclose(
            gpu[visible][:, k], processor[visible][:, COLUMNS[k]], rtol=2e-3, atol=2e-3
        )


def test_stretches_are_limited_as_by_the_processor(project_pass):
    """Some of these Gaussians are drawn out to needles, some turned inside out."""
    scene, pose = bent("star", 1200, 6.0)
    splats = scene.puppet._posed_whole(pose, Placement())
    stretches = np.linalg.svd(splats.skinned.linear, compute_uv=False)
    is_limited = (stretches[:, 0] > 0.999 * MOST_STRETCH) | (
        stretches[:, 2] < 1.001 * LEAST_STRETCH
    )
    assert is_limited.sum() > 20
    compare(project_pass, splats, scene.camera)


def test_at_rest_every_gaussian_looks_where_it_is(project_pass):
    scene = shapes.scene("star", 1200)
    rows = by_gpu(project_pass, scene.puppet.posed(None, Placement()), scene.camera)
    shift = rows[:, [COLUMNS.index(c) for c in (p.SX, p.SY)]]
    residuals = scene.lifted.texture.u0 - scene.camera.project(
        scene.lifted.world_points(scene.lifted.gaussians.means.astype(np.float64))
    )
    # Others look aside; what is seen edge-on may or may not, as float32 rounds it.
    is_towards = scene.puppet.posed(None, Placement()).rest.cosines > NEARLY_NOTHING
    shown = (rows[:, COLUMNS.index(p.WEIGHT)] > 0) & is_towards
    np.testing.assert_allclose(shift[shown], residuals[shown], atol=1e-12)
    slope = rows[shown][:, [COLUMNS.index(c) for c in (p.AXX, p.AXY, p.AYX, p.AYY)]]
    assert np.abs(slope).max() < 1e-3  # the ridge's


def test_rows_come_in_the_order_that_is_given(project_pass):
    splats, _ = shapes.random_splats(0, "classic", False)
    order = np.random.default_rng(0).permutation(len(splats))[:100].astype(np.uint32)
    everything = by_gpu(project_pass, splats, shapes.camera())
    np.testing.assert_array_equal(
        by_gpu(project_pass, splats, shapes.camera(), order), everything[order, :16]
    )


@pytest.mark.parametrize("motion", ["none", "given", "skin"])
def test_depths_are_those_that_the_rasterisers_sort_by(motion):
    from objectmorpher.render.splat_pass import near_to_far, view_depths

    if motion == "given":
        splats, _ = shapes.random_splats(0, "classic", False)
    else:
        scene, pose = bent("star", 1200, 1.0)
        placement = Placement(turn=(20.0, 30.0, 10.0))
        splats = scene.puppet._posed_whole(pose if motion == "skin" else None, placement)
    depths = splats.means[:, 2].astype(np.float32)
    np.testing.assert_allclose(view_depths(splats), depths, rtol=1e-6)
    there = np.flatnonzero(depths > RULES.near * splats.gap)
    np.testing.assert_array_equal(near_to_far(splats), there[depth_order(depths[there])])
