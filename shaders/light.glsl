// compose/harmonize.py, `lit`: a premultiplied colour under another light.

vec4 lit(vec4 color, vec3 gain) {
    return gain == vec3(1) ? color : vec4(min(color.rgb * gain, vec3(color.a)), color.a);
}

// compose/light/harmonize.py, `saturated`: so many times as far from grey.
vec4 saturated(vec4 color, float saturation) {
    if (saturation == 1.0) return color;
    vec3 grey = vec3(dot(color.rgb, vec3(0.299, 0.587, 0.114)));
    return vec4(clamp(mix(grey, color.rgb, saturation), vec3(0), vec3(color.a)), color.a);
}
