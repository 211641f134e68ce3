#version 330
// The photo, the plate over it, and what the selection says about it. What a scene lacks is not
// looked up: HAS_PLATE, HAS_MASK, HAS_BLEND, HAS_PAPER.

uniform sampler2D photo;
uniform sampler2D plate;
uniform sampler2D mask;
uniform sampler2D blend;  // 1 shows the edit, 0 the photo
uniform vec2 cells;       // canvas px that the blend covers
uniform vec2 corner;      // image px at the canvas's left top
uniform float zoom;       // canvas px per image px
uniform vec2 photo_size;  // px
uniform vec4 plate_box;   // x0, y0, x1, y1 image px; empty where there is no plate
uniform float split;      // canvas px, left of which the photo is shown as it was
uniform vec3 surround;    // sRGB
uniform float veil;       // share of black over what is outside the mask
uniform float hatch;      // share of the hatching over the mask
uniform vec3 paper;       // sRGB, instead of the photo
uniform vec3 checked;     // sRGB, of every other square

in vec2 xy;
out vec4 color;

#include "hatch.glsl"

// 1 inside a box, 0 outside, a ramp of one canvas px along its border.
float inside(vec2 point, vec4 bounds) {
    vec2 depth = min(point - bounds.xy, bounds.zw - point) * zoom;
    return clamp(min(depth.x, depth.y) + 0.5, 0.0, 1.0);
}

// Squares of 8 points, which move with the photo.
vec3 checker(vec2 point) {
    vec2 square = floor(point * zoom / (8.0 * unit));
    return mod(square.x + square.y, 2.0) < 1.0 ? paper : checked;
}

void main() {
    vec2 point = corner + xy / zoom;  // image px
#ifdef HAS_PAPER
    vec3 picture = checker(point);
#else
    vec3 picture = texture(photo, point / photo_size).rgb;
#endif
#ifdef HAS_BLEND
    float edited = texture(blend, xy / cells).r;
#else
    float edited = 1.0;
#endif
#ifdef HAS_PLATE
    vec2 in_plate = (point - plate_box.xy) / (plate_box.zw - plate_box.xy);
    if (all(greaterThan(in_plate, vec2(0))) && all(lessThan(in_plate, vec2(1)))) {
        picture = mix(picture, texture(plate, in_plate).rgb, edited);
    }
#endif
#ifdef HAS_MASK
    float meant = texture(mask, point / photo_size).r;
    picture = mix(picture, vec3(0), veil * (1.0 - meant));
    picture = hatched(picture, 1.0, hatch * meant * edited, xy);
#endif
    if (xy.x < split) picture = texture(photo, point / photo_size).rgb;
    color = vec4(mix(surround, picture, inside(point, vec4(0, 0, photo_size))), 1);
}
