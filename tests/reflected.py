"""A textured thing on even ground that mirrors it, or does not: photos for tests."""

from __future__ import annotations

import cv2
import numpy as np
from skimage import data

from objectmorpher_core.compose.shadow.shadow import GAMMA
from tests.shadowed import FOOT, HEIGHT, MIDDLE, WIDTH, ground_of, inside


def thing() -> np.ndarray:
    """(H, W, 3) encoded, a cat's fur wherever the thing may be."""
    return cv2.resize(data.chelsea()[20:280, 60:400], (WIDTH, HEIGHT)) / 255.0


def mirrored(tilt: float = 0.0, turned: bool = True) -> np.ndarray:
    """(H, W, 4) the thing and its outline below its foot; laid there as it is if not `turned`."""
    picture = np.dstack([thing() * inside()[..., None], inside().astype(np.float64)])
    if not turned:
        moved = np.array([[1, 0, 0], [0, 1, 2 * (FOOT - MIDDLE[1])]], np.float64)
        return cv2.warpAffine(picture, moved, (WIDTH, HEIGHT))
    angle = np.radians(tilt)
    normal, foot = np.array([-np.sin(angle), np.cos(angle)]), np.array([MIDDLE[0], FOOT - 0.5])
    matrix = np.eye(2) - 2 * np.outer(normal, normal)
    shift = 2 * (foot @ normal) * normal
    return cv2.warpAffine(picture, np.column_stack([matrix, shift]), (WIDTH, HEIGHT))


def photo_with(
    laid: np.ndarray | None, strength: float = 0.4, ground: np.ndarray | None = None
) -> np.ndarray:
    """(H, W, 3) u8 of the thing on a ground, so much of whose light is what is `laid` (H, W, 4)."""
    ground = ground_of() if ground is None else ground
    if laid is not None:
        share = strength * laid[..., 3:]
        light = np.clip(ground, 0, 1) ** GAMMA * (1 - share)
        own = np.clip(laid[..., :3], 0, 1) / np.maximum(laid[..., 3:], 1e-6)
        ground = (light + share * np.clip(own, 0, 1) ** GAMMA) ** (1 / GAMMA)
    soft = cv2.GaussianBlur(inside().astype(np.float64), (0, 0), 0.7)[..., None]
    return np.rint(np.clip(soft * thing() + (1 - soft) * ground, 0, 1) * 255).astype(np.uint8)
