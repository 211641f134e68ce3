"""What every inpainter promises, and what the default one does to real photos."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from objectmorpher_core import models
from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.compose import BACKENDS, InpaintError, load
from tests.core.compose import tiny_inpainters
from tests.tree import over, quick

LEARNED = (*tiny_inpainters.FAMILIES, "klein")


@pytest.fixture(scope="module", params=quick(sorted(BACKENDS, key=lambda n: n == "pixelhacker"), 4))
def inpainter(request, tmp_path_factory):
    """Each; those that learned something are tiny networks of random weights.

    The others have no network that looks at what is to be filled: see `without_weights`.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OBJECTMORPHER_CACHE", str(tmp_path_factory.mktemp("none")))
        if request.param in LEARNED:
            at = tmp_path_factory.mktemp("tiny")
            bring = bring_klein if request.param == "klein" else tiny_inpainters.bring
            bring(request.param, at, patch)
        yield load(request.param)


def bring_klein(name, at, patch) -> None:
    """The pipeline of the refiner, and the adapter that removes."""
    pytest.importorskip("peft")
    from tests.core.compose.refine import tiny_pipelines

    tiny_pipelines.make_small(patch, 64)
    folder = tiny_pipelines.write_klein(at / name)
    lora = tiny_pipelines.write_lora(at / "lora", folder / "transformer", "Flux2KleinPipeline", 5)
    models.use_folder("flux2-klein-4b", folder)
    models.use_folder("klein-remove-lora", lora)


def is_trained(inpainter) -> bool:
    """Whether what it fills a hole with means anything."""
    return inpainter.name not in LEARNED


@pytest.fixture
def hole(view):
    """About the rocket, and away from the frame."""
    hole = np.zeros(view.shape[:2], bool)
    hole[5:100, 45:75] = True
    return hole


def sixteen_bit(pixels: np.ndarray) -> np.ndarray:
    noise = np.random.default_rng(3).integers(-128, 128, pixels.shape)
    return np.clip(pixels.astype(int) * 257 + noise, 0, 65535).astype(np.uint16)


def roughness(pixels: np.ndarray, where: np.ndarray) -> float:
    """RMS of the Laplacian, 8-bit levels: what a smear lacks."""
    grey = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY).astype(np.float32)
    return float(np.sqrt(np.mean(cv2.Laplacian(grey, cv2.CV_32F)[where] ** 2)))


@pytest.mark.parametrize("depth", quick([16, 8], 1))
def test_contract(inpainter, view, hole, depth):
    pixels = view if depth == 8 else sixteen_bit(view)
    before, hole_before = pixels.copy(), hole.copy()
    filled = inpainter.inpaint(pixels, hole, silent)
    assert filled.dtype == pixels.dtype
    assert filled.shape == pixels.shape
    np.testing.assert_array_equal(filled[~hole], pixels[~hole])
    np.testing.assert_array_equal(pixels, before)
    np.testing.assert_array_equal(hole, hole_before)
    assert (filled[hole] != pixels[hole]).any(1).mean() > 0.9
    again = inpainter.inpaint(pixels, hole, silent)
    np.testing.assert_array_equal(again, filled)


def test_the_rocket_is_gone(inpainter, view, hole):
    """The rocket is white on a dark sky; the fill is as dark as the sky beside it."""
    if not is_trained(inpainter):
        pytest.skip("random weights invent nothing that fits")
    filled = inpainter.inpaint(view, hole, silent).astype(float)
    sky = np.zeros_like(hole)
    sky[10:45, 20:40] = True
    filling = np.zeros_like(hole)
    filling[10:45, 48:72] = True
    assert view[filling].mean() > 60
    np.testing.assert_allclose(filled[filling].mean(0), filled[sky].mean(0), atol=12)


def test_what_the_hole_hides_does_not_matter(inpainter, view, hole):
    """The old object must not shine through, not even at its rim."""
    if inpainter.name == "klein":
        pytest.skip("it is shown what is to go")
    covered = view.copy()
    covered[hole] = (255, 0, 255)
    np.testing.assert_array_equal(
        inpainter.inpaint(covered, hole, silent), inpainter.inpaint(view, hole, silent)
    )


