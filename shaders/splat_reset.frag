#version 330
// Empties what a later layer is going to draw into: its front, or its sums and pixels.

#ifdef IS_FRONT
out vec4 front;

void main() {
    front = vec4(1e30, 0.0, 0.0, 0.0);
    gl_FragDepth = 1.0;
}
#else
layout(location = 0) out vec4 sum_cover;
layout(location = 1) out vec4 sum_place;
layout(location = 2) out vec4 sum_photo;
layout(location = 3) out vec4 sum_color;
layout(location = 4) out vec4 sum_left;
layout(location = 5) out vec4 look;
layout(location = 6) out vec4 cover;

void main() {
    sum_cover = sum_place = sum_photo = sum_color = sum_left = look = cover = vec4(0.0);
}
#endif
