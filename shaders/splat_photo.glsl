// The photo, looked up (raster/texture.py: sample_texture).

uniform sampler2D photo;  // straight colour and alpha on the object's crop, halved copies below;
                          // the photo's own size with a border, of the same colours without alpha
uniform ivec2 sizes[8];   // px of each level without the border; the texture's own are larger
uniform int levels;
uniform float finest;     // level of the photo that the texture's first one is

const int BORDER = 2;

// Of a halved copy.
vec4 texel(ivec2 at, int level) {
    ivec2 size = sizes[level];
    vec4 value = texelFetch(photo, clamp(at, ivec2(0), size - 1), level);
    bool is_inside = all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, size));
    return is_inside ? value : vec4(value.rgb, 0.0);
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

vec4 cubic(vec2 at) {
    ivec2 base = ivec2(floor(at - 0.5));
    vec2 t = at - 0.5 - vec2(base);
    vec4 wx = cubic_weights(t.x), wy = cubic_weights(t.y), value = vec4(0.0);
    ivec2 end = sizes[0] + (2 * BORDER - 1);
    ivec4 x = clamp(base.x + BORDER + ivec4(-1, 0, 1, 2), 0, end.x);
    ivec4 y = clamp(base.y + BORDER + ivec4(-1, 0, 1, 2), 0, end.y);
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
            value += wy[i] * wx[j] * texelFetch(photo, ivec2(x[j], y[i]), 0);
    return clamp(value, 0.0, 1.0);
}

vec4 bilinear(vec2 at, int level) {
    vec2 there = at / float(1 << level) - 0.5;
    ivec2 base = ivec2(floor(there));
    vec2 t = there - vec2(base);
    vec4 above = mix(texel(base, level), texel(base + ivec2(1, 0), level), t.x);
    vec4 below = mix(texel(base + ivec2(0, 1), level), texel(base + ivec2(1, 1), level), t.x);
    return mix(above, below, t.y);
}

// At crop px, for so many photo px per view px.
vec4 sample_photo(vec2 look, float magnified) {
    vec2 at = look / exp2(finest);
    float lod = clamp(log2(max(magnified, 1.0)) - finest, 0.0, float(levels - 1));
    int lower = int(lod);
    float between = lod - float(lower);
    int upper = between > 0.0 ? lower + 1 : lower;
    vec4 value = vec4(0.0);
    bool is_own = lower == 0 && finest == 0.0;
    if (is_own) value = (1.0 - between) * cubic(at);
    for (int level = is_own ? 1 : lower; level <= upper; ++level)
        value += (level == lower ? 1.0 - between : between) * bilinear(at, level);
    return value;
}
