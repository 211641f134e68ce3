"""A moved object is as noisy as the photo; at rest every byte is the photo's."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import cv2
import numpy as np
import pytest

from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.light.grain import Grain, find_grain, sketch_grain
from objectmorpher_core.compose.light.noise import BANDS, TILE, Noise, find_noise
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.session.file import SessionError, decode_session, encode_session
from tests import shapes
from tests.tree import quick

WIDTH, HEIGHT = 320, 200  # px
MIDDLE, RADIUS = (90.0, 100.0), 70.0  # px, of a disc
MOVED = (130.0, 0.0)  # px
SEEN = np.s_[72:128, 192:248]  # inside of it there
DEVIATION = 6 / 255  # of the noise at half brightness
RINGS = (0.0, 0.12, 0.25, 0.38, 0.8)  # cycles per px: the power is compared in between
PLACES = {
    "by a part of a pixel": Placement(move=(MOVED[0] + 0.5, 0.5)),
    "made smaller": Placement(move=MOVED, scale=0.6),
    "rolled": Placement(move=MOVED, turn=(0.0, 0.0, 33.0)),
    "enlarged": Placement(move=MOVED, scale=1.5),
    "turned": Placement(move=MOVED, turn=(30.0, 0.0, 0.0)),
}


def _noise(shape: tuple[int, int], blur: float, seed: int) -> np.ndarray:
    """(h, w, 3) of deviation 1; half of it is the same in all channels."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(*shape, 3)) + rng.normal(size=(*shape, 1))
    if blur > 0:
        noise = cv2.GaussianBlur(noise, (0, 0), blur)
    return noise / noise.std()


def _grainy(blur: float, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """A photo (H, W, 3) u8 of a disc before a plain ground, and the disc (H, W)."""
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    inside = np.hypot(x - MIDDLE[0], y - MIDDLE[1]) < RADIUS
    clean = np.where(inside, 0.62 - 0.1 * x / WIDTH, 0.3 + 0.1 * y / HEIGHT)[..., None]
    pixels = clean + DEVIATION * (0.5 + clean) * _noise(inside.shape, blur, seed)
    return np.rint(255 * pixels.clip(0, 1)).astype(np.uint8), inside


@cache
def _scene(blur: float) -> tuple[Document, Puppet]:
    pixels, inside = _grainy(blur)
    scene = shapes.lifted_scene(pixels, inside, 2000)
    return scene.document(), scene.puppet


def _power(patch: np.ndarray) -> tuple[np.ndarray, float]:
    """Of the noise on a smooth patch (h, w, 3): in RINGS, and its variance."""
    height, width = patch.shape[:2]
    y, x = np.mgrid[:height, :width] / height
    table = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], -1).reshape(-1, 6)
    flat = patch.reshape(-1, 3).astype(float)
    rest = (flat - table @ np.linalg.lstsq(table, flat, rcond=None)[0]).reshape(patch.shape)
    window = np.outer(np.hanning(height), np.hanning(width))[..., None]
    power = (np.abs(np.fft.fft2(rest * window, axes=(0, 1))) ** 2).sum(2)
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.fftfreq(width))
    mean = [power[(frequency > a) & (frequency <= b)].mean() for a, b in pairwise(RINGS)]
    return np.array(mean), float(rest.var())


@pytest.mark.parametrize(
    ("place", "blur"), quick(((place, blur) for blur in (0.6, 0.0) for place in PLACES), 5)
)
def test_a_moved_object_is_as_noisy_as_the_photo(place, blur):
    document, puppet = _scene(blur)
    moved = edits.set_placement(document, 0, PLACES[place])
    level = 0.57  # of the disc
    true = 255 * DEVIATION * (0.5 + level) * _noise((56, 56), blur, 7)
    wanted, variance = _power(true)
    without, _ = _power(composite(moved, {0: puppet}).pixels[SEEN])
    grained = composite(edits.set_share(moved, 0, "grain", 1.0), {0: puppet}).pixels[SEEN]
    power, after = _power(grained)

    def off(found: np.ndarray) -> float:
        return float(np.abs(np.log(found / wanted)).mean())

    assert off(power) < off(without)
    # What is enlarged has coarse noise that stays: so its variance may be too large.
    assert 0.8 < np.sqrt(after / variance) < 1.3
    fine = np.sqrt(power[-1] / wanted[-1])
    assert 0.75 < fine < 1.35
    assert np.sqrt(without[-1] / wanted[-1]) < min(fine, 0.95)


