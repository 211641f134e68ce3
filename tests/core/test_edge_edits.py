"""A cleaner edge: the matte's colours less the background's, see `document/edge_edits.py`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from objectmorpher_core.document.edge_edits import decontaminated
from objectmorpher_core.document.model import EditObject, Matte, Photo
from objectmorpher_core.pictures.image import Picture
from tests import shapes


def test_the_backgrounds_colour_is_taken_out_of_the_edge_once():
    rng = np.random.default_rng(0)
    photo = Photo(Picture(np.zeros((20, 30, 3), np.uint8)), shapes.camera(30, 20), b"", "made")
    matte = Matte(3, 4, rng.random((9, 11), np.float32), rng.random((9, 11, 3), np.float32))
    spill = rng.uniform(-1, 1, matte.foreground.shape).astype(np.float32)
    plain = EditObject("made", matte=matte)
    item = replace(plain, decontaminate=0.75)
    clean = decontaminated(photo, item, spill)
    assert clean.matte is not None and clean.contaminated is matte.foreground
    exact = (matte.foreground - 0.75 * spill.astype(np.float64)).clip(0, 1)
    assert (exact == 1).any() and (exact == 0).any()
    np.testing.assert_allclose(clean.matte.foreground, exact, atol=1e-6)
    assert clean.matte.alpha is matte.alpha
    for other in (clean, plain, replace(item, matte=None)):
        assert decontaminated(photo, other, spill) is other
