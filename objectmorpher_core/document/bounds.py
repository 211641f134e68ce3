"""The values that an artist may choose among: names, and the ends of ranges. Imports nothing."""

from __future__ import annotations

# Of a shape.
BACKS = ("auto", "mirrored", "continued")  # what the side looks like that the photo does not show
KINDS = ("auto", "free", "round", "flat", "box", "tube")  # see lift.shapes
LEAST_THICKNESS, MOST_THICKNESS = 0.05, 3.0  # x what the silhouette says

# Of a look.
MOST_EXPOSURE = 3.0  # stops, up or down
MOST_SATURATION = 2.0
MOST_SHARPNESS = 3.0
MOST_BLUR = 50.0  # px
NORMAL, MULTIPLY, SCREEN, SOFT_LIGHT = MODES = ("normal", "multiply", "screen", "soft light")
MOST_VIEWS = 3  # further photos of an object
