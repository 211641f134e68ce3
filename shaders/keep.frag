#version 330
// The photo over the edit, where the edit changed nothing.

uniform sampler2D photo;
uniform sampler2D blend;  // 1 shows the edit, 0 the photo
uniform vec2 corner;      // image px at the canvas's left top
uniform float zoom;       // canvas px per image px
uniform vec2 photo_size;  // px
uniform vec2 cells;       // canvas px that the blend covers

in vec2 xy;
out vec4 color;

void main() {
    vec2 point = (corner + xy / zoom) / photo_size;
    if (any(lessThan(point, vec2(0))) || any(greaterThan(point, vec2(1)))) discard;
    float kept = 1.0 - texture(blend, xy / cells).r;
    color = vec4(texture(photo, point).rgb * kept, kept);
}
