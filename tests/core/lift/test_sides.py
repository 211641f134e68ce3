"""Invented sides: as fine as what the photo shows, seed-stable, and never seen at rest."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial import KDTree

from objectmorpher_core.compose.light.lighting import object_texture
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import LiftedObject, Placement
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.lift.relief.sides import SidePicture, mirrored, standing_out, with_sides
from objectmorpher_core.lift.relief.thickness import with_thickness
from objectmorpher_core.raster import reference, tiles
from objectmorpher_core.raster.posed import RestSplats
from objectmorpher_core.raster.reference import Picture3D
from objectmorpher_core.raster.rules import RULES
from objectmorpher_core.raster.texture import sample_texture
from objectmorpher_core.raster.trust import trust_in
from tests import shapes
from tests.core.segment.test_matte import furry
from tests.tree import over

LEVEL = 2 / 255
TURN = Placement(turn=(45.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def scene() -> shapes.Scene:
    """A ball in a grain as coarse as a few Gaussians."""
    y, x = np.mgrid[:200, :240]
    noise = np.random.default_rng(0).random((200, 240, 3)).astype(np.float32)
    grain = cv2.GaussianBlur(noise, (0, 0), 1.5)
    grain = 0.5 + (grain - grain.mean()) / (4 * grain.std())
    inside = (x - 120) ** 2 + (y - 100) ** 2 < 80**2
    pixels = np.where(inside[..., None], grain, 0.2).clip(0, 1)
    return shapes.lifted_scene((255 * pixels).astype(np.uint8), inside, 4000)


@pytest.fixture(scope="module")
def vase() -> shapes.Scene:
    """A vase with stripes around it, which go on behind as they are in front."""
    y, x = np.mgrid[:240, :200] + 0.5
    half = np.interp(y, [20, 80, 150, 220], [34, 28, 62, 44])
    inside = (np.abs(x - 100) < half) & (y > 20) & (y < 220)
    stripes = np.array([(226, 84, 48), (244, 214, 150)])[(y / 16).astype(int) % 2]
    pixels = np.where(inside[..., None], stripes, (0, 0, 0))
    return shapes.lifted_scene(pixels.astype(np.uint8), inside, 4000)


def _drawn(scene: shapes.Scene, lifted: LiftedObject, place: Placement) -> Picture3D:
    texture = object_texture(scene.matte, lifted)
    return Puppet(lifted, DeformSettings(), scene.camera).draw(None, place, texture, scene.camera)


def _contrast(picture: Picture3D, where: np.ndarray) -> float:
    """Mean step between neighbours."""
    grey = picture.color.mean(-1)
    steps = np.abs(np.diff(grey, axis=0))[:, :-1] + np.abs(np.diff(grey, axis=1))[:-1]
    return float(steps[where[:-1, :-1]].mean())


def test_a_newly_shown_side_is_as_rough_as_the_object_itself(scene):
    plain = replace(scene.lifted, sides=None)
    bare = _drawn(scene, plain, TURN)
    new = (bare.from_photo < 0.1) & (bare.alpha > 0.99)
    own = (bare.from_photo > 0.9) & (bare.alpha > 0.99)
    assert new.sum() > 300
    after = []  # which patches are found is chance, that the least noise in the photo decides
    for seed in range(6):
        noise = np.random.default_rng(seed).normal(0, 1e-4, scene.matte.foreground.shape)
        noisy = (scene.matte.foreground + noise).clip(0, 1).astype(np.float32)
        matte = replace(scene.matte, foreground=noisy)
        lifted = with_sides(plain, matte, scene.camera, seed)
        after.append(_contrast(_drawn(scene, lifted, TURN), new))
    assert np.mean(after) > max(0.5 * _contrast(bare, own), 2 * _contrast(bare, new))
    # Nothing of it counts as the photo's, and the outline is what it was.
    picture = _drawn(scene, scene.lifted, TURN)
    assert picture.from_photo[new].mean() < 0.1
    assert np.abs(picture.alpha - bare.alpha).mean() < 0.02


@pytest.mark.parametrize("yaw", [30.0, -30.0, 45.0])
def test_stripes_go_on_where_the_photo_ends(vase, yaw):
    """Half way between neighbours of which one shows the photo and one what is invented."""
    lifted, camera = vase.lifted, vase.camera
    place, sides = Placement(turn=(yaw, 0.0, 0.0)), lifted.sides
    rest = RestSplats(lifted, camera)
    assert sides is not None
    motion = place.matrix(lifted, camera)
    world = lifted.world_points(rest.means)
    moved = world @ motion[:3, :3].T + motion[:3, 3]
    cosines = -((rest.normals @ motion[:3, :3].T) * moved).sum(1) / np.linalg.norm(moved, axis=1)
    is_shown = lifted.is_body & (cosines > 0.15)
    aside = is_shown & (sides.zoom != 0) & (rest.cosines < RULES.look_aside * cosines)
    i = np.flatnonzero(aside)
    own = np.flatnonzero(is_shown & ~aside & (lifted.texture.visibility > 0))
    gap, nearest = map(np.asarray, KDTree(world[own]).query(world[i]))
    is_near = gap < 1.5 * rest.spacing
    i, j = i[is_near], own[nearest[is_near]]
    assert len(i) > 30
    middle = 0.5 * (world[i] + world[j])
    there = sides.at[i] + np.einsum("nij,nj->ni", sides.slopes[i], middle - world[i])
    finest = np.zeros(len(i))
    photo = sample_texture(vase.texture, camera.project(middle), finest)[:, :3]
    invented = sample_texture(vase.texture, there, finest)[:, :3]
    misfit = np.abs(photo - invented).mean(1)
    assert misfit.mean() < 13 / 255 and np.median(misfit) < 5 / 255
    assert (misfit > 40 / 255).mean() < 0.11  # on another stripe


def test_what_a_handle_hides_from_every_side_has_a_picture_too():
    """Of a can with a handle, turned so far that one sees its body between the two."""
    y, x = np.mgrid[:240, :260] + 0.5
    away = np.hypot((x - 150) / 62, (y - 125) / 66)
    handle = (x > 150) & (away < 1) & (away > 0.66)
    body = (np.abs(x - 100) < 55) & (np.abs(y - 125) < 90)
    stripes = np.array([(226, 84, 48), (244, 214, 150)])[(y / 9).astype(int) % 2]
    pixels = np.where((body | handle)[..., None], stripes, (0, 0, 0)).astype(np.uint8)
    scene = shapes.lifted_scene(pixels, body | handle, 6000)
    lifted, camera = scene.lifted, scene.camera
    assert lifted.sides is not None
    rest = RestSplats(replace(lifted, sides=None), camera)
    for yaw in (50.0, -50.0):
        motion = Placement(turn=(yaw, 0.0, 0.0)).matrix(lifted, camera)
        world = lifted.world_points(rest.means) @ motion[:3, :3].T + motion[:3, 3]
        normals = rest.normals @ motion[:3, :3].T
        cosines = -(normals * world).sum(1) / np.linalg.norm(world, axis=1)
        new = lifted.is_body & (cosines > 0.35) & (rest.cosines < 0.5 * RULES.look_aside * cosines)
        assert new.sum() > 100
        assert (lifted.sides.zoom[new] != 0).mean() > 0.95


def test_nothing_but_the_object_can_be_looked_up(vase):
    """Neither between the pictures, nor beside them, nor from the photo's background."""
    darkest = 84 / 255  # of the green of the darker stripe
    assert vase.texture.levels[0][..., 1].min() > 0.4 * darkest
    for turn in ((30, 0, 0), (-60, 20, 0), (0, 40, 0), (0, -40, 0), (80, -30, 10)):
        picture = _drawn(vase, vase.lifted, Placement(turn=turn))
        inner = cv2.erode((picture.alpha > 0.99).astype(np.uint8), np.ones((3, 3))) > 0
        assert picture.color[inner, 1].min() > 0.4 * darkest


