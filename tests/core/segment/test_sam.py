"""SAMs: their own code paths on tiny networks, the contract of segmenters, folders and faults."""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from objectmorpher_core import models, segment
from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.document.model import Click, Prompt
from objectmorpher_core.models import ModelError, device, ledger
from objectmorpher_core.models.plans import Plan
from objectmorpher_core.segment import SelectionError
from objectmorpher_core.segment.sam.segmenter import Sam, open_network
from objectmorpher_core.segment.sam.view import Asked, Masks, SamFrame, at_level
from tests.core.models.small_networks import in_ways
from tests.core.segment import tiny_sams
from tests.core.segment.contract import *  # noqa: F403
from tests.core.segment.contract import ellipses, overlap, prompt
from tests.tree import over, quick

LAYOUTS = ("sam", "pixels", "efficient")
F32 = 1e-4  # logits of two ways to the same network
SUB_PIXEL = 0.02  # x logits' range: two ways of enlarging
DISC = 0.96  # IoU; the network sees 3 to 6 px of the photo as one
BF16 = 0.05  # x deviation of features: 8 bits of mantissa through a few layers
ANSWERING = {"sam": 2, "sam2": 1, "sam3": 7}  # seeds whose answers are no specks, with torch 2.13


def needs(*names: str) -> None:
    for name in names:
        if importlib.util.find_spec(name) is None:
            pytest.skip(f"{name} is not installed")


def needs_torch() -> None:
    needs("torch", "transformers", "safetensors")


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A cache of the module's own, for module-wide segmenters."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OBJECTMORPHER_CACHE", str(tmp_path_factory.mktemp("cache")))
        patch.setenv(device.DEVICE, "cpu")
        yield


@pytest.fixture(
    scope="module", params=[*quick(tiny_sams.FAMILIES, 1), *(f"onnx {n}" for n in LAYOUTS)]
)
def segmenter(request, cache, tmp_path_factory):
    """A SAM of each family; of random weights some whose answers are no specks."""
    kind, _, layout = request.param.partition(" ")
    if kind == "onnx":
        needs("onnx")
        models.use_folder(
            "mobile-sam", tiny_sams.write_onnx(layout, tmp_path_factory.mktemp("onnx"))
        )
        return segment.load("sam-onnx")
    needs_torch()
    for seed in (ANSWERING[kind], *range(40)):
        models.use_folder(kind, tiny_sams.write(kind, tmp_path_factory.mktemp(kind), seed))
        found = segment.load(kind)
        if answers(found):
            return found
    raise AssertionError("no seed gives a mask")


def answers(segmenter: segment.Segmenter) -> bool:
    """Whether the contract's prompts have an answer."""
    image = np.full((150, 200, 3), 90, np.uint8)
    cv2.circle(image, (100, 75), 40, (190, 180, 170), -1)
    boxed = Prompt((Click(80, 60),), box=(40, 20, 100, 75))
    embedding = segmenter.encode(image, silent)
    try:
        for asked in (prompt([(100, 75)]), Prompt(box=(50, 25, 150, 125)), boxed):
            segmenter.segment(image, asked, embedding, silent)
    except SelectionError:
        return False
    return True


@pytest.fixture(scope="module")
def is_trained(segmenter) -> bool:
    return segmenter.name == "sam-onnx"


def test_it_tells_how_sure_it_is(segmenter, disc, disc_embedding):
    asked = prompt([(100, 75)])
    segmenter.segment(disc, asked, disc_embedding, silent)
    sure = segmenter.confidence(disc, asked, disc_embedding)
    assert 0 <= sure <= 1
    assert sure == segmenter.confidence(disc, asked, disc_embedding)


def test_progress_grows_to_the_end(segmenter, disc):
    seen: list[float] = []
    segmenter.segment(disc, prompt([(100, 75)]), None, lambda f, note: seen.append(f))
    assert seen == sorted(seen) and seen[-1] == 1


