// compose/harmonize.py, `lit`: a premultiplied colour under another light.

vec4 lit(vec4 color, vec3 gain) {
    return gain == vec3(1) ? color : vec4(min(color.rgb * gain, vec3(color.a)), color.a);
}
