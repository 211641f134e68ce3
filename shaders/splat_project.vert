#version 330
// One Gaussian onto the screen: the motion, EWA projection and the map into the photo, once per
// Gaussian (raster/projection.py, whose names these are). Captured by transform feedback.
//
// 32 bits are enough because nothing is computed as a difference of large numbers: the motion is
// one from the rest, and the covariance is kept as a factor `root` with Sigma = root root^T, so
// that determinants are lengths of cross products.
//
// IS_PLAIN: nothing is computed but what a plain colour needs.

in vec4 place;   // xyz object frame, opacity
in vec4 quat;    // wxyz
in vec4 size;    // standard deviations, object units; cosine of the normal at rest
in vec3 normal;  // object frame
in vec3 look;    // u0 minus where the mean is seen at rest, photo px; solidity
in vec4 paint;   // colour; zoom, px per world unit at rest
in float visibility;
in vec3 side0;   // px per unit of the object at rest, of an invented picture: across,
in vec3 side1;   // and down
in vec3 aside;   // `look` there; its zoom, 0: there is none

#include "MOTION"

uniform mat3 rest_linear;   // world from object, at rest
uniform vec3 rest_offset;
uniform mat3 linear;        // of the placed object
uniform mat3 turn;          // what the placement adds to `rest_linear`
uniform vec3 slide;         // and to `rest_offset`
uniform float scale;        // of the placement
uniform float nearest;      // world units, nothing nearer to the camera is drawn
uniform vec3 view;          // focal, cx, cy of the view, px
uniform float photo_focal;  // px
uniform vec2 limits;        // |x / z| and |y / z|, see posed.view_limits

uniform bool has_sides;     // invented pictures; else the attributes above are none
uniform float look_aside;   // rules.Rules
uniform float fringe_aside;
uniform bool is_surface;    // rules.Splatting
uniform float low_pass;     // its `filter`, a word that GLSL keeps for itself
uniform bool is_compensated;
uniform bool has_colors;
uniform bool is_edged;
uniform bool is_layered;    // see PosedSplats
uniform float tail;
uniform float least;
uniform float ridge;        // rules.Rules
uniform float least_front;
uniform float facing_ramp;
uniform float brim_start;
uniform float brim_end;
uniform float edged_start;
uniform float edged_end;
uniform float matte_start;
uniform float matte_end;
uniform float turned_start;
uniform float turned_end;
uniform float closing_start;
uniform float closing_end;
uniform float streak_start;
uniform float streak_end;
uniform float sharp;

out vec4 p_centre;  // CX, CY, QXX, TILT
out vec4 p_kernel;  // RYY, WEIGHT, CUT, FRONT
out vec4 p_axes;    // view px, the half-axes of the ellipse outside which alpha is 0
out vec4 p_color;   // RED, GREEN, BLUE, how much is not SEEN
#ifndef IS_PLAIN
out vec4 p_depth;   // Z, ZX, ZY, what MAGNIFIED / sharp is more than 1
out vec4 p_shift;   // SX, SY, PHOTO, BODY
out vec4 p_slope;   // AXX, AXY, AYX, AYY
out vec3 p_edge;    // how much is not MATTED, SOLID of that; ASIDE
#endif

