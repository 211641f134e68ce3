"""CUPID, tiny and of random weights: a view-conditioned second flow, and a camera."""

# ruff: noqa: E402 (nothing that needs torch can be imported before the skip)
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="CUPID needs torch")
pytest.importorskip("transformers", reason="CUPID needs transformers")

from objectmorpher_core import lift
from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.registration.placement import Hints, Registrar
from objectmorpher_core.lift.trellis.camera import view
from objectmorpher_core.lift.trellis.generator import CupidGenerator, Folders, centres
from objectmorpher_core.lift.trellis.latent import looked_up
from objectmorpher_core.lift.trellis.lifter import FITS, placed, pose_seen
from objectmorpher_core.lift.trellis.picture import ConditionPicture
from objectmorpher_core.lift.trellis.voxels import Voxels
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.segment.matting.matte import build_matte
from objectmorpher_core.splat_files.splats.ply import QUARTER_TURN
from tests.core.lift import registered
from tests.core.lift.trellis import tiny_trellis

PARTS = tiny_trellis.PARTS
DECODER = PARTS["sparse_structure_decoder"][1]
CUPID_PARTS = {
    "sparse_structure_flow_model": (
        "SparseStructureFlowModel",
        {**PARTS["sparse_structure_flow_model"][1], "in_channels": 16, "out_channels": 16},
    ),
    "sparse_structure_decoder": PARTS["sparse_structure_decoder"],
    "sparse_structure_uv_decoder": ("SparseStructureDecoder", {**DECODER, "out_channels": 3}),
    "slat_flow_model": (
        "ElasticVisualLatentConditioningSLatFlowModel",
        {
            **PARTS["slat_flow_model"][1], "cond_latent_channels": 8,
            "visual_feat_channels": [4, 4], "visual_feat_resolution": 32,
        },
    ),
    "slat_decoder_gs": PARTS["slat_decoder_gs"],
}  # fmt: skip
SHARED_PARTS = {
    "slat_enc_swin8_B_64l8_fp16": (
        "ElasticSLatEncoder",
        {
            "resolution": tiny_trellis.CELLS, "in_channels": tiny_trellis.WIDTH,
            "model_channels": 24, "latent_channels": 8, "num_blocks": 2, "num_heads": 2,
            "mlp_ratio": 2, "attn_mode": "swin", "window_size": 8, "use_fp16": True,
        },
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    root = tmp_path_factory.mktemp("cache") / "models"
    return Folders(
        tiny_trellis.write_model(root / "cupid", CUPID_PARTS),
        tiny_trellis.write_encoder(root / "dinov2-with-registers-large"),
        tiny_trellis.write_model(root / "trellis-image-large", SHARED_PARTS),
    )


@pytest.fixture
def generator(folders):
    return CupidGenerator(folders, tiny_trellis.CPU)


def test_it_makes_an_object_and_how_it_is_seen(generator, picture):
    made, again = generator.make(picture, seed=1), generator.make(picture, seed=1)
    assert np.array_equal(made.gaussians.means, again.gaussians.means)
    assert len(made.gaussians) == 4 * len(made.voxels)
    turn = made.view.camera_from_object[:, :3]
    assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-9) and np.linalg.det(turn) > 0
    assert np.array_equal(made.view.camera_from_object, again.view.camera_from_object)
    assert made.view.uv.shape == (len(made.voxels), 2) and not generator._parts


def test_the_second_flow_sees_the_picture_through_its_extra_channels(generator, picture):
    with torch.inference_mode():
        seen = generator._seen(picture)
        latents = torch.randn(1, 16, *[tiny_trellis.LATENTS] * 3)
        extras = generator._extras(picture, seen, generator._placed(latents))
    own = CUPID_PARTS["slat_flow_model"][1]["in_channels"]
    assert extras.shown.shape[2] == 8 + 4 + 4
    assert generator.part("slat_flow_model").form.in_channels == own + 16
    assert not extras.hidden[..., :8].any() and extras.shown[..., :8].any()
    assert not torch.equal(extras.hidden[..., 8:], extras.shown[..., 8:])


def test_looking_up_meets_the_middles_of_pixels():
    grid = torch.arange(12.0).reshape(1, 1, 3, 4)
    uv = torch.tensor([[0.125, 0.5 / 3], [0.875, 2.5 / 3], [0.25, 0.5]])
    assert torch.allclose(looked_up(grid, uv)[0, :, 0], torch.tensor([0.0, 11.0, 4.5]), atol=1e-5)


def test_middles_of_cells_lie_in_the_cube():
    voxels = Voxels(torch.tensor([[0, 0, 0], [15, 15, 15]]), 16)
    assert np.allclose(centres(voxels), [[-15 / 32] * 3, [15 / 32] * 3])


def test_it_cancels(generator, picture):
    def progress(fraction, note):
        if fraction > 0.6:
            raise Cancelled

    with pytest.raises(Cancelled):
        generator.make(picture, progress)


def test_where_cells_are_seen_is_where_the_object_stands():
    """From the network's axes and its picture's square to ours and the photo's pixels."""
    _, scene = registered.known_bracket()
    picture = ConditionPicture.of(build_matte(scene.pixels, scene.mask, 12))
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (400, 3))  # z up
    ours = points @ QUARTER_TURN.T
    turn, shift = scene.world_from_object[:3, :3], scene.world_from_object[:3, 3]
    xy = scene.camera.project(ours @ turn.T + shift)
    seen = view(points, (xy - [picture.left, picture.top]) / picture.side)
    found = pose_seen(seen, picture, scene.camera)
    assert found is not None and np.allclose(found, scene.world_from_object, atol=1e-5)
    assert seen.intrinsic[0, 0] == pytest.approx(scene.camera.focal / picture.side)


def test_a_pose_that_fits_is_kept():
    gaussians, scene = registered.known_bracket()
    registrar = Registrar(gaussians, scene.target)
    near = scene.world_from_object.copy()
    near[:3, 3] += [0.01, 0.0, 0.02]
    told = []
    found = placed(gaussians, scene.target, Hints(start=near), lambda f, n: told.append(n), seed=0)
    assert found.score > FITS and told == ["Fitting the object"]
    assert registered.turn_error(found.world_from_object, scene.world_from_object) < 3
    assert found.score >= registrar.rated(near).score


@pytest.mark.slow
def test_instead_of_a_pose_that_does_not_fit_another_is_looked_for():
    gaussians, scene = registered.known_bracket()
    wrong = scene.world_from_object.copy()
    wrong[:3, :3] = wrong[:3, :3] @ np.diag([1.0, -1, -1])
    found = placed(gaussians, scene.target, Hints(start=wrong), silent, seed=0)
    assert registered.turn_error(found.world_from_object, scene.world_from_object) < 3


def test_a_mask_becomes_a_registered_object(folders, subject, monkeypatch):
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(folders.model.parents[1]))
    _, lifted = lift_mask(*subject, "cupid")
    assert lifted.backend == "cupid"
    assert (lifted.world_points(lifted.body.means)[:, 2] > 0).all()


def test_a_missing_part_is_one_sentence(folders, picture, tmp_path):
    lacking = replace(folders, shared=None)
    with pytest.raises(LiftError, match="not complete"):
        CupidGenerator(lacking, tiny_trellis.CPU).make(picture)


def test_missing_weights_are_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path))
    with pytest.raises(LiftError, match="models get cupid"):
        lift.load("cupid")