@over("step", range(1, 6))
def test_it_can_be_cancelled_at_each_step(segmenter, disc, step):
    calls = 0

    def cancel(fraction: float, note: str) -> None:
        nonlocal calls
        calls += 1
        if calls == step:
            raise Cancelled

    with pytest.raises(Cancelled):
        segmenter.segment(disc, prompt([(100, 75)]), None, cancel)


def test_clicks_one_after_the_other_are_as_clicks_at_once(segmenter, disc, disc_embedding):
    clicks = [(100, 75), (20, 20, False), (120, 90)]
    for count in (1, 2, 3):
        mask = given(segmenter, disc, prompt(clicks[:count]), disc_embedding)
    fresh = Sam(segmenter._family)
    np.testing.assert_array_equal(mask, given(fresh, disc, prompt(clicks), None))


def given(segmenter, rgb, asked, embedding) -> np.ndarray:
    """The mask, or that there is none."""
    try:
        return segmenter.segment(rgb, asked, embedding, silent)
    except SelectionError as error:
        return np.array(str(error))


# What the networks are asked ------------------------------------------------------------------


@pytest.fixture
def own_cache(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv(device.DEVICE, "cpu")
    return tmp_path


@pytest.fixture
def picture() -> np.ndarray:
    """A photo with something everywhere (90, 130, 3)."""
    noise = np.random.default_rng(3).integers(0, 256, (12, 17, 3), dtype=np.uint8)
    return np.asarray(cv2.resize(noise, (130, 90), interpolation=cv2.INTER_CUBIC), np.uint8)


def opened(family: str, folder: Path, seed: int = 0):
    """The network of a tiny model, and the same in transformers' hands."""
    at = tiny_sams.write(family, folder / family, seed)
    return open_network(models.use_folder(family, at).model), tiny_sams.tiny(family, seed)


@pytest.mark.slow
@pytest.mark.parametrize("family", tiny_sams.FAMILIES)
def test_what_was_saved_is_loaded_and_asked_as_transformers_would(own_cache, family, picture):
    needs_torch()
    import torch

    network, theirs = opened(family, own_cache)
    frame = SamFrame((0, 0, 130, 90), network.side, network.is_padded)
    small = frame.picture(picture)
    features = network.encode(small)
    points = np.array([[20.25, 31.5], [40.0, 7.75]])
    earlier = np.random.default_rng(1).normal(0, 3, (network.low, network.low)).astype(np.float32)
    mean, deviation = ([0.5] * 3, [0.5] * 3) if family == "sam3" else (
        [0.485, 0.456, 0.406], [0.229, 0.224, 0.225]
    )  # fmt: skip
    pixels = torch.zeros(1, 3, network.side, network.side)
    normal = (torch.from_numpy(small / 255.0) - torch.tensor(mean)) / torch.tensor(deviation)
    pixels[0, :, : small.shape[0], : small.shape[1]] = normal.permute(2, 0, 1)
    with torch.inference_mode():
        for box, logits, is_several in ((None, None, True), ([3.0, 4, 50, 40], earlier, False)):
            asked = Asked(
                points, np.array([True, False]), None if box is None else np.array(box), logits
            )
            ours = network.decode(features, asked, is_several)
            more = {} if box is None else {"input_boxes": torch.tensor([[box]]) - 0.5}
            if logits is not None:
                more["input_masks"] = torch.from_numpy(logits)[None, None]
            found = theirs(
                pixel_values=pixels, input_points=torch.tensor((points - 0.5)[None, None]).float(),
                input_labels=torch.tensor([[[1, 0]]]), multimask_output=is_several, **more,
            )  # fmt: skip
            assert ours.logits.shape == (3 if is_several else 1, network.low, network.low)
            np.testing.assert_allclose(ours.logits, found.pred_masks[0, 0], atol=F32)
            np.testing.assert_allclose(ours.scores, found.iou_scores[0, 0], atol=F32)


def test_sam_sees_and_answers_as_by_its_own_processor(own_cache, picture):
    needs_torch()
    import torch
    from PIL import Image
    from transformers.models.sam.image_processing_pil_sam import SamImageProcessorPil

    network, theirs = opened("sam", own_cache)
    frame = SamFrame((0, 0, 130, 90), network.side, True)
    processor = SamImageProcessorPil(
        size={"longest_edge": 64}, pad_size={"height": 64, "width": 64},
        mask_pad_size={"height": 32, "width": 32}, mask_size={"longest_edge": 32},
    )  # fmt: skip
    seen = processor(Image.fromarray(picture), return_tensors="pt")
    assert tuple(seen["reshaped_input_sizes"][0]) == frame.size[::-1]
    ours = network.encode(frame.picture(picture))[0]
    with torch.inference_mode():
        features = theirs.get_image_embeddings(seen["pixel_values"])
        np.testing.assert_allclose(ours, features, atol=F32)
        at = torch.tensor([[[[31.0, 22.0]]]])
        found = theirs(image_embeddings=features, input_points=at, multimask_output=True)
    asked = Asked(np.array([[31.5, 22.5]]), np.ones(1, np.bool_))
    logits = network.decode((ours,), asked, True).logits
    np.testing.assert_allclose(logits, found.pred_masks[0, 0], atol=F32)
    masks = processor.post_process_masks(
        found.pred_masks, seen["original_sizes"], seen["reshaped_input_sizes"], binarize=False
    )[0][0]
    for k in range(3):
        large = frame.unfold(logits[k], (130, 90))
        assert np.abs(large - masks[k].numpy()).max() < SUB_PIXEL * np.ptp(logits[k]) + F32


@pytest.mark.slow
def test_the_trackers_for_videos_hold_the_same_network(own_cache, picture):
    needs_torch()
    at = tiny_sams.write("sam2", own_cache / "sam2")
    network = open_network(models.use_folder("sam2", at).model)
    small = SamFrame((0, 0, 130, 90), network.side, False).picture(picture)
    before = network.encode(small)
    config = json.loads((at / "config.json").read_text())
    config["model_type"] = "sam2_video"
    (at / "config.json").write_text(json.dumps(config))
    again = open_network(models.use_folder("sam2", at).model)
    for a, b in zip(before, again.encode(small), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.slow
@pytest.mark.parametrize("family", tiny_sams.FAMILIES)
def test_short_numbers_encode_nearly_the_same(own_cache, family, picture):
    needs_torch()
    network, _ = opened(family, own_cache)
    small = SamFrame((0, 0, 130, 90), network.side, network.is_padded).picture(picture)
    exact = network.encode(small)
    network._model = in_ways(network._model, Plan("cpu", "bfloat16", "whole"))
    rounded = network.encode(small)
    assert all(f.dtype == np.float32 for f in rounded)
    for a, b in zip(exact, rounded, strict=True):
        assert np.abs(a - b).mean() < BF16 * a.std()
    decoded = network.decode(rounded, Asked(np.array([[20.0, 20]]), np.ones(1, np.bool_)), True)
    assert decoded.logits.dtype == np.float32


# Where things are -----------------------------------------------------------------------------


@pytest.mark.parametrize("is_padded", [True, False])
@pytest.mark.parametrize("box", [(0, 0, 130, 90), (10, 5, 60, 85)])
def test_a_point_of_the_photo_is_where_its_picture_shows_it(is_padded, box):
    frame = SamFrame(box, 64, is_padded)
    photo = np.zeros((90, 130, 3), np.uint8)
    cv2.circle(photo, (40, 50), 6, (255, 255, 255), -1)
    picture = frame.picture(photo)[..., 0].astype(float)
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]] + 0.5
    seen = np.array([(x * picture).sum(), (y * picture).sum()]) / picture.sum()
    assert np.abs(frame.points(np.array([40.5, 50.5])) - seen).max() < 0.1


