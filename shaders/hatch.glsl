// Diagonal stripes over pixels that are not the photo's.

uniform float unit;        // canvas px per point
uniform vec3 ink;          // sRGB of the stripes
uniform float strength;    // share of the ink in a stripe
uniform float brightness;  // share of the picture that is left under the hatching
uniform float slant;       // 1: rising to the right, -1: falling, 0: upright

// 1 in a stripe at canvas px, 0 between; they are 8 points apart.
float stripes(vec2 at) {
    float phase = fract((at.x + slant * at.y) / (8.0 * unit * length(vec2(1.0, slant))));
    return smoothstep(0.30, 0.38, phase) - smoothstep(0.62, 0.70, phase);
}

// A colour premultiplied by `alpha`, `share` of which is hatched.
vec3 hatched(vec3 color, float alpha, float share, vec2 at) {
    vec3 striped = mix(color * brightness, ink * alpha, strength * stripes(at));
    return mix(color, striped, share);
}
