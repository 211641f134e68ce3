"""The far side of a free form comes up to what is seen, at a line without the outline's waves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64, Mask
from objectmorpher_core.document.model import LiftSettings
from objectmorpher_core.lift.relief.body import BACK, FRONT, ReliefBody, closed
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from tests import shapes

SIDE, RADIUS, TUFTS, HIGH = 300, 110.0, 40, 4.0  # px; of a disc with tufts around it
EXACT = 1e-6  # px


def _tufted() -> Mask:
    y, x = np.mgrid[:SIDE, :SIDE] - 0.5 * SIDE
    return np.hypot(x, y) < RADIUS + HIGH * np.cos(TUFTS * np.arctan2(y, x))


def _slab(outline: ReliefSilhouette) -> ReliefBody:
    """As thick at its outline as anywhere."""
    body = ReliefBody.of(outline, shapes.camera(), LiftSettings(is_standing=False))
    half, one = np.full(outline.shape, 30.0), np.ones(outline.shape)
    return replace(body, front=body.front.mixed(half, one), back=body.back.mixed(half, one))


def _sheets(body: ReliefBody) -> tuple[F64, F64]:
    outline = body.silhouette
    at = outline.photo_xy(outline.cells).reshape(-1, 2)
    front, back = (body.sample(at, side)[0].reshape(outline.shape) for side in (FRONT, BACK))
    return front, back


def _waves(part: Mask) -> float:
    """How far the outermost cells to all sides are from a circle, cells."""
    y, x = np.nonzero(part)
    y, x = y - y.mean(), x - x.mean()
    way = np.floor((np.arctan2(y, x) + np.pi) * 3 * TUFTS / np.pi).astype(int)
    return float(np.std([np.hypot(x, y)[way == k].max() for k in np.unique(way)]))


def test_a_slab_with_tufts_becomes_round_behind_and_stays_in_front():
    body = _slab(ReliefSilhouette.of(_tufted()))
    outline, after = body.silhouette, closed(body)
    front, back = _sheets(after)
    assert np.abs(front - _sheets(body)[0])[outline.inside].max() < EXACT
    rim = outline.inside & (outline.depth < 1.5 * outline.cell)
    inner = outline.inside & (outline.depth > 0.1 * outline.extent)
    assert np.median((front - back)[rim]) < 0.5 * np.median((front - back)[inner])
    assert np.abs(back - _sheets(body)[1])[inner].max() < EXACT
    thick = outline.inside & (front - back > 0.5 * np.median((front - back)[inner]))
    assert _waves(thick) < 0.5 * _waves(outline.inside)


def test_what_goes_on_beyond_the_frame_does_not_close_there():
    mask = np.zeros((200, 300), bool)
    mask[60:, 80:] = True
    body = _slab(ReliefSilhouette.of(mask))
    front, back = _sheets(closed(body))
    (bottom, right), inside = np.array(mask.shape) - 1, body.silhouette.inside
    for xy in ([190.0, bottom], [right, 130.0]):
        j, i = np.rint(body.silhouette.grid_xy(np.array(xy))).astype(int)
        assert inside[i, j]
        assert front[i, j] - back[i, j] == pytest.approx(60.0, abs=EXACT)


@pytest.mark.parametrize("name", shapes.MASKS)
def test_what_is_closed_already_stays(name):
    body = ReliefBody.of(
        ReliefSilhouette.of(shapes.mask(name)), shapes.camera(), LiftSettings(is_standing=False)
    )
    before, after = _sheets(body), _sheets(closed(body))
    thick = (before[0] - before[1]).max()
    inside = body.silhouette.inside
    assert np.abs(before[0] - after[0])[inside].max() < EXACT
    assert np.mean(np.abs(before[1] - after[1])[inside]) < 0.02 * thick
