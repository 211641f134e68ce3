"""TRELLIS's weights in the manager: the user's folders, the Hub's, and what is wrong with them."""

# ruff: noqa: E402 (nothing that needs torch can be imported before the skip)
from __future__ import annotations

import json
import os
import shutil

import pytest

torch = pytest.importorskip("torch", reason="TRELLIS needs torch")
pytest.importorskip("transformers", reason="TRELLIS needs transformers")

from objectmorpher_core import lift, models
from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.trellis import configs, lifter
from objectmorpher_core.models import device, ledger
from tests.core.lift.trellis import tiny_trellis
from tests.core.models.local_hub import serving


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    at = tmp_path_factory.mktemp("own")
    return tiny_trellis.write_model(at / "trellis"), tiny_trellis.write_encoder(at / "encoder")


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv(device.DEVICE, raising=False)


def test_folders_of_the_users_are_found_by_the_lifter(tiny):
    assert models.use_folder("trellis", tiny[0]).model.id == configs.TRELLIS
    models.use_folder(configs.ENCODER, tiny[1])
    assert lift.load("trellis").name == "trellis"
    assert configs.weights_folder(configs.TRELLIS) == tiny[0]


def test_the_memory_asked_for_is_the_published_model_s_or_what_smaller_files_need(tiny):
    published = lifter.TrellisLifter().need()
    assert published.parameters == lifter.TrellisLifter.parameters
    models.use_folder("trellis", tiny[0])
    models.use_folder(configs.ENCODER, tiny[1])
    need = lifter.TrellisLifter().need()
    held = sum(weights_size(at) for folder in tiny for at in folder.rglob("*.safetensors"))
    assert held <= need.weights("float32") <= 2 * held
    assert need.work / published.work == pytest.approx(need.parameters / published.parameters, 0.01)


def weights_size(at):
    """Bytes of a file's weights in single precision."""
    from safetensors.torch import load_file

    return sum(4 * tensor.numel() for tensor in load_file(str(at)).values())


def test_a_folder_that_was_linked_by_hand_is_found_as_before(tiny):
    models.folder().mkdir(parents=True)
    for id, at in zip((configs.TRELLIS, configs.ENCODER), tiny, strict=True):
        (models.folder() / id).symlink_to(at)
    assert lift.load("trellis").name == "trellis"


def test_they_are_got_from_the_hub_without_the_parts_for_meshes(tiny, monkeypatch):
    model = models.hub_model(configs.TRELLIS)
    files = {
        "pipeline.json": (tiny[0] / "pipeline.json").read_bytes(),
        "ckpts/slat_dec_mesh_x.safetensors": b"not wanted",
    }
    names = ("ss_flow_x", "ss_dec_x", "slat_flow_x", "slat_dec_gs_x", "slat_enc_x")
    for name in names:
        files |= {
            f"ckpts/{name}.json": b"{}",
            f"ckpts/{name}.safetensors": b"\x02" + bytes(7) + b"{}",
        }
    with serving() as hub:
        hub.commit = model.revision
        hub.repositories[model.repository] = files
        monkeypatch.setenv("HF_ENDPOINT", hub.url)
        monkeypatch.delenv("HF_HUB_OFFLINE", raising=False)
        at = models.get(model.id)
    assert len(list((at / "ckpts").iterdir())) == 10 and (at / "pipeline.json").is_file()
    assert models.verify_hub(model.id).state == "ok"


def damaged(at, how: str) -> None:
    part = at / "ckpts" / "slat_flow_model.safetensors"
    said = json.loads((at / "pipeline.json").read_text())
    if how == "cut":
        part.write_bytes(part.read_bytes()[:-3])
    elif how == "pickle":
        os.rename(part, part.with_suffix(".pt"))
    elif how == "lacks":
        part.unlink()
    elif how == "outside":
        said["args"]["models"]["slat_flow_model"] = "../elsewhere"
    elif how == "role":
        del said["args"]["models"]["slat_decoder_gs"]
    (at / "pipeline.json").write_text("[" if how == "json" else json.dumps(said))


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        ("cut", "cut off"), ("pickle", "can run any code"), ("lacks", "lacks ckpts/slat_flow"),
        ("outside", "points out of its folder"), ("role", "names no slat_decoder_gs"),
        ("json", "which parts it has"),
    ],
)  # fmt: skip
def test_a_folder_of_no_use_is_one_sentence_and_nothing_has_changed(tiny, tmp_path, how, sentence):
    copy = shutil.copytree(tiny[0], tmp_path / "copy")
    damaged(copy, how)
    with pytest.raises(models.ModelError, match=sentence):
        models.use_folder("trellis", copy)
    assert models.look_hub(configs.TRELLIS).state == "missing"


def test_a_file_that_is_cut_off_later_is_said_before_it_is_opened(tiny, tmp_path):
    copy = shutil.copytree(tiny[0], tmp_path / "copy")
    models.use_folder("trellis", copy)
    damaged(copy, "cut")
    with pytest.raises(LiftError, match=r"damaged .*slat_flow_model.safetensors has"):
        lift.load("trellis")


def test_a_gpu_that_is_not_there_is_one_sentence(monkeypatch):
    if torch.cuda.is_available():
        pytest.skip("this machine has one")
    monkeypatch.setenv(device.DEVICE, "cuda")
    with pytest.raises(LiftError, match="'cuda'; this machine has"):
        lifter.TrellisLifter().make(lambda generator: generator.make())


def test_a_gpu_with_little_room_gets_a_part_at_a_time_and_none_is_an_hour_s_work(monkeypatch):
    monkeypatch.setattr(device, "devices", lambda: ("mps", "cpu"))
    model = ledger.Model("TRELLIS", 0, lifter.TrellisLifter().need(), lambda plan: plan)
    for free, expected in ((16, "whole"), (4, "parts")):
        monkeypatch.setattr(device, "free_memory", lambda _, free=free: free << 30)
        plan = ledger.SHARED.plan(model)
        assert (plan.way, plan.number) == (expected, "float16")  # as published
    monkeypatch.setattr(device, "free_memory", lambda _: 1 << 30)
    with pytest.raises(models.ModelError, match=r"on the GPU .MPS.* a part at a time for TRELLIS"):
        ledger.SHARED.plan(model)
