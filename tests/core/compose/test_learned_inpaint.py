"""PixelHacker, Moebius, LaMa, MI-GAN as tiny networks of random weights: real code paths."""

from __future__ import annotations

import hashlib
import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from objectmorpher_core import models
from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.compose import InpaintError, load
from objectmorpher_core.compose.plate import inpaint_latent, inpaint_onnx
from objectmorpher_core.document.settings import Hint
from objectmorpher_core.models import ModelError, device, ledger
from objectmorpher_core.models.plans import Plan
from objectmorpher_core.models.tensors_only import take_tensors
from objectmorpher_core.scripting.background import PlateTask
from tests.core.compose import tiny_inpainters
from tests.core.models.local_hub import offering
from tests.core.models.small_networks import Ways

pytestmark = pytest.mark.slow

KEYS = Path(__file__).with_name("pixelhacker_keys.json")
F32 = 1e-5  # sums in another order
SUMS = 1e-4  # differences of sums of gates that reach 400
HALF = 0.06  # bfloat16 has 8 bits, and nineteen steps


@pytest.fixture
def hole(view):
    hole = np.zeros(view.shape[:2], bool)
    hole[30:70, 45:75] = True
    return hole


@pytest.fixture(params=tiny_inpainters.FAMILIES)
def family(request, tmp_path, monkeypatch) -> tuple[str, Path]:
    return request.param, tiny_inpainters.bring(request.param, tmp_path, monkeypatch)


@pytest.fixture
def pixelhacker(tmp_path, monkeypatch) -> Path:
    return tiny_inpainters.bring("pixelhacker", tmp_path, monkeypatch)


@pytest.mark.parametrize("length", [1, 16, 37, 100])
@pytest.mark.parametrize("closed", [1.0, 400.0])
def test_chunks_are_the_recurrence(length, closed):
    """Also where gates are all but shut, whose cumulative logarithm no float32 can invert."""
    torch = pytest.importorskip("torch")
    from objectmorpher_core.compose.plate.pixelhacker import chunked, recurrence

    random = torch.Generator().manual_seed(length)
    q, k, logits = torch.randn(3, 2, 3, length, 5, generator=random)
    v = torch.randn(2, 3, length, 7, generator=random)
    gates = torch.nn.functional.logsigmoid(logits * closed) / 16
    torch.testing.assert_close(chunked(q, k, v, gates), recurrence(q, k, v, gates), atol=SUMS,
                               rtol=SUMS)  # fmt: skip


def test_pairs_in_portions_are_the_same(monkeypatch):
    torch = pytest.importorskip("torch")
    from objectmorpher_core.compose.plate import pixelhacker as attention

    q, k, g = torch.randn(3, 1, 2, 70, 4, generator=torch.Generator().manual_seed(0))
    once = attention.chunked(q, k, q, -g.abs())
    monkeypatch.setattr(attention, "AT_ONCE", 1)
    torch.testing.assert_close(attention.chunked(q, k, q, -g.abs()), once)


def test_keys_and_shapes_are_the_published_ones():
    """As the published classes name them, with the published configuration: 862 M numbers."""
    torch = pytest.importorskip("torch")
    pytest.importorskip("diffusers")
    from objectmorpher_core.compose.plate.latent_diffusion import build
    from objectmorpher_core.compose.plate.pixelhacker import PixelHacker

    def flat(tree: dict, path: str = "") -> dict[str, str]:
        found = {}
        for key, value in tree.items():
            here = f"{path}{key}"
            found |= flat(value, here + ".") if isinstance(value, dict) else {here: value}
        return found

    with torch.device("meta"):
        network = build(PixelHacker)
    own = {key: "x".join(map(str, t.shape)) for key, t in network.state_dict().items()}
    assert own == flat(json.loads(KEYS.read_text(encoding="utf-8")))
    assert sum(t.numel() for t in network.parameters()) == 862_251_708


MOEBIUS_KEYS = "fd06a49a2a94b7189289935f238b310fbfde85f42272e72bbe8e750bbbd951f0"  # SHA-256
MOEBIUS_SAYS = (
    -0.725156, 1.893795, 0.536151, 1.526541, -0.545873, 1.680731, 0.991451, 6.23414,
)  # fmt: skip