@pytest.mark.parametrize("yaw", [25.0, -25.0])
def test_beside_turned_fur_stands_hardly_any_ground(yaw):
    """Of a mask drawn around fur, nearly a quarter of what was seen beside it was the ground."""
    photo, _, mask, _ = furry()
    scene = shapes.lifted_scene(photo, mask, 6000)
    picture = _drawn(scene, scene.lifted, Placement(turn=(yaw, 0.0, 0.0)))
    red, *others = np.moveaxis(picture.color, -1, 0)  # fur is red before all, neither ground is
    is_ground = np.maximum(*others) > red
    assert picture.alpha[is_ground].sum() < 0.1 * picture.alpha.sum()


def test_a_fringe_shows_its_side_sooner(scene):
    plain = replace(scene.lifted, sides=None)
    sides = scene.lifted.sides
    assert sides is not None
    fringed = replace(scene.lifted, sides=replace(sides, zoom=-np.abs(sides.zoom)))
    place = Placement(turn=(20.0, 0.0, 0.0))
    usual, sooner = (_drawn(scene, lifted, place) for lifted in (scene.lifted, fringed))
    assert sooner.from_photo.sum() < usual.from_photo.sum() - 30
    splats = scene.puppet.posed(None, place)
    splats = replace(splats, rest=RestSplats(fringed, scene.camera))
    slow = reference.render(splats, scene.texture, scene.camera, scene.camera)
    fast = tiles.render(splats, scene.texture, scene.camera, scene.camera)
    assert np.abs(slow.color - fast.color).max() < LEVEL
    rest = [_drawn(scene, lifted, Placement()) for lifted in (plain, fringed)]
    np.testing.assert_array_equal(rest[0].from_photo, rest[1].from_photo)