@pytest.mark.parametrize("is_padded", [True, False])
def test_logits_come_back_to_where_they_were(is_padded):
    frame = SamFrame((10, 5, 110, 65), 256, is_padded)
    y, x = np.mgrid[:60, :100].astype(np.float32) + 0.5
    logits = (5 - 0.5 * np.hypot(x - 60, y - 25)).astype(np.float32)
    back = frame.unfold(frame.fold(logits, 64), (100, 60))
    assert overlap(back > 0, logits > 0) > 0.9


def masks_of(*discs: float, scores=(0.8, 0.9, 0.7)) -> Masks:
    """Discs of these radii round one centre."""
    y, x = np.mgrid[:64, :64] + 0.5
    logits = [radius - np.hypot(x - 32, y - 32) for radius in discs]
    return Masks(np.array(logits, np.float32), np.array(scores, np.float32))


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_of_three_masks_the_level_chooses(order):
    radii, scores = np.array([8.0, 16, 28])[list(order)], np.array([0.8, 0.9, 0.7])[list(order)]
    masks = masks_of(*radii, scores=scores)
    chosen = [radii[at_level(masks, level)] for level in ("part", "object", "group")]
    assert chosen == [8, 16, 28]


def test_masks_that_are_no_alternatives_are_no_levels():
    same = masks_of(16, 16.2, 15.9)
    doubtful = masks_of(8, 16, 28, scores=(0.1, 0.9, 0.2))
    everything = masks_of(15.9, 16, 99)
    for level in ("part", "group"):
        assert at_level(same, level) == at_level(doubtful, level) == 1
    assert at_level(everything, "group") == 1


