// compose/grain.py, `grained`: a premultiplied colour with the photo's noise, so much of each band.

vec4 grained(vec4 color, vec4 amount) {
    if (color.a <= 0) return color;
    ivec2 size = textureSize(grain, 0).xy;
    ivec2 at = ivec2(floor((corner + xy / zoom) / grain_texel));
    at -= size * ivec2(floor(vec2(at) / vec2(size)));  // also of what is left of the photo
    vec3 noise = amount.x * texelFetch(grain, ivec3(at, 0), 0).rgb
               + amount.y * texelFetch(grain, ivec3(at, 1), 0).rgb
               + amount.z * texelFetch(grain, ivec3(at, 2), 0).rgb
               + amount.w * texelFetch(grain, ivec3(at, 3), 0).rgb;
    ivec3 level = ivec3(clamp(color.rgb / color.a, 0, 1) * 255 + 0.5);
    vec3 deviation = vec3(
        texelFetch(deviations, ivec2(level.r, 0), 0).r,
        texelFetch(deviations, ivec2(level.g, 0), 0).g,
        texelFetch(deviations, ivec2(level.b, 0), 0).b
    );
    return vec4(clamp(color.rgb + color.a * deviation * noise, vec3(0), vec3(color.a)), color.a);
}