float ramp(float value, float zero, float one) {
    float t = clamp((value - zero) / (one - zero), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

// Sigma = root root^T at rest, object frame.
mat3 covariance_root() {
    float w = quat.x, x = quat.y, y = quat.z, z = quat.w;
    return mat3(
        size.x * vec3(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        size.y * vec3(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        size.z * vec3(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))
    );
}

// Cosine of the moved normal with the way to the camera. Normals move by cofactors.
float facing(mat3 f, vec3 at) {
    mat3 cofactors = mat3(cross(f[1], f[2]), cross(f[2], f[0]), cross(f[0], f[1]));
    vec3 moved = cofactors * normal;
    moved *= dot(f[0], cofactors[0]) >= 0.0 ? 1.0 : -1.0;
    vec3 way = at * linear;
    return -dot(moved, way) / max(length(moved) * length(way), 1e-30);
}

// The ellipse q <= cut of the covariance (xx, xy, yy) with this determinant.
vec4 axes(vec3 covariance, float det, float cut) {
    float mean = 0.5 * (covariance.x + covariance.z), lean = 0.5 * (covariance.x - covariance.z);
    float radius = length(vec2(lean, covariance.y));
    vec2 along = lean >= 0.0 ? vec2(radius + lean, covariance.y) : vec2(covariance.y, radius - lean);
    along = radius > 0.0 ? normalize(along) : vec2(1.0, 0.0);
    float larger = mean + radius;
    // a little more, so that no pixel on the brink is lost by rounding
    vec2 lengths = sqrt(cut * vec2(larger, det / larger)) + 0.02;
    return vec4(lengths.x * along, lengths.y * vec2(-along.y, along.x));
}

void main() {
    float opacity = place.w, seen = visibility, zoom = paint.w;
    // where it is now, and how its surroundings have moved
    vec3 shift;
    mat3 grown;
    move(place.xyz, shift, grown);
    mat3 f = mat3(1.0) + grown;
    vec3 rest = rest_linear * place.xyz + rest_offset;
    vec3 way = turn * place.xyz + slide + linear * shift;
    vec3 at = rest + way;
    mat3 motion = transpose(linear * f), change = transpose(turn * f + rest_linear * grown);
    mat3 rest_rows = transpose(rest_linear);

    // J1 = j [[1, 0, -side.x], [0, 1, -side.y]]; the rows of J1 W F root
    float j = view.x / at.z;
    vec2 straight = at.xy / at.z, limit = is_surface ? vec2(1e30) : limits;
    vec2 side = clamp(straight, -limit, limit);
    mat3 root = covariance_root();
    vec3 g0 = j * (motion[0] - side.x * motion[2]) * root;
    vec3 g1 = j * (motion[1] - side.y * motion[2]) * root;
    vec3 across = cross(g0, g1);
    float sxx = dot(g0, g0), sxy = dot(g0, g1), syy = dot(g1, g1), area = dot(across, across);
    float fdet = area + low_pass * (sxx + syy) + low_pass * low_pass;
    float fxx = sxx + low_pass, fyy = syy + low_pass;
    float weight = opacity * (is_compensated ? sqrt(area / fdet) : 1.0), both = 1.0;

#ifndef IS_PLAIN
    float extra = ridge * (sxx + syy) + 1e-12;
    float det = area + extra * (sxx + syy) + extra * extra;
    vec3 k0 = (cross(g1, across) + extra * g0) / det, k1 = (cross(across, g0) + extra * g1) / det;

    // A - ratio = (J0 W - ratio J1 W F) Sigma (J1 W F)^T (...)^-1, ratio = photo_focal / view.x
    float ratio = photo_focal / view.x, nearer = way.z / (rest.z * at.z);
    vec2 before = rest.xy / rest.z, sideways = (way.xy - before * way.z) / at.z;
    vec2 turned = before * nearer - (sideways + side - straight) / at.z;
    vec3 d0 = nearer * rest_rows[0] - turned.x * rest_rows[2] - (change[0] - side.x * change[2]) / at.z;
    vec3 d1 = nearer * rest_rows[1] - turned.y * rest_rows[2] - (change[1] - side.y * change[2]) / at.z;
    vec3 h0 = photo_focal * d0 * root, h1 = photo_focal * d1 * root;
    float cosine = facing(f, at), turn = cosine - size.w;
    float least_aside = aside.z < 0.0 ? fringe_aside : look_aside;
    bool is_aside = has_sides && aside.z != 0.0 && size.w < least_aside * cosine;
    vec2 looks = look.xy;
    if (is_aside) {
        h0 = side0 * root - ratio * g0;
        h1 = side1 * root - ratio * g1;
        looks = aside.xy;
        zoom = abs(aside.z);
    }
    float own = ratio * extra / det;
    float axx = dot(h0, k0) - own * (syy + extra), axy = dot(h0, k1) + own * sxy;
    float ayx = dot(h1, k0) + own * sxy, ayy = dot(h1, k1) - own * (sxx + extra);

    // the singular values of A
    float round_part = length(vec2(axx + ayy + 2.0 * ratio, ayx - axy));
    float flat_part = length(vec2(axx - ayy, axy + ayx));
    float largest = 0.5 * (round_part + flat_part), smallest = 0.5 * abs(round_part - flat_part);
    float volume = abs(dot(f[0], cross(f[1], f[2])));
    float stretch = smallest * j / zoom * pow(volume, 1.0 / 3.0) * scale;

    // the rules that decide weights and shares
    float solidity = is_layered ? look.z : 1.0;  // no brim where no photo is carried
    if (is_edged && seen == 0.0) cosine = min(cosine, turn);
    float photo = ramp(stretch, streak_end, streak_start);
    float front = 1.0, brim = ramp(abs(cosine), brim_end, brim_start);
    if (is_edged) brim = ramp(abs(cosine), edged_end, edged_start);
    if (is_surface)
        front = clamp((cosine - facing_ramp * (1.0 - seen)) / facing_ramp + 1.0, 0.0, 1.0);
    weight *= solidity * front + (1.0 - solidity) * brim;
    float matted = ramp(stretch, matte_end, matte_start);
    if (is_edged)
        matted *= seen * (solidity + (1.0 - solidity) * ramp(turn, closing_end, closing_start));
    else
        matted *= ramp(turn, turned_end, turned_start);
    if (is_aside) {
        matted = seen = 0.0;
    } else if (has_colors) {
        photo *= seen;
        seen = 1.0;
    }
    float body = (1.0 - photo) * solidity;
    both = photo + body;
    vec3 along_depth = motion[2] * root;
    p_depth = vec4(at.z, dot(along_depth, k0), dot(along_depth, k1), max(largest / sharp - 1.0, 0.0));
    p_shift = vec4(looks - photo_focal * sideways, photo, body);
    p_slope = vec4(axx, axy, ayx, ayy);
    p_edge = vec3(1.0 - matted, solidity, is_aside ? 1.0 : 0.0);
#else
    seen = 1.0;
#endif

    float ends = tail + least / max(weight, 1e-30);
    bool is_there = at.z > nearest && weight * both > 0.0 && ends < 1.0 && weight < 1e30;
    float cut = is_there ? -2.0 * log(ends) : 0.0;
    float first = tail + max(least_front / (weight * both), least / weight);

    p_centre = vec4(view.x * straight + view.yz, fyy / fdet, -sxy / fyy);
    p_kernel = vec4(1.0 / fyy, is_there ? weight : 0.0, cut, first < 1.0 ? -2.0 * log(first) : -1.0);
    p_axes = axes(vec3(fxx, sxy, fyy), fdet, cut);
    p_color = vec4(paint.rgb, 1.0 - seen);
    if (!is_there || any(isnan(p_centre)) || any(isinf(p_centre)) || any(isnan(p_axes)))
        p_kernel = vec4(1.0, 0.0, 0.0, -1.0);
}
