"""Light stays where it is while an object turns; what did not turn keeps its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.light.lighting import ABOVE, estimate_light
from objectmorpher_core.compose.light.relight import (
    LEAST,
    MOST,
    Relit,
    _multiply,
    relight,
    turned_normals,
)
from objectmorpher_core.compose.silhouette import sampled
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Placement
from objectmorpher_core.session.file import SessionError, decode_session, encode_session
from tests import shapes
from tests.outlines import silhouette
from tests.tree import quick

MIDDLE, RADIUS = (80.0, 60.0), 42.0  # px, of a ball
AMBIENT = 0.35
LAMPS = [(-0.8, -0.35, -0.5), (0.6, -0.6, -0.55), (0.05, -0.85, -0.5)]  # towards them
TURNED = Placement(turn=(40.0, 0.0, 0.0))
WHOLE = (0, 0, shapes.WIDTH, shapes.HEIGHT)


def _ball(
    lamp: tuple[float, float, float], colours: np.ndarray, ambient: float = AMBIENT
) -> shapes.Scene:
    """A photo of a ball in the light of a lamp; `colours` (H, W, 3) in [0, 1] are its own."""
    x, y = np.meshgrid(np.arange(shapes.WIDTH) + 0.5, np.arange(shapes.HEIGHT) + 0.5)
    normals = np.dstack([x - MIDDLE[0], y - MIDDLE[1], np.zeros_like(x)]) / RADIUS
    flat = (normals**2).sum(-1)
    normals[..., 2] = -np.sqrt(np.maximum(1 - flat, 0))
    shade = ambient + (1 - ambient) * np.clip(normals @ _unit(lamp), 0, 1)
    inside = flat < 1
    rgb = np.where(inside[..., None], colours * shade[..., None], 0.5)
    return shapes.lifted_scene((rgb * 255).astype(np.uint8), inside, 1200)


def _unit(vector: tuple[float, float, float]) -> np.ndarray:
    return np.array(vector) / np.linalg.norm(vector)


def _plain() -> np.ndarray:
    return np.full((shapes.HEIGHT, shapes.WIDTH, 3), 0.7)


def _patched(seed: int = 3) -> np.ndarray:
    """Patches of colours of all brightnesses, and grain."""
    rng = np.random.default_rng(seed)
    patches = rng.uniform(0.25, 0.9, (6, 8, 3)).repeat(20, 0).repeat(20, 1)
    return np.clip(patches + rng.normal(0, 0.05, patches.shape), 0, 1)


def _light(scene: shapes.Scene) -> np.ndarray:
    return estimate_light(scene.lifted, scene.matte)


@pytest.mark.parametrize("lamp", LAMPS)
def test_the_lamp_is_found(lamp):
    light = _light(_ball(lamp, _plain()))
    assert light @ _unit(lamp) > 0.9 * np.linalg.norm(light)
    assert 0.2 < np.linalg.norm(light) < 1.2


@pytest.mark.parametrize("lamp", LAMPS)
def test_the_lamp_is_found_on_a_patched_ball(lamp):
    light, plain = _light(_ball(lamp, _patched())), _light(_ball(lamp, _plain()))
    assert light @ _unit(lamp) > 0.75 * np.linalg.norm(light)
    assert np.linalg.norm(light - plain) < 0.6 * np.linalg.norm(plain)


@pytest.mark.parametrize("seed", quick(range(5), 2))
def test_patches_alone_are_not_taken_for_light(seed):
    even = _ball((0, 0, -1), _patched(seed), ambient=1.0)
    assert np.linalg.norm(_light(even) - ABOVE) < 0.3


def test_of_what_is_too_small_nothing_is_told():
    scene = _ball(LAMPS[0], _plain())
    hidden = replace(
        scene.lifted.texture, visibility=np.zeros(len(scene.lifted.gaussians), np.float32)
    )
    assert np.array_equal(estimate_light(replace(scene.lifted, texture=hidden), scene.matte), ABOVE)


@pytest.mark.parametrize("lamp", LAMPS)
def test_a_turned_ball_looks_as_it_did(lamp):
    """A plain ball in a light that stays is the same from all sides."""
    scene = _ball(lamp, _plain())
    document = edits.set_placement(scene.document(), 0, TURNED)
    truth = scene.pixels.astype(float)

    def error(relight: float) -> float:
        relit = edits.set_share(document, 0, "relight", relight)
        pixels = composite(relit, {0: scene.puppet}).pixels
        x, y = np.meshgrid(np.arange(shapes.WIDTH) + 0.5, np.arange(shapes.HEIGHT) + 0.5)
        inner = np.hypot(x - MIDDLE[0], y - MIDDLE[1]) < 0.8 * RADIUS
        return float(np.abs(pixels.astype(float) - truth)[inner].mean())

    whole, half, none = error(1.0), error(0.5), error(0.0)
    assert whole < half < none
    assert whole < 0.75 * none


def test_what_only_moved_keeps_its_light():
    scene = _ball(LAMPS[0], _patched())
    for place in (Placement(move=(11.0, -4.0)), Placement(depth=0.5), Placement(scale=1.3)):
        document = edits.set_placement(scene.document(), 0, place)
        plain = composite(document, {0: scene.puppet}).pixels
        relit = composite(edits.set_share(document, 0, "relight", 1.0), {0: scene.puppet}).pixels
        assert np.abs(plain.astype(int) - relit).max() <= 1


def test_what_did_not_move_is_the_photo():
    scene = _ball(LAMPS[0], _patched())
    document = edits.set_share(scene.document(), 0, "relight", 1.0)
    assert np.array_equal(composite(document, {0: scene.puppet}).pixels, scene.pixels)
    turned = composite(edits.set_placement(document, 0, TURNED), {0: scene.puppet})
    assert turned.outside_footprint_changed == 0
    assert turned.changed > 0


def test_how_many_rows_are_blended_at_a_time_changes_nothing():
    scene = _ball(LAMPS[0], _patched())
    document = edits.set_share(edits.set_placement(scene.document(), 0, TURNED), 0, "relight", 1.0)
    few, all_at_once = (
        composite(document, {0: scene.puppet}, rows=rows).pixels for rows in (1, 10_000)
    )
    assert np.array_equal(few, all_at_once)


def test_normals_turn_with_the_surface():
    """Stretched to twice its height, a surface at 45 degrees looks more to the side."""
    scene = _ball(LAMPS[0], _plain())
    splats = scene.puppet.posed(None, TURNED)
    turn = splats.placement[:3, :3]
    np.testing.assert_allclose(turned_normals(splats), splats.rest.normals @ turn.T, atol=1e-5)
    stretch = np.diag([1.0, 2.0, 1.0])
    still = scene.puppet.posed(None, Placement())
    skinned = type(still.skinned)(
        still.skinned.points @ stretch, np.broadcast_to(stretch, (len(still), 3, 3))
    )
    stretched = turned_normals(replace(still, motion=skinned))
    expected = still.rest.normals / np.diag(stretch)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(stretched, expected, atol=1e-5)


def test_a_sketch_is_near_the_exact_picture():
    scene = _ball(LAMPS[0], _plain())
    light, splats = _light(scene), scene.puppet.posed(None, TURNED)
    exact = relight(splats, light, 1.0, scene.camera)
    rough = relight(splats, light, 1.0, scene.camera, is_sketch=True)
    assert exact is not None and rough is not None
    shape = silhouette(splats, scene.texture, scene.camera)
    assert shape is not None
    inner = sampled(shape.alpha, (shape.left, shape.top), shape.pitch, WHOLE) > 0.99
    factors = [
        1 + sampled(own.factor, (own.left, own.top), own.pitch, WHOLE)[inner]
        for own in (exact, rough)
    ]
    assert np.ptp(factors[0]) > 0.2
    assert np.abs(factors[0] - factors[1]).mean() < 0.25 * np.abs(factors[0] - 1).mean()
    for found in factors:
        assert found.min() >= LEAST - 1e-5 and found.max() <= MOST + 1e-5


def test_the_same_light_on_numbers_and_on_bytes():
    rng = np.random.default_rng(0)
    relit = Relit(rng.uniform(-0.4, 0.6, (20, 30)).astype(np.float32), -3.0, 7.0, 4.0)
    rgba = rng.integers(0, 256, (90, 110, 4), np.uint8)
    rgba[..., :3] = np.minimum(rgba[..., :3], rgba[..., 3:])
    unit = np.asarray(rgba / 255, np.float32)
    factor = 1 + sampled(relit.factor, (-3.0, 7.0), 4.0, (5, 2, 115, 92))[..., None]
    expected = np.minimum(unit[..., :3] * factor, unit[..., 3:])
    lit = relit.lit(unit[..., :3], unit[..., 3], 5, 2)
    np.testing.assert_allclose(lit, expected, atol=1e-5)
    shown = relit.lit_rgba(rgba, 5, 2, 1.0)
    assert np.array_equal(shown[..., 3], rgba[..., 3])
    assert np.abs(shown[..., :3] - 255 * lit).max() <= 1
    larger = relit.lit_rgba(rgba, 5, 2, 2.0)  # half as many px of the photo
    assert np.abs(larger.astype(int) - shown).max() > 3


def test_a_part_of_a_picture_gets_the_same_and_stays_as_it_was():
    """Whatever lies in memory how; the kernel is compiled for one kind of arrays."""
    rng = np.random.default_rng(4)
    factor = rng.uniform(LEAST, MOST, (9, 12)).astype(np.float32) - 1
    alpha = rng.uniform(0.2, 1, (60, 80)).astype(np.float32)
    colour = alpha[..., None] * rng.uniform(0, 1, (60, 80, 3)).astype(np.float32)
    before = colour.copy()
    relit = Relit(factor, 1.5, -2.0, 7.5)
    whole = relit.lit(colour, alpha, 0, 0)
    assert (whole != colour).mean() > 0.5
    colour.setflags(write=False)
    np.testing.assert_array_equal(relit.lit(colour, alpha, 0, 0), whole)
    part = relit.lit(colour[:, :50], alpha[:, :50], 0, 0)
    np.testing.assert_array_equal(part, whole[:, :50])
    np.testing.assert_array_equal(relit.lit(colour[:, :50].copy(), alpha[:, :50], 0, 0), part)
    np.testing.assert_array_equal(colour, before)
    assert len(_multiply.signatures) == 1


def test_a_session_keeps_it_and_nonsense_is_refused():
    document = edits.set_share(_ball(LAMPS[0], _plain()).document(), 0, "relight", 0.75)
    assert decode_session(encode_session(document)).objects[0].relight == 0.75
    with pytest.raises(edits.EditError, match=r"relighting of -0\.1"):
        edits.set_share(document, 0, "relight", -0.1)
    wrong = replace(document, objects=(replace(document.objects[0], relight=2.0),))
    with pytest.raises(SessionError, match="relighting is 2"):
        decode_session(encode_session(wrong))
