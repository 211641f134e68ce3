#version 300 es
// A photo-textured Gaussian, skinned and projected: the same formulas as splat_project.vert.
precision highp float;
precision highp int;
precision highp sampler2D;

layout(location = 0) in vec3 mean;       // object frame, at rest
layout(location = 1) in vec3 cov_a;      // xx, xy, xz
layout(location = 2) in vec3 cov_b;      // yy, yz, zz
layout(location = 3) in vec2 u0;         // px of the photo
layout(location = 4) in vec2 seen;       // visibility, solidity
layout(location = 5) in vec4 color;      // sRGB, opacity
layout(location = 6) in vec3 normal;
layout(location = 7) in uvec4 nodes;     // control points that move it
layout(location = 8) in vec4 shares;
layout(location = 9) in vec3 slope0;     // gradients of the shares
layout(location = 10) in vec3 slope1;
layout(location = 11) in vec3 slope2;
layout(location = 12) in vec3 slope3;

uniform sampler2D bones;   // rows: where control points are, their quaternions xyzw, at rest
uniform float steep;       // what 1 of a slope means
uniform mat3 turn;         // world from object, now
uniform vec3 shift;
uniform mat3 rest_turn;    // the same at rest
uniform vec3 rest_shift;
uniform vec3 camera;       // focal, centre: px of the photo
uniform vec2 size;         // px of the photo
uniform float scale;       // canvas px per photo px
uniform bool is_surface;
uniform bool is_edged;

flat out vec2 v_centre;    // canvas px
flat out vec4 v_kernel;    // inverse covariance xx, xy, yy; weight
flat out vec4 v_slope;     // photo px per canvas px
flat out vec4 v_look;      // u0, share of the photo
flat out vec3 v_depth;     // depth and its slope
flat out vec3 v_color;

const float CUTOFF = 7.0;
const float FILTER = 0.15;  // px^2

mat3 turned(vec4 q) {
    vec3 a = 2.0 * q.xyz, b = a * q.w;
    vec3 xx = a * q.xyz, xy = a.xxy * q.yzz;  // 2xx 2yy 2zz, 2xy 2xz 2yz
    return mat3(1.0 - xx.y - xx.z, xy.x + b.z, xy.y - b.y,
                xy.x - b.z, 1.0 - xx.x - xx.z, xy.z + b.x,
                xy.y + b.y, xy.z - b.x, 1.0 - xx.x - xx.y);
}

void skin(uint node, float share, vec3 slope, inout vec3 p, inout mat3 f) {
    int n = int(node);
    mat3 r = turned(texelFetch(bones, ivec2(n, 1), 0));
    vec3 at = r * (mean - texelFetch(bones, ivec2(n, 2), 0).xyz)
        + texelFetch(bones, ivec2(n, 0), 0).xyz;
    p += share * at;
    f += share * r + outerProduct(at - mean, slope * steep);
}

float ramp(float value, float zero, float one) {
    float t = clamp((value - zero) / (one - zero), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

float facing(float cosine) {
    float front = is_surface ? clamp((cosine - 0.25 * (1.0 - seen.x)) / 0.25 + 1.0, 0.0, 1.0) : 1.0;
    float rim = is_edged ? ramp(abs(cosine), 0.8, 0.5) : ramp(abs(cosine), 0.42, 0.22);
    return seen.y * front + (1.0 - seen.y) * rim;
}

void main() {
    vec3 p = vec3(0.0);
    mat3 f = mat3(0.0);
    skin(nodes.x, shares.x, slope0, p, f);
    skin(nodes.y, shares.y, slope1, p, f);
    skin(nodes.z, shares.z, slope2, p, f);
    skin(nodes.w, shares.w, slope3, p, f);
    mat3 moved = turn * f;
    vec3 world = turn * p + shift;
    mat3 cov = mat3(cov_a, vec3(cov_a.y, cov_b.xy), vec3(cov_a.z, cov_b.yz));

    float zoom = camera.x * scale / world.z;
    mat3 back = transpose(moved);
    vec3 sx = cov * (back * vec3(zoom, 0.0, -zoom * world.x / world.z));
    vec3 mx = back * vec3(zoom, 0.0, -zoom * world.x / world.z);
    vec3 my = back * vec3(0.0, zoom, -zoom * world.y / world.z);
    vec3 sy = cov * my;
    float xx = dot(mx, sx), xy = dot(mx, sy), yy = dot(my, sy);
    float ridge = 1e-6 * (xx + yy) + 1e-12;
    float det = (xx + ridge) * (yy + ridge) - xy * xy;
    mat2 inverse_c = mat2(yy + ridge, -xy, -xy, xx + ridge) / det;

    // A = J0 S F^T J1^T (J1 F S F^T J1^T)^-1: what of the photo is seen around the centre.
    vec3 there = rest_turn * mean + rest_shift;
    float rest_zoom = camera.x / there.z;
    mat3 rest_back = transpose(rest_turn);
    vec3 bx = rest_back * vec3(rest_zoom, 0.0, -rest_zoom * there.x / there.z);
    vec3 by = rest_back * vec3(0.0, rest_zoom, -rest_zoom * there.y / there.z);
    vec2 ax = vec2(dot(bx, sx), dot(bx, sy)) * inverse_c;
    vec2 ay = vec2(dot(by, sx), dot(by, sy)) * inverse_c;
    vec3 bz = back * vec3(0.0, 0.0, 1.0);
    v_depth = vec3(world.z, vec2(dot(bz, sx), dot(bz, sy)) * inverse_c);

    // Where the motion stretches the photo too much its pixels would be streaks.
    float sum = dot(ax, ax) + dot(ay, ay), det_a = ax.x * ay.y - ax.y * ay.x;
    float larger = sqrt(0.5 * (sum + sqrt(max(sum * sum - 4.0 * det_a * det_a, 0.0))));
    float share = seen.x * ramp(1.0 / (scale * larger + 1e-9), 0.18, 0.40);

    mat3 away = transpose(inverse(moved));
    float cosine = -dot(normalize(away * normal), normalize(world));
    float fxx = xx + FILTER, fyy = yy + FILTER;
    float filtered = fxx * fyy - xy * xy;
    float weight = color.a * sqrt(clamp((xx * yy - xy * xy) / filtered, 0.0, 1.0)) * facing(cosine);
    v_centre = (camera.x * world.xy / world.z + camera.yz) * scale;
    v_kernel = vec4(fyy, -xy, fxx, 0.0) / filtered;
    v_kernel.w = weight;
    v_slope = vec4(ax, ay);
    v_look = vec4(u0, share, 0.0);
    v_color = color.rgb;

    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    vec2 at = (v_centre + corner * sqrt(CUTOFF * vec2(fxx, fyy))) / (size * scale) * 2.0 - 1.0;
    bool is_shown = weight > 0.002 && world.z > 0.0;
    gl_Position = is_shown ? vec4(at.x, -at.y, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