def test_moebius_is_the_published_network():
    """Against numbers of the published code: names, shapes, and a tiny network's answer."""
    torch = pytest.importorskip("torch")
    pytest.importorskip("diffusers")
    from objectmorpher_core.compose.plate.latent_diffusion import build
    from objectmorpher_core.compose.plate.moebius import Moebius

    with torch.device("meta"):
        network = build(Moebius)
    told = sorted(f"{key} {tuple(t.shape)}" for key, t in network.state_dict().items())
    assert hashlib.sha256("\n".join(told).encode()).hexdigest() == MOEBIUS_KEYS
    assert sum(t.numel() for t in network.parameters()) == 226_041_531
    random, tiny = np.random.default_rng(0), tiny_inpainters.latent("moebius")
    for key, tensor in sorted(tiny.state_dict().items()):
        if tensor.is_floating_point():
            drawn = random.normal(0, 0.7, tensor.shape)
            drawn = 0.5 + np.abs(drawn) if key.endswith("running_var") else drawn
            tensor.copy_(torch.from_numpy(drawn))
    latents = torch.from_numpy(random.normal(0, 1, (2, 9, 8, 8)).astype(np.float32))
    with torch.no_grad():
        said = tiny(latents, torch.tensor([701, 3]), torch.arange(20).view(2, -1))
    np.testing.assert_allclose(said[:, :, 3, 4].numpy().ravel(), MOEBIUS_SAYS, rtol=SUMS)


def test_another_seed_invents_something_else(pixelhacker, view, hole):
    one, other = (load("pixelhacker").inpaint(view, hole, silent, seed) for seed in (0, 1))
    assert (one[hole] != other[hole]).any(1).mean() > 0.5


@pytest.mark.parametrize("name", ["lama", "migan"])
def test_what_is_not_random_ignores_the_seed(name, tmp_path, monkeypatch, view, hole):
    tiny_inpainters.bring(name, tmp_path, monkeypatch)
    one, other = (load(name).inpaint(view, hole, silent, seed) for seed in (0, 1))
    assert not load(name).is_random
    np.testing.assert_array_equal(one, other)


def test_each_step_is_told_and_can_be_the_last(pixelhacker, view, hole):
    told: list[tuple[float, str]] = []
    load("pixelhacker").inpaint(view, hole, lambda f, n: told.append((f, n)))
    steps = [note for _, note in told if "step" in note]
    assert len(steps) == len(set(steps)) == 19
    assert [f for f, _ in told] == sorted(f for f, _ in told)

    def stop(fraction: float, note: str) -> None:
        if "step 3 " in note:
            raise Cancelled

    with pytest.raises(Cancelled):
        load("pixelhacker").inpaint(view, hole, stop)


def test_bfloat16_invents_nearly_the_same(pixelhacker):
    torch = pytest.importorskip("torch")
    from objectmorpher_core.compose.plate.latent_diffusion import load as load_network
    from objectmorpher_core.compose.plate.latent_diffusion import load_codec, sample
    from objectmorpher_core.compose.plate.pixelhacker import PixelHacker

    codec = load_codec(pixelhacker / "vae", "cpu")
    weights = pixelhacker / "diffusion_pytorch_model.safetensors"
    picture = np.random.default_rng(0).random((64, 64, 3), np.float32)
    inside = np.zeros((64, 64), bool)
    inside[20:40, 20:40] = True
    one, other = (
        sample(load_network(PixelHacker, weights, "cpu", number), codec, picture, inside, silent, 0)
        for number in (torch.float32, torch.bfloat16)
    )
    assert one.dtype == other.dtype == np.float32
    assert 0 < np.abs(one - other).mean() < HALF


def test_the_masks_cells_are_whole():
    torch = pytest.importorskip("torch")
    from objectmorpher_core.compose.plate.latent_diffusion import in_cells

    mask = torch.zeros(1, 1, 32, 32)
    mask[..., 13, 13] = 1
    grown = in_cells(mask, 8)
    assert grown.sum() == 64 and grown[..., 8:16, 8:16].min() == 1


