#version 330
// Third pass: a layer's sums become colour and alpha, the photo is looked up once per pixel
// (raster/reference.py, step 4; raster/tiles.py: _close).

uniform sampler2D sum_shift;
uniform sampler2D sum_color;
uniform sampler2D sum_slope;
uniform sampler2D sum_edge;
uniform sampler2D look_before;   // what the layer before wrote to `look`
uniform sampler2D result_before;
uniform bool peels;              // whether there is a layer before
uniform float same_point;        // photo px within which two layers show one surface
uniform sampler2D photo;         // straight colour and alpha on the object's crop, with mipmaps

uniform vec3 view;               // focal, cx, cy of the window, px
uniform vec3 photo_camera;       // the same of the photo
uniform vec2 corner;             // px, of the crop in the photo
uniform float level;             // kernel sum at which the surface ends
uniform float edge_width;        // px

layout(location = 0) out vec4 result;  // premultiplied
layout(location = 1) out vec4 look;    // shift (2), coverage, 1 where the photo is shown

float coverage(float total, vec2 slope) {
    return clamp(0.5 + (total - level) / (edge_width * length(slope) + 1e-6), 0.0, 1.0);
}

// Catmull-Rom: gives a pixel's own value at its centre.
vec4 cubic_weights(float t) {
    return vec4(
        ((-0.5 * t + 1.0) * t - 0.5) * t,
        (1.5 * t - 2.5) * t * t + 1.0,
        ((-1.5 * t + 2.0) * t + 0.5) * t,
        (0.5 * t - 0.5) * t * t
    );
}

vec4 texel(ivec2 at, ivec2 size) {
    vec4 value = texelFetch(photo, clamp(at, ivec2(0), size - 1), 0);
    bool inside = all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, size));
    return inside ? value : vec4(value.rgb, 0.0);
}

vec4 cubic(vec2 at) {
    ivec2 size = textureSize(photo, 0);
    ivec2 base = ivec2(floor(at - 0.5));
    vec2 t = at - 0.5 - vec2(base);
    vec4 wx = cubic_weights(t.x), wy = cubic_weights(t.y);
    vec4 value = vec4(0.0);
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
            value += wy[i] * wx[j] * texel(base + ivec2(j - 1, i - 1), size);
    return clamp(value, 0.0, 1.0);
}

vec4 sample_photo(vec2 at, float lod) {
    vec4 fine = lod < 1.0 ? cubic(at) : vec4(0.0);
    if (lod <= 0.0) return fine;
    vec2 size = vec2(textureSize(photo, 0));
    bool inside = all(greaterThan(at, vec2(0.0))) && all(lessThan(at, size));
    vec4 coarse = textureLod(photo, at / size, max(lod, 1.0));
    if (!inside) coarse.a = 0.0;
    return mix(fine, coarse, min(lod, 1.0));
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 shifts = texelFetch(sum_shift, pixel, 0);
    float seen = shifts.z, body = shifts.w, total = seen + body;
    if (total <= 0.0) discard;
    vec4 colors = texelFetch(sum_color, pixel, 0);
    vec4 slopes = texelFetch(sum_slope, pixel, 0);
    vec4 edges = texelFetch(sum_edge, pixel, 0);
    float matte = 0.0;
    vec4 texel = vec4(0.0);
    if (seen > 1e-6 * total) {
        vec2 at = (gl_FragCoord.xy - view.yz) * (photo_camera.x / view.x) + photo_camera.yz;
        texel = sample_photo(at + shifts.xy / seen - corner, edges.z / seen);
        matte = (texel.a * edges.x + edges.y) / seen;
    }
    float whole = coverage(total, slopes.xy), solid = coverage(body, slopes.zw);
    float alpha = matte * whole + (1.0 - matte) * solid;
    vec2 shift = seen > 1e-6 * total ? shifts.xy / seen : vec2(0.0);
    look = vec4(shift, whole, seen > 1e-6 * total ? 1.0 : 0.0);
    if (peels && look.w > 0.5) {
        // One surface that was split in two: its coverage adds up under one matte.
        vec4 first = texelFetch(look_before, pixel, 0);
        float above = texelFetch(result_before, pixel, 0).a;
        if (first.w > 0.5 && distance(first.xy, shift) < same_point)
            alpha *= (1.0 - first.z) / max(1.0 - above, 1e-4);
    }
    float shown = seen * matte;
    vec3 mixed = (shown * texel.rgb + colors.rgb) / max(shown + body, 1e-30);
    result = vec4(mixed, 1.0) * alpha;
}