# What tells colours, in ONNX files ------------------------------------------------------------


@pytest.fixture(params=LAYOUTS)
def colours(request, own_cache) -> Callable[[], segment.Segmenter]:
    needs("onnx")
    folder = tiny_sams.write_onnx(request.param, own_cache / "onnx")
    models.use_folder("mobile-sam", folder)
    return lambda: segment.load("sam-onnx")


@pytest.fixture
def two_discs() -> np.ndarray:
    image = np.full((240, 400, 3), 90, np.uint8)
    cv2.circle(image, (110, 120), 60, (190, 180, 170), -1)
    cv2.circle(image, (290, 140), 50, (30, 60, 200), -1)
    return image


@pytest.mark.parametrize("at", [(110, 120), (290, 140)])
@pytest.mark.parametrize("size", [1, 3])
def test_a_click_finds_its_disc_along_its_edge(colours, two_discs, at, size):
    large = cv2.resize(two_discs, None, fx=size, fy=size, interpolation=cv2.INTER_CUBIC)
    x, y = at
    radius = 60 if x == 110 else 50
    mask = colours().segment(large, prompt([(x * size, y * size)]), None, silent)
    whole = (x * size, y * size, radius * size, radius * size)
    assert overlap(mask, ellipses(large.shape, whole)) > DISC


def test_further_clicks_add_and_take_away(colours, two_discs):
    segmenter = colours()
    embedding = segmenter.encode(two_discs, silent)
    both = segmenter.segment(two_discs, prompt([(110, 120), (290, 140)]), embedding, silent)
    assert both[120, 110] and both[140, 290] and not both[120, 200]
    one = prompt([(110, 120), (290, 140, False)])
    first = segmenter.segment(two_discs, one, embedding, silent)
    assert first[120, 110] and not first[140, 290]


def test_the_levels_of_a_click_are_nested(colours):
    shades = np.full((200, 200, 3), 30, np.uint8)
    for radius, shade in ((90, 168), (60, 180), (30, 195)):
        cv2.circle(shades, (100, 100), radius, (shade,) * 3, -1)
    segmenter = colours()
    embedding = segmenter.encode(shades, silent)
    click = (Click(100, 100),)
    masks = [
        segmenter.segment(shades, Prompt(click, level=level), embedding, silent)
        for level in ("part", "object", "group")
    ]
    areas = [mask.sum() for mask in masks]
    assert areas[0] < areas[1] < areas[2]
    assert not (masks[0] & ~masks[1]).any() and not (masks[1] & ~masks[2]).any()