def test_at_rest_and_beside_it_every_byte_is_the_photos():
    document, puppet = _scene(0.0)
    still = edits.set_share(document, 0, "grain", 1.0)
    assert composite(still, {0: puppet}).pixels is document.photo.pixels
    moved = edits.set_placement(still, 0, PLACES["enlarged"])
    result = composite(moved, {0: puppet})
    assert result.outside_footprint_changed == 0
    plain = composite(edits.set_share(moved, 0, "grain", 0.0), {0: puppet})
    assert np.array_equal(result.footprint, plain.footprint)
    again = composite(moved, {0: puppet})
    assert np.array_equal(result.pixels, again.pixels)  # no chance in it


def test_a_move_by_nothing_asks_for_nothing():
    document, puppet = _scene(0.0)
    noise = find_noise(document.photo.pixels)
    assert noise is not None
    camera, splats = document.photo.camera, puppet.posed(None, Placement())
    assert find_grain(splats, puppet_texture(document), noise, 1.0, camera) is None
    assert sketch_grain(splats, noise, 1.0, camera) is None


def puppet_texture(document: Document):
    from objectmorpher_core.compose.light.lighting import object_texture

    matte = document.objects[0].matte
    assert matte is not None
    return object_texture(matte, document.objects[0].lifted)


def test_what_shows_nothing_of_the_photo_is_given_all_of_its_grain():
    document, puppet = _scene(0.0)
    noise = find_noise(document.photo.pixels)
    assert noise is not None
    camera, lifted = document.photo.camera, puppet.lifted
    unseen = np.zeros(len(lifted.gaussians), np.float32)
    texture = replace(lifted.texture, visibility=unseen)
    other = Puppet(replace(lifted, splatting="classic", texture=texture), DeformSettings(), camera)
    splats = other.posed(None, Placement(move=MOVED))
    exact = find_grain(splats, puppet_texture(document), noise, 0.5, camera)
    rough = sketch_grain(splats, noise, 0.5, camera)
    assert exact is not None and rough is not None
    assert exact.amount.min() > 0.49 and rough.amount.min() == 0.5


