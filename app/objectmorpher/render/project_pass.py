"""Gaussians onto the screen, once each: shaders/splat_project.vert by transform feedback.

What does not change lies on the GPU; of a new pose come the table of control points and, where the
Gaussians have to be sorted, their order, and of a frame only a few matrices. The results are the
instances that the other passes draw.
"""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np

from objectmorpher_core.base.arrays import F32, frozen
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.deform.binding import Binding
from objectmorpher_core.deform.jacobians import LEAST_STRETCH, MOST_STRETCH
from objectmorpher_core.deform.skinning import Motion, Skin, Skinned, nodes_of
from objectmorpher_core.raster import posed
from objectmorpher_core.raster.posed import PosedSplats, RestSplats
from objectmorpher_core.raster.rules import RULES

from .gpu_memory import Columns, Instances, Uploads
from .shaders import buffer_layout, build_feedback, set_uniforms

PLAIN: Columns = (("p_centre", "4f"), ("p_kernel", "4f"), ("p_axes", "4f"), ("p_color", "4f"))
LAYERED: Columns = (
    *PLAIN, ("p_depth", "4f"), ("p_shift", "4f"), ("p_slope", "4f"), ("p_edge", "3f"),
)  # fmt: skip

GEOMETRY = (("place", "4f"), ("quat", "4f"), ("size", "4f"), ("normal", "3f"), ("look", "3f"))
PAINT = (("paint", "4f"), ("visibility", "1f"))
SIDES = (("side0", "3f"), ("side1", "3f"), ("aside", "3f"))
NODES = (("control_points", "4i"),)
SHARES = tuple((f"share{c}", "4f") for c in range(4))
GIVEN = (("shift_at", "3f"), ("grown0", "3f"), ("grown1", "3f"), ("grown2", "3f"))

Uniforms = dict[str, Any]


class ProjectPass:
    """Projects one object after the other."""

    def __init__(self, context: moderngl.Context, uploads: Uploads) -> None:
        self._context, self._uploads = context, uploads
        self._programs: dict[tuple[str, bool], moderngl.Program] = {}
        self._plain, self._layered = Instances(context, PLAIN), Instances(context, LAYERED)

    def draw(
        self, splats: PosedSplats, camera: Camera, photo_camera: Camera, order: np.ndarray | None
    ) -> Instances:
        """Draw all Gaussians, or the rows `order` (M,) u32 in that order, without layers.

        The order is uploaded if it is another array than before.
        """
        count = len(splats) if order is None else len(order)
        instances = self._layered if order is None else self._plain
        output = instances.reserve(count)
        if count == 0:
            return instances
        motion = splats.motion
        name = "skin" if isinstance(motion, Skin) else "none" if motion is None else "given"
        program = self._program(name, order is None)
        uniforms = _uniforms(splats, camera, photo_camera)
        content = self._rest(program, splats.rest, photo_camera, order is None)
        if isinstance(motion, Skin):
            content += self._bound(program, motion.binding)
            pose = self._uploads(
                "pose", motion.motion, lambda: PoseTable(self._context, motion.motion)
            )
            pose.texture.use(0)
            uniforms |= pose.uniforms
        elif isinstance(motion, Skinned):
            content.append(buffer_layout(program, self._given(splats.rest, motion), GIVEN))
        set_uniforms(program, **uniforms)
        index = None
        if order is not None:
            index = self._uploads("order", order, lambda: self._context.buffer(frozen(order)))
        array = self._context.vertex_array(program, content, index_buffer=index)
        array.transform(output, moderngl.POINTS, vertices=count)
        array.release()
        return instances

    def _program(self, motion: str, is_layered: bool) -> moderngl.Program:
        key = (motion, is_layered)
        if key not in self._programs:
            names = [name for name, _ in (LAYERED if is_layered else PLAIN)]
            defines = () if is_layered else ("IS_PLAIN",)
            self._programs[key] = build_feedback(
                self._context, "splat_project.vert", names, *defines,
                MOTION=f"motion_{motion}.glsl",
            )  # fmt: skip
            stretches = (LEAST_STRETCH, MOST_STRETCH)
            set_uniforms(self._programs[key], **RULES._asdict(), nodes=0, stretches=stretches)
        return self._programs[key]

    def _rest(
        self, program: moderngl.Program, rest: RestSplats, photo: Camera, is_layered: bool
    ) -> list[Any]:
        """What does not depend on the motion. Paint changes none of it but its own."""
        uploads, buffer = self._uploads, self._context.buffer
        geometry = uploads("geometry", rest.means, lambda: buffer(_table_geometry(rest, photo)))
        paint = uploads("paint", rest, lambda: buffer(_table_paint(rest)))
        content = [
            buffer_layout(program, geometry, GEOMETRY), buffer_layout(program, paint, PAINT)
        ]  # fmt: skip
        if is_layered:
            sides = uploads("sides", rest.means, lambda: buffer(_table_sides(rest, photo)))
            content.append(buffer_layout(program, sides, SIDES))
        return content

    def _bound(self, program: moderngl.Program, binding: Binding) -> list[Any]:
        uploads, buffer = self._uploads, self._context.buffer
        nodes = uploads("nodes", binding, lambda: buffer(binding.control_points))
        shares = uploads("shares", binding, lambda: buffer(_table_shares(binding)))
        return [buffer_layout(program, nodes, NODES), buffer_layout(program, shares, SHARES)]

    def _given(self, rest: RestSplats, motion: Skinned) -> moderngl.Buffer:
        return self._uploads(
            "given", motion, lambda: self._context.buffer(_table_given(rest, motion))
        )


