#version 330
// A plainly coloured Gaussian behind those that are there (reference.py, step 3).

#include "splat_kernel.glsl"

flat in vec4 v_color;

out vec4 color;  // premultiplied

void main() {
    float q = distance_at(offset());
    if (q > v_kernel.z) discard;
    float alpha = alpha_of(exp(-0.5 * q));
    color = vec4(v_color.rgb, 1.0) * alpha;
}
