// Cells of 16 x 16 px: whether anything is left in them for the layer that is drawn.

uniform sampler2D left;  // a texel a cell

const int CELL = 16;  // px

bool is_open(ivec2 cell) {
    return texelFetch(left, cell, 0).r > 0.0;
}
