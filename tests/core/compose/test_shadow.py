"""The shadow of a moved object: none by default, and nothing beyond the footprint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.light.lighting import stand
from objectmorpher_core.compose.shadow.fall import Caster
from objectmorpher_core.compose.shadow.shadow import (
    FINE,
    FlatShadow,
    Shade,
    StandingObject,
    opacity,
    smooth,
)
from objectmorpher_core.compose.silhouette import sampled
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.document.placement import ground_normal
from objectmorpher_core.document.settings import Finish, Shadow
from objectmorpher_core.session.file import SessionError, decode_session, encode_session
from tests import shapes
from tests.outlines import silhouette, standing, upright

MOVE = Placement(move=(14.0, -9.0), scale=0.7)
F32_ROUNDING = 1e-5
DARK = Shadow(strength=0.7)


CAMERA = Camera.from_fov(260, 200)
FOOT = np.array([124.0, 114.0])  # px, amid what the block stands on


def _block() -> StandingObject:
    """A board of 40 x 60 px."""
    mask = np.zeros((200, 260), bool)
    mask[54:114, 104:144] = True
    return standing(mask, CAMERA)


def cast(shadow: Shadow, standing: StandingObject) -> Shade | None:
    return Caster(shadow, standing).shade


def _moved(name: str = "ellipse", placement: Placement = MOVE) -> Document:
    return edits.set_placement(shapes.scene(name).document(), 0, placement)


def test_a_shadow_fades_with_its_object():
    """An invisible object has none, and a half transparent one takes half of the light."""

    def finished(opacity: float, strength: float) -> Document:
        document = edits.set_finish(_moved(), 0, Finish(opacity))
        return edits.set_shadow(document, 0, replace(DARK, strength=strength))

    gone, bare = (composite(finished(0.0, strength)) for strength in (0.9, 0.0))
    assert np.array_equal(gone.pixels, bare.pixels)
    assert np.array_equal(gone.footprint, bare.footprint)
    (half,), (weak,) = (
        [thing.look.shade for thing in composite(finished(*told)).stack]
        for told in ((0.5, 0.8), (1.0, 0.4))
    )
    assert half is not None and weak is not None
    assert np.array_equal(half.alpha, weak.alpha)


def test_no_strength_is_no_shadow():
    assert cast(Shadow(), _block()) is None
    behind = StandingObject(np.array([[0.0, 0.0, -1.0]]), np.array([0.0, 1.0, 0.0]), CAMERA)
    assert cast(DARK, behind) is None
    with pytest.raises(ValueError, match="without a single"):
        StandingObject(np.zeros((0, 3)), np.array([0.0, 1.0, 0.0]), CAMERA)


@pytest.mark.parametrize("direction", [0, 60, 90, 170, -90, -30])
def test_a_shadow_falls_where_it_is_told(direction):
    shade = cast(replace(DARK, direction=direction, contact=0.0, length=1.0), _block())
    assert shade is not None
    x0, y0, x1, y1 = shade.bounds
    y, x = np.mgrid[y0:y1, x0:x1] + 0.5
    middle = np.array([(x * shade.alpha).sum(), (y * shade.alpha).sum()]) / shade.alpha.sum()
    towards = np.array([np.cos(np.radians(direction)), np.sin(np.radians(direction))])
    assert (middle - FOOT) @ towards > 3


def test_a_shadow_ends_clear_and_is_never_more_than_all():
    for softness in (0.0, 0.5, 1.0):
        shade = cast(replace(DARK, strength=1.0, softness=softness, length=2.0), _block())
        assert shade is not None
        assert shade.alpha.min() >= 0 and shade.alpha.max() <= 1
        border = (shade.alpha[0], shade.alpha[-1], shade.alpha[:, 0], shade.alpha[:, -1])
        assert not any(edge.any() for edge in border)
    assert opacity(Shadow(1.0), np.full((1, 1), 1.3, np.float32), 1.0) == 1


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
    assert abs(row - FOOT[1]) < 6


def test_what_is_thin_takes_as_much_light_for_its_width():
    taken, sharp = [], Shadow(1.0, 70.0, 2.0, 0.0, 0.0)
    for wide in (4, 8, 40):
        mask = np.zeros((200, 260), bool)
        mask[54:114, 104 : 104 + wide] = True
        own = standing(mask, CAMERA)
        grid = own.grid(sharp)
        assert grid is not None
        taken.append(float(own.far(sharp, grid).sum()) * grid.pitch**2 / wide)
    assert taken[:2] == pytest.approx([taken[2]] * 2, rel=0.15)


@given(st.floats(0, 15), st.floats(0, 15))
def test_a_shadow_is_blurred_by_as_much_as_asked(across: float, down: float):
    dot = np.zeros((121, 121), np.float32)
    dot[60, 60] = 1
    blurred, away = smooth(dot, across, down).astype(np.float64), np.arange(-60.0, 61)
    spread = [np.sqrt(max(blurred.sum(axis) @ away**2, 0)) for axis in (0, 1)]
    assert blurred.sum() == pytest.approx(1, abs=1e-4)
    assert spread == pytest.approx([across, down], abs=1e-2)


@pytest.mark.parametrize("ground", [20.0, 90.0])
@pytest.mark.parametrize("softness", [0.0, 0.5, 1.0])
def test_a_soft_shadow_of_what_lies_flat_is_not_cut_off(ground: float, softness: float):
    """A sheet that hardly rises from the ground."""
    place = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 80), np.linspace(-0.5, 0.5, 80)), -1)
    normal = ground_normal(CAMERA, None, ground, CAMERA.cy)
    assert normal is not None
    sheet = place[..., :1] * [1.0, 0, 0] + place[..., 1:] * np.cross(normal, [1.0, 0, 0])
    points = np.concatenate([sheet.reshape(-1, 3) - h * normal for h in (0.0, 0.04)])
    own = StandingObject(points + [0.0, 0.0, 4.0], normal, Camera.from_fov(1040, 800))
    flat = FlatShadow.of(Shadow(1.0, 30.0, 0.5, softness, 0.0, ground=ground), own, FINE)
    assert flat is not None
    alpha = flat.alpha
    ends = [float(edge.max()) for edge in (alpha[0], alpha[-1], alpha[:, 0], alpha[:, -1])]
    assert alpha.max() > 0.5 and max(ends) == 0


@pytest.mark.parametrize("ground", [10.0, 30.0, 60.0])
def test_it_lies_on_the_ground_that_is_seen_so(ground):
    """The end of a board's shadow towards the viewer, against the same by ray and plane."""
    mask = np.zeros((200, 260), bool)
    mask[30:100, 110:150] = True
    points = upright(mask, CAMERA, ground)
    normal = ground_normal(CAMERA, None, ground, 99.0)
    sharp = Shadow(1.0, 90.0, 0.5, 0.0, 0.0)
    shade = cast(sharp, StandingObject(points, normal, CAMERA))
    assert shade is not None
    top = points[points[:, 1].argmin()]
    height = float((points @ normal).max() - top @ normal)
    end = top + height * (normal + 0.5 * np.cross(normal, [1.0, 0.0, 0.0]))
    rows = np.flatnonzero((shade.alpha > 0.25 * shade.alpha.max()).any(1))
    last = shade.top + shade.pitch * (rows[-1] + 1)
    assert abs(last - CAMERA.project(end)[1]) < 0.12 * 70