class PoseTable:
    """Where the control points are, on the GPU: a row of the texture each, see `nodes_of`."""

    def __init__(self, context: moderngl.Context, motion: Motion) -> None:
        table, frame = nodes_of(motion)
        self.uniforms: Uniforms = {"centre": tuple(frame[0]), "drift": tuple(frame[1])}
        data = np.ascontiguousarray(table, np.float32)
        self.texture = context.texture((2, len(table)), 4, data, dtype="f4")
        self.texture.filter = moderngl.NEAREST, moderngl.NEAREST

    def release(self) -> None:
        self.texture.release()


def _uniforms(splats: PosedSplats, camera: Camera, photo_camera: Camera) -> Uniforms:
    """Kind of asset, cameras, and the placement as what it adds to the rest."""
    rest, kind = splats.rest, splats.rest.splatting
    at_rest, placed = rest.world_from_object, splats.world_from_object
    added = placed - at_rest
    return {
        **kind._asdict(), "low_pass": kind.filter, "is_layered": splats.is_layered,
        "rest_linear": _columns(at_rest), "rest_offset": tuple(at_rest[:3, 3]),
        "linear": _columns(placed), "turn": _columns(added), "slide": tuple(added[:3, 3]),
        "has_sides": rest.sides is not None,
        "scale": splats.scale, "nearest": RULES.near * splats.gap,
        "view": (camera.focal, camera.cx, camera.cy), "photo_focal": photo_camera.focal,
        "limits": posed.view_limits(photo_camera),
    }  # fmt: skip


def _columns(matrix: np.ndarray) -> tuple[float, ...]:
    """The linear part of a (4, 4) matrix as GLSL takes it, column by column."""
    return tuple(matrix[:3, :3].T.ravel().tolist())


def _table_geometry(rest: RestSplats, photo_camera: Camera) -> F32:
    """(N, 18), see GEOMETRY."""
    gaussians, texture = rest.lifted.gaussians, rest.lifted.texture
    seen_at = photo_camera.project(rest.lifted.world_points(rest.means))
    return np.column_stack(
        [
            rest.means, gaussians.opacities, gaussians.quats, gaussians.scales, rest.cosines,
            gaussians.normals, texture.u0 - seen_at, texture.solidity,
        ]
    ).astype(np.float32)  # fmt: skip


def _table_sides(rest: RestSplats, photo_camera: Camera) -> F32:
    """(N, 9), see SIDES; zeros where there are none."""
    table, sides = np.zeros((len(rest), 9)), rest.lifted.sides
    if sides is not None:
        slopes = sides.slopes.astype(np.float64) @ rest.world_from_object[:3, :3]
        seen_at = photo_camera.project(rest.lifted.world_points(rest.means))
        table = np.column_stack([slopes.reshape(len(rest), 6), sides.at - seen_at, sides.zoom])
    return table.astype(np.float32)


def _table_paint(rest: RestSplats) -> F32:
    """(N, 5), see PAINT."""
    colors, visibility = rest.lifted.gaussians.colors, rest.lifted.texture.visibility
    return np.column_stack([colors, rest.zoom, visibility]).astype(np.float32)


def _table_shares(binding: Binding) -> F32:
    """(N, 16), see SHARES."""
    shares = np.concatenate([binding.weights[:, :, None], binding.weight_gradients], axis=2)
    return shares.reshape(len(shares), -1).astype(np.float32)


def _table_given(rest: RestSplats, motion: Skinned) -> F32:
    """(N, 12), see GIVEN."""
    grown = (motion.linear - np.eye(3)).transpose(0, 2, 1)
    return np.concatenate(
        [motion.points - rest.means, grown.reshape(len(grown), 9)], axis=1
    ).astype(np.float32)  # fmt: skip
