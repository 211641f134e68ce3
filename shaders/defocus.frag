#version 330
// A premultiplied picture blurred along its rows or columns; beyond its border it goes on as there.

uniform sampler2D picture;
uniform ivec2 way;   // px, to the next one along the blur
uniform int reach;   // px, where it ends
uniform float blur;  // px, standard deviation

#ifdef SHARPEN
uniform sampler2D detailed;
uniform float sharpness;
#endif

out vec4 color;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy), last = textureSize(picture, 0) - 1;
    float total = 0.0;
    color = vec4(0);
    for (int k = -reach; k <= reach; k++) {
        float weight = exp(-0.5 * float(k * k) / (blur * blur));
        color += weight * texelFetch(picture, clamp(at + k * way, ivec2(0), last), 0);
        total += weight;
    }
    color /= total;
#ifdef SHARPEN  // compose/light/defocus.py, `sharpened`
    vec4 own = texelFetch(detailed, at, 0);
    vec3 coarse = color.rgb * (own.a / max(color.a, 1e-6));
    color = vec4(clamp(own.rgb + sharpness * (own.rgb - coarse), vec3(0), vec3(own.a)), own.a);
#endif
}
