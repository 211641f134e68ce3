#version 330
// A rectangle of the canvas. Canvas px: x right, y down, from the canvas's left top corner.

uniform vec2 canvas;  // px, size of the canvas
uniform vec4 box;     // x0, y0, x1, y1 canvas px

out vec2 xy;  // canvas px

const vec2 CORNERS[4] = vec2[4](vec2(0, 0), vec2(1, 0), vec2(0, 1), vec2(1, 1));

void main() {
    xy = mix(box.xy, box.zw, CORNERS[gl_VertexID]);
    gl_Position = vec4(xy / canvas * vec2(2, -2) + vec2(-1, 1), 0, 1);
}
