#version 330
// A Gaussian of a plain colour behind those that are there (reference.py, step 3).
//
// LEAST and MOST: alpha, see rules.Splatting.

noperspective in vec2 v_away;  // see splat_cloud.vert
flat in vec3 v_slopes;
flat in vec4 v_color;

out vec4 color;  // premultiplied

void main() {
    float across = dot(v_slopes.xy, v_away), down = v_slopes.z * v_away.y;
    float power = v_color.w - across * across - down * down;  // log2 of alpha
    if (power < log2(LEAST)) discard;
    color = vec4(v_color.rgb, 1.0) * min(exp2(power), MOST);
}
