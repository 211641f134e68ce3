"""The shadow of a moved object: none by default, and nothing beyond the footprint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core import edits
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.shadow import cast
from objectmorpher_core.compose.silhouette import Silhouette, sampled, silhouette
from objectmorpher_core.document import Document, Placement
from objectmorpher_core.joining import Shadow
from objectmorpher_core.session_file import SessionError, decode_session, encode_session
from tests import shapes

MOVE = Placement(move=(14.0, -9.0), scale=0.7)
F32_ROUNDING = 1e-5
DARK = Shadow(strength=0.7)


def _block(width: int = 40, height: int = 60, pad: int = 4) -> Silhouette:
    alpha = np.zeros((height + 2 * pad, width + 2 * pad), np.float32)
    alpha[pad:-pad, pad:-pad] = 1
    return Silhouette(alpha, 100.0, 50.0, 1.0)


def _moved(name: str = "ellipse", placement: Placement = MOVE) -> Document:
    return edits.set_placement(shapes.scene(name).document(), 0, placement)


def test_no_strength_is_no_shadow():
    assert cast(Shadow(), _block()) is None
    assert cast(DARK, replace(_block(), alpha=np.zeros((9, 9), np.float32))) is None


@pytest.mark.parametrize("direction", [0, 60, 90, 170, -90, -30])
def test_a_shadow_falls_where_it_is_told(direction):
    shade = cast(replace(DARK, direction=direction, contact=0.0, length=1.0), _block())
    assert shade is not None
    x0, y0, x1, y1 = shade.bounds
    y, x = np.mgrid[y0:y1, x0:x1] + 0.5
    middle = np.array([(x * shade.alpha).sum(), (y * shade.alpha).sum()]) / shade.alpha.sum()
    foot = np.array([100.0 + 24, 50.0 + 64])
    towards = np.array([np.cos(np.radians(direction)), np.sin(np.radians(direction))])
    assert (middle - foot) @ towards > 5


def test_a_shadow_ends_clear_and_is_never_more_than_all():
    for softness in (0.0, 0.5, 1.0):
        shade = cast(replace(DARK, strength=1.0, softness=softness, length=2.0), _block())
        assert shade is not None
        assert shade.alpha.min() >= 0 and shade.alpha.max() <= 1
        border = (shade.alpha[0], shade.alpha[-1], shade.alpha[:, 0], shade.alpha[:, -1])
        assert not any(edge.any() for edge in border)


def test_a_stronger_shadow_is_darker_and_a_softer_one_less_steep():
    weak, strong = (cast(replace(DARK, strength=s), _block()) for s in (0.3, 0.8))
    assert weak is not None and strong is not None
    assert strong.alpha.max() > 1.5 * weak.alpha.max()
    hard, soft = (cast(replace(DARK, softness=s, contact=0.0), _block()) for s in (0.0, 1.0))
    assert hard is not None and soft is not None
    steep = [np.abs(np.diff(s.alpha, axis=1)).max() for s in (hard, soft)]
    assert steep[0] > 1.5 * steep[1]


def test_the_contact_is_right_below_the_object():
    shade = cast(replace(DARK, length=0.0, softness=0.0, strength=1.0, contact=1.0), _block())
    assert shade is not None
    row = int(np.argmax(shade.alpha.max(1))) + 0.5 + shade.top
    assert abs(row - (50 + 64)) < 6


@pytest.mark.parametrize("name", ["ellipse", "thin", "ring", "frame"])
def test_outside_the_footprint_nothing_changes_with_shadow_and_light(name):
    scene = shapes.scene(name)
    document = edits.set_shadow(_moved(name), 0, replace(DARK, length=1.5, direction=150))
    result = composite(edits.set_harmony(document, 0, 1.0), {0: scene.puppet})
    plain = composite(_moved(name), {0: scene.puppet})
    different = (result.pixels != scene.pixels).any(-1)
    assert not (different & ~result.footprint).any()
    assert result.outside_footprint_changed == 0
    assert result.footprint.sum() > plain.footprint.sum()
    assert sum(vars(result.shares).values()) == pytest.approx(1, abs=1e-6)


def test_a_shadow_only_darkens_and_never_the_object():
    scene = shapes.scene("ellipse")
    plain = composite(_moved(), {0: scene.puppet})
    shaded = composite(edits.set_shadow(_moved(), 0, DARK), {0: scene.puppet})
    change = shaded.pixels.astype(int) - plain.pixels
    filled = _moved().plate.hole  # more of which is shown in a shadow
    assert change[~filled].max() <= 1
    assert change.min() < -20
    shape = silhouette(scene.puppet.posed(None, MOVE), scene.texture, scene.camera)
    assert shape is not None
    box = (0, 0, shapes.WIDTH, shapes.HEIGHT)
    body = sampled(shape.alpha, (shape.left, shape.top), shape.pitch, box) > 0.99
    assert np.abs(change[body]).mean() < 0.5


def test_how_many_rows_are_blended_at_a_time_changes_nothing():
    document = edits.set_harmony(edits.set_shadow(_moved(), 0, DARK), 0, 1.0)
    scene = shapes.scene("ellipse")
    pictures = [composite(document, {0: scene.puppet}, rows=rows).pixels for rows in (1, 10_000)]
    assert np.array_equal(*pictures)


def test_what_has_not_moved_has_no_shadow_and_its_own_light():
    scene = shapes.scene("ellipse")
    document = edits.set_harmony(edits.set_shadow(scene.document(), 0, DARK), 0, 1.0)
    assert np.array_equal(composite(document).pixels, scene.pixels)
    hidden = edits.set_visible(document, 0, False)
    assert np.array_equal(
        composite(hidden, {0: scene.puppet}).pixels,
        composite(edits.set_visible(scene.document(), 0, False), {0: scene.puppet}).pixels,
    )


def test_a_shadow_leaves_other_objects_where_they_are():
    """An object at rest stands before another one's shadow: neither darker nor painted out."""
    scene = shapes.scene("ellipse")
    document = scene.document()
    still = replace(document.objects[0], name="still")
    document = replace(document, objects=(document.objects[0], still))
    away = Placement(move=(-60.0, 0.0), scale=0.5)
    document = edits.set_placement(document, 0, away)
    plain = composite(document, {0: scene.puppet}).pixels
    document = edits.set_shadow(document, 0, replace(DARK, direction=0, length=3.0))
    shaded = composite(document, {0: scene.puppet})
    assert shaded.outside_footprint_changed == 0
    assert (shaded.pixels != plain).any()
    assert still.matte is not None
    x0, y0, x1, y1 = still.matte.box
    is_opaque = still.matte.alpha >= 1
    own = [pixels[y0:y1, x0:x1][is_opaque] for pixels in (shaded.pixels, plain)]
    assert np.array_equal(*own)