def _half_seen(colors: np.ndarray, fringe: int) -> SidePicture:
    """A side (h, w, 3) of which the left half is seen, up to a `fringe` px wide."""
    seen = np.zeros(colors.shape[:2], bool)
    seen[:, : seen.shape[1] // 2] = True
    own = seen.copy()
    own[:, seen.shape[1] // 2 - fringe :] = False
    return SidePicture(
        colors.astype(np.float32), np.ones_like(seen), seen, own, np.zeros_like(seen), own,
        np.ones(seen.shape, np.float32),
    )  # fmt: skip


def test_hair_is_mirrored_where_the_photo_ends_and_an_edge_is_not():
    rng = np.random.default_rng(0)
    hair = cv2.GaussianBlur(rng.random((120, 200, 3)), (0, 0), 2.0)
    soft, hard = _half_seen(hair, 6), _half_seen(hair, 0)
    made, share = mirrored(soft)
    beyond = slice(100, 130)
    assert share[20:-20, beyond].min() > 0.5
    image = 255 * hair[:, 2 * 94 - 1 - np.arange(100, 130)]
    light = made[:, beyond].mean() / image.mean()
    assert np.abs(made[20:-20, beyond] - light * image[20:-20]).mean() < 4
    assert mirrored(hard)[1].max() == 0


def test_what_stands_out_is_not_there_twice():
    yellow = np.full((160, 240, 3), 0.5)
    cv2.circle(yellow, (96, 80), 9, (1.0, 0.9, 0.1), -1)
    picture = _half_seen(yellow, 6)
    odd = standing_out((255 * yellow).astype(np.float32), picture.is_own)
    assert odd[80, 96] and odd.mean() < 0.1
    made, share = mirrored(replace(picture, is_odd=odd))
    shown = np.where(share[..., None] > 0.5, made, 127.5)
    assert np.ptp(shown[:, 120:], axis=-1).max() < 40  # nothing yellow


@over("coarse", [8.0, 12.0, 16.0])
def test_most_of_a_pattern_does_not_stand_out_and_an_eye_in_it_does(coarse):
    noise = cv2.GaussianBlur(np.random.default_rng(0).normal(size=(320, 400)), (0, 0), coarse)
    fur = np.repeat((120 + 35 * noise / noise.std())[..., None], 3, 2).astype(np.float32)
    cv2.circle(fur, (200, 160), 14, (255.0, 255.0, 0.0), -1)
    odd = standing_out(fur, np.ones((320, 400), np.bool_))
    assert odd[160, 200]
    assert odd.mean() < 0.55, odd.mean()  # of 8 px it was 0.86


def test_at_rest_nothing_of_it_is_seen(scene):
    plain = _drawn(scene, replace(scene.lifted, sides=None), Placement())
    sided = _drawn(scene, scene.lifted, Placement())
    assert np.abs(sided.color - plain.color).max() < LEVEL
    np.testing.assert_array_equal(sided.from_photo, plain.from_photo)


def test_the_same_seed_invents_the_same(scene):
    plain = replace(scene.lifted, sides=None)
    first, second = (with_sides(plain, scene.matte, scene.camera, 3).sides for _ in range(2))
    assert first is not None and second is not None
    np.testing.assert_array_equal(first.pixels, second.pixels)
    np.testing.assert_array_equal(first.at, second.at)


def test_tiles_draw_sides_as_the_reference_does(scene):
    splats = scene.puppet.posed(None, TURN)
    view = scene.camera.windowed(140.0, 60.0, 60, 60)
    fast = tiles.render(splats, scene.texture, view, scene.camera)
    slow = reference.render(splats, scene.texture, view, scene.camera)
    assert np.abs(fast.color - slow.color).max() < 3 * LEVEL
    assert np.abs(fast.from_photo - slow.from_photo).max() < 0.02


def test_a_thicker_shape_shows_the_same_side(scene):
    """Each Gaussian slides along its ray and takes its piece along, drawn out as it was."""
    thicker = with_thickness(scene.lifted, scene.camera, 1.5)
    assert thicker.sides is not None and scene.lifted.sides is not None
    np.testing.assert_array_equal(thicker.sides.at, scene.lifted.sides.at)
    new = _drawn(scene, thicker, TURN)
    own = (new.from_photo > 0.9) & (new.alpha > 0.99)
    side = (new.from_photo < 0.1) & (new.alpha > 0.99)
    assert _contrast(new, side) > 0.4 * _contrast(new, own)


def test_trust_falls_with_every_degree(scene):
    angles = (0, 10, 20, 35, 60, 90, 180)
    found = [trust_in(scene.puppet.posed(None, Placement(turn=(a, 0.0, 0.0)))) for a in angles]
    assert found[0].sign == "fine" and found[0].invented < 0.02 and found[0].astray < 1e-3
    assert np.all(np.diff([trust.invented for trust in found]) > 0)
    assert found[-1].sign == "guesswork" and found[-1].invented > 0.95
    file = Puppet(replace(scene.lifted, backend="imported"), DeformSettings(), scene.camera)
    assert trust_in(file.posed(None, TURN)).sign == "fine", "it came with its back"


@pytest.mark.parametrize("kind", ["free", "round"])
@pytest.mark.parametrize("doubt", [0.03, 0.3])
def test_the_sign_is_of_what_the_photo_did_not_show_alone(scene, kind, doubt):
    """How sure a shape is, and what it was taken for, is the same at turns that look right."""
    lifted = replace(scene.lifted, kind=kind, doubt=doubt)
    puppet = Puppet(lifted, DeformSettings(), scene.camera)
    found = [trust_in(puppet.posed(None, Placement(turn=(a, 0.0, 0.0)))) for a in (30, 45, 90)]
    assert [trust.sign for trust in found] == ["fine", "look closely", "guesswork"]
    assert found[0].astray == pytest.approx(doubt * 0.5, rel=0.2)


def test_a_side_has_the_colours_of_its_own_part():
    """A small brown head on a red body, of which far more patches are known."""
    y, x = np.mgrid[:260, :240] + 0.5
    head = (x - 120) ** 2 + (y - 62) ** 2 < 13**2
    body = ((x - 120) / 95) ** 2 + ((y - 165) / 85) ** 2 < 1
    noise = np.random.default_rng(0).random((260, 240)).astype(np.float32)
    grain = cv2.GaussianBlur(noise, (0, 0), 1.2)[..., None]
    grain = (0.5 + (grain - grain.mean()) / (3 * grain.std())).clip(0, 1)
    colours = np.where(head[..., None], (150, 110, 60), (230, 70, 40)) * (0.6 + 0.4 * grain)
    inside = head | body | ((np.abs(x - 120) < 5) & (y > 60) & (y < 100))
    pixels = np.where(inside[..., None], colours, 20).astype(np.uint8)
    scene = shapes.lifted_scene(pixels, inside, 4000)
    for yaw in (40.0, -40.0):
        shown = _drawn(scene, scene.lifted, Placement(turn=(yaw, 0.0, 0.0)))
        new = (shown.from_photo < 0.1 * shown.alpha) & (shown.alpha > 0.98)
        new[72:] = False
        assert new.sum() > 40
        assert (shown.color[new][:, 1] > 0.5 * shown.color[new][:, 0]).mean() > 0.97
