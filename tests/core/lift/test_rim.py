"""Rims lie on the outline."""

import cv2
import numpy as np
import shapes

from objectmorpher_core.document.model import LiftSettings, Matte
from objectmorpher_core.lift.relief.body import ReliefBody
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.lift.relief.spreading import rim_lines, spread


def test_a_line_runs_on_the_outline_whichever_way_it_goes_round():
    lines = rim_lines(ReliefSilhouette.of(shapes.mask("ring", 320, 240)).inside)
    assert len(lines) == 2
    for line in lines:
        middle = line.xy.mean(0)
        radius = np.linalg.norm(line.xy - middle, axis=1)
        assert radius.std() < 0.12  # cells, of a circle
        outwards = ((line.xy - middle) * line.inward).sum(1)
        assert len({bool(side) for side in outwards > 0}) == 1


def test_a_corner_stays_one():
    inside = np.zeros((80, 100), bool)
    inside[20:60, 20:80] = True
    (line,) = rim_lines(inside)
    for corner in ([19.5, 19.5], [79.5, 59.5]):
        assert np.linalg.norm(line.xy - corner, axis=1).min() < 1.2  # cells


def test_a_straight_edge_has_no_stairs_where_the_matte_knows_it_exactly():
    corners, fine = np.array([[60, 50], [255, 72], [240, 200], [45, 178]]), 16
    drawn = cv2.fillPoly(np.zeros((240 * fine, 320 * fine), np.uint8), [corners * fine], 255)
    small = cv2.resize(drawn, (320, 240), interpolation=cv2.INTER_AREA)
    alpha = np.asarray(small, np.float32) / np.float32(255)
    body = ReliefBody.of(ReliefSilhouette.of(alpha > 0.5), shapes.camera(), LiftSettings())
    matte = Matte(0, 0, alpha, np.zeros((240, 320, 3), np.float32))
    surface, _ = spread(body, 3000, 2.0, np.random.default_rng(0), matte)
    is_wall = ~surface.is_front & ~surface.is_brim & (surface.normals[:, 2] == 0)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        way = (b - a) / np.linalg.norm(b - a)
        outward = np.array([way[1], -way[0]])
        along, beyond = (surface.xy - a) @ way, (surface.xy - a) @ outward
        there = is_wall & (np.abs(beyond) < 3) & (along > 20) & (b @ way - a @ way - along > 20)
        assert there.sum() > 10
        assert np.abs(beyond[there]).max() < 0.2  # px, of steps of one
        assert (surface.normals[there, :2] @ outward).min() > 0.995
