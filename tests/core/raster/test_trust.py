"""How far to believe a moved object: against its definition, Gaussian by Gaussian."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.raster.posed import PosedSplats, RestSplats
from objectmorpher_core.raster.trust import EDGE_ON, LIMITS, SIGNS, UNSAID, Trust, trust_in
from tests import shapes

F64 = 1e-9


@pytest.mark.parametrize("doubt", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_share_of_what_is_visible_and_was_not_shown(seed, doubt):
    splats, _ = shapes.random_splats(seed)
    lifted = replace(splats.rest.lifted, doubt=doubt)
    placement = np.eye(4)
    placement[:3, :3] = shapes.rotation(seed)
    placement[:3, 3] = (0.3, -0.2, 3.0) - placement[:3, :3] @ (0.0, 0.0, 3.0)
    rest = RestSplats(lifted, shapes.camera())
    splats = PosedSplats(rest, splats.motion, placement)
    visible = invented = astray = 0.0
    for k in np.flatnonzero(lifted.is_body):
        way, before = splats.means[k], lifted.world_points(rest.means[k : k + 1])[0]
        motion = splats.linear[k]
        normal = np.linalg.solve(motion.T, rest.normals[k])
        cosine = -normal @ way / np.linalg.norm(normal) / np.linalg.norm(way)
        if cosine <= 0:
            continue
        visible += cosine
        was = lifted.texture.visibility[k] > 0 and rest.cosines[k] >= EDGE_ON * cosine
        invented += 0.0 if was else cosine
        sight = motion @ before  # an error along it is seen as far as it is across the way now
        across = np.linalg.norm(np.cross(sight, way))
        astray += cosine * across / np.linalg.norm(sight) / np.linalg.norm(way)
    found = trust_in(splats)
    assert 0 < invented < visible
    assert found.invented == pytest.approx(invented / visible, rel=F64)
    assert found.astray == pytest.approx((doubt or UNSAID) * astray / visible, rel=F64)


def test_a_sign_begins_at_its_limit():
    below = np.nextafter(LIMITS, 0)
    shares = (0.0, below[0], LIMITS[0], below[1], LIMITS[1], 1.0)
    told = [Trust(float(share), 0.0).sign for share in shares]
    assert told == [SIGNS[k] for k in (0, 0, 1, 1, 2, 2)]
