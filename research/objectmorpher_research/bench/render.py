"""`objectmorpher bench render`: frames of a drag, by each renderer that runs here.

A frame begins with the posed control points: skinning, projection, sorting, drawing. Solving for
the pose is `bench deform`'s; scenes tell what it took them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from objectmorpher_core.raster import reference, tiles
from objectmorpher_core.raster.binning import bin_tiles, depth_order
from objectmorpher_core.raster.projection import project
from objectmorpher_core.raster.rules import Z

from . import gl
from .scenes import VIEW, BenchScene, Row, cloud_scene, lift_scene
from .timing import Effort, Timing, measure


@dataclass(frozen=True)
class RenderBench:
    """The settings of the benchmark."""

    counts: tuple[int, ...]  # Gaussians of the clouds
    lifted: int  # Gaussians of the lift
    sizes: tuple[int, ...]  # px, sides of the view
    view: int  # px, sides of the photo
    small: tuple[int, int]  # Gaussians and px with which the reference, plain numpy, ends
    effort: Effort


FULL = RenderBench(
    (10_000, 100_000, 300_000), 20_000, (512, 1024), VIEW, (1_000, 256), Effort(1.5, 9, 60)
)
QUICK = RenderBench((2_000,), 1_000, (256,), 256, (200, 96), Effort(0.0, 3, 3))


def bench_render(is_quick: bool) -> tuple[list[Row], str | None]:
    """Return all rows, and the name of the OpenGL renderer."""
    plan = QUICK if is_quick else FULL
    rows: list[Row] = []
    with gl.drawing() as drawer:
        count, size = plan.small
        for scene in (cloud_scene(count, size), lift_scene(count, size)):
            rows += [tiles_row(scene, plan.effort), _reference_row(scene)]
            rows += drawer.rows(scene, plan.effort)
        for scene in _scenes(plan):
            for size in plan.sizes:
                view = scene.sized(size)
                rows += [tiles_row(view, plan.effort), *drawer.rows(view, plan.effort)]
    return rows, drawer.name


def _scenes(plan: RenderBench) -> Iterator[BenchScene]:
    """One at a time: the largest fill hundreds of megabytes."""
    for count in plan.counts:
        yield cloud_scene(count, plan.view)
    yield lift_scene(plan.lifted, plan.view)


def tiles_frame(scene: BenchScene, frame: int) -> np.ndarray:
    """(h, w, 4) u8, premultiplied: as the editor draws it on the CPU."""
    drawable = tiles.prepare(scene.splats(frame), scene.camera, scene.puppet.camera)
    return tiles.draw_rgba(drawable, scene.texture)


def tiles_row(scene: BenchScene, effort: Effort) -> Row:
    """The CPU rasteriser, and what the parts of its frame take alone.

    Each part works on what the one before it has made; what is left of drawing is `draw_ms`.
    """
    camera, photo = scene.camera, scene.puppet.camera
    window = (0, 0, camera.width, camera.height)
    tile = tiles.tile_size(scene.splats(0))

    def timed(run: Callable[[int], object]) -> Timing:
        return measure(run, effort)

    frame = timed(lambda k: tiles_frame(scene, k))
    drawable = tiles.prepare(scene.splats(0), camera, photo)
    depths = drawable.projected[:, Z].copy()

    def sort(_: int) -> object:
        return depth_order(depths)

    sorting = None if drawable.order is None else timed(sort)
    projecting = timed(lambda k: project(scene.splats(k), camera, photo))
    binning = timed(lambda _: bin_tiles(drawable.projected, window, tile, drawable.order))
    drawing = timed(lambda _: tiles.draw_rgba(drawable, scene.texture)).less(binning)
    return scene.row(
        "tiles", frame, sorting, project_ms=projecting, bin_ms=binning, draw_ms=drawing
    )


def _reference_row(scene: BenchScene) -> Row:
    """The specification, once: it takes seconds."""
    camera, photo = scene.camera, scene.puppet.camera
    once = Effort(0.0, 1, 1)

    def sort(_: int) -> object:
        return np.argsort(scene.splats(0).means[:, 2].astype(np.float32), kind="stable")

    frame = measure(lambda k: reference.render(scene.splats(k), scene.texture, camera, photo), once)
    return scene.row("reference", frame, measure(sort, once))