def test_what_is_small_in_a_large_photo_is_looked_at_more_closely(own_cache):
    needs("onnx")
    models.use_folder("mobile-sam", tiny_sams.write_onnx("sam", own_cache / "onnx"))
    photo = np.full((900, 1200, 3), 90, np.uint8)
    cv2.rectangle(photo, (600, 400), (631, 447), (190, 180, 170), -1)
    cv2.rectangle(photo, (604, 404), (611, 412), (90, 90, 90), -1)  # finer than the network sees
    truth = photo[..., 0] == 190
    segmenter = segment.load("sam-onnx")
    mask = segmenter.segment(photo, prompt([(605, 440)]), None, silent)
    assert overlap(mask, truth) > 0.9
    assert not mask[408, 608]
    assert len(segmenter._looks) == 1
    looks = list(segmenter._looks)
    embedding = segmenter._view[0]
    segmenter.segment(photo, prompt([(605, 440), (625, 440)]), embedding, silent)
    assert segmenter._looks == looks  # the second click uses the same


def test_the_subject_needs_its_own_network(colours, two_discs):
    with pytest.raises(SelectionError, match="objectmorpher models get u2netp"):
        colours().segment(two_discs, Prompt(is_subject=True), None, silent)


def test_the_subject_is_found_by_its_box(own_cache, monkeypatch, two_discs):
    needs("onnx")
    mine = models.folder()
    with monkeypatch.context() as patch:
        patch.delenv("OBJECTMORPHER_CACHE")
        genuine = models.path("u2netp")
    if genuine is None:
        pytest.skip("u2netp is not in the cache")
    mine.mkdir(parents=True)
    (mine / "u2netp.onnx").symlink_to(genuine)
    models.use_folder("mobile-sam", tiny_sams.write_onnx("sam", own_cache / "onnx"))
    one = two_discs[:, :200]
    mask = segment.load("sam-onnx").segment(one, Prompt(is_subject=True), None, silent)
    assert overlap(mask, ellipses(one.shape, (110, 120, 60, 60))) > DISC


# Which one, and what is missing ---------------------------------------------------------------


def test_auto_takes_a_sam_that_is_here(colours):
    assert segment.load("auto").name == "sam-onnx"
    models.remove_hub("mobile-sam")
    assert segment.load("auto").name == "grabcut"


def test_without_a_gpu_auto_takes_no_sam_that_is_too_slow(own_cache):
    needs_torch()
    at = tiny_sams.write("sam2", own_cache / "a")
    models.use_folder("sam2.1-large", at)
    assert segment.load("auto").name == "grabcut"
    assert segment.load("sam2").missing() is None  # asked for, it runs
    models.use_folder("sam2.1-small", at)
    auto = segment.load("auto")
    assert auto.name == "sam2" and auto.model().id == "sam2.1-small"
    assert segment.load("sam2.1-large").model().id == "sam2.1-large"


@pytest.mark.parametrize("name", ["sam", "sam2", "sam3", "sam-onnx", "sam2.1-tiny", "mobile-sam"])
def test_what_is_missing_is_one_sentence_with_its_remedy(own_cache, name):
    segmenter = segment.load(name)
    reason = segmenter.missing()
    assert reason is not None and "objectmorpher models" in reason and "\n" not in reason
    with pytest.raises(SelectionError, match="objectmorpher models"):
        segmenter.encode(np.zeros((20, 20, 3), np.uint8), silent)


