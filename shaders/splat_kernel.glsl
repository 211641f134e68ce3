// A Gaussian at a pixel: its alpha (raster/reference.py, step 1).

flat in vec4 v_centre;  // px of the target; QXX, TILT
flat in vec4 v_kernel;  // RYY, WEIGHT, CUT, FRONT

uniform float tail;     // rules.Splatting
uniform float most;
uniform float least;

// Way from the Gaussian's centre, px.
vec2 offset() {
    return gl_FragCoord.xy - v_centre.xy;
}

// Squared Mahalanobis distance.
float distance_at(vec2 d) {
    float e = d.x + v_centre.w * d.y;
    return v_centre.z * e * e + v_kernel.x * d.y * d.y;
}

// 0 where nothing is.
float alpha_of(float bell) {
    float alpha = min(v_kernel.y * (bell - tail), most);
    return alpha >= least ? max(alpha, 0.0) : 0.0;
}
