"""TripoSplat: its networks against numbers of the published code, and tiny ones from end to end."""

# ruff: noqa: E402 (nothing that needs torch can be imported before the skip)
from __future__ import annotations

import hashlib

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="TripoSplat needs torch")
pytest.importorskip("transformers", minversion="5.6", reason="TripoSplat needs transformers")
pytest.importorskip("diffusers", reason="TripoSplat needs diffusers")

from objectmorpher_core import models
from objectmorpher_core.base.progress import Cancelled
from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.trellis.lifter import TripoSplatLifter
from objectmorpher_core.lift.triposplat import networks
from objectmorpher_core.lift.triposplat.generator import DINO, SAMPLING, TripoSplatGenerator
from objectmorpher_core.models import ModelError
from objectmorpher_core.models.plans import Plan
from tests.core.lift.trellis.conftest import one_thread, picture, subject  # noqa: F401
from tests.core.lift.triposplat import tiny_triposplat
from tests.core.lift.triposplat.tiny_triposplat import FORM

SUMS = 1e-4  # relative, of sums in another order
PUBLISHED = {  # SHA-256 of all names and shapes
    networks.Flow: "7ff101e0bcb1f9e0fefe5a94cf017301e989942d930f8cff8fbca15b54d27a87",
    networks.Decoder: "40f24a1617d5fb2f20f3226a505166f2e34b43aaf9bcafe0d39120129b437661",
}
VELOCITY = -34.74908, 5.92456, 37.77288, 13.28139, 27.65883, 25.95625, -44.02889, 0.0
LOGITS = -0.79118, -0.84592, 2.23696, -3.28931, 3.09325, 0.78866, 3.98056, 0.26008
FEATURES = -4.23874, 4.95489, -0.48226, 1.48556, -6.95787, -2.97459, -1.33077, -4.55002


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path))
    return tiny_triposplat.bring(tmp_path / "models" / "triposplat", monkeypatch)


@pytest.fixture
def generator(folder):
    return TripoSplatGenerator(folder, Plan("cpu", "float32", "cpu"))


@pytest.mark.parametrize("kind", PUBLISHED)
def test_keys_and_shapes_are_the_published_ones(kind):
    with torch.device("meta"):
        network = kind(networks.FORM)
    condition = sorted(f"{key} {tuple(t.shape)}" for key, t in network.state_dict().items())
    assert hashlib.sha256("\n".join(condition).encode()).hexdigest() == PUBLISHED[kind]


def test_what_they_say_is_what_the_published_code_says():
    random = np.random.default_rng(0)

    def normal(*shape: int) -> torch.Tensor:
        return torch.from_numpy(random.normal(0, 0.4, shape).astype(np.float32))

    flow, decoder = networks.Flow(FORM).eval(), networks.Decoder(FORM).eval()
    for network in (flow, decoder):
        for key, tensor in sorted(network.state_dict().items()):
            if "offset" not in key:
                tensor.copy_(normal(*tensor.shape))
    latents, camera = normal(1, 7, 4), FORM.camera
    latents[:, -1, camera:] = 0
    with torch.inference_mode():
        velocity = flow(latents, torch.tensor([420.0]), normal(1, 9, FORM.seen + FORM.drawn))
        points = torch.from_numpy(random.random((1, 3, 3), np.float32))
        logits = decoder.octree(points, 16, latents[:, :-1])
        features = decoder.gs(points, latents[:, :-1])
    for found, said in (
        (velocity[0, [0, -1]], VELOCITY), (logits[0, 1], LOGITS), (features[0, 1, ::60], FEATURES),
    ):  # fmt: skip
        np.testing.assert_allclose(found.flatten(), said, rtol=SUMS, atol=SUMS)


def test_draws_are_dealt_as_the_shares_are():
    random = torch.Generator().manual_seed(0)
    shares = torch.rand(200, 8, generator=random, dtype=torch.float64).pow(4)
    shares, counts = shares / shares.sum(1, keepdim=True), torch.arange(200)
    found = networks.dealt(shares, counts, torch.rand(200, 1, generator=random))
    assert (found.sum(1) == counts).all() and found.min() >= 0
    assert (found - shares * counts[:, None]).abs().max() < 1


def test_as_many_gaussians_as_are_asked_for_and_the_same_for_a_seed(generator, picture):  # noqa: F811
    few, again, other, many = (
        generator.make(picture, count, seed=seed)
        for count, seed in ((640, 1), (640, 1), (640, 2), (3200, 1))
    )
    assert (len(few), len(many)) == (640, 3200)
    assert np.array_equal(few.means, again.means)
    assert not np.array_equal(few.means, other.means)
    assert np.abs(many.means).max() < 0.6 and (many.scales >= 9e-4).all()


def test_each_step_is_told_and_can_be_the_last(generator, picture):  # noqa: F811
    condition = []
    generator.make(picture, 64, lambda fraction, note: condition.append((fraction, note)))
    assert [f for f, _ in condition] == sorted(f for f, _ in condition)
    assert sum("step" in note for _, note in condition) == SAMPLING.steps

    def stop(fraction: float, note: str) -> None:
        if "step 3 " in note:
            raise Cancelled

    with pytest.raises(Cancelled):
        generator.make(picture, 64, stop)
    assert not generator._parts


def test_another_encoder_is_one_sentence(folder, generator, picture):  # noqa: F811
    from safetensors.torch import load_file, save_file

    found = load_file(folder / DINO)
    save_file({key: t for key, t in found.items() if "layer.1" not in key}, folder / DINO)
    with pytest.raises(LiftError, match=r"dino_v3_vit_h.* lacks layer\.1"):
        generator.make(picture, 64)


def test_the_licence_of_its_encoder_has_to_be_accepted(folder, tmp_path):
    model = models.hub_model("triposplat")
    with pytest.raises(ModelError, match="--accept-licence 'DINOv3 License'"):
        models.check_licence(model, "")
    models.check_licence(model, "dinov3 license")
    assert TripoSplatLifter().missing() is None
    models.use_folder("triposplat", folder)
    (folder / DINO).rename(tmp_path / "elsewhere")
    with pytest.raises(ModelError, match="dino_v3_vit_h"):
        models.use_folder("triposplat", folder)


def test_networks_are_made_on_the_device_that_is_asked_for(monkeypatch) -> None:
    """Also where torch.device overlooks linspace, which other libraries replace for a while."""
    from torch.utils import _device

    known = _device._device_constructors()
    monkeypatch.setattr(_device, "_device_constructors", lambda: known - {torch.linspace})
    with torch.device("meta"):
        made = networks.Flow(networks.FORM), networks.Decoder(networks.FORM)
    assert {p.device.type for network in made for p in network.parameters()} == {"meta"}
