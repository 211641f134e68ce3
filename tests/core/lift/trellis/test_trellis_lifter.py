"""From a photo and a mask to a registered object, with a tiny TRELLIS of random configs."""

# ruff: noqa: E402 (nothing that needs torch can be imported before the skip)
from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="TRELLIS needs torch")
pytest.importorskip("transformers", reason="TRELLIS needs transformers")

from safetensors.torch import load_file, save_file

from objectmorpher_core import lift
from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.trellis import configs
from objectmorpher_core.lift.trellis import generator as generators
from objectmorpher_core.lift.trellis.generator import Generator, unseen
from objectmorpher_core.lift.trellis.lifter import TrellisLifter
from objectmorpher_core.lift.trellis.parts import build
from objectmorpher_core.models import ledger
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.segment.matting.matte import build_matte
from tests.core.lift.trellis import tiny_trellis
from tests.core.models.small_networks import Ways

F32 = 1e-5
ARRAYS = ("means", "quats", "scales", "opacities", "colors")


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    return tiny_trellis.write(tmp_path_factory.mktemp("cache") / "models")


@pytest.fixture
def generator(folders):
    return Generator(folders, tiny_trellis.CPU)


@pytest.fixture
def installed(folders, monkeypatch):
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(folders.model.parents[1]))


def same(one, other):
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ARRAYS)


def test_the_picture_is_the_object_on_black_and_knows_where_it_was(subject, picture):
    mask = subject[2]
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    low, high = np.array([columns[0], rows[0]]), np.array([columns[-1], rows[-1]])
    middle = picture.photo_xy(np.array([0.5, 0.5]))
    assert np.abs(middle - 0.5 * (low + high)).max() <= 3  # the soft edge
    assert picture.side == pytest.approx(1.2 * (high - low).max(), abs=6)
    rgb = picture.on_black(64)
    assert rgb.shape == (64, 64, 3) and rgb.min() >= 0 and rgb.max() <= 1
    assert rgb[:3].max() == 0 and rgb[32, 32].max() > 0.1


def test_another_seed_makes_another_object(generator, picture):
    one, other = (generator.make(picture, seed=s).gaussians for s in (1, 2))
    assert len(one) != len(other) or not same(one, other)


def test_one_token_of_nothing_tells_a_flow_what_all_of_them_do():
    torch.manual_seed(0)
    flow = build(tiny_trellis.description("sparse_structure_flow_model")).eval()
    noise, seen = torch.randn(1, 8, 4, 4, 4), torch.randn(1, 20, tiny_trellis.WIDTH)
    time = torch.full((1,), 500.0)
    with torch.inference_mode():
        all_of_them = flow(noise, time, torch.zeros_like(seen))
        assert torch.allclose(flow(noise, time, unseen(seen)), all_of_them, atol=F32)
        assert not torch.allclose(flow(noise, time, seen), all_of_them, atol=100 * F32)


def test_what_is_made_lies_in_its_cube(generator, picture):
    made = generator.make(picture)
    cell = 1 / tiny_trellis.CELLS
    assert len(made.gaussians) == 4 * len(made.voxels)
    assert np.abs(made.gaussians.means).max() <= 0.5 + 0.25 * cell
    own = (made.voxels.cells.numpy().repeat(4, 0) + 0.5) * cell - 0.5
    assert np.abs(made.gaussians.means - own).max() <= 0.75 * cell + 1e-6
    assert (made.gaussians.scales >= 9e-4).all()


@pytest.mark.parametrize("number", ["float16", "bfloat16"])
def test_lower_precision_makes_nearly_the_same(folders, picture, number):
    full, low = (
        Generator(folders, replace(tiny_trellis.CPU, number=d)).make(picture)
        for d in ("float32", number)
    )
    cells = [set(map(tuple, made.voxels.cells.tolist())) for made in (full, low)]
    assert len(cells[0] & cells[1]) > 0.9 * len(cells[0] | cells[1])


def test_memory_is_given_back_unless_it_is_to_be_kept(folders, generator, picture):
    generator.make(picture)
    assert not generator._parts
    keeping = Generator(folders, replace(tiny_trellis.CPU, way="whole", kept=1))
    assert same(keeping.make(picture).gaussians, generator.make(picture).gaussians)
    assert len(keeping._parts) == 5


