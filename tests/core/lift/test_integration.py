"""A surface from depths and normals: exact where both are, better than either where one is not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from objectmorpher_core.lift.crop import rays
from objectmorpher_core.lift.relief.integration import integrated

SIDE = 96
TANGENTS = np.array([0.2, -0.1, 0.5], np.float32)
RAYS = rays(TANGENTS, SIDE)
AWAY = float(np.hypot(1, np.hypot(0.2, 0.1)) / 0.5)
STEP = 1 / (SIDE * AWAY)
NO_EDGE = np.zeros((SIDE, SIDE), np.float32)
DISC = cv2.circle(np.zeros((SIDE, SIDE), np.uint8), (48, 48), 40, 1, -1) > 0


def plane(normal: tuple[float, float, float], away: float = AWAY) -> tuple[np.ndarray, np.ndarray]:
    """Distances (s, s) along the rays to a plane, and its normals."""
    unit = np.array(normal) / np.linalg.norm(normal)
    middle = RAYS[SIDE // 2, SIDE // 2] * away
    distance = (middle @ unit) / (RAYS @ unit)
    return distance, np.broadcast_to(unit, RAYS.shape).astype(np.float32)


def ball() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distances to a ball, normals, and where it is."""
    centre = RAYS[SIDE // 2, SIDE // 2] * AWAY
    along = RAYS @ centre
    root = along**2 - centre @ centre + 0.35**2
    hit = root > 0.01
    distance = along - np.sqrt(np.maximum(root, 0))
    normal = (RAYS * distance[..., None] - centre) / 0.35
    return np.where(hit, distance, AWAY), normal.astype(np.float32), hit


def solved(distance, normal, error=0.03, edge=NO_EDGE, mask=DISC):
    wrong = np.full((SIDE, SIDE), error, np.float32)
    return integrated(distance, wrong, normal, edge, RAYS, mask, STEP)


@pytest.mark.parametrize("normal", [(0, 0, -1), (0.5, -0.3, -0.8), (-0.7, 0.2, -0.7)])
def test_a_plane_seen_in_perspective_stays_as_it_is(normal):
    distance, normals = plane(normal)
    assert np.abs(solved(distance, normals) - distance)[DISC].max() < 1e-5


def test_waves_in_the_depth_of_a_plane_are_smoothed_away():
    distance, normals = plane((0.4, 0.1, -0.9))
    rng = np.random.default_rng(0)
    waves = cv2.GaussianBlur(rng.normal(0, 1, (SIDE, SIDE)), (0, 0), 6)
    waves *= 0.03 / waves.std()
    found = solved(distance + waves, normals)
    before, after = (np.std((d - distance)[DISC]) for d in (distance + waves, found))
    assert after < 0.5 * before


def test_a_ball_stays_round():
    distance, normal, hit = ball()
    found = solved(distance, normal, mask=hit)
    assert np.abs(found - distance)[hit].max() < 0.004  # a hundredth of its radius


def test_two_planes_stay_apart_where_an_edge_is_and_only_there():
    near, normals = plane((0, 0, -1), AWAY - 0.3)
    far, _ = plane((0, 0, -1))
    left = np.arange(SIDE)[None, :] < SIDE // 2
    distance = np.where(left, near, far)
    edge = np.zeros((SIDE, SIDE), np.float32)
    edge[:, SIDE // 2 - 1] = 1.0
    cut = solved(distance, normals, edge=edge)
    assert np.abs(cut - distance)[DISC].max() < 1e-4
    whole = solved(distance, normals)
    assert np.abs(whole - distance)[DISC].max() > 0.05


def test_what_is_sure_of_its_depth_keeps_it():
    distance, _ = plane((0, 0, -1))
    _, wrong = plane((0.6, 0, -0.8))
    moved = [np.abs(solved(distance, wrong, error) - distance)[DISC].mean()
             for error in (1e-4, 0.01, 1.0)]  # fmt: skip
    assert moved[0] < 0.05 * moved[2] and moved[0] < moved[1] < moved[2]


def test_outside_nothing_changes():
    distance, normals = plane((0.5, 0, -0.8))
    noisy = distance + np.random.default_rng(1).normal(0, 0.05, distance.shape)
    assert (solved(noisy, normals) == noisy)[~DISC].all()
