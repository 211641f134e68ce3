"""A thing that stands on even ground, with or without a shadow: photos for tests."""

from __future__ import annotations

import cv2
import numpy as np

from objectmorpher_core.compose.shadow.shadow import GAMMA

WIDTH, HEIGHT = 260, 200  # px
MIDDLE, RADII = (130.0, 90.0), (30.0, 42.0)  # px, of a thing that stands
FOOT = MIDDLE[1] + RADII[1]
GROUND = 30.0  # degrees, from which it is seen
DARK = 0.6  # of the light, that the shadow takes


def inside() -> np.ndarray:
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    x, y = np.abs(x - MIDDLE[0]) / RADII[0], (y - MIDDLE[1]) / RADII[1]
    return (x < 1) & (np.abs(y) < 1) & (y > 2 * x - 2)  # upright, its shoulders cut


def thrown(direction: float, length: float) -> np.ndarray:
    """(H, W) in [0, 1]: the outline, sheared along the ground about its foot, and blurred."""
    angle = np.radians(direction)
    across, down = length * np.cos(angle), np.sin(np.radians(GROUND)) * length * np.sin(angle)
    # (x, y) of the thing, h = FOOT - y above the ground -> (x + across h, FOOT + down h)
    matrix = np.array([[1, -across, across * FOOT], [0, -down, FOOT + down * FOOT]])
    drawn = cv2.warpAffine(inside().astype(np.float32), matrix, (WIDTH, HEIGHT))
    return cv2.GaussianBlur(drawn, (0, 0), 3.0)


def ground_of(seed: int = 0) -> np.ndarray:
    """(H, W, 3) encoded, lit from one side, with grain."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-1, 1, WIDTH), np.linspace(-1, 1, HEIGHT))
    light = 0.6 + 0.08 * x + 0.1 * y
    grain = cv2.GaussianBlur(rng.normal(size=(HEIGHT, WIDTH)), (0, 0), 1.0)
    lit = light + 0.03 * grain / grain.std()
    return np.clip(lit[..., None] * np.array([1.0, 0.9, 0.75]), 0, 1)


def photo_of(
    shadow: np.ndarray | None, ground: np.ndarray | None = None, dark: float = DARK
) -> np.ndarray:
    """(H, W, 3) u8 of a thing on the ground with a shadow (H, W), that takes so much light."""
    ground = ground_of() if ground is None else ground
    if shadow is not None:
        ground = ground * (1 - dark * shadow[..., None]) ** (1 / GAMMA)
    soft = cv2.GaussianBlur(inside().astype(np.float64), (0, 0), 0.7)[..., None]
    thing = np.array([0.2, 0.45, 0.75])
    return np.rint((soft * thing + (1 - soft) * ground) * 255).astype(np.uint8)
