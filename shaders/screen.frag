#version 330
// The canvas in the colours that the screen has to be told.

uniform sampler2D canvas;
uniform sampler3D table;  // GRID values of each channel of the photo

out vec4 color;

void main() {
    vec3 told = texelFetch(canvas, ivec2(gl_FragCoord.xy), 0).rgb;
    float grid = float(textureSize(table, 0).x);
    color = vec4(texture(table, (told * (grid - 1) + 0.5) / grid).rgb, 1);
}
