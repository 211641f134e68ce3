#version 330
// All layers' colour and alpha, and what else is known of a pixel, into the picture.

uniform sampler2D sum_color;
uniform sampler2D sum_detail;  // see splat_resolve.frag
uniform sampler2D sum_median;
uniform ivec2 corner;  // px of the picture, at which these begin

layout(location = 0) out vec4 color;   // premultiplied sRGB
layout(location = 1) out vec4 detail;  // depth (0: nothing is there), from_photo, shift

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy) - corner;
    color = texelFetch(sum_color, pixel, 0);
    detail = texelFetch(sum_detail, pixel, 0);
    vec4 median = texelFetch(sum_median, pixel, 0);
    if (median.x != 0.0) detail.x = median.x;
    if (median.y != 0.0) detail.zw = median.zw;
}
