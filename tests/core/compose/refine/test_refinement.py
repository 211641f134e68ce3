"""A refinement is seen inside the footprint only, is kept, and goes with what it showed."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.progress import silent
from objectmorpher_core.compose import refine
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.layers import REFINEMENT, layers
from objectmorpher_core.compose.refine import RefineError, refinement
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Placement
from objectmorpher_core.document.settings import Shadow
from objectmorpher_core.scripting.runner import coarse_edit
from objectmorpher_core.session.file import decode_session, encode_session
from tests import shapes


class Dimming:
    """Darkens what was edited, and makes all of the picture a little redder, as a network would."""

    name = "dimming"

    def __init__(self, shift: int = 0) -> None:
        self._shift = shift

    def missing(self) -> str | None:
        return None

    def refine(self, original, coarse, object_alpha, progress, seed=0):
        made = coarse * (1 - 0.25 * object_alpha[..., None]) + np.array([6.0, 0.0, -4.0]) - seed
        made = np.clip(np.rint(made), 0, 255).astype(np.uint8)
        if self._shift:  # one half of it, which no shift of the whole undoes
            half = len(made) // 2
            made[half:] = np.roll(made[half:], self._shift, axis=1)
        return made


def edited():
    document = shapes.scene("ellipse").document()
    return edits.set_placement(document, 0, Placement(move=(12.0, -5.0)))


def refined(document, strength=1.0, seed=0):
    made = refinement.refine(coarse_edit(document), Dimming(), silent, seed, strength)
    return edits.set_refined(document, made)


def test_it_changes_the_footprint_and_no_pixel_outside():
    bare = edited()
    before, after = composite(bare), composite(refined(bare))
    outside = ~before.footprint
    assert np.array_equal(after.pixels[outside], bare.photo.pixels[outside])
    assert after.outside_footprint_changed == 0
    assert not np.array_equal(after.pixels, before.pixels)
    shares = after.shares
    total = shares.from_photo + shares.from_lifter + shares.from_inpainter + shares.from_refiner
    assert abs(total - 1) < 1e-6 and shares.from_refiner > 0.5


def test_its_drift_is_not_seen_and_its_strength_is():
    bare = edited()
    full = composite(refined(bare)).pixels.astype(float)
    none = composite(refined(bare, 0.0))
    plain = composite(bare).pixels.astype(float)
    assert np.array_equal(none.pixels, plain) and none.shares.from_refiner == 0
    half = composite(refined(bare, 0.5)).pixels.astype(float)
    assert np.abs(half - (full + plain) / 2).max() <= 1  # rounded
    inner = composite(bare, keeps_weights=True)
    x0, y0, x1, y1 = inner.box
    shown = inner.weights >= 1
    ratio = (full[y0:y1, x0:x1][shown] + 1) / (plain[y0:y1, x0:x1][shown] + 1)
    assert abs(np.median(ratio) - 0.75) < 0.05  # the dimming, without the red


def test_seeds_are_variants():
    bare = edited()
    one, same, other = (refined(bare, seed=s).refined for s in (1, 1, 9))
    assert np.array_equal(one.pixels, same.pixels) and one.seed == 1 and other.seed == 9


def test_what_does_not_lie_as_its_input_is_refused():
    bare = edited()
    with pytest.raises(RefineError, match="is not used"):
        refinement.refine(coarse_edit(bare), Dimming(shift=9), silent)
    with pytest.raises(RefineError, match="nothing was edited"):
        coarse_edit(edits.set_placement(bare, 0, Placement()))


def test_it_goes_with_what_it_showed_and_only_then():
    document = refined(edited())
    assert edits.rename(document, 0, "Another").refined is document.refined
    assert edits.set_hints(document, ()).refined is document.refined
    changes = {
        "place": edits.set_placement(document, 0, Placement(move=(1.0, 0.0))),
        "shadow": edits.set_shadow(document, 0, Shadow(strength=0.5)),
        "light": edits.harmonised(document, 0),
        "plate": edits.set_plate(document, None),
        "feather": edits.set_feather(document, 2.0),
        "horizon": edits.set_horizon(document, 10.0),
        "copy": edits.duplicate(document, 0),
        "gone": edits.remove_object(document, 0),
        "hidden": edits.set_visible(document, 0, False),
    }
    assert [name for name, after in changes.items() if after.refined is not None] == []
    assert ("refine", "dimming") in document.backends
    assert dict(edits.set_refined(document, None).backends).get("refine") is None
    with pytest.raises(edits.EditError, match="not between 0 and 1"):
        edits.set_strength(document, 1.5)


def test_a_session_keeps_it_to_the_byte():
    document = edits.set_strength(refined(edited()), 0.7)
    again = decode_session(encode_session(document))
    kept, was = again.refined, document.refined
    assert kept.box == was.box and kept.strength == 0.7 and kept.backend == "dimming"
    assert np.array_equal(kept.pixels, was.pixels) and np.array_equal(kept.alpha, was.alpha)
    assert np.array_equal(composite(again).pixels, composite(document).pixels)


def test_it_is_the_topmost_layer_and_the_pile_is_the_export():
    result, pile = layers(refined(edited(), 0.8))
    assert pile[-1].name == REFINEMENT
    picture = pile[0].pixels.astype(float)
    for layer in pile[1:]:
        if layer.is_shown:
            x0, y0, x1, y1 = layer.box
            alpha, under = layer.pixels[..., 3:] / 255, picture[y0:y1, x0:x1]
            under += alpha * (layer.pixels[..., :3] - under)
    assert np.abs(picture - result.pixels).max() <= 2.5  # each layer is rounded


def test_every_backend_is_known_to_scripts():
    from objectmorpher_core.scripting.options import EditScript, ScriptError
    from objectmorpher_core.scripting.runner import refuse_missing

    for name in refine.BACKENDS:
        if refine.missing(name) is not None:
            with pytest.raises(ScriptError, match=f"refine {name}: "):
                refuse_missing(EditScript(refine=name))
    with pytest.raises(ScriptError, match="there is no refiner 'paint'"):
        refuse_missing(EditScript(refine="paint"))
