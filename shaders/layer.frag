#version 330
// A rendered object, px for px.

uniform sampler2D layer;  // premultiplied sRGB
uniform sampler2D blend;  // 1 shows the edit, 0 the photo
uniform vec2 cells;       // canvas px that the blend covers
uniform sampler2D photo;
uniform vec2 photo_size;  // px
uniform vec4 box;         // x0, y0, x1, y1 canvas px
uniform vec4 photo_box;   // x0, y0, x1, y1 canvas px; nothing is drawn outside
uniform float split;      // canvas px, left of which the photo is shown as it was
uniform sampler2D marks;  // share that shows the object but nothing of the photo
uniform float opacity;

uniform float saturation;
uniform vec3 gain;        // of the light at the new place
uniform sampler2D relit;  // less 1, of the light where the object turned
uniform vec4 relit_box;   // x0, y0, x1, y1 canvas px

uniform sampler2D amounts;       // of each of the bands of grain
uniform vec4 amounts_box;        // x0, y0, x1, y1 canvas px
uniform sampler2DArray grain;    // noise, a layer a band, periodic
uniform sampler2D deviations;    // of the photo's noise, by brightness
uniform vec2 corner;             // image px at the canvas's left top
uniform float zoom;              // canvas px per image px
uniform float grain_texel;       // image px

in vec2 xy;
out vec4 color;

#include "hatch.glsl"
#include "light.glsl"

#ifdef MODE  // how it is mixed with what is there
uniform sampler2D under;
#include "blend_modes.glsl"
#endif

#ifdef HAS_GRAIN
#include "grain.glsl"
#endif

void main() {
    if (xy.x < split || any(lessThan(xy, photo_box.xy)) || any(greaterThan(xy, photo_box.zw))) discard;
    vec2 at = (xy - box.xy) / (box.zw - box.xy);
    color = lit(texture(layer, at), gain);
#ifdef HAS_RELIT
    color = lit(color, vec3(1 + texture(relit, (xy - relit_box.xy) / (relit_box.zw - relit_box.xy)).r));
#endif
#ifdef HAS_GRAIN
    color = grained(color, texture(amounts, (xy - amounts_box.xy) / (amounts_box.zw - amounts_box.xy)));
#endif
    color = saturated(color, saturation);
#ifdef HAS_MARKS
#ifdef DETAIL  // of a picture drawn by the GPU: share that shows the photo, second channel
    float share = color.a - texture(marks, at).g;
#else
    float share = texture(marks, at).r;
#endif
    color.rgb = hatched(color.rgb, color.a, clamp(share / max(color.a, 1e-3), 0, 1), xy);
#endif
    color *= opacity;
#ifdef MODE
    vec3 below = texelFetch(under, ivec2(gl_FragCoord.xy), 0).rgb;
    color = vec4(mixed(below, color, MODE), 1.0);
#endif
#ifdef HAS_BLEND  // where the photo is shown, the layer shows it too, and not what lies between
    vec3 original = texture(photo, (corner + xy / zoom) / photo_size).rgb;
    color.rgb = mix(color.a * original, color.rgb, texture(blend, xy / cells).r);
#endif
}
