#version 330
// A projected Gaussian of a plain colour as the triangle around its ellipse.
//
// That is 1.3 times as large as the rectangle of splat.vert, but only one thing to set up, and no
// edge runs through its middle.

in vec4 p_centre;  // see splat_project.vert
in vec4 p_kernel;
in vec4 p_axes;
in vec4 p_color;

uniform vec2 resolution;  // px of the target

noperspective out vec2 v_away;  // px from the Gaussian's centre
flat out vec3 v_slopes;         // of the square roots of what splat_cloud.frag subtracts
flat out vec4 v_color;          // colour; log2 of the weight

// Of the triangle around the unit circle.
const vec2 CORNERS[3] = vec2[3](vec2(0.0, 2.0), vec2(-1.7320508, -1.0), vec2(1.7320508, -1.0));
const float HALF_AS_POWER = 0.72134752;  // exp(-q / 2) = exp2(-that q)

void main() {
    vec2 corner = CORNERS[gl_VertexID], slopes = sqrt(HALF_AS_POWER * vec2(p_centre.z, p_kernel.x));
    v_away = corner.x * p_axes.xy + corner.y * p_axes.zw;
    v_slopes = vec3(slopes.x, slopes.x * p_centre.w, slopes.y);
    v_color = vec4(p_color.rgb, log2(p_kernel.y));
    // y stays as it is: row 0 of the target is the top row of the picture
    vec2 at = (p_centre.xy + v_away) / resolution * 2.0 - 1.0;
    gl_Position = p_kernel.y > 0.0 ? vec4(at, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
