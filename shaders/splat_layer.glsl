// A Gaussian at a pixel: its place, what it shows of the photo, and how much of it belongs to
// which layer (raster/reference.py, step 4; raster/surface.py).

flat in vec4 v_depth;  // Z, ZX, ZY, excess of MAGNIFIED
flat in vec4 v_shift;  // SX, SY, PHOTO, BODY
flat in vec4 v_slope;  // AXX, AXY, AYX, AYY
flat in vec3 v_edge;   // how much is not MATTED, SOLID of that; ASIDE

uniform vec2 gaps;         // 1 / gap^2, 1 / texture_gap^2
uniform float fade;        // x gap, beyond which nothing belongs to a layer
uniform float least_front;

#if LAYER > 0
#include "splat_cells.glsl"

uniform sampler2D cover;   // of the layer before, see splat_resolve.frag
uniform sampler2D front0;  // depth, shift and what is shown of the nearest samples of a layer
#endif
#if LAYER > 1
uniform sampler2D front1;
#endif
#if LAYER > 2
uniform sampler2D front2;
#endif

float depth_at(vec2 d) {
    return v_depth.x + dot(v_depth.yz, d);
}

vec2 shift_at(vec2 d) {
    return v_shift.xy + vec2(dot(v_slope.xy, d), dot(v_slope.zw, d));
}

// 1: the photo, -1: an invented picture, 0: neither. Of alike ones the product is positive.
float shows() {
    return v_shift.z > 0.0 ? 1.0 - 2.0 * v_edge.z : 0.0;
}

// How much of a sample belongs to the layer of a front.
float membership(float depth, vec2 shift, vec4 front) {
    float away = depth - front.x;
    vec2 looks = shift - front.yz;
    float square = max(away * away * gaps.x, shows() * front.w * dot(looks, looks) * gaps.y);
    float end = fade * fade;
    float t = clamp((end - square) / (end - 1.0), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

// What the layers before have left of a sample.
float remaining(float depth, vec2 shift) {
    float share = 1.0;
#if LAYER > 0
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    share *= 1.0 - membership(depth, shift, texelFetch(front0, pixel, 0));
#endif
#if LAYER > 1
    share *= 1.0 - membership(depth, shift, texelFetch(front1, pixel, 0));
#endif
#if LAYER > 2
    share *= 1.0 - membership(depth, shift, texelFetch(front2, pixel, 0));
#endif
    return share;
}

// Whether a later layer can have anything here.
bool is_over() {
#if LAYER > 0
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    return !is_open(pixel / CELL) || texelFetch(cover, pixel, 0).w == 0.0;
#else
    return false;
#endif
}
