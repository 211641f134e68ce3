#version 330
// Second pass: the sums of one surface layer, added up in any order (raster/reference.py, step 3).

flat in vec3 v_conic;
flat in vec3 v_plane;
flat in vec2 v_shift;
flat in vec4 v_shift_slope;
flat in vec4 v_weights;
flat in vec3 v_color;
flat in vec2 v_edge;
in vec2 v_offset;

uniform float cutoff;
uniform float tail;
uniform float gap;
uniform bool peels;
uniform sampler2D front;     // depth of this layer's front
uniform sampler2D before;    // depth of the layer before, where there is one

layout(location = 0) out vec4 sum_shift;   // shift x photo (2), photo, body
layout(location = 1) out vec4 sum_color;   // color x body (3), seen x photo
layout(location = 2) out vec4 sum_slope;   // gradients of photo + body, and of body
layout(location = 3) out vec4 sum_edge;    // matted, solid, lod (x photo), depth x (photo + body)

void main() {
    vec2 d = v_offset;
    vec2 g = vec2(v_conic.x * d.x + v_conic.y * d.y, v_conic.y * d.x + v_conic.z * d.y);
    float q = dot(g, d);
    if (q >= cutoff) discard;
    float depth = v_plane.x + dot(v_plane.yz, d);
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    if (depth > texelFetch(front, pixel, 0).r + gap) discard;
    if (peels && depth <= texelFetch(before, pixel, 0).r + gap) discard;
    float bell = exp(-0.5 * q);
    float photo = (bell - tail) * v_weights.y;
    float body = (bell - tail) * v_weights.z;
    vec2 shift = v_shift + vec2(dot(v_shift_slope.xy, d), dot(v_shift_slope.zw, d));
    sum_shift = vec4(photo * shift, photo, body);
    sum_color = vec4(body * v_color, photo * v_weights.w);
    sum_slope = -bell * vec4(g * (v_weights.y + v_weights.z), g * v_weights.z);
    sum_edge = vec4(
        photo * v_edge.x, photo * (1.0 - v_edge.x) * v_edge.y, photo * v_weights.x,
        (photo + body) * depth
    );
}