def test_progress_rises_at_every_step_and_cancels_anywhere(generator, picture):
    told = []
    generator.make(picture, lambda fraction, note: told.append((fraction, note)))
    fractions = [fraction for fraction, _ in told]
    assert fractions == sorted(fractions) and fractions[0] >= 0 and fractions[-1] <= 1
    assert sum("step" in note for _, note in told) == 6
    for stop in range(len(told)):
        left = iter(range(stop))

        def progress(fraction, note, left=left):
            if next(left, None) is None:
                raise Cancelled

        with pytest.raises(Cancelled):
            generator.make(picture, progress)
        assert not generator._parts


def test_numbers_that_are_none_are_one_sentence(folders, picture, tmp_path):
    copy = Path(shutil.copytree(folders.model, tmp_path / "model"))
    path = copy / "ckpts" / "slat_flow_model.safetensors"
    state = load_file(str(path))
    save_file(
        {**state, "out_layer.bias": torch.full_like(state["out_layer.bias"], torch.nan)}, path
    )
    with pytest.raises(LiftError, match="not finite"):
        Generator(replace(folders, model=copy), tiny_trellis.CPU).make(picture)


def test_too_many_cells_are_cut_to_the_surest(monkeypatch):
    torch.manual_seed(0)
    logits = torch.randn(8, 8, 8)
    monkeypatch.setattr(generators, "CELLS", 40)
    voxels = generators.occupied(logits)
    assert len(voxels) == 40
    assert logits[*voxels.cells.T].min() >= logits.flatten().topk(41).values[-1]
    with pytest.raises(LiftError, match="another seed"):
        generators.occupied(-logits.abs() - 1)


def test_out_of_memory_falls_back_to_one_part_at_a_time(installed, picture, monkeypatch):
    whole = replace(tiny_trellis.CPU, way="whole", kept=1)
    monkeypatch.setattr(TrellisLifter, "need", lambda self: Ways(whole, tiny_trellis.CPU))

    def make(generator):
        if generator.plan.keeps:
            raise torch.OutOfMemoryError("no")
        return generator.make(picture)

    assert len(TrellisLifter().make(make).gaussians)
    generator = ledger.SHARED.opened("TRELLIS")
    assert generator.plan == tiny_trellis.CPU and not generator._parts

    def never(_):
        raise torch.OutOfMemoryError("no")

    with pytest.raises(LiftError, match=r"not enough memory on the CPU.*as a relief"):
        TrellisLifter().make(never)


def test_a_mask_becomes_a_registered_object_with_the_photo_on_it(installed, subject):
    pixels, camera, mask = subject
    told = []
    _, lifted = lift_mask(
        pixels, camera, mask, "trellis", progress=lambda f, n: told.append((f, n))
    )
    assert lifted.backend == "trellis" and lifted.splatting == "mip"
    world = lifted.world_points(lifted.body.means)
    assert (world[:, 2] > 0).all()
    middle = camera.project(world).mean(0)
    assert np.abs(middle - [camera.cx, camera.cy]).max() < 30  # px: over the mask
    assert (lifted.texture.visibility > 0.5).any() and (lifted.texture.visibility < 0.5).any()
    assert any("agree" in note for _, note in told)


def test_nothing_selected_is_one_sentence(installed, subject):
    pixels, camera, mask = subject
    matte = build_matte(pixels, mask, 12)
    empty = lift.LiftSubject(pixels, camera, mask, replace(matte, alpha=np.zeros_like(matte.alpha)))
    with pytest.raises(LiftError, match="nothing is selected"):
        TrellisLifter().lift(empty, lift.LiftSettings(), silent)


def test_missing_weights_are_one_sentence_that_says_how_to_get_them(tmp_path, monkeypatch):
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path))
    with pytest.raises(LiftError) as error:
        lift.load("trellis")
    for told in ("models get trellis-image-large", "models add trellis FOLDER", "MIT", "GB"):
        assert told in str(error.value)
    tiny_trellis.write_model(configs.weights_folder(configs.TRELLIS))
    with pytest.raises(LiftError, match="dinov2-with-registers-large"):
        lift.load("trellis")
    tiny_trellis.write_encoder(configs.weights_folder(configs.ENCODER))
    assert lift.load("trellis").name == "trellis"


def test_missing_packages_are_one_sentence(monkeypatch):
    monkeypatch.setattr(configs, "PACKAGES", ("torch", "no_such_package"))
    missing = TrellisLifter().missing()
    assert missing == "no_such_package is not installed: objectmorpher models setup"
