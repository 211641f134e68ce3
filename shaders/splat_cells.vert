#version 330
// Rectangles over the open cells. What is beside them is not touched.

#include "splat_cells.glsl"

uniform vec2 resolution;  // px of the target

void main() {
    int across = textureSize(left, 0).x;
    ivec2 cell = ivec2(gl_InstanceID % across, gl_InstanceID / across);
    vec2 corner = vec2(cell + ivec2(gl_VertexID & 1, gl_VertexID >> 1)) * float(CELL);
    vec4 outside = vec4(2.0, 2.0, 2.0, 1.0);
    gl_Position = is_open(cell) ? vec4(corner / resolution * 2.0 - 1.0, 0.0, 1.0) : outside;
}