def test_what_turns_throws_another_shadow():
    """A board that is seen edge-on still throws the shadow of a board, under a lamp beside it."""
    across = np.stack(np.meshgrid(np.linspace(-0.3, 0.3, 80), np.linspace(-0.6, 0, 120)), -1)
    flat = np.column_stack([across.reshape(-1, 2), np.zeros(across[..., 0].size)])
    away = flat[:, [2, 1, 0]]
    normal = ground_normal(CAMERA, None, 25.0, CAMERA.cy)
    sharp, sizes = Shadow(1.0, 0.0, 1.0, 0.0, 0.0), []
    for board in (flat, away):
        shade = cast(sharp, StandingObject(board + [0.0, 0.2, 3.0], normal, CAMERA))
        assert shade is not None
        rows = np.flatnonzero((shade.alpha > 0.3).any(1))
        sizes.append(np.ptp(rows) * shade.pitch)
    deep = 0.6 * np.sin(np.radians(25)) * CAMERA.focal / 3  # px, of the board that points away
    assert sizes[1] > max(deep, 2 * sizes[0])


def test_the_horizon_tells_how_the_ground_is_seen():
    high = ground_normal(CAMERA, -300.0, None, 150.0)
    level = ground_normal(CAMERA, CAMERA.cy, None, 150.0)
    np.testing.assert_allclose(level, [0, 1, 0], atol=1e-12)
    assert high[2] > 0.5
    told = ground_normal(CAMERA, -300.0, 10.0, 150.0)
    ray = CAMERA.unproject(np.array([CAMERA.cx, 150.0]), 1.0)
    assert np.degrees(np.arcsin(told @ ray / np.linalg.norm(ray))) == pytest.approx(10, abs=1e-9)
    assert ground_normal(CAMERA, 180.0, None, 150.0) is None, "it is under the thing"
    assert ground_normal(CAMERA, None, None, 150.0) is None


