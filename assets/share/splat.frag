#version 300 es
// FRONT: where a layer begins. Otherwise: the sums of what belongs to it.
precision highp float;
precision highp sampler2D;

flat in vec2 v_centre;
flat in vec4 v_kernel;
flat in vec4 v_slope;
flat in vec4 v_look;
flat in vec3 v_depth;
flat in vec3 v_color;

uniform sampler2D foreground;  // the object's own colours, continued beyond it
uniform sampler2D matte;
uniform vec4 crop;             // px of the photo: corner and size of both
uniform sampler2D before;      // depths of the fronts of the layer before
uniform sampler2D front;       // and of this one
uniform vec2 range;            // world units: nearest depth, 1 / extent
uniform float gap;             // world units
uniform float height;          // px of the canvas
uniform bool is_first;

const float SHARPER = -0.7;    // levels: halved copies would blur all that turns a little

#ifndef FRONT
layout(location = 0) out vec4 sum;
layout(location = 1) out vec4 total;
#endif

void main() {
    vec2 d = vec2(gl_FragCoord.x, height - gl_FragCoord.y) - v_centre;
    float q = v_kernel.x * d.x * d.x + 2.0 * v_kernel.y * d.x * d.y + v_kernel.z * d.y * d.y;
    vec2 at = v_look.xy + vec2(dot(v_slope.xy, d), dot(v_slope.zw, d));
    vec2 place = (at - crop.xy) / crop.zw;
    vec3 photo = texture(foreground, place, SHARPER).rgb;
    float there = texture(matte, place, SHARPER).r;
    if (q > 7.0) discard;
    float alpha = v_kernel.w * (exp(-0.5 * q) - 0.0302);
    if (alpha <= 0.0) discard;
    float share = v_look.z;
    float solid = mix(1.0, there, share);
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float depth = (v_depth.x + dot(v_depth.yz, d) - range.x) * range.y;
    if (!is_first && depth < texelFetch(before, pixel, 0).r + gap * range.y) discard;
#ifdef FRONT
    if (alpha * solid < 0.01) discard;
    gl_FragDepth = clamp(depth, 0.0, 0.9999);
#else
    float beyond = (depth - texelFetch(front, pixel, 0).r) / (gap * range.y);
    float member = clamp((2.25 - beyond * beyond) / 1.25, 0.0, 1.0);
    if (member <= 0.0) discard;
    sum = vec4(mix(v_color, photo * there, share), solid) * alpha * member;
    total = vec4(alpha * member, 0.0, 0.0, 0.0);
#endif
}
