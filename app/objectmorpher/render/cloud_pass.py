"""Plainly coloured Gaussians, one by one from near to far: step 3 of `raster/reference.py`."""

from __future__ import annotations

import moderngl

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.raster.posed import PosedSplats

from .instances import Instances
from .shaders import build_program, set_uniforms


class CloudPass:
    """Draws Gaussians that are in the order of their depth already."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = build_program(context, "splat.vert", "splat_cloud.frag")

    def draw(
        self, instances: Instances, splats: PosedSplats, camera: Camera,
        picture: moderngl.Framebuffer,
    ) -> None:  # fmt: skip
        """Into `picture`, its first row is the topmost."""
        picture.use()
        picture.clear()
        self._context.enable_only(moderngl.BLEND)
        # behind what is there: as much as that lets through
        self._context.blend_func = moderngl.ONE_MINUS_DST_ALPHA, moderngl.ONE
        set_uniforms(
            self._program, **splats.rest.splatting._asdict(),
            resolution=(camera.width, camera.height), top=0.0,
        )  # fmt: skip
        instances.draw(self._program)
