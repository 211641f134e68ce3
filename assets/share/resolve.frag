#version 300 es
// Two layers of weighted means over the background; a surface ends where its kernels' sum does.
precision highp float;
precision highp sampler2D;

uniform sampler2D sum0;
uniform sampler2D total0;
uniform sampler2D sum1;
uniform sampler2D total1;
uniform sampler2D plate;
uniform vec2 canvas;  // px

out vec4 color;

const float LEVEL = 0.35;

vec4 layer(sampler2D sums, sampler2D totals) {
    ivec2 p = ivec2(gl_FragCoord.xy), last = textureSize(totals, 0) - 1;
    float all = texelFetch(totals, p, 0).r;
    vec4 sum = texelFetch(sums, p, 0);
    if (all <= 0.0 || sum.a <= 0.0) return vec4(0.0);
    vec2 slope = 0.5 * vec2(
        texelFetch(totals, min(p + ivec2(1, 0), last), 0).r - texelFetch(totals, max(p - ivec2(1, 0), 0), 0).r,
        texelFetch(totals, min(p + ivec2(0, 1), last), 0).r - texelFetch(totals, max(p - ivec2(0, 1), 0), 0).r);
    float inside = clamp(0.5 + (all - LEVEL) / (length(slope) + 1e-6), 0.0, 1.0);
    float alpha = inside * min(sum.a / all, 1.0);
    return vec4(sum.rgb / sum.a * alpha, alpha);
}

void main() {
    vec2 place = gl_FragCoord.xy / canvas;
    vec3 below = texture(plate, vec2(place.x, 1.0 - place.y)).rgb;
    vec4 one = layer(sum0, total0), two = layer(sum1, total1);
    vec4 thing = one + (1.0 - one.a) * two;
    color = vec4(thing.rgb + (1.0 - thing.a) * below, 1.0);
}