def test_a_sketch_of_a_shadow_is_near_the_exact_one():
    scene = shapes.scene("ellipse")
    document = edits.set_shadow(_moved(), 0, replace(DARK, softness=0.5))
    splats, item = scene.puppet.posed(None, MOVE), document.objects[0]
    box, found = (0, 0, shapes.WIDTH, shapes.HEIGHT), []
    for most in (1500, 40_000):
        own = stand(splats, scene.camera, None, item.shadow, most)
        assert own is not None
        shade = cast(item.shadow, own)
        assert shade is not None
        found.append(shade.at(box))
    assert np.abs(found[0] - found[1]).mean() < 0.15 * found[1].mean()


@pytest.mark.parametrize("name", ["ellipse", "thin", "ring", "frame"])
def test_outside_the_footprint_nothing_changes_with_shadow_and_light(name):
    scene = shapes.scene(name)
    document = edits.set_shadow(_moved(name), 0, replace(DARK, length=1.5, direction=150))
    result = composite(edits.set_share(document, 0, "harmony", 1.0), {0: scene.puppet})
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
    plate = _moved().plate
    assert plate is not None
    assert change[~plate.hole].max() <= 1  # more of it is shown in a shadow
    assert change.min() < -20
    shape = silhouette(scene.puppet.posed(None, MOVE), scene.texture, scene.camera)
    assert shape is not None
    box = (0, 0, shapes.WIDTH, shapes.HEIGHT)
    body = sampled(shape.alpha, (shape.left, shape.top), shape.pitch, box) > 0.99
    assert np.abs(change[body]).mean() < 0.5


def test_how_many_rows_are_blended_at_a_time_changes_nothing():
    document = edits.set_share(edits.set_shadow(_moved(), 0, DARK), 0, "harmony", 1.0)
    scene = shapes.scene("ellipse")
    pictures = [composite(document, {0: scene.puppet}, rows=rows).pixels for rows in (1, 10_000)]
    assert np.array_equal(pictures[0], pictures[1])


def test_what_has_not_moved_has_no_shadow_and_its_own_light():
    scene = shapes.scene("ellipse")
    document = edits.set_share(edits.set_shadow(scene.document(), 0, DARK), 0, "harmony", 1.0)
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
    assert np.array_equal(own[0], own[1])


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
    for shadow in (
        Shadow(strength=1.2), Shadow(length=-1), Shadow(direction=np.nan), Shadow(ground=91.0),
    ):  # fmt: skip
        with pytest.raises(edits.EditError, match=r"shadow|ground"):
            edits.set_shadow(document, 0, shadow)
    with pytest.raises(edits.EditError, match="harmony of 2"):
        edits.set_share(document, 0, "harmony", 2.0)
    with pytest.raises(edits.EditError, match=r"is not 0\.25"):
        edits.set_feather(document, 0.0)


def test_a_session_keeps_shadow_light_and_edge():
    document = edits.set_shadow(_moved(), 0, replace(DARK, direction=-40, ground=33.0))
    document = edits.set_feather(edits.set_share(document, 0, "harmony", 0.5), 2.0)
    loaded = decode_session(encode_session(document))
    assert loaded.objects[0].shadow == document.objects[0].shadow
    assert loaded.objects[0].harmony == 0.5 and loaded.feather == 2.0
    with pytest.raises(SessionError, match="times as wide"):
        decode_session(encode_session(replace(document, feather=9.0)))
