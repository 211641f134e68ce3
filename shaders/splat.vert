#version 330
// One Gaussian on the screen, projected by the CPU (raster/tiles.py: _project), as a rectangle
// that holds all of its kernel. Same names as there.

in vec2 centre;        // px
in vec3 conic;         // inverse covariance: xx, xy, yy
in vec2 extent;        // px, half-size of the rectangle
in vec3 plane;         // depth at the centre, and its slope per px
in vec2 shift;         // photo px, from the pixel to what it shows of the photo
in vec4 shift_slope;   // per px: xx, xy, yx, yy
in vec4 weights;       // lod, photo, body, seen
in vec3 color;
in vec2 edge;          // matted, solid

uniform vec2 size;     // px of the target
uniform vec2 near_far; // depths at the ends of the depth buffer

flat out vec3 v_conic;
flat out vec3 v_plane;
flat out vec2 v_shift;
flat out vec4 v_shift_slope;
flat out vec4 v_weights;
flat out vec3 v_color;
flat out vec2 v_edge;
out vec2 v_offset;     // px from the centre

void main() {
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    v_offset = corner * extent;
    vec2 at = (centre + v_offset) / size * 2.0 - 1.0;
    bool shown = weights.y + weights.z > 0.0;
    // y stays as it is: row 0 of the target is the top row of the picture
    gl_Position = shown ? vec4(at, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
    v_conic = conic;
    v_plane = plane;
    v_shift = shift;
    v_shift_slope = shift_slope;
    v_weights = weights;
    v_color = color;
    v_edge = edge;
}