@pytest.mark.parametrize("place", ["made smaller", "enlarged", "rolled"])
def test_a_sketch_is_about_as_grainy(place):
    document, puppet = _scene(0.0)
    noise = find_noise(document.photo.pixels)
    assert noise is not None
    camera, splats = document.photo.camera, puppet.posed(None, PLACES[place])
    exact = find_grain(splats, puppet_texture(document), noise, 1.0, camera)
    rough = sketch_grain(splats, noise, 1.0, camera)
    assert exact is not None and rough is not None
    height, width = exact.amount.shape[:2]
    inner = exact.amount[height // 3 : -height // 3, width // 3 : -width // 3].mean((0, 1))
    assert np.abs(inner - rough.amount[0, 0]).max() < 0.25


@pytest.mark.parametrize("blur", [0.0, 0.6])
def test_the_photos_noise_is_found(blur):
    pixels, _ = _grainy(blur, seed=4)
    noise = find_noise(pixels)
    assert noise is not None
    for level in (0.35, 0.57):  # the brightnesses that it has
        found = noise.deviation[round(255 * level)]
        assert np.abs(found / (DEVIATION * (0.5 + level)) - 1).max() < 0.15
    assert noise.tile.shape == (BANDS, TILE, TILE, 3)
    whole = noise.tile.sum(0).reshape(-1, 3)
    assert abs(whole.std() - 1) < 0.01
    assert (
        np.abs(np.corrcoef(whole.T) - np.corrcoef(_noise((99, 99), blur, 2).reshape(-1, 3).T)).max()
        < 0.1
    )
    # The same number of deviations in each of the bands as noise of that blur has.
    wanted = np.mean([_power(_noise((64, 64), blur, seed))[0] for seed in range(8)], 0)
    parts = noise.tile.sum(0).reshape(4, 64, 4, 64, 3).swapaxes(1, 2).reshape(-1, 64, 64, 3)
    mine = np.mean([_power(part)[0] for part in parts], 0)
    assert np.abs(np.log(mine / wanted)).max() < 0.5


def test_a_photo_without_noise_has_none():
    pixels, _ = _grainy(0.0)
    assert find_noise(np.full_like(pixels, 120)) is None
    assert find_noise(pixels[:12, :12]) is None
    smooth = np.asarray(cv2.GaussianBlur(pixels, (0, 0), 8), np.uint8)
    assert find_noise(smooth) is None


@pytest.mark.parametrize("share", [0.05, 0.2, 0.45])
@pytest.mark.parametrize("grey", [32, 90, 128, 205])
def test_a_bar_of_one_colour_changes_nothing_about_the_grain_beside_it(share, grey):
    pixels, _ = _grainy(0.0)
    whole = find_noise(pixels)
    bar = np.full((HEIGHT, round(share / (1 - share) * WIDTH), 3), grey, np.uint8)
    noise = find_noise(np.hstack([pixels, bar]))
    assert whole is not None and noise is not None
    levels = np.s_[round(255 * 0.32) : round(255 * 0.6)]  # of the photo
    ratio = noise.deviation[levels] / whole.deviation[levels]
    assert np.abs(ratio - 1).max() < 0.15
    assert np.isfinite(noise.tile).all()


def test_what_is_drawn_in_flat_colours_has_no_grain():
    rng = np.random.default_rng(5)
    drawing = np.full((HEIGHT, WIDTH, 3), 200, np.uint8)
    for x, y, radius, *colour in rng.integers(5, 250, (60, 6)).tolist():
        place = (x * WIDTH // 255, y * HEIGHT // 255)
        cv2.circle(drawing, place, 5 + radius // 12, colour, cv2.FILLED, cv2.LINE_AA)
    assert find_noise(drawing) is None


def test_an_object_moved_beside_a_grey_bar_keeps_its_colours():
    pixels, inside = _grainy(0.0)
    bar = np.full((HEIGHT, WIDTH // 2, 3), 128, np.uint8)
    wide, mask = np.hstack([pixels, bar]), np.hstack([inside, np.zeros(bar.shape[:2], bool)])
    scene = shapes.lifted_scene(wide, mask, 2000)
    moved = edits.set_placement(scene.document(), 0, PLACES["by a part of a pixel"])
    plain, grained = (
        composite(edits.set_share(moved, 0, "grain", share), {0: scene.puppet}).pixels[SEEN]
        for share in (0.0, 1.0)
    )
    assert np.abs(grained.mean((0, 1)) - plain.mean((0, 1))).max() < 2


def test_half_as_much_grain_is_half_as_strong_and_deep_photos_have_it_too():
    pixels, _ = _grainy(0.0)
    noise = find_noise(pixels)
    deep = find_noise(pixels.astype(np.uint16) * np.uint16(257))
    assert noise is not None and deep is not None
    assert np.abs(deep.deviation / noise.deviation - 1).max() < 0.02
    grey, alpha = np.full((60, 80, 3), 0.5, np.float32), np.ones((60, 80), np.float32)
    deviation = [
        (_even(noise, share).grained(grey, alpha, 5, -7) - grey).std() for share in (0.5, 1.0)
    ]
    assert deviation[0] == pytest.approx(deviation[1] / 2, rel=1e-3)
    assert deviation[1] == pytest.approx(float(noise.deviation[128].mean()), rel=0.05)


def _even(noise: Noise, share: float) -> Grain:
    return Grain(noise, np.full((2, 3, BANDS), share, np.float32), 0.0, 0.0, 40.0)


def test_bytes_are_given_the_same_grain_and_alpha_stays():
    noise = find_noise(_grainy(0.0)[0])
    assert noise is not None
    rng = np.random.default_rng(3)
    alpha = rng.uniform(0, 1.4, (70, 90)).clip(0, 1).astype(np.float32)
    alpha[:20] = 0
    colour = (rng.uniform(0, 1, (70, 90, 3)) * alpha[..., None]).astype(np.float32)
    rgba = np.rint(255 * np.dstack([colour, alpha])).astype(np.uint8)
    unit = (rgba / 255).astype(np.float32)
    varied = rng.uniform(0, 1, (5, 7, BANDS)).astype(np.float32)
    for amount in (varied, varied[:1, :1]):
        grain = Grain(noise, amount, -3.0, 4.0, 17.0)
        shown = grain.grained_rgba(rgba, 5, 2, 1.0)
        exact = grain.grained(np.ascontiguousarray(unit[..., :3]), unit[..., 3], 5, 2)
        assert np.array_equal(shown[..., 3], rgba[..., 3])
        assert np.abs(shown[..., :3] - 255 * exact).max() < 1.01
        assert (shown[..., :3] <= shown[..., 3:]).all()
        assert not shown[alpha == 0].any()
    halved = grain.grained_rgba(np.full_like(rgba, 128), 0, 0, 0.5)
    whole = grain.grained_rgba(np.full_like(rgba, 128), 0, 0, 1.0)
    assert halved[..., 0].std() < 0.7 * whole[..., 0].std()  # shown smaller, noise is averaged


def test_it_is_kept_and_nonsense_is_refused():
    document, _ = _scene(0.0)
    kept = decode_session(encode_session(edits.set_share(document, 0, "grain", 0.6)))
    assert kept.objects[0].grain == 0.6
    with pytest.raises(edits.EditError, match=r"grain of 1\.5"):
        edits.set_share(document, 0, "grain", 1.5)
    wrong = replace(document, objects=(replace(document.objects[0], grain=-1.0),))
    with pytest.raises(SessionError, match="grain is -1"):
        decode_session(encode_session(wrong))
