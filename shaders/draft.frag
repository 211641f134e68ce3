#version 330
// A coarsely rendered object, made sharp: the map of where its pixels look in the photo is smooth,
// so the photo is sampled through it at the canvas's own resolution.

uniform sampler2D layer;  // premultiplied sRGB, coarse
uniform sampler2D looks;  // x, y photo px relative to the pixel; share that shows the photo
uniform sampler2D crop;   // straight sRGB and alpha of the object in the photo
uniform sampler2D blend;  // 1 shows the edit, 0 the photo
uniform vec2 cells;       // canvas px that the blend covers
uniform vec4 box;         // x0, y0, x1, y1 canvas px
uniform vec4 crop_box;    // x0, y0, x1, y1 image px
uniform vec2 corner;      // image px at the canvas's left top
uniform float zoom;       // canvas px per image px
uniform vec4 photo_box;   // x0, y0, x1, y1 canvas px; nothing is drawn outside
uniform float split;      // canvas px, left of which the photo is shown as it was
uniform sampler2D marks;  // share that shows the object but nothing of the photo

uniform vec3 gain;        // of the light at the new place

in vec2 xy;
out vec4 color;

#include "hatch.glsl"
#include "light.glsl"

void main() {
    if (xy.x < split || any(lessThan(xy, photo_box.xy)) || any(greaterThan(xy, photo_box.zw))) discard;
    vec2 at = (xy - box.xy) / (box.zw - box.xy);
    vec4 coarse = texture(layer, at);
    vec4 look = texture(looks, at);
    vec2 point = corner + xy / zoom + look.xy;  // image px
    vec4 texel = texture(crop, (point - crop_box.xy) / (crop_box.zw - crop_box.xy));
    float covered = clamp(2.0 * coarse.a, 0.0, 1.0);
    vec4 sharp = vec4(texel.rgb * texel.a, texel.a) * covered;
    color = lit(mix(coarse, sharp, look.z), gain);
#ifdef HAS_MARKS
    float share = clamp(texture(marks, at).r / max(coarse.a, 1e-3), 0, 1);
    color.rgb = hatched(color.rgb, color.a, share, xy);
#endif
#ifdef HAS_BLEND
    color *= texture(blend, xy / cells).r;
#endif
}