def test_a_blend_of_one_is_the_usual_and_others_keep_to_their_footprint():
    scene = shapes.scene("star", 2000)
    document = edits.set_placement(scene.document(), 0, Placement(move=(3.0, 1.0)))
    usual = composite(document, {0: scene.puppet})
    again = composite(edits.set_feather(document, 1.0), {0: scene.puppet})
    assert np.array_equal(usual.pixels, again.pixels)
    for feather in (0.25, 3.0):
        result = composite(edits.set_feather(document, feather), {0: scene.puppet})
        assert result.outside_footprint_changed == 0
        assert (result.footprint.sum() > usual.footprint.sum()) == (feather > 1)


def test_nonsense_is_refused():
    document = shapes.scene("ellipse").document()
    for shadow in (Shadow(strength=1.2), Shadow(length=-1), Shadow(direction=np.nan)):
        with pytest.raises(edits.EditError, match="shadow"):
            edits.set_shadow(document, 0, shadow)
    with pytest.raises(edits.EditError, match="harmony of 2"):
        edits.set_harmony(document, 0, 2.0)
    with pytest.raises(edits.EditError, match=r"is not 0\.25"):
        edits.set_feather(document, 0.0)


def test_a_session_keeps_shadow_light_and_edge():
    document = edits.set_shadow(_moved(), 0, replace(DARK, direction=-40))
    document = edits.set_feather(edits.set_harmony(document, 0, 0.5), 2.0)
    loaded = decode_session(encode_session(document))
    assert loaded.objects[0].shadow == document.objects[0].shadow
    assert loaded.objects[0].harmony == 0.5 and loaded.feather == 2.0
    with pytest.raises(SessionError, match="times as wide"):
        decode_session(encode_session(replace(document, feather=9.0)))