def test_hole_at_the_frame(inpainter, view):
    hole = np.zeros(view.shape[:2], bool)
    hole[:, :35] = True
    hole[-15:] = True
    filled = inpainter.inpaint(view, hole, silent)
    np.testing.assert_array_equal(filled[~hole], view[~hole])


def test_only_a_rim_is_known(inpainter, view):
    hole = np.ones(view.shape[:2], bool)
    hole[0, 0] = hole[-1, -3:] = False
    filled = inpainter.inpaint(view, hole, silent)
    np.testing.assert_array_equal(filled[~hole], view[~hole])


@over("shape", [(1, 2), (2, 1), (3, 3), (1, 40), (9, 5)])
def test_tiny_pictures(inpainter, view, shape):
    pixels = view[: shape[0], : shape[1]]
    hole = np.zeros(shape, bool)
    hole[-1, -1] = True
    filled = inpainter.inpaint(pixels, hole, silent)
    np.testing.assert_array_equal(filled[~hole], pixels[~hole])


def test_no_hole_changes_nothing(inpainter, view):
    np.testing.assert_array_equal(
        inpainter.inpaint(view, np.zeros(view.shape[:2], bool), silent), view
    )


def test_nothing_but_hole(inpainter, view):
    with pytest.raises(InpaintError, match="nothing to fill it from"):
        inpainter.inpaint(view, np.ones(view.shape[:2], bool), silent)


def test_cancel(inpainter, view, hole):
    def stop(fraction: float, note: str) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        inpainter.inpaint(view, hole, stop)


@pytest.mark.usefixtures("without_weights")
def test_seed_changes_the_result(coffee):
    table = coffee[290:, 440:]
    hole = np.zeros(table.shape[:2], bool)
    hole[30:90, 40:120] = True
    results = [load("patchmatch").inpaint(table, hole, silent, seed) for seed in (0, 1)]
    assert not np.array_equal(*results)


def test_detail_is_the_photos_own(china):
    """Trees that are filled at 1/3 of the photo's resolution are as rough as the trees around."""
    large = cv2.resize(china[250:, 380:], None, fx=4, fy=4, interpolation=cv2.INTER_LANCZOS4)
    large = np.clip(large + np.random.default_rng(1).normal(0, 6, large.shape), 0, 255)
    large = large.astype(np.uint8)
    hole = np.zeros(large.shape[:2], bool)
    hole[420:560, 200:420] = True
    around = cv2.dilate(hole.astype(np.uint8), np.ones((81, 81))).astype(bool) & ~hole
    filled = load("patchmatch").inpaint(large, hole, silent)
    inner = cv2.erode(hole.astype(np.uint8), np.ones((5, 5))).astype(bool)
    assert 0.75 < roughness(filled, inner) / roughness(large, around) < 1.25


@pytest.mark.usefixtures("without_weights")
def test_16_bit_gradient_shows_no_bands():
    """A sky finer than 8 bits: the fill has in-between values, and no step above the photo's."""
    ramp = np.linspace(20000, 23000, 240)[:, None, None]
    noise = np.random.default_rng(2).normal(0, 20, (240, 300, 3))
    sky = np.rint(ramp + noise).astype(np.uint16)
    hole = np.zeros(sky.shape[:2], bool)
    hole[90:150, 120:180] = True
    filled = load("patchmatch").inpaint(sky, hole, silent)[90:150, 120:180]
    assert len(np.unique(filled)) > 500
    np.testing.assert_allclose(filled.mean((1, 2)), ramp[90:150, 0, 0], atol=257)


@over("kind", [np.uint8, np.uint16])
@over("share", [0.0, 1.0])
def test_black_and_white_stay_black_and_white(inpainter, kind, share):
    """Where OpenCV goes a level beyond white, nothing turns black."""
    if not is_trained(inpainter):
        pytest.skip("random weights invent nothing that fits")
    level = kind(share * np.iinfo(kind).max)
    plain = np.full((60, 70, 3), level, kind)
    y, x = np.mgrid[:60, :70]
    hole = np.hypot(x - 35, y - 30) < 20
    plain[hole] = kind(np.iinfo(kind).max) - level
    filled = inpainter.inpaint(plain, hole, silent).astype(float)
    assert np.abs(filled - float(level)).max() <= 0.02 * np.iinfo(kind).max


def test_unknown_name():
    with pytest.raises(InpaintError, match="there is no inpainter 'lamb'"):
        load("lamb")
