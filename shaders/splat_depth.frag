#version 330
// First of three passes: the depth of the front surface. A second layer is peeled by drawing
// again what lies behind the first.

flat in vec3 v_conic;
flat in vec3 v_plane;
flat in vec4 v_weights;
in vec2 v_offset;

uniform vec2 near_far;
uniform float cutoff;
uniform float tail;
uniform float least;        // kernel weight from which a Gaussian makes a surface
uniform float gap;          // depth within which samples are one surface
uniform bool peels;         // whether `front` holds the depth of the layer before
uniform sampler2D front;

out float depth_out;

void main() {
    vec2 d = v_offset;
    float q = v_conic.x * d.x * d.x + 2.0 * v_conic.y * d.x * d.y + v_conic.z * d.y * d.y;
    if (q >= cutoff) discard;
    float kernel = exp(-0.5 * q) - tail;
    if (kernel * (v_weights.y + v_weights.z) < least) discard;
    float depth = v_plane.x + dot(v_plane.yz, d);
    if (peels && depth <= texelFetch(front, ivec2(gl_FragCoord.xy), 0).r + gap) discard;
    gl_FragDepth = clamp((depth - near_far.x) / (near_far.y - near_far.x), 0.0, 1.0);
    depth_out = depth;
}