def test_memory_that_runs_out_is_followed_by_the_next_tier(pixelhacker, view, hole, monkeypatch):
    torch = pytest.importorskip("torch")
    from objectmorpher_core.compose.plate import latent_diffusion as network

    ways = Ways(Plan("cpu", "bfloat16", "whole"), Plan("cpu", "float32", "cpu"))
    monkeypatch.setattr(inpaint_latent, "need", lambda parameters: ways)
    load_network = network.load

    def full(kind: Any, at: Path, where: str, number: Any) -> Any:
        if number == torch.bfloat16:
            raise torch.OutOfMemoryError("CUDA out of memory")
        return load_network(kind, at, where, number)

    monkeypatch.setattr(network, "load", full)
    filled = load("pixelhacker").inpaint(view, hole, silent)
    np.testing.assert_array_equal(filled[~hole], view[~hole])
    assert next(ledger.SHARED.opened("PixelHacker")[0].parameters()).dtype == torch.float32


def test_auto_takes_what_is_there_and_quick_and_heeds_hints(family, view, hole, monkeypatch):
    name, _ = family
    monkeypatch.setenv(device.DEVICE, "cpu")
    assert load("auto").name == ("patchmatch" if name in tiny_inpainters.LATENT else name)
    assert load("auto", has_hints=True).name == "patchmatch"
    hints = (Hint((10.0, 10.0), (60.0, 50.0), 20.0),)
    tasks = (PlateTask(view, hole, (), hints, inpaint, 0) for inpaint in ("auto", "patchmatch"))
    one, two = (task.run(silent).plate.pixels for task in tasks)
    np.testing.assert_array_equal(one, two)
    models.remove_hub(name)
    assert load("auto").name == "patchmatch"
    with pytest.raises(InpaintError, match=f"models get {name}"):
        load(name)