@pytest.mark.parametrize("name", ["torch", "transformers", "safetensors"])
def test_without_pytorch_one_sentence_says_how_to_get_it(own_cache, monkeypatch, name):
    needs_torch()
    models.use_folder("sam2", tiny_sams.write("sam2", own_cache / "sam2"))
    monkeypatch.setitem(sys.modules, name, None)  # as where it is not installed
    reason = segment.load("sam2").missing()
    assert reason == f"SAM 2 is not here: `{models.EXTRA}`"
    assert segment.load("auto").name == "grabcut"


def damaged(family: str, folder: Path, change: Callable[[dict], None]) -> None:
    config = json.loads((folder / "config.json").read_text())
    change(config)
    (folder / "config.json").write_text(json.dumps(config))


def test_weights_that_do_not_fit_are_one_sentence(own_cache, picture):
    needs_torch()
    from safetensors.numpy import load_file, save_file

    at = tiny_sams.write("sam2", own_cache / "sam2")
    weights = load_file(at / "model.safetensors")
    left = dict(list(weights.items())[:-3])
    save_file(left, at / "model.safetensors", {"format": "pt"})
    models.use_folder("sam2", at)
    with pytest.raises(SelectionError, match="lacks some of its weights"):
        segment.load("sam2").encode(picture, silent)
    save_file(weights, at / "model.safetensors", {"format": "pt"})
    damaged("sam2", at, lambda c: c["prompt_encoder_config"].update(image_size=-1))
    models.use_folder("sam2", at)
    with pytest.raises(SelectionError, match="cannot be read"):
        segment.load("sam2").encode(picture, silent)


def test_files_that_are_no_sam_are_one_sentence(own_cache, picture):
    needs("onnx")
    at = tiny_sams.write_onnx("sam", own_cache / "onnx")
    encoder, decoder = at / "tiny.encoder.onnx", at / "tiny.decoder.onnx"
    whole = encoder.read_bytes()
    layout = decoder.read_bytes()
    for first, second, sentence in (
        (whole[: len(whole) // 2], layout, "not an ONNX network"),
        (whole, whole, "not a known layout"),
        (whole, b"hello", "not an ONNX network"),
    ):
        encoder.write_bytes(first)
        decoder.write_bytes(second)
        with pytest.raises(models.ModelError, match=sentence):
            models.use_folder("mobile-sam", at)
    assert models.look_hub("mobile-sam").state == "missing"
    encoder.write_bytes(whole)
    decoder.write_bytes(layout)
    models.use_folder("mobile-sam", at)
    assert models.verify_hub("mobile-sam").state == "ok"
    decoder.write_bytes(bytes(len(layout)))
    assert "not an ONNX network" in models.verify_hub("mobile-sam").reason
    with pytest.raises(SelectionError, match=r"not an ONNX network.* models remove mobile-sam"):
        segment.load("sam-onnx").encode(picture, silent)


@pytest.mark.slow
def test_memory_that_runs_out_is_followed_by_the_next_tier(own_cache, picture, caplog):
    needs_torch()
    import torch

    network, _ = opened("sam2", own_cache)
    least, first = Plan("cpu", "float32", "cpu"), Plan("cpu", "bfloat16", "whole")
    network._model = in_ways(network._model, first, least)
    small = SamFrame((0, 0, 130, 90), network.side, False).picture(picture)
    load, opened_as = network._load, []

    def full(plan: Plan):
        if plan == first:
            raise torch.OutOfMemoryError("CUDA out of memory")
        opened_as.append(plan)
        return load(plan)

    network._model = replace(network._model, open=full)
    ledger.SHARED.clear()
    with caplog.at_level("WARNING"):
        assert network.encode(small)[0].shape[0] == 1
    assert opened_as == [least]
    assert "Memory ran out" in caplog.text and caplog.text.count("\n") == 1
    network._model = replace(network._model, made_of=0, open=lambda plan: full(first))
    with pytest.raises(ModelError, match="not enough memory on the CPU"):
        network.encode(small)
