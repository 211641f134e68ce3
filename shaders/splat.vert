#version 330
// A projected Gaussian as the rectangle around its ellipse.
//
// LAYER: of the asset's layers the one that is drawn; IS_FRONT: whether its front is looked for.

in vec4 p_centre;  // see splat_project.vert
in vec4 p_kernel;
in vec4 p_axes;
in vec4 p_color;
in vec4 p_depth;
in vec4 p_shift;
in vec4 p_slope;
in vec3 p_edge;

uniform vec2 resolution;  // px of the target
uniform float top;        // px of the view, the target's first row

#if LAYER > 0
#include "splat_cells.glsl"

const int MOST_CELLS = 25;  // that are looked at

// Whether anything is left where the rectangle is.
bool is_any_open(vec2 middle, vec2 extent) {
    ivec2 last = textureSize(left, 0) - 1;
    ivec2 low = clamp(ivec2(floor((middle - extent) / float(CELL))), ivec2(0), last);
    ivec2 high = clamp(ivec2(floor((middle + extent) / float(CELL))), ivec2(0), last);
    ivec2 count = high - low + 1;
    if (count.x * count.y > MOST_CELLS) return true;
    bool is_any = false;
    for (int y = low.y; y <= high.y; ++y)
        for (int x = low.x; x <= high.x; ++x) is_any = is_any || is_open(ivec2(x, y));
    return is_any;
}
#endif

flat out vec4 v_centre;
flat out vec4 v_kernel;
flat out vec4 v_color;
flat out vec4 v_depth;
flat out vec4 v_shift;
flat out vec4 v_slope;
flat out vec3 v_edge;

void main() {
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    vec4 axes = p_axes;
    bool is_shown = p_kernel.y > 0.0;
#if defined(IS_FRONT) && LAYER == 0
    axes *= sqrt(max(p_kernel.w / p_kernel.z, 0.0));
    is_shown = is_shown && p_kernel.w > 0.0;
#endif
    vec2 middle = vec2(p_centre.x, p_centre.y - top);
#if LAYER > 0
    is_shown = is_shown && is_any_open(middle, abs(axes.xy) + abs(axes.zw));
#endif
    vec2 at = (middle + corner.x * axes.xy + corner.y * axes.zw) / resolution * 2.0 - 1.0;
    // y stays as it is: row 0 of the target is the top row of the picture
    gl_Position = is_shown ? vec4(at, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
    v_centre = vec4(middle, p_centre.zw);
    v_kernel = p_kernel;
    v_color = p_color;
    v_depth = p_depth;
    v_shift = p_shift;
    v_slope = p_slope;
    v_edge = p_edge;
}
