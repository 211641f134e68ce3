#version 330
// Where a layer begins: the nearest sample that is no mere tail (reference.py: _find_front).

#include "splat_kernel.glsl"
#include "splat_layer.glsl"

uniform vec2 depth_range;  // world units: the object's depth, and its size

out vec4 front;            // depth, shift, see `shows`

void main() {
    vec2 d = offset();
    float q = distance_at(d), both = v_shift.z + v_shift.w;
#if LAYER == 0
    if (q > v_kernel.w) discard;
    float depth = depth_at(d);
    vec2 shift = shift_at(d);
#else
    if (q > v_kernel.z || is_over()) discard;
    float depth = depth_at(d);
    vec2 shift = shift_at(d);
    if (remaining(depth, shift) * alpha_of(exp(-0.5 * q)) * both < least_front) discard;
#endif
    // Any depth has a place between 0 and 1, with most digits where the object is.
    float t = (depth - depth_range.x) / depth_range.y;
    gl_FragDepth = 0.5 + 0.5 * t / (1.0 + abs(t));
    front = vec4(depth, shift, shows());
}
