"""Gaussians on the GPU: the picture that `raster/reference.py` defines.

Each Gaussian is projected once (`project_pass`); then the object is drawn in layers
(`layered_pass`) or, where it shows plain colours only, one Gaussian after the other (`cloud_pass`).

OpenGL 3.3 core, without storage buffers, compute or geometry shaders, so that macOS runs it.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.raster.texture import TextureLevels

from .gpu_memory import Instances, Uploads
from .layered_pass import LayeredPass
from .project_pass import ProjectPass
from .shaders import build_program, set_uniforms
from .view_depths import near_to_far


@dataclass(frozen=True, eq=False)
class SplatPicture:
    """A rendered object on the GPU. Row 0 is the top row of the picture."""

    color: moderngl.Texture  # RGBA, 16 or 32 bits, premultiplied sRGB
    # RGBA, 32 bits: depth, world units, 0 where nothing is; share that shows the photo; px of the
    # photo to where it looks (2). None of an object without layers.
    detail: moderngl.Texture | None


class SplatPass:
    """Draws one object after the other."""

    def __init__(self, context: moderngl.Context, most_texture: int | None = None) -> None:
        """`most_texture`: px, the longest side of a texture, if not the driver's limit."""
        limit = most_texture or int(context.info["GL_MAX_TEXTURE_SIZE"])
        self._context = context
        self.uploads = Uploads()
        self._project = ProjectPass(context, self.uploads)
        self._layered = LayeredPass(context, self.uploads, limit)
        self._cloud = CloudPass(context)
        self._pictures: dict[bool, _Target] = {}
        # Without a window, transform feedback needs some framebuffer; and none that is bound may
        # be released.
        self._idle = context.framebuffer([context.texture((1, 1), 4)])

    def draw(
        self, splats: PosedSplats, texture: TextureLevels, camera: Camera, photo_camera: Camera
    ) -> SplatPicture | None:
        """The object as `camera` sees it, valid until the next call; None of a view without px.

        Raises moderngl.Error, one sentence, where the driver cannot.
        """
        if camera.width < 1 or camera.height < 1:
            return None
        self._idle.use()
        _ = self._context.error  # whatever somebody else has left
        is_layered = splats.is_layered
        target = self._sized(is_layered, (camera.width, camera.height))
        order = None if is_layered else near_to_far(splats)
        instances = self._project.draw(splats, camera, photo_camera, order)
        if is_layered:
            cameras = (camera, photo_camera)
            self._layered.draw(instances, splats, texture, cameras, target.framebuffer)
        else:
            self._cloud.draw(instances, splats, camera, target.framebuffer)
        error = self._context.error
        if error != "GL_NO_ERROR":
            raise moderngl.Error(f"the driver reports {error}")
        return SplatPicture(target.textures[0], target.textures[1] if is_layered else None)

    def sweep(self) -> None:
        """Releases the objects that have not been drawn since the last time."""
        self.uploads.sweep()

    def _sized(self, is_layered: bool, size: tuple[int, int]) -> _Target:
        """The picture to draw into; made anew when the canvas has changed."""
        target = self._pictures.get(is_layered)
        if target is None or target.size != size:
            if target is not None:
                self._pictures.pop(is_layered).release()
            target = self._pictures[is_layered] = _Target(self._context, size, is_layered)
        return target


class _Target:
    """A picture's textures. Sums of thousands of Gaussians need 32 bits, finished ones 16."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int], is_layered: bool) -> None:
        self.size = size
        types = ("f2", "f4") if is_layered else ("f4",)
        self.textures = [context.texture(size, 4, dtype=bits) for bits in types]
        for texture in self.textures:
            texture.filter = moderngl.NEAREST, moderngl.NEAREST
        self.framebuffer = context.framebuffer(self.textures)

    def release(self) -> None:
        self.framebuffer.release()
        for texture in self.textures:
            texture.release()


# Plainly coloured Gaussians, one by one from near to far: step 3 of `raster/reference.py`.


class CloudPass:
    """Draws Gaussians that are in the order of their depth already."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = build_program(context, "splat.vert", "splat_cloud.frag")

    def draw(
        self, instances: Instances, splats: PosedSplats, camera: Camera,
        picture: moderngl.Framebuffer,
    ) -> None:  # fmt: skip
        """Draw into `picture`, whose first row is the topmost."""
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
