#version 330
// The sums of a layer, added up in any order (reference.py: _Sums).

#include "splat_kernel.glsl"
#include "splat_layer.glsl"

flat in vec4 v_color;  // RED, GREEN, BLUE, how much is not SEEN

uniform bool is_edged;  // rules.Splatting
#ifndef IS_LAST
uniform sampler2D front;  // of this layer
#endif

layout(location = 0) out vec4 sum_cover;  // total, body; gradient of total or logs of what is clear
layout(location = 1) out vec4 sum_place;  // gradient of what ends with the surface, depth, shift x
layout(location = 2) out vec4 sum_photo;  // shift y; excess of MAGNIFIED, not SEEN, not MATTED
layout(location = 3) out vec4 sum_color;  // of the body; SOLID of what is not MATTED
layout(location = 4) out vec4 sum_left;   // for later layers; of the last one: its fronts;
                                          // what is ASIDE, and its shift

void main() {
    vec2 d = offset();
    float q = distance_at(d);
    if (q > v_kernel.z || is_over()) discard;
    float bell = exp(-0.5 * q), alpha = alpha_of(bell);
    float depth = depth_at(d);
    vec2 shift = shift_at(d);
    float share = alpha > 0.0 ? remaining(depth, shift) : 0.0;
    float photo = v_shift.z, body = v_shift.w, both = photo + body;
#ifdef IS_LAST
    float member = share;
    float left = share * alpha * both >= least_front ? 1.0 : 0.0;
#else
    vec4 begin = texelFetch(front, ivec2(gl_FragCoord.xy), 0);
    if (begin.x > 1e29) discard;  // there is no such layer
    float member = share * membership(depth, shift, begin);
    float left = (share - member) * alpha * both;
#endif
    alpha *= member;
    photo *= alpha;
    body *= alpha;
    float steep = member * v_kernel.y * bell, across = v_centre.z * (d.x + v_centre.w * d.y);
    vec2 gradient = -steep * vec2(across, v_centre.w * across + v_kernel.x * d.y);
    gradient = alpha > 0.0 ? gradient : vec2(0.0);
#ifdef IS_SURFACE
    sum_cover = vec4(photo + body, body, gradient * both);
#else
    vec2 clear = max(1.0 - vec2(alpha * both, body), 1e-30);
    sum_cover = vec4(photo + body, body, log(clear));
#endif
    float ended = v_shift.w + (is_edged ? v_shift.z * v_edge.x * v_edge.y : 0.0);
    float aside = photo * v_edge.z;
    vec2 own = (photo - aside) * shift;
    sum_left = vec4(left, aside, aside * shift);
    sum_place = vec4(gradient * ended, (photo + body) * depth, own.x);
    sum_photo = vec4(own.y, photo * vec3(v_depth.w, v_color.w, v_edge.x));
    sum_color = vec4(body * v_color.rgb, photo * v_edge.x * v_edge.y);
}
