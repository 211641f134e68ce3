"""The constants and the small formulas that make up the picture's definition.

Renderers differ in how they loop; everything that decides a colour is here or in `reference`.
The scalar functions are compiled by numba and called from `tiles`; `reference` writes the same
formulas with numpy. Kernels get the constants as an argument: compiled code on the disk keeps
the globals it was compiled with, and would not notice that they changed here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..base.kernel_files import numba

CUTOFF = 7.0  # squared Mahalanobis distance beyond which a Gaussian of a surface is 0
LAYERS = 4  # of a pixel; all that is left belongs to the last one


class Splatting(NamedTuple):
    """The rule that turns an asset's Gaussians into a picture as they were made to look.

    A Gaussian's alpha on a pixel is min(most, weight (exp(-q/2) - tail)), and 0 below `least`.
    """

    is_surface: bool  # photo-textured surface: coverage from the kernels' sum; else 1 - prod(1 - a)
    filter: float  # px^2, added to the screen covariance: the screen's own low-pass
    is_compensated: bool  # whether a Gaussian that the filter enlarges loses opacity by it
    has_colors: bool  # of its own, where the photo has shown nothing
    tail: float = 0.0  # subtracted: the kernel ends without a step
    most: float = 0.99  # alpha
    least: float = 1 / 255  # alpha
    # Whether what the photo has not shown ends with the surface, and all that it has with the
    # matte, however far they turn; else both change from the one to the other as they turn.
    # What it has not shown is nowhere seen at rest, also where it would face the camera a little.
    is_edged: bool = False


SPLATTINGS = {
    # The photo is looked up, so a filter blurs nothing; this much keeps Gaussians that are smaller
    # than a pixel from falling between pixels.
    "surface": Splatting(True, 0.15, True, False, math.exp(-CUTOFF / 2), 1e30, 0.0),
    # The same of a whole object, whose other side the photo has not seen.
    "solid": Splatting(True, 0.15, True, True, math.exp(-CUTOFF / 2), 1e30, 0.0),
    # Both with rims that are whole lines, which older shapes do not have.
    "edged surface": Splatting(
        True, 0.15, True, False, math.exp(-CUTOFF / 2), 1e30, 0.0, is_edged=True
    ),
    "edged solid": Splatting(
        True, 0.15, True, True, math.exp(-CUTOFF / 2), 1e30, 0.0, is_edged=True
    ),
    # Mip-Splatting (Yu et al. 2024), with which TRELLIS was trained
    "mip": Splatting(False, 0.1, True, True),
    # 3D Gaussian Splatting (Kerbl et al. 2023)
    "classic": Splatting(False, 0.3, False, True),
}


class Rules(NamedTuple):
    """Everything that is a number in the definition of the picture."""

    ridge: float = 1e-6  # x trace, added to the covariance before inversion
    near: float = 1e-3  # x the object's gap: nothing nearer to the camera is drawn

    # A layer begins at the sample nearest to the camera whose alpha is at least this much. What
    # lies within the gaps of it belongs to it; beyond, membership falls to 0 at `fade` x the gap.
    least_front: float = 0.01
    fade: float = 1.5

    # The kernels' sum is about 2 where the surface is whole (spacing 1, sigma 0.66).
    surface_level: float = 0.35  # kernel sum at which the surface ends
    edge_width: float = 1.0  # px, width of the antialiased edge there

    # Cosine between normal and view ray. Fronts fade until 0.25 beyond grazing, backs begin at
    # grazing: at rest every front counts fully and no back at all. The brim, which stands
    # around the silhouette of the photo and carries its soft edge, faces along the rim; it
    # counts while the rim is still the silhouette.
    facing_ramp: float = 0.25
    brim_start: float = 0.22
    brim_end: float = 0.42
    # Of edged shapes it goes on over what turns into view, and fades when it is seen edge-on.
    edged_start: float = 0.5
    edged_end: float = 0.8

    # Where the motion magnifies the photo, the matte's edge would become a translucent band:
    # below matte_start the surface's own edge takes over from the matte's, wholly at matte_end.
    matte_start: float = 0.55
    matte_end: float = 0.35

    # Where the rim has turned towards the camera it is no silhouette any more, and the matte's
    # edge would become a slit: from turned_start on the surface's own edge takes over, likewise.
    turned_start: float = 0.08  # of the cosine, more than at rest
    turned_end: float = 0.25

    # Where the rim of an edged shape turns towards the camera, a side comes into view behind it,
    # and the soft inner half of the matte's edge would be a translucent line between the two. The
    # brim shows how far the rim has turned: the more of it has, the more the matte is closed, from
    # closed_start of its alpha on, and wholly from closed_end on. Of smaller turns a rounded thing
    # has no side to show, and one that is moved by a few px keeps its soft edge.
    closing_start: float = 0.06  # of the cosine, from which on a Gaussian of the brim has turned
    closing_end: float = 0.12
    closing_share: float = 0.1  # of what shows the photo, that suffices; all the brim would fade
    closed_start: float = 0.15
    closed_end: float = 0.45

    # Where an invented picture shows the surface, too, it takes the photo's place from this ratio
    # of the cosines on: of the normal with the way to the photo's camera, to that now.
    look_aside: float = 0.4  # = streak_start: nothing of the photo has faded before
    # Of a soft matte's fringe it does so sooner: turned away from the outline, hair that the
    # background shines through would be a line of it. `Sides.zoom` is negative there.
    fringe_aside: float = 0.7

    # Stretch: smallest magnification of the photo by the motion, 1 at rest. Below streak_start
    # the photo's pixels begin to show as streaks, below streak_end they are not used.
    streak_start: float = 0.40
    streak_end: float = 0.18

    # Photo px per view px up to which the full-size photo is looked up: what aliasing that brings
    # cannot be seen, and halved copies would blur all that turns a little.
    sharp: float = 1.19

    # Px of the photo: layers that look so close together are one surface; `apart`, they are two.
    same_point: float = 1.0
    apart: float = 1.5
    visible: float = 1 / 255  # alpha of the layer whose depth and shift a pixel has
    opaque: float = 0.999  # alpha from which what lies behind is not looked at


RULES = Rules()


class PixelLimits(NamedTuple):
    """The numbers, of 32 bits, that the loops over a tile's pixels need.

    They are handed on with each Gaussian, where all rules would take longer than its pixels.
    """

    tail: np.float32  # of alpha, see `Splatting`
    most: np.float32
    least: np.float32
    least_front: np.float32
    sharp: np.float32
    per_gap: np.float32  # 1 / the gap's square, in depth, ...
    per_texture_gap: np.float32  # ... and in the photo
    end: np.float32  # so many squared gaps from its front a layer ends, ...
    fall: np.float32  # ... so steeply
    is_surface: bool
    is_edged: bool


@numba.njit(nogil=True)
def limits_of(rules, kind, gap, texture_gap):
    """`gap` world units, `texture_gap` px of the photo."""
    end = rules.fade * rules.fade
    return PixelLimits(
        np.float32(kind.tail), np.float32(kind.most), np.float32(kind.least),
        np.float32(rules.least_front), np.float32(rules.sharp), np.float32(1.0 / (gap * gap)),
        np.float32(1.0 / (texture_gap * texture_gap)), np.float32(end),
        np.float32(1.0 / (end - 1.0)), kind.is_surface, kind.is_edged,
    )  # fmt: skip


@numba.njit(cache=False, nogil=True)
def ramp(value, zero, one):
    """0 at `zero`, 1 at `one`, smooth between and constant beyond (either may be larger)."""
    t = min(max((value - zero) / (one - zero), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


@numba.njit(cache=False, nogil=True)
def facing_weight(cosine, is_seen, solidity, rules, is_surface=True, is_edged=False):
    """Weight of a Gaussian whose normal makes this cosine with the way to the camera.

    A cloud has no normals, but its soft edge has.
    """
    width, front = rules.facing_ramp, 1.0
    if is_surface:
        front = min(max((cosine - width * (1.0 - is_seen)) / width + 1.0, 0.0), 1.0)
    brim = ramp(abs(cosine), rules.brim_end, rules.brim_start)
    if is_edged:
        brim = ramp(abs(cosine), rules.edged_end, rules.edged_start)
    return solidity * front + (1.0 - solidity) * brim


@numba.njit(cache=False, nogil=True, error_model="numpy")
def coverage(total, slope, rules):
    """Share of a pixel that is inside the surface whose kernel sum is `total`; of 32 bits.

    The surface ends where the sum falls to the surface level; the sum's gradient `slope` (per
    px) says how far that is, so the edge is one pixel wide at any scale.
    """
    width = np.float32(rules.edge_width) * np.float32(slope) + np.float32(1e-6)
    edge = (np.float32(total) - np.float32(rules.surface_level)) / width
    return min(max(HALF + edge, ZERO), ONE)


# What the numbers of a Gaussian on the screen are: columns of what `projection` makes.

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
ASIDE = 28  # 1: what it shows is in an invented picture
SPAN = 32  # numbers of a row: two lines of the processor's cache
PLAIN_SPAN = 16  # of one that has no photo: one line


# Numbers of 32 bits for kernels: a plain 1.0 would make 64-bit arithmetic of what it meets.

ZERO, HALF, ONE, TWO, THREE = (np.float32(value) for value in (0, 0.5, 1, 2, 3))
INFINITE = np.float32(np.inf)
