// compose/composite.py, `mixed`: a premultiplied colour over an opaque one.

const int MULTIPLY = 1, SCREEN = 2;

vec3 mixed(vec3 below, vec4 color, int mode) {
    if (mode == MULTIPLY) return below * (1 - color.a + color.rgb);
    if (mode == SCREEN) return below + color.rgb * (1 - below);
    vec3 tilt = 2 * color.rgb - color.a;
    vec3 bright = mix(sqrt(below), ((16 * below - 12) * below + 4) * below, lessThanEqual(below, vec3(0.25)));
    return below + tilt * mix(bright - below, below - below * below, lessThanEqual(tilt, vec3(0)));
}
