"""What the numbers of a Gaussian on the screen are: columns of what `projection` makes."""

from __future__ import annotations

# Columns of a projected Gaussian: its place and shape, ...
CX, CY = 0, 1  # view px
QXX = 2  # of the inverse of the filtered screen covariance C; q = QXX e^2 + RYY dy^2
TILT = 3  # e = dx + TILT dy: so written, q keeps its digits however thin the Gaussian
RYY = 4  # 1 / Cyy
CUT = 5  # q beyond which alpha is 0
EX, EY = 6, 7  # view px, half-size of the box that holds what is left
WEIGHT = 8  # of alpha
RED, GREEN, BLUE = 9, 10, 11
Z, ZX, ZY = 12, 13, 14  # depth, and its slope per px
# ... and what it shows of the photo.
SX, SY = 15, 16  # photo px, from the pixel to where it looks
AXX, AXY, AYX, AYY = 17, 18, 19, 20  # slope of that
MAGNIFIED = 21  # photo px per view px, the larger
PHOTO, BODY = 22, 23  # shares of alpha that show the photo, and its own colour
SEEN, MATTED, SOLID = 24, 25, 26
FRONT = 27  # q up to which it can be a layer's front
SPAN = 32  # numbers of a row: two lines of the processor's cache
PLAIN_SPAN = 16  # of one that has no photo: one line
