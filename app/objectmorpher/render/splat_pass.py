"""Gaussians on the GPU: the picture that `raster/reference.py` defines.

Each Gaussian is projected once (`project_pass`); then the object is drawn in layers
(`layered_pass`) or, where it shows plain colours only, one Gaussian after the other (`cloud_pass`).

OpenGL 3.3 core, without storage buffers, compute or geometry shaders, so that macOS runs it.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import moderngl
import numpy as np

from objectmorpher_core.base.arrays import F32, frozen
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.kernel_files import numba
from objectmorpher_core.base.threads import FAST, LEAST_ROWS, in_threads
from objectmorpher_core.deform.skinning import Skin, nodes_of
from objectmorpher_core.raster.binning import depth_order
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.raster.rules import RULES, Splatting
from objectmorpher_core.raster.texture import TextureLevels

from .gpu_memory import Instances, Uploads
from .layered_pass import LayeredPass
from .project_pass import ProjectPass
from .shaders import build_program, set_uniforms

# Depths by which plainly coloured Gaussians are sorted: the skinning of one coordinate.
#
# A third of the time of skinning them whole, and the same 32 bits as `PosedSplats.means` has.


def near_to_far(splats: PosedSplats) -> np.ndarray:
    """Rows (M,) u32 of the Gaussians before the camera, as the rasterisers sort them."""
    depths = view_depths(splats)
    return depth_order(np.where(depths > RULES.near * splats.gap, depths, 0))


def view_depths(splats: PosedSplats) -> F32:
    """(N,) world units along z, where the edit has put the Gaussians."""
    row, motion = splats.world_from_object[2], splats.motion
    if not isinstance(motion, Skin):
        points = splats.rest.means if motion is None else motion.points
        return (points @ row[:3] + row[3]).astype(np.float32)
    nodes, frame = nodes_of(motion.motion)
    plane = np.array([*row[:3], row[3] + row[:3] @ frame[1], *frame[0]])
    depths = np.empty(len(splats), np.float32)
    binding = motion.binding
    inputs = (
        frozen(motion.points, np.float64), frozen(binding.control_points.view(np.uint32)),
        frozen(binding.weights), nodes, frozen(plane), depths,
    )  # fmt: skip
    in_threads(lambda first, last: _depths(first, last, *inputs), len(splats), least=LEAST_ROWS)
    return depths


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _depths(first, last, x, control_points, weights, nodes, plane, out):
    """Rows first..last; the formulas and names are those of `deform.skinning`.

    `plane` (7,): the depth's gradient in the object's frame, its value at 0 with the displacement
    that all share, and the control points' centre.
    """
    for i in range(np.uint64(first), np.uint64(last)):
        b0 = b1 = b2 = b3 = p0 = p1 = p2 = p3 = 0.0
        n = np.uint64(control_points[i, 0])
        for c in range(4):
            j, w = np.uint64(control_points[i, c]), weights[i, c]
            q0, q1, q2, q3 = nodes[j, 0], nodes[j, 1], nodes[j, 2], nodes[j, 3]
            dot = q0 * nodes[n, 0] + q1 * nodes[n, 1] + q2 * nodes[n, 2] + q3 * nodes[n, 3]
            w = w if dot >= 0.0 else -w
            b0, b1, b2, b3 = b0 + w * q0, b1 + w * q1, b2 + w * q2, b3 + w * q3
            p0, p1 = p0 + w * nodes[j, 4], p1 + w * nodes[j, 5]
            p2, p3 = p2 + w * nodes[j, 6], p3 + w * nodes[j, 7]
        x0, x1, x2 = x[i, 0], x[i, 1], x[i, 2]
        y0, y1, y2 = 2.0 * (x0 - plane[4]), 2.0 * (x1 - plane[5]), 2.0 * (x2 - plane[6])
        p1, p2, p3 = p1 + b2 * y2 - b3 * y1, p2 + b3 * y0 - b1 * y2, p3 + b1 * y1 - b2 * y0
        v0 = p1 * b0 - p0 * b1 - p2 * b3 + p3 * b2
        v1 = p2 * b0 - p0 * b2 - p3 * b1 + p1 * b3
        v2 = p3 * b0 - p0 * b3 - p1 * b2 + p2 * b1
        shift = plane[0] * v0 + plane[1] * v1 + plane[2] * v2
        shift /= b0 * b0 + b1 * b1 + b2 * b2 + b3 * b3
        out[i] = plane[0] * x0 + plane[1] * x1 + plane[2] * x2 + plane[3] + shift


@dataclass(frozen=True, eq=False)
class SplatPicture:
    """A rendered object on the GPU. Row 0 is the top row of the picture."""

    color: moderngl.Texture  # RGBA, 16 bits, premultiplied sRGB
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
        self._orders: WeakKeyDictionary[PosedSplats, np.ndarray] = WeakKeyDictionary()
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
        order = None if is_layered else self._sorted(splats)
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

    def _sorted(self, splats: PosedSplats) -> np.ndarray:
        """The order of the Gaussians, the same array as long as they are the same."""
        if splats not in self._orders:
            self._orders[splats] = near_to_far(splats)
        return self._orders[splats]

    def _sized(self, is_layered: bool, size: tuple[int, int]) -> _Target:
        """The picture to draw into; made anew when the canvas has changed."""
        target = self._pictures.get(is_layered)
        if target is None or target.size != size:
            if target is not None:
                self._pictures.pop(is_layered).release()
            target = self._pictures[is_layered] = _Target(self._context, size, is_layered)
        return target


class _Target:
    """A picture's textures. Finished layers need 16 bits; so do Gaussians that are put together.

    As fractions, not as floating point: of thousands of the faintest on one pixel the sum is right
    to 0.4 / 255, with half floats to 25 / 255.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int], is_layered: bool) -> None:
        self.size = size
        types = ("f2", "f4") if is_layered else ("nu2",)
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
        self._programs: dict[Splatting, moderngl.Program] = {}

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
        program = self._program(splats.rest.splatting)
        set_uniforms(program, resolution=(camera.width, camera.height))
        instances.draw(program, 3)

    def _program(self, kind: Splatting) -> moderngl.Program:
        """Compiled with the numbers in it: emulated, to look them up takes a tenth of the time."""
        assert kind.tail == 0, "the shader subtracts none"
        if kind not in self._programs:
            self._programs[kind] = build_program(
                self._context, "splat_cloud.vert", "splat_cloud.frag",
                f"MOST {kind.most!r}", f"LEAST {kind.least!r}",
            )  # fmt: skip
        return self._programs[kind]
