#version 330
// The pixels of a cell become one: whether anything is left in it for the next layer.

#if LAYER > 0
#include "splat_cells.glsl"
#else
const int CELL = 16;  // px
#endif

uniform sampler2D cover;  // of this layer, see splat_resolve.frag

out float open;

void main() {
    ivec2 cell = ivec2(gl_FragCoord.xy), last = textureSize(cover, 0) - 1;
#if LAYER > 0
    if (!is_open(cell)) discard;
#endif
    open = 0.0;
    for (int y = 0; y < CELL; ++y)
        for (int x = 0; x < CELL; ++x)
            open = max(open, texelFetch(cover, min(CELL * cell + ivec2(x, y), last), 0).w);
    if (open == 0.0) discard;  // and nothing is counted
}
