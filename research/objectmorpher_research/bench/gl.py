"""The rows of OpenGL: the editor's own pass, and what public viewers do instead."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from objectmorpher_core.raster.binning import depth_order

from .classic_gl import ClassicViewer
from .scenes import BenchScene, Row
from .timing import Effort, measure

log = logging.getLogger(__name__)


class Drawer:
    """Draws scenes in a context without a window. Rows that cannot be had are left out."""

    def __init__(self, context: Any) -> None:
        """`context`: a moderngl.Context, or None where there is none."""
        self._context = context
        self._pass: Any = None
        self.name = None if context is None else str(context.info["GL_RENDERER"])

    def rows(self, scene: BenchScene, effort: Effort) -> list[Row]:
        """The scene by each renderer that draws such."""
        kinds = {"gl": self._own_row}
        if scene.name == "cloud":  # the peer knows no photo
            kinds["classic-gl"] = self._classic_row
        rows = []
        for name, row in kinds.items() if self._context else ():
            try:
                rows.append(row(scene, effort))
            except Exception as error:  # a driver's, of any kind: the other rows still count
                log.warning("No %s row of the %s: %s", name, scene.name, error)
        return rows

    def _own_row(self, scene: BenchScene, effort: Effort) -> Row:
        """The pass with which the editor draws."""
        if self._pass is None:
            from objectmorpher.render.splat_pass import SplatPass

            self._pass = SplatPass(self._context)
        splat_pass, photo = self._pass, scene.puppet.camera
        depths = scene.splats(0).means[:, 2]

        def frame(k: int) -> None:
            splat_pass.draw(scene.splats(k), scene.texture, scene.camera, photo)
            splat_pass.sweep()  # as after each frame of the window
            self._context.finish()

        sort = measure(lambda _: depth_order(depths), effort)
        return scene.row("gl", measure(frame, effort), sort if scene.name == "cloud" else None)

    def _classic_row(self, scene: BenchScene, effort: Effort) -> Row:
        viewer = ClassicViewer(self._context, scene.posed_gaussians(), scene.camera)

        def frame(_: int) -> None:
            viewer.draw()
            self._context.finish()

        sort = measure(lambda _: viewer.sort(), effort)
        row = scene.row("classic-gl", measure(frame, effort), sort)
        viewer.release()
        return row


@contextmanager
def drawing() -> Iterator[Drawer]:
    """A drawer, with OpenGL where it can be had without a window."""
    try:
        import moderngl  # what is measured need not be there

        settings: Any = {"backend": "egl"}  # moderngl's annotation of it is of another type
        context = moderngl.create_context(standalone=True, **settings)
    except Exception as error:  # what the loader raises differs from system to system
        log.warning("OpenGL cannot be had without a window here, its rows are left out: %s", error)
        context = None
    try:
        yield Drawer(context)
    finally:
        if context is not None:
            context.release()
