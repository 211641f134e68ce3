"""A line drawn across the picture parts what is left of it from what is right of it."""

from __future__ import annotations

import numpy as np

from objectmorpher.editor.intents.rigging import sides_of_cut
from objectmorpher_core.deform.deformer import Deformer
from objectmorpher_core.document.rig import Rig, Seam
from objectmorpher_core.document.settings import DeformSettings
from tests import shapes

BAR = shapes.capsule()
LIFTED = shapes.lifted_surface(BAR.points, BAR.normals)


def _pairs(deformer: Deformer) -> np.ndarray:
    links = deformer.graph.weights.tocoo()
    return np.column_stack([links.row, links.col])


def test_a_line_across_a_bar_makes_two_of_it() -> None:
    whole = Deformer(LIFTED, DeformSettings())
    picture = whole.points[:, :2]
    line = np.array([[0.01, -0.3], [0.03, 0.0], [-0.01, 0.3]])
    first, second = sides_of_cut(_pairs(whole), picture, line)
    assert picture[second, 0].max() < 0.04 and picture[first, 0].min() > -0.02
    parted = Deformer(LIFTED, DeformSettings(), Rig(seams=(Seam(first, second),)))
    assert parted.graph.component_count == 2


def test_a_line_beside_the_bar_cuts_nothing() -> None:
    whole = Deformer(LIFTED, DeformSettings())
    line = np.array([[-0.3, 0.2], [0.3, 0.2]])
    first, second = sides_of_cut(_pairs(whole), whole.points[:, :2], line)
    assert len(first) == len(second) == 0


def test_a_slit_leaves_the_part_in_one() -> None:
    whole = Deformer(LIFTED, DeformSettings())
    line = np.array([[-0.25, 0.0], [0.1, 0.0]])
    first, second = sides_of_cut(_pairs(whole), whole.points[:, :2], line)
    assert len(first) and len(second)
    slit = Deformer(LIFTED, DeformSettings(), Rig(seams=(Seam(first, second),)))
    assert slit.graph.component_count == 1
