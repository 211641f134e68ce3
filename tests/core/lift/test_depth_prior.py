"""A relief that follows an installed depth network, and one that has none."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_core import models
from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.progress import silent
from objectmorpher_core.document.edits import EditError, set_depth
from objectmorpher_core.document.model import LiftedObject, LiftSettings, show_the_same
from objectmorpher_core.lift import LiftSubject
from objectmorpher_core.lift.relief.body import BACK, FRONT, MIDDLE, ReliefBody
from objectmorpher_core.lift.relief.depth_look import box_around, look_at_all
from objectmorpher_core.lift.relief.depth_prior import NetworkDepth, align, follow, membrane
from objectmorpher_core.lift.relief.lifter import ReliefLifter
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.lift.relief.thickness import with_thickness
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.segment.matting.matte import build_matte
from objectmorpher_core.session.file import decode_session, encode_session
from tests import shapes
from tests.core.models.small_networks import brightness, constant

LIFTING = Path(__file__).parents[3] / "docs" / "lifting"
WIDTH, HEIGHT = 320, 240  # px
CAMERA = shapes.camera(WIDTH, HEIGHT)
AS_SEEN = LiftSettings(2000)
ALONE = LiftSettings(2000, uses_depth=False)
SAME = 1e-4  # px: the network's float32


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))


def install(tmp_path: Path, network: bytes) -> None:
    (tmp_path / "net.onnx").write_bytes(network)
    models.add("depth", tmp_path / "net.onnx")


def test_a_look_at_the_whole_photo_is_kept_in_its_document(tmp_path: Path) -> None:
    document = shapes.scene("disc").document()
    assert look_at_all(document.photo.pixels) is None
    install(tmp_path, brightness())
    known = set_depth(document, look_at_all(document.photo.pixels))
    opened = decode_session(encode_session(known))
    assert known.depth is not None and opened.depth is not None
    assert np.array_equal(known.depth, opened.depth)
    assert not show_the_same(document, known)
    with pytest.raises(EditError, match="a number for each"):
        set_depth(document, np.full((3, 4), np.nan, np.float32))


def lifted(
    settings: LiftSettings,
    pixels: np.ndarray | None = None,
    size: tuple[int, int] = (WIDTH, HEIGHT),
) -> LiftedObject:
    inside = shapes.mask("ellipse", *size)
    own = shapes.picture(inside) if pixels is None else pixels
    return lift_mask(own, shapes.camera(*size), inside, "relief", settings)[1]


def body(name: str = "ellipse", thickness: float = 1.0) -> ReliefBody:
    outline = ReliefSilhouette.of(shapes.mask(name, WIDTH, HEIGHT))
    return ReliefBody.of(outline, CAMERA, LiftSettings(thickness=thickness))


def seen_from(inverse: F64) -> NetworkDepth:
    return NetworkDepth(np.asarray(inverse, np.float32), (0, 0, WIDTH, HEIGHT))


def lumpy(name: str = "ellipse") -> F64:
    """(H, W) inverse depth of a body that leans, and has a lump where its silhouette tells none."""
    own = body(name)
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    xy = np.column_stack([x.ravel(), y.ravel()])
    height = own.sample(xy, FRONT)[0].reshape(HEIGHT, WIDTH)
    lump = 0.15 * own.silhouette.extent * np.exp(-((x - 190) ** 2 + (y - 110) ** 2) / 2 / 18**2)
    return 1 / (1 - (height + lump + 0.3 * (x - 160)) / CAMERA.focal)


def same(one: LiftedObject, other: LiftedObject) -> bool:
    own = [
        (a.gaussians.means, a.gaussians.quats, a.gaussians.scales, a.gaussians.colors,
         a.texture.u0, a.texture.visibility, a.control_points, a.middle)
        for a in (one, other)
    ]  # fmt: skip
    return all(np.array_equal(a, b) for a, b in zip(*own, strict=True))


def test_without_a_network_or_without_its_word_everything_is_as_before(tmp_path: Path) -> None:
    as_seen, alone = (partial(lifted, told, size=(96, 72)) for told in (AS_SEEN, ALONE))
    before = as_seen()
    assert same(before, alone())
    install(tmp_path, brightness())
    assert same(before, alone())
    seen = as_seen()
    assert not same(before, seen) and same(seen, as_seen())
    models.remove("depth")
    assert same(before, as_seen())


def test_what_is_bright_comes_nearer_where_brightness_is_depth(tmp_path: Path) -> None:
    inside = shapes.mask("ellipse", WIDTH, HEIGHT)
    inverse = np.where(inside, lumpy(), 0.8)
    grey = 255 * (inverse - inverse.min()) / np.ptp(inverse)
    pixels = np.repeat(grey[..., None], 3, -1).astype(np.uint8)
    install(tmp_path, brightness())
    gaps = []
    for settings in (AS_SEEN, ALONE):
        made = lifted(settings, pixels)
        front = (made.texture.visibility > 0) & (made.texture.solidity > 0)
        depth = made.world_points(made.gaussians.means)[front, 2]
        x, y = made.texture.u0[front].T
        right, left = (np.hypot(x - at, y - 110) < 12 for at in (190, 130))
        gaps.append(np.median(depth[left]) - np.median(depth[right]))
    assert gaps[0] > gaps[1] + 0.1, "in units of its own size"


@pytest.mark.parametrize("name", ["ellipse", "star", "disc"])
def test_the_front_is_where_the_network_sees_it_and_the_rim_stays_closed(name: str) -> None:
    plain = body(name)
    made = follow(plain, seen_from(5 * lumpy(name) - 2), CAMERA.focal, 1.0, None)
    outline = plain.silhouette
    at_rim, _ = outline.contour
    gaps = [np.subtract(*(b.sample(at_rim, side)[0] for side in (FRONT, BACK)))
            for b in (plain, made)]  # fmt: skip
    assert np.abs(gaps[1] - gaps[0]).max() < 0.03 * outline.extent
    rows, columns = np.nonzero(outline.depth > 0.06 * outline.extent)
    xy = outline.photo_xy(np.column_stack([columns, rows]).astype(float))
    front, back, middle = (made.sample(xy, side)[0] for side in (FRONT, BACK, MIDDLE))
    assert (front > middle).all() and (middle > back).all()
    told = 1 / (1 - front / CAMERA.focal)
    assert np.corrcoef(told, seen_from(lumpy(name)).at(xy))[0, 1] > 0.99


def test_neither_scale_nor_shift_of_what_is_seen_matters() -> None:
    one, other = (
        follow(body(), seen_from(inverse), CAMERA.focal, 1.0, None)
        for inverse in (lumpy(), 40 * lumpy() + 300)
    )
    assert one.detail is not None and other.detail is not None
    assert np.abs(one.middle - other.middle).max() < 200 * SAME
    assert np.abs(one.detail - other.detail).max() < 200 * SAME


@pytest.mark.parametrize("inverse", [-1, 0, np.nan], ids=["hollow", "flat", "nothing"])
def test_what_contradicts_the_silhouette_or_says_nothing_is_ignored(inverse: float) -> None:
    plain = body()
    made = follow(plain, seen_from(inverse * lumpy()), CAMERA.focal, 1.0, None)
    assert np.array_equal(made.middle, plain.middle)
    assert made.detail is None or not made.detail.any()


def test_the_relief_stays_sane_whatever_is_seen() -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        wild = lumpy() + rng.normal(0, 1, (HEIGHT, WIDTH)) * rng.uniform(0, 10)
        made = follow(body(), seen_from(wild), CAMERA.focal, 1.0, None)
        rows, columns = np.nonzero(made.silhouette.inside)
        xy = made.silhouette.photo_xy(np.column_stack([columns, rows]).astype(float))
        front, back = (made.sample(xy, side)[0] for side in (FRONT, BACK))
        assert (front > back - SAME).all() and (front < 0.5 * CAMERA.focal).all()
        assert (back > -1.5 * CAMERA.focal).all()


def test_the_thickness_is_still_the_users(tmp_path: Path) -> None:
    thin, thick = (
        follow(body(thickness=s), seen_from(lumpy()), CAMERA.focal, s, None) for s in (0.5, 1.5)
    )
    assert np.abs(thin.middle - thick.middle).max() < SAME
    xy = np.array([[190.0, 110.0], [140.0, 120.0]])
    gaps = [b.sample(xy, FRONT)[0] - b.sample(xy, MIDDLE)[0] for b in (thin, thick)]
    assert np.abs(gaps[1] - 3 * gaps[0]).max() < 10 * SAME
    install(tmp_path, constant(lumpy().astype(np.float32)))
    whole = lifted(AS_SEEN)
    slid = with_thickness(whole, CAMERA, 0.5)
    wanted = lifted(replace(AS_SEEN, thickness=0.5))
    ranges = [np.ptp(each.world_points(each.gaussians.means)[:, 2]) for each in (slid, wanted)]
    assert ranges[0] == pytest.approx(ranges[1], rel=0.05)


def test_the_brush_adds_to_what_is_seen(tmp_path: Path) -> None:
    install(tmp_path, constant(lumpy().astype(np.float32)))
    near = np.zeros((24, 32), np.float32)
    near[:, 20:] = 0.2
    painted, plain = lifted(replace(AS_SEEN, nearness=near)), lifted(AS_SEEN)
    assert painted.middle is not None and plain.middle is not None
    steps = []
    for each in (painted, plain):
        x, z = each.texture.u0[:, 0], each.middle[:, 0]  # type: ignore[index]
        steps.append(np.median(z[x < 150]) - np.median(z[x > 220]))
    assert steps[0] - steps[1] == pytest.approx(0.2, abs=0.05)


def test_what_hides_the_object_tells_nothing_of_its_depth() -> None:
    outline = body().silhouette
    at = outline.photo_xy(outline.cells)
    hidden = (np.abs(at - [160, 120]) < 15).all(-1) & outline.inside
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    wall = (np.abs(x - 160) < 15) & (np.abs(y - 120) < 15)
    clean, before = (
        follow(body(), seen_from(inverse), CAMERA.focal, 1.0, hidden)
        for inverse in (lumpy(), np.where(wall, 9.0, lumpy()))
    )
    away = outline.depth[hidden].min() >= 0 and ~hidden
    assert np.abs(clean.middle - before.middle)[away].max() < 0.02 * outline.extent


def test_a_membrane_goes_through_its_rim_and_is_level_between() -> None:
    outline = body().silhouette
    rim = outline.inside & (outline.depth < 0.05 * outline.extent)
    level = membrane(np.full(outline.shape, 7.0), rim, outline)
    assert np.abs(level - 7).max() < 1e-6
    slope = outline.cells[..., 0]
    leaning = membrane(slope, rim, outline)
    assert np.abs(leaning - slope)[outline.inside].max() < 0.05 * np.ptp(slope)


def test_too_few_cells_align_nothing() -> None:
    few = np.zeros((20, 20), bool)
    few[3, 3:9] = True
    assert align(np.random.default_rng(0).random((20, 20)), np.ones((20, 20)), few) is None


def test_an_installed_network_looks_at_the_object_and_around_it(tmp_path: Path) -> None:
    inside = shapes.mask("ellipse", WIDTH, HEIGHT)
    box = box_around(inside)
    rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
    assert box[0] < columns[0] and box[1] < rows[0] and box[2] > columns[-1] + 1
    part = lumpy()[box[1] : box[3], box[0] : box[2]].astype(np.float32)
    install(tmp_path, constant(part))
    matte = build_matte(shapes.picture(inside), inside, 20)
    subject = LiftSubject(shapes.picture(inside), CAMERA, inside, matte)
    told = ReliefLifter(lambda pixels, mask: NetworkDepth(part, box)).lift(subject, AS_SEEN, silent)
    assert same(told, ReliefLifter().lift(subject, AS_SEEN, silent))
    assert not same(told, ReliefLifter().lift(subject, ALONE, silent))


@pytest.mark.slow
def test_with_true_depth_solids_turn_better_than_from_their_outline(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("skimage")
    monkeypatch.syspath_prepend(str(LIFTING))
    import solids  # type: ignore[import-not-found]
    import turning  # type: ignore[import-not-found]

    turns = {k: e for k, e in turning.EDITS.items() if e.group in ("turn 20", "turn 35")}
    monkeypatch.setattr(turning, "EDITS", turns)
    gains = []
    for name in solids.MADE:
        found = turning.measured(turning.make_scene(name, LIFTING), ("relief", "depth"))
        plain, deep = (
            turning.mean(score for (_, own), (_, score) in found.items() if own == way)
            for way in ("relief", "depth")
        )
        gains.append((deep.psnr - plain.psnr, deep.iou - plain.iou))
    psnr, iou = np.mean(gains, axis=0)
    assert psnr > 2.0  # dB; it is 3.1
    assert iou > 0.04  # it is 0.067
    assert np.min(gains, axis=0)[0] > -0.5
