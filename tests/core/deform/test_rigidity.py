"""Soft, normal, rigid: the same pull bends and stretches the one more than the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from objectmorpher_core.deform.deformer import Deformer
from objectmorpher_core.document.model import Handle, LiftedObject
from objectmorpher_core.document.settings import (
    DeformSettings,
    Rigidity,
    rigidity_of,
    with_rigidity,
)
from tests import shapes

SOFT_TO_RIGID = (Rigidity.SOFT, Rigidity.NORMAL, Rigidity.RIGID)


def _handle(lifted: LiftedObject, at, move=(0.0, 0.0, 0.0), turn=None) -> Handle:
    means = lifted.gaussians.means.astype(np.float64)
    point = means[((means - at) ** 2).sum(1).argmin()]
    node = int(((lifted.control_points - point) ** 2).sum(1).argmin())
    return Handle(node, point, point + np.array(move), turn=turn)


def test_a_rigid_bar_bends_less_than_a_soft_one():
    bar = shapes.capsule()
    lifted = shapes.lifted_surface(bar.points, bar.normals)
    turns = []
    for material in SOFT_TO_RIGID:
        deformer = Deformer(lifted, with_rigidity(DeformSettings(), material))
        held = _handle(lifted, (-0.5, 0, 0), turn=np.zeros(3))
        pose = deformer.solve((held, _handle(lifted, (0.5, 0, 0), (-0.15, 0.4, 0.0)))).pose
        r = pose.rotations[deformer.points[:, 0] > 0.4]
        turns.append(float(np.degrees(np.arctan2(r[:, 1, 0], r[:, 0, 0])).mean()))
    assert turns[0] > turns[1] + 2, turns
    assert turns[1] > turns[2] + 5, turns


def test_a_rigid_ball_passes_a_pull_on_and_a_soft_one_stretches():
    points = shapes.ball(4000)
    lifted = shapes.lifted_surface(points, 2 * points)
    stretches, shares = [], []
    for material in SOFT_TO_RIGID:
        deformer = Deformer(lifted, with_rigidity(DeformSettings(), material))
        still = ((0, 0, -0.5), (0.5, 0, -0.1), (-0.5, 0, -0.1))
        pulled = _handle(lifted, (0, 0, 0.5), (0, 0, 0.2))
        pose = deformer.solve((pulled, *(_handle(lifted, at) for at in still))).pose
        stretches.append(float(deformer.strain(pose).most.max()) - 1)
        moves = np.linalg.norm(pose.points - deformer.points, axis=1)
        shares.append(float(moves.mean()) / 0.2)
    assert stretches[0] > 1.5 * stretches[1] > 1.5 * 1.5 * stretches[2]
    assert shares[0] < shares[1] < shares[2]


def test_settings_name_their_material_or_none():
    for material in Rigidity:
        assert rigidity_of(with_rigidity(DeformSettings(), material)) is material
    assert rigidity_of(DeformSettings()) is Rigidity.NORMAL
    assert rigidity_of(replace(DeformSettings(), stiffness=1.3)) is None
