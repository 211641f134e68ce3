"""A peer: the cloud as public splat viewers draw it (3D Gaussian Splatting, Kerbl et al. 2023).

Every frame the CPU sorts the depths; each Gaussian is a quad, axis-aligned, three standard
deviations wide to each side; its covariance is projected in the vertex shader, at each of the four
corners anew; fragments are blended far to near, premultiplied.

It draws what stands still in its world: the Gaussians are uploaded once, and nothing is skinned.
Public viewers read them from storage buffers; OpenGL 3.3 has none, and a texture is read instead.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from objectmorpher_core.base.arrays import F32
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.gaussians import Gaussians

TEXELS = 4  # of a Gaussian: mean and opacity, quaternion, sizes, colour
ROW = 512  # Gaussians in a row of the texture
BEYOND = 1.3  # x half the view: Jacobians are taken no farther out

VERTEX = (
    f"""
#version 330
#define ROW {ROW}
#define TEXELS {TEXELS}
"""
    + """
uniform sampler2D table;
uniform vec2 size;      // px of the view
uniform vec2 limit;     // |x / z| and |y / z| up to which the Jacobian is taken
uniform vec3 view;      // focal, cx, cy, px
uniform float near;
in int gaussian;        // the instance's, far ones first
out vec2 away;          // px from the centre
flat out vec3 conic;
flat out vec4 paint;    // colour, opacity

vec4 texel(int k) {
    return texelFetch(table, ivec2((gaussian % ROW) * TEXELS + k, gaussian / ROW), 0);
}

void main() {
    vec4 place = texel(0), q = texel(1);
    vec3 scale = texel(2).xyz, p = place.xyz;
    float w = q.x, x = q.y, y = q.z, z = q.w;
    mat3 turn = transpose(mat3(
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)));
    mat3 axes = turn * mat3(scale.x, 0, 0, 0, scale.y, 0, 0, 0, scale.z);
    mat3 sigma = axes * transpose(axes);
    vec2 side = clamp(p.xy / p.z, -limit, limit);
    float j = view.x / p.z;
    vec3 jx = vec3(j, 0, -j * side.x), jy = vec3(0, j, -j * side.y);
    float xx = dot(jx, sigma * jx) + 0.3, xy = dot(jx, sigma * jy), yy = dot(jy, sigma * jy) + 0.3;
    conic = vec3(yy, -xy, xx) / (xx * yy - xy * xy);
    paint = vec4(texel(3).rgb, place.w);
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    away = corner * 3.0 * sqrt(vec2(xx, yy));
    vec2 at = (p.xy / p.z * view.x + view.yz + away) / size * 2.0 - 1.0;
    gl_Position = p.z > near ? vec4(at, 0, 1) : vec4(2, 2, 2, 1);
}
"""
)

FRAGMENT = """
#version 330
in vec2 away;
flat in vec3 conic;
flat in vec4 paint;
out vec4 color;

void main() {
    vec2 d = away;
    float power = -0.5 * (conic.x * d.x * d.x + conic.z * d.y * d.y) - conic.y * d.x * d.y;
    float alpha = min(0.99, paint.a * exp(power));
    if (power > 0.0 || alpha < 1.0 / 255.0) discard;
    color = vec4(paint.rgb * alpha, alpha);
}
"""


class ClassicViewer:
    """Draws one cloud. The constructor uploads it."""

    def __init__(self, context: Any, gaussians: Gaussians, camera: Camera) -> None:
        """`context`: a moderngl.Context; `gaussians` in the frame of `camera`."""
        self._context, self._camera, self._means = context, camera, gaussians.means
        self._program = context.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
        table = _table(gaussians)
        self._table = context.texture(
            (table.shape[1], table.shape[0]), 4, table.tobytes(), dtype="f4"
        )
        self._table.filter = context.NEAREST, context.NEAREST
        self._order = context.buffer(reserve=4 * len(gaussians), dynamic=True)
        self._quads = context.vertex_array(self._program, [(self._order, "1i/i", "gaussian")])
        size = camera.width, camera.height
        self.picture = context.texture(size, 4)  # 8 bits, as a window has
        self._buffer = context.framebuffer([self.picture])
        sides = np.array(size) / 2 / camera.focal
        uniforms = {
            "size": size, "limit": tuple(BEYOND * sides), "near": 0.01,
            "view": (camera.focal, camera.cx, camera.cy), "table": 0,
        }  # fmt: skip
        for name, value in uniforms.items():
            self._program[name].value = value

    def sort(self) -> np.ndarray:
        """Rows of the Gaussians, near ones first."""
        return np.argsort(self._means[:, 2])

    def draw(self) -> None:
        """Draw one frame into `picture`, whose first row is the topmost."""
        self._order.write(np.ascontiguousarray(self.sort()[::-1], np.int32))
        self._buffer.use()
        self._buffer.clear()
        context = self._context
        context.enable_only(context.BLEND)
        context.blend_func = context.ONE, context.ONE_MINUS_SRC_ALPHA
        self._table.use(0)
        self._quads.render(context.TRIANGLE_STRIP, 4, instances=len(self._means))

    def release(self) -> None:
        """Gives back what lies on the GPU."""
        for item in (self._quads, self._buffer, self.picture, self._table, self._order):
            item.release()
        self._program.release()


def _table(gaussians: Gaussians) -> F32:
    """(rows, ROW * TEXELS, 4), see TEXELS."""
    count = len(gaussians)
    table = np.zeros((-(-count // ROW) * ROW, TEXELS, 4), np.float32)
    table[:count, 0] = np.column_stack([gaussians.means, gaussians.opacities])
    table[:count, 1] = gaussians.quats
    table[:count, 2, :3] = gaussians.scales
    table[:count, 3, :3] = gaussians.colors
    return table.reshape(-1, ROW * TEXELS, 4)
