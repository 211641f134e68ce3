#version 330
// A rendered object, px for px.

uniform sampler2D layer;  // premultiplied sRGB
uniform sampler2D blend;  // 1 shows the edit, 0 the photo
uniform vec2 cells;       // canvas px that the blend covers
uniform vec4 box;         // x0, y0, x1, y1 canvas px
uniform vec4 photo_box;   // x0, y0, x1, y1 canvas px; nothing is drawn outside
uniform float split;      // canvas px, left of which the photo is shown as it was

in vec2 xy;
out vec4 color;

void main() {
    if (xy.x < split || any(lessThan(xy, photo_box.xy)) || any(greaterThan(xy, photo_box.zw))) discard;
    color = texture(layer, (xy - box.xy) / (box.zw - box.xy)) * texture(blend, xy / cells).r;
}
