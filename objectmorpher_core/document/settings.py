"""Settings of a photo's edit: sources of the background, the joining of moved objects to the photo,
the result of a learned refiner, and how objects deform.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Literal

import numpy as np

from ..base.arrays import F32, U8, Pixels, frozen
from .bounds import MODES, MOST_BLUR, MOST_EXPOSURE, MOST_SATURATION, MOST_SHARPNESS, NORMAL

# From where the background is to be filled in, as the user says it.


@dataclass(frozen=True)
class Hint:
    """The background around `to` is to be filled in with what is around `source`."""

    source: tuple[float, float]  # x, y px of the photo
    to: tuple[float, float]
    radius: float  # px, of both places

    def __post_init__(self) -> None:
        if not self.radius > 0:
            raise ValueError(f"a hint's radius is {self.radius:g} px")

    def moved(self, dx: float, dy: float, scale: tuple[float, float] = (1.0, 1.0)) -> Hint:
        """Return the hint in px of a picture at (-dx, -dy) that is `scale` times as fine."""
        (a, b), (c, d) = self.source, self.to
        source = (a + dx) * scale[0], (b + dy) * scale[1]
        return Hint(source, ((c + dx) * scale[0], (d + dy) * scale[1]), self.radius * min(scale))


# How a moved object is joined to the photo, in numbers that the artist chooses.

MOST_SHADOW = 4.0  # x the object's height, length of its shadow
Share = Literal["harmony", "relight", "grain", "defocus"]
# Of an object that is harmonised.
USUAL_SHARES: dict[Share, float] = {"harmony": 0.8, "relight": 0.75, "grain": 1.0, "defocus": 1.0}
LEAST_FEATHER, MOST_FEATHER = 0.25, 3.0  # x the usual width of the blend


@dataclass(frozen=True)
class Shadow:
    """The soft shadow that a moved object casts on the ground below it (compose/shadow)."""

    strength: float = 0.0  # in [0, 1], of the light that it takes; 0: there is none
    direction: float = 20.0  # degrees, where it falls: 0 to the right, 90 towards the viewer
    length: float = 0.6  # x the object's height in the picture
    softness: float = 0.4  # in [0, 1]: how blurred its far end is
    contact: float = 0.7  # in [0, 1]: how dark the ground is right below the object
    colour: tuple[float, float, float] = (0.02, 0.02, 0.04)  # sRGB in [0, 1], near black
    ground: float | None = None  # degrees above it from which one looks; None: by the horizon

    def check(self) -> None:
        """Raises ValueError where a number makes no sense."""
        if self.ground is not None and not 0 <= self.ground <= 90:
            raise ValueError(f"a ground seen from {self.ground:g} degrees is not 0 to 90 above it")
        shares = {"strength": self.strength, "softness": self.softness, "contact": self.contact}
        for name, value in shares.items():
            if not 0 <= value <= 1:
                raise ValueError(f"a shadow's {name} of {value:g} is not between 0 and 1")
        if not 0 <= self.length <= MOST_SHADOW:
            raise ValueError(f"a shadow's length of {self.length:g} is not 0 to {MOST_SHADOW:g}")
        if not math.isfinite(self.direction):
            raise ValueError("a shadow's direction is not a number of degrees")
        if not all(0 <= channel <= 1 for channel in self.colour):
            raise ValueError("a shadow's colour is not between 0 and 1")


# How an object looks otherwise than in the photo, as of a layer of a paint program.

GAMMA = 2.2  # of encoded values: a stop of linear light is a factor of them
WARMTH = 0.5  # stops, by which red rises and blue falls at a warmth of 1


@dataclass(frozen=True)
class Finish:
    """The opacity, colours and sharpness of an object, as the artist wants them."""

    opacity: float = 1.0  # in [0, 1]
    exposure: float = 0.0  # stops of light
    warmth: float = 0.0  # in [-1, 1], from blue to amber
    saturation: float = 1.0  # x as far from grey, in [0, 2]
    sharpness: float = 0.0  # x the fine detail that is added to it
    blur: float = 0.0  # px of the photo, standard deviation
    blend_mode: str = NORMAL  # of MODES: how it is mixed with what lies behind it

    def check(self) -> None:
        """Raises ValueError where a number makes no sense."""
        if not 0 <= self.opacity <= 1:
            raise ValueError(f"an opacity of {self.opacity:g} is not between 0 and 1")
        if not -MOST_EXPOSURE <= self.exposure <= MOST_EXPOSURE:
            raise ValueError(
                f"an exposure of {self.exposure:g} stops is not"
                f" {-MOST_EXPOSURE:g} to {MOST_EXPOSURE:g}"
            )
        if not -1 <= self.warmth <= 1:
            raise ValueError(f"a warmth of {self.warmth:g} is not between -1 and 1")
        if not 0 <= self.saturation <= MOST_SATURATION:
            raise ValueError(
                f"a saturation of {self.saturation:g} is not between 0 and {MOST_SATURATION:g}"
            )
        if not 0 <= self.sharpness <= MOST_SHARPNESS:
            raise ValueError(
                f"a sharpness of {self.sharpness:g} is not between 0 and {MOST_SHARPNESS:g}"
            )
        if not 0 <= self.blur <= MOST_BLUR:
            raise ValueError(f"a blur of {self.blur:g} px is not between 0 and {MOST_BLUR:g}")
        if self.blend_mode not in MODES:
            raise ValueError(f"a blend mode is {self.blend_mode!r}, not one of {', '.join(MODES)}")

    @property
    def gain(self) -> tuple[float, float, float]:
        """Return the factors of encoded red, green and blue."""
        warmer = WARMTH * self.warmth
        r, g, b = (2.0 ** ((self.exposure + stops) / GAMMA) for stops in (warmer, 0.0, -warmer))
        return r, g, b


AS_IN_THE_PHOTO = Finish()


# What a learned refiner has made of an edit, as the document keeps it.


@dataclass(frozen=True, eq=False)
class Refined:
    """The edit as a learned refiner made it look, shown over the composite inside its footprint."""

    left: int  # px, crop's corner in the photo
    top: int
    pixels: Pixels  # (h, w, 3) the photo's bit depth
    alpha: U8  # (h, w) how much of the edit is seen: 0 outside the footprint
    backend: str
    seed: int = 0
    strength: float = 1.0  # in [0, 1], how much of it is shown

    def __post_init__(self) -> None:
        # What is frozen stays the same array: of another strength it is known by its identity.
        if self.pixels.flags.writeable:
            object.__setattr__(self, "pixels", frozen(self.pixels))
        if self.alpha.flags.writeable:
            object.__setattr__(self, "alpha", frozen(self.alpha, np.uint8))

    @property
    def box(self) -> tuple[int, int, int, int]:
        """x0, y0, x1, y1 px of the crop in the photo."""
        height, width = self.alpha.shape
        return self.left, self.top, self.left + width, self.top + height

    @property
    def weights(self) -> F32:
        """(h, w) in [0, 1]: how much of it is shown."""
        return self.alpha.astype(np.float32) * np.float32(self.strength / 255)


# How an object deforms, and the three materials to choose from.
#
# All the solver knows of a material is how far along the surface a control point is linked to
# others (`DeformSettings.stiffness`, x the usual reach). What that does, measured on a round bar
# (length 1, radius 0.08) whose one end is held while the other is pulled across by 0.43, and on a
# ball pulled at one point by a fifth of its diameter:
#
#     material   reach   bar's end turns   ball: largest stretch   ball: mean share that follows
#     soft       0.35    45 degrees        25 %                    0.23
#     normal     1       42 degrees        13 %                    0.25
#     rigid      2       34 degrees         5 %                    0.30
#
# A soft object gives way where it is pulled; a rigid one passes the pull on, and bends less.


@dataclass(frozen=True, eq=False)
class DeformSettings:
    """Settings of the deformation. The defaults are ours; the others serve ablations."""

    mode: str = "arap"  # or "laplacian"
    links: str = "geodesic"  # or "euclidean"
    is_faithful: bool = False  # the paper as printed: three iterations, Eq. 5
    stiffness: float = 1.0  # x the usual radius within which control points are linked
    stretch_limit: float | None = None  # x its length at rest: handles go no farther than that
    is_splitting: bool = False  # Gaussians that are stretched far become several


class Rigidity(Enum):
    """The reach of the links of each material, x the usual one."""

    RIGID = 2.0
    NORMAL = 1.0
    SOFT = 0.35


def rigidity_of(settings: DeformSettings) -> Rigidity | None:
    """The material of these settings; None for one of its own."""
    return next((r for r in Rigidity if r.value == settings.stiffness), None)


def with_rigidity(settings: DeformSettings, rigidity: Rigidity) -> DeformSettings:
    """Return the same settings for another material."""
    return replace(settings, stiffness=rigidity.value)