def test_a_file_cut_off_is_one_sentence(family, view, hole):
    name, folder = family
    (weights,) = [p for p in models.files(name) if p.parent == folder and p.suffix != ".json"]
    content = weights.read_bytes()
    weights.write_bytes(content[: len(content) // 2])
    assert models.look_hub(name).state == "damaged"
    with pytest.raises(InpaintError, match="is not here"):
        load(name)
    if name in tiny_inpainters.LATENT:  # as one that is brought anew
        with pytest.raises(ModelError, match="cut off"):
            models.use_folder(name, folder)
        return
    with pytest.raises(ModelError, match="can be opened"):
        models.use_folder(name, folder)
    weights.write_bytes(bytes(len(content)))
    assert models.look_hub(name).state == "ok", "its size is right"
    assert "can be opened" in models.verify_hub(name).reason
    with pytest.raises(InpaintError, match=rf"^{name} .*can be opened.*`.* models remove {name}`"):
        load(name).inpaint(view, hole, silent)


@pytest.mark.parametrize("fault", ["lacks", "has", "shape", "codec", "config"])
def test_weights_that_do_not_fit_are_one_sentence(pixelhacker, view, hole, fault):
    from safetensors.torch import load_file, save_file

    at = pixelhacker / "diffusion_pytorch_model.safetensors"
    tensors, said = load_file(at), json.loads((pixelhacker / "config.json").read_text())
    key = "diff_model.mid_block.attentions.0.transformer_blocks.0.attn1.g_norm_swish_gate.weight"
    if fault == "lacks":
        del tensors[key]
    elif fault == "has":
        tensors["other"] = tensors[key].clone()
    elif fault == "shape":
        tensors[key] = tensors[key][:1].clone()
    elif fault == "config":
        (pixelhacker / "config.json").write_text(json.dumps({**said, "block_out_channels": [3, 7]}))
    if fault in ("lacks", "has", "shape"):
        save_file(tensors, at)
    if fault == "codec":
        at = pixelhacker / "vae" / "diffusion_pytorch_model.safetensors"
        rest = dict(list(load_file(at).items())[1:])
        save_file(rest, at)
    models.use_folder("pixelhacker", pixelhacker)
    with pytest.raises(InpaintError) as told:
        load("pixelhacker").inpaint(view, hole, silent)
    assert "\n" not in str(told.value) and len(str(told.value)) < 200


def as_published(folder: Path, at: Path) -> Path:
    """The same weights as the pickles in which PixelHacker is published."""
    import torch
    from safetensors.torch import load_file

    name = "diffusion_pytorch_model"
    for source, target in ((folder, at / "ft_places2"), (folder / "vae", at / "vae")):
        target.mkdir(parents=True)
        torch.save(load_file(source / f"{name}.safetensors"), target / f"{name}.bin")
        (target / "config.json").write_bytes((source / "config.json").read_bytes())
    return at


def test_pickles_are_refused_and_converted_when_that_is_asked_for(
    pixelhacker, tmp_path, view, hole
):
    before = load("pixelhacker").inpaint(view, hole, silent)
    published = as_published(pixelhacker, tmp_path / "published")
    models.remove_hub("pixelhacker")
    with pytest.raises(ModelError, match="--convert"):
        models.use_folder("pixelhacker", published)
    state = models.convert_folder("pixelhacker", published)
    assert state.state == "ok" and not state.is_own
    assert not list(state.path.rglob("*.bin")) and list(published.rglob("*.bin"))
    assert models.verify_hub("pixelhacker").state == "ok"
    np.testing.assert_array_equal(load("pixelhacker").inpaint(view, hole, silent), before)


class Payload:
    """What a hostile pickle would run."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self) -> tuple:
        return Path.touch, (self.trace,)


def test_a_pickle_that_holds_more_than_numbers_is_refused(pixelhacker, tmp_path):
    import torch

    published = as_published(pixelhacker, tmp_path / "published")
    models.remove_hub("pixelhacker")
    trace, weights = tmp_path / "ran", published / "ft_places2" / "diffusion_pytorch_model.bin"
    for content in ({"a": Payload(trace)}, {"a": "text"}, [torch.zeros(1)]):
        torch.save(content, weights)
        with pytest.raises((ValueError, pickle.UnpicklingError)):
            take_tensors(weights, tmp_path / "out")
    weights.write_bytes(pickle.dumps(Payload(trace)))
    with pytest.raises(ModelError, match="holds more than numbers"):
        models.convert_folder("pixelhacker", published)
    assert not trace.exists()
    assert models.look_hub("pixelhacker").state == "missing"


def test_what_the_hub_has_as_pickles_arrives_as_numbers(
    pixelhacker, tmp_path, monkeypatch, view, hole
):
    published = as_published(pixelhacker, tmp_path / "published")
    before = load("pixelhacker").inpaint(view, hole, silent)
    models.remove_hub("pixelhacker")
    model = models.hub_model("pixelhacker")
    monkeypatch.setenv("HF_HOME", str(tmp_path / "hf"))
    with offering(monkeypatch, {n: (published / n).read_bytes() for n in model.files}, model):
        at = models.get("pixelhacker")
    assert sorted(p.suffix for p in models.files("pixelhacker")) == [
        ".json", ".safetensors", ".safetensors"
    ]  # fmt: skip
    assert not list(at.rglob("*.bin")) and models.verify_hub("pixelhacker").state == "ok"
    # The published network comes without a config, so this tiny one needs its own.
    (at / "ft_places2" / "config.json").write_text(json.dumps(tiny_inpainters.TINY))
    np.testing.assert_array_equal(load("pixelhacker").inpaint(view, hole, silent), before)


@pytest.mark.parametrize("dark", [False, True])
def test_lama_in_either_numbers_is_the_same(tmp_path, view, hole, dark):
    """Exports end in [0, 1] or in [0, 255]; a photo of a night looks like neither."""
    picture = view[:64, :64].astype(np.float32) / (2550 if dark else 255)
    inside, answers = hole[20:84, 30:94], []
    for scale in (1.0, 255.0):
        at = tmp_path / f"{scale}.onnx"
        at.write_bytes(tiny_inpainters.lama(scale=scale))
        answers.append(inpaint_onnx.OnnxNetwork(at, "lama").fill(picture, inside, silent, 0))
    np.testing.assert_allclose(answers[0], answers[1], atol=F32)
    np.testing.assert_allclose(answers[0][~inside], picture[~inside], atol=F32)


@pytest.mark.parametrize("name", ["lama", "migan"])
def test_another_network_is_refused(tmp_path, monkeypatch, name):
    from tests.core.models.small_networks import brightness

    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))
    at = tmp_path / "other.onnx"
    for data, sentence in ((brightness(), "no known"), (b"hello", "not an ONNX"), (b"", "ONNX")):
        at.write_bytes(data)
        for given in (at, tmp_path):
            with pytest.raises(ModelError, match=sentence):
                models.use_folder(name, given)
    assert models.look_hub(name).state == "missing" and load("auto").name == "patchmatch"
    (tmp_path / "weights.pt").write_bytes(b"")
    with pytest.raises(ModelError, match=r"pickled weights \(weights\.pt\)"):
        models.use_folder(name, tmp_path / "weights.pt")
