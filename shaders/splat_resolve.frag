#version 330
// A layer's sums become colour and alpha, the photo is looked up once per pixel, and the layer
// is put behind those that are there (reference.py: _Composite; raster/compositing.py).

#include "splat_photo.glsl"

uniform sampler2D sum_cover;  // see splat_sum.frag
uniform sampler2D sum_place;
uniform sampler2D sum_photo;
uniform sampler2D sum_color;
uniform sampler2D sum_left;
#if LAYER > 0
uniform sampler2D look_before;   // what the layer before has written
uniform sampler2D cover_before;
#endif

uniform vec3 unmoved;            // crop px = x * gl_FragCoord + yz, of what has not moved
uniform vec4 photo_box;          // crop px, the photo: elsewhere it is made up
uniform float surface_level;     // rules.Rules
uniform float edge_width;
uniform float closing_share;
uniform float closed_start;
uniform float closed_end;
uniform float same_point;
uniform float apart;
uniform float visible;
uniform float opaque;
uniform float least_front;
uniform bool is_edged;           // rules.Splatting

layout(location = 0) out vec4 color;   // added up: premultiplied
layout(location = 1) out vec4 detail;  // added up: the first visible layer's depth, shift (zw)
layout(location = 2) out vec4 median;  // added up: with which alpha reaches a half: the same
layout(location = 3) out vec4 look;    // of this layer: shift, share of the photo itself, coverage
layout(location = 4) out vec4 cover;   // clear before, alpha, has_depth, whether more may follow

const float HALF = 0.5;  // reference.py: MEDIAN

float ramp(float value, float zero, float one) {
    float t = clamp((value - zero) / (one - zero), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

float coverage(float total, vec2 slope) {
    return clamp(0.5 + (total - surface_level) / (edge_width * length(slope) + 1e-6), 0.0, 1.0);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 covers = texelFetch(sum_cover, pixel, 0);
    vec4 sides = texelFetch(sum_left, pixel, 0);  // r: left; share aside, and its shift
    float total = covers.x, body = covers.y, left = sides.r;
    if (total <= 0.0) discard;
#ifdef IS_LAST
    if (left == 0.0) discard;  // tails only
#endif
    vec4 places = texelFetch(sum_place, pixel, 0), photos = texelFetch(sum_photo, pixel, 0);
    vec4 colors = texelFetch(sum_color, pixel, 0);

    // what the photo shows
    float shown = max(total - body, 0.0);
    bool is_photo = shown > 1e-6 * total;
    shown = is_photo ? shown : 0.0;
    float inverse = is_photo ? 1.0 / shown : 0.0;
    float own = max(shown - sides.y, 0.0), aside = sides.y * inverse;
    bool is_own = own > 1e-6 * total, is_aside = aside > 1e-6;
    vec2 shift = is_own ? vec2(places.w, photos.x) / own : vec2(0.0);
    vec2 unshifted = unmoved.x * gl_FragCoord.xy + unmoved.yz, at = unshifted + shift;
    vec4 texel = vec4(0.0);
    if (is_own) texel = sample_photo(at, 1.0 + photos.y * inverse);
    float seen = is_own && all(greaterThan(at, photo_box.xy)) && all(lessThan(at, photo_box.zw)) ? 1.0 : 0.0;
    seen *= max(1.0 - photos.z * inverse, 0.0);
    float matted = max(1.0 - photos.w * inverse, 0.0), solids = colors.a * inverse;
    float matte = texel.a * matted + solids;
    if (is_edged) {  // rules.py: closing_end
        float turned = clamp((1.0 - matted - solids) / closing_share, 0.0, 1.0);
        matte = mix(matte, 1.0, turned * ramp(texel.a, closed_start, closed_end));
    }
    matte = is_photo ? matte : 0.0;
    if (is_aside) {  // whole, and the photo counts as far as the matte has something of it
        vec2 there = sides.zw / sides.y;
        vec3 invented = sample_photo(unshifted + there, 1.0 + photos.y * inverse).rgb;
        float share = is_own ? min(aside / max(matte, 1e-30), 1.0) : 1.0;
        texel.rgb = mix(texel.rgb, invented, share);
        seen *= min((1.0 - share) / max(1.0 - aside, 1e-6), 1.0);
        if (!is_own) shift = there;
    }

    // the layer's alpha and colour
#ifdef IS_SURFACE
    float whole = coverage(total, covers.zw), solid = coverage(body + (is_edged ? colors.a : 0.0), places.xy);
#else
    float whole = 1.0 - exp(covers.z), solid = 1.0 - exp(covers.w);
#endif
    float alpha = mix(solid, whole, matte);
    float share = shown / total * max(1.0 - aside, 0.0);
    shown *= matte;
    float weight = 1.0 / max(shown + body, 1e-30);
    vec3 mixed = (shown * texel.rgb + colors.rgb) * weight;

    // behind the layers before
#if LAYER > 0
    vec4 before = texelFetch(look_before, pixel, 0), covered = texelFetch(cover_before, pixel, 0);
#else
    vec4 before = vec4(0.0), covered = vec4(0.0);
#endif
    float clear = 1.0 - covered.y;
    float same = ramp(distance(shift, before.xy), apart, same_point) * share * before.z;
    float through = min(mix(clear * alpha, covered.x * (1.0 - before.w) * alpha, same), clear);
    bool is_first = covered.z == 0.0 && alpha > visible;
    float sum = covered.y + through;
    color = vec4(mixed, 1.0) * through;
    detail = vec4(0.0, through * seen * shown * weight, 0.0, 0.0);  // y: from_photo
    if (is_first) detail += vec4(places.z / total, 0.0, shift);
    bool is_half = covered.y < HALF && sum >= HALF;
    median = is_half ? vec4(places.z / total, is_photo ? 1.0 : 0.0, shift) : vec4(0.0);
    look = vec4(shift, share, 1.0 - (1.0 - same * before.w) * (1.0 - whole));
    cover = vec4(mix(clear, covered.x, same), sum, is_first ? 1.0 : covered.z, 0.0);
    cover.w = sum <= opaque && left >= 0.99 * least_front ? 1.0 : 0.0;
}
