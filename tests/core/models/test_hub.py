"""Models of several files arrive whole and verified from a hub, or not at all."""

from __future__ import annotations

import json
import os
import shutil
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_core import models
from objectmorpher_core.base.progress import Cancelled
from objectmorpher_core.compose.refine.diffusion import adapter_files
from objectmorpher_core.models import hub, registry
from objectmorpher_core.models.hub_download import PART
from objectmorpher_core.models.weight_folder import check_folder, check_safetensors
from tests.core.models.local_hub import COMMIT, TOKEN, Hub, offering, own_cache

FREE, GATED = models.hub_model("sam2.1-tiny"), models.hub_model("sam3")
CONFIG = json.dumps({"model_type": "sam2"}).encode()
NUMBERS = np.random.default_rng(0).integers(0, 256, 3 << 20, np.uint8)


def safetensors(numbers: np.ndarray) -> bytes:
    """One tensor of bytes, in the format's own layout."""
    told = {"a": {"dtype": "U8", "shape": [numbers.size], "data_offsets": [0, numbers.size]}}
    header = json.dumps(told).encode()
    return len(header).to_bytes(8, "little") + header + numbers.tobytes()


WEIGHTS = safetensors(NUMBERS)
FILES = {"config.json": CONFIG, "model.safetensors": WEIGHTS, "other.bin": b"no"}


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    return own_cache(tmp_path, monkeypatch)


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Hub]:
    with offering(monkeypatch, FILES, FREE, GATED) as hub:
        yield hub


def left_in(cache: Path) -> list[str]:
    """Names without those of what a broken download goes on with."""
    names = os.listdir(cache) if cache.exists() else []
    return sorted(name for name in names if not name.startswith(hub.PARTIAL))


def test_every_model_says_its_size_and_licence() -> None:
    assert len({m.id for m in models.hub_models()}) == len(models.hub_models())
    for model in models.hub_models():
        assert model.size > 0 and model.parameters > 0 and model.licence and model.purpose
        assert model.licence_kind in ("permissive", "non-commercial", "gated")
        assert model.home.startswith("https://")
        assert bool(model.repository) == bool(model.files)


def test_a_model_is_got_whole_pinned_and_not_got_again(server: Hub, cache: Path) -> None:
    seen: list[float] = []
    at = models.get(FREE.id, lambda fraction, note: seen.append(fraction))
    assert at == models.place(FREE.id)
    assert sorted(os.listdir(at)) == ["config.json", "model.safetensors"]
    assert (at / "model.safetensors").read_bytes() == WEIGHTS
    assert left_in(cache) == sorted([FREE.id, hub.NAME])
    assert seen[-1] == 1.0 and min(seen) >= 0
    state = models.verify_hub(FREE.id)
    assert state.state == "ok" and state.revision == COMMIT and not state.is_own
    asked = len(server.ranges)
    assert models.get(FREE.id) == at and len(server.ranges) == asked


def test_the_lock_file_keeps_the_commit_over_removing(server: Hub) -> None:
    models.get(FREE.id)
    models.remove_hub(FREE.id)
    assert models.look_hub(FREE.id).state == "missing"
    server.commit = "b" * 40  # the repository has moved on
    with pytest.raises(models.ModelError, match="no such version"):
        models.get(FREE.id)


def test_another_file_under_the_same_commit_is_refused(server: Hub) -> None:
    models.get(FREE.id)
    models.remove_hub(FREE.id)
    server.repositories[FREE.repository]["model.safetensors"] = safetensors(NUMBERS[::-1])
    with pytest.raises(models.ModelError, match="wrong checksum"):
        models.get(FREE.id)


def test_a_cancelled_download_is_gone_on_with(server: Hub, cache: Path) -> None:
    """From the very byte at which it was cancelled: the server gives no more until then."""
    at = 20 << 20  # bytes: the library writes 10 MiB at a time
    large = safetensors(np.resize(NUMBERS, at + (4 << 20)))
    server.repositories[FREE.repository]["model.safetensors"] = large
    server.stall, server.stall_at = threading.Event(), at

    def cancel_there(fraction: float, note: str) -> None:
        if sum(path.stat().st_size for path in cache.rglob(f"model.safetensors{PART}")) == at:
            raise Cancelled

    with pytest.raises(Cancelled):
        models.get(FREE.id, cancel_there)
    assert left_in(cache) == []
    server.stall.set()
    server.stall = None
    models.get(FREE.id)
    starts = [start for name, start in server.ranges if name == "model.safetensors"]
    assert starts == [0, at]
    assert models.verify_hub(FREE.id).state == "ok"


@pytest.mark.parametrize("name", ["config.json", "model.safetensors"])
def test_a_wrong_checksum_is_one_sentence_and_leaves_nothing(
    server: Hub, cache: Path, name: str
) -> None:
    server.wrong.add(name)
    with pytest.raises(models.ModelError, match=f"{name} is not the file.*wrong checksum"):
        models.get(FREE.id)
    assert left_in(cache) == [] and models.place(FREE.id) is None
    server.wrong.clear()
    assert models.get(FREE.id)


def test_a_file_that_ends_early_is_one_sentence(server: Hub, cache: Path) -> None:
    server.short.add("model.safetensors")
    with pytest.raises(models.ModelError, match="ended before its end"):
        models.get(FREE.id)
    assert left_in(cache) == [] and models.place(FREE.id) is None


def test_no_room_on_the_disk_is_said_before_anything_is_downloaded(server: Hub) -> None:
    server.sizes["model.safetensors"] = 1 << 60
    with pytest.raises(models.ModelError, match=r"needs \d+ MB, \d+ MB are free in"):
        models.get(FREE.id)
    assert server.ranges == []


def test_a_gated_model_needs_its_licence_and_a_token(
    server: Hub, monkeypatch: pytest.MonkeyPatch
) -> None:
    for refused in ("", "MIT"):
        with pytest.raises(models.ModelError, match="--accept-licence 'SAM License'"):
            models.get(GATED.id, accepted=refused)
    assert server.ranges == []
    with pytest.raises(models.ModelError, match=r"accepted at .*facebook/sam3.*HF_TOKEN"):
        models.get(GATED.id, accepted="sam license")
    monkeypatch.setenv("HF_TOKEN", "hf_wrong")
    with pytest.raises(models.ModelError, match="HF_TOKEN"):
        models.get(GATED.id, accepted="SAM License")
    monkeypatch.setenv("HF_TOKEN", TOKEN)
    assert (models.get(GATED.id, accepted="SAM License") / "config.json").read_bytes() == CONFIG


def test_a_non_commercial_licence_is_accepted_by_its_name() -> None:
    model = replace(FREE, licence="CC-BY-NC-4.0", licence_kind="non-commercial")
    with pytest.raises(models.ModelError, match=r"not for every use.*'CC-BY-NC-4\.0'"):
        models.check_licence(model, "yes")
    models.check_licence(model, "CC-BY-NC-4.0")
    models.check_licence(FREE, "")


def test_a_missing_file_and_a_missing_repository_are_one_sentence(server: Hub) -> None:
    del server.repositories[FREE.repository]["model.safetensors"]
    with pytest.raises(models.ModelError, match="lacks"):
        models.get(FREE.id)
    del server.repositories[FREE.repository]
    with pytest.raises(models.ModelError, match=r"the Hub has no facebook/sam2\.1-hiera-tiny"):
        models.get(FREE.id)


def test_stars_mean_the_files_of_the_repository(
    server: Hub, monkeypatch: pytest.MonkeyPatch
) -> None:
    server.repositories["some/parts"] = {
        "config.json": CONFIG, "unet/a-1.safetensors": WEIGHTS, "unet/a-2.safetensors": WEIGHTS,
        "old.bin": b"no",
    }  # fmt: skip
    names = ("config.json", "unet/*.safetensors")
    parts = replace(FREE, id="parts", repository="some/parts", revision="", sha256={}, files=names)
    known = registry.hub_models()
    monkeypatch.setattr(registry, "hub_models", lambda: (*known, parts))
    at = models.get("parts")
    found = sorted(str(p.relative_to(at)) for p in at.rglob("*") if p.is_file())
    assert found == ["config.json", "unet/a-1.safetensors", "unet/a-2.safetensors"]


def test_offline_downloads_nothing(server: Hub, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(models.OFFLINE, "1")
    for get in (models.get, models.fetch):
        id = FREE.id if get is models.get else "u2netp"
        with pytest.raises(models.ModelError, match=models.OFFLINE):
            get(id)
    assert server.ranges == []


def test_no_network_is_one_sentence(monkeypatch: pytest.MonkeyPatch, server: Hub) -> None:
    monkeypatch.setenv("HF_ENDPOINT", "http://127.0.0.1:9")  # discard: nobody listens
    with pytest.raises(models.ModelError, match="is there a network"):
        models.get(FREE.id)


def test_damage_on_the_disk_is_seen(server: Hub, cache: Path) -> None:
    at = models.get(FREE.id) / "model.safetensors"
    at.write_bytes(WEIGHTS[:-1] + bytes([WEIGHTS[-1] ^ 1]))
    assert models.look_hub(FREE.id).state == "ok"  # sizes are right, nothing is hashed
    assert "hash" in models.verify_hub(FREE.id).reason
    at.write_bytes(WEIGHTS[:-9])
    assert models.look_hub(FREE.id).state == "damaged" and models.place(FREE.id) is None
    models.get(FREE.id)
    assert models.verify_hub(FREE.id).state == "ok"
    (cache / hub.NAME).write_text("{", "utf-8")
    with pytest.raises(models.ModelError, match="is damaged"):
        models.look_hub(FREE.id)


def test_a_cache_that_is_no_folder_is_one_sentence(
    server: Hub, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "file"))
    with pytest.raises(models.ModelError, match="cannot be"):
        models.get(FREE.id)


def test_a_model_without_a_repository_says_where_it_is(cache: Path) -> None:
    with pytest.raises(models.ModelError, match=r"https://.* models add mobile-sam FOLDER"):
        models.get("mobile-sam")


# The user's own folder


@pytest.fixture
def own(tmp_path: Path) -> Path:
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "config.json").write_bytes(CONFIG)
    (folder / "model.safetensors").write_bytes(WEIGHTS)
    return folder


def test_a_folder_is_used_where_it_is_and_forgotten(own: Path, cache: Path) -> None:
    state = models.use_folder(FREE.id, own)
    assert state.state == "ok" and state.is_own and models.place(FREE.id) == own
    assert models.get(FREE.id) == own and models.verify_hub(FREE.id).state == "ok"
    assert left_in(cache) == [hub.NAME]
    assert [m.id for m in models.installed("sam2")] == [FREE.id]
    models.remove_hub(FREE.id)
    assert models.place(FREE.id) is None and (own / "config.json").exists()


def test_what_lay_beneath_a_folder_is_used_again_and_deleted_by_a_second_call(
    own: Path, server: Hub, cache: Path
) -> None:
    at = models.get(FREE.id)
    shutil.copytree(own, own.with_name("second"))
    for folder in (own, own.with_name("second")):  # one folder after another forgets neither
        assert models.use_folder(FREE.id, folder).path == folder
    models.remove_hub(FREE.id)
    state = models.verify_hub(FREE.id)
    assert (state.state, state.path, state.revision, state.is_own) == ("ok", at, COMMIT, False)
    models.remove_hub(FREE.id)
    assert models.look_hub(FREE.id).state == "missing" and not at.exists() and own.exists()
    models.use_folder(FREE.id, own)
    models.remove_hub(FREE.id)
    known = hub.locked(FREE.id)
    assert known is not None and known.revision == COMMIT, "the commit stays known"


def test_a_lock_file_of_before_leaves_a_download_beneath_a_folder(own: Path, cache: Path) -> None:
    """What an older version wrote of a folder says nothing of a download."""
    models.use_folder(FREE.id, own)
    told = json.loads((cache / hub.NAME).read_text())
    del told["models"][FREE.id]["ours"]
    (cache / hub.NAME).write_text(json.dumps(told))
    (cache / FREE.id).mkdir()
    assert models.place(FREE.id) == own
    models.remove_hub(FREE.id)
    assert models.place(FREE.id) is None and (cache / FREE.id).exists()


@pytest.mark.parametrize("id", ["qwen-refine-lora", "klein-remove-lora"])
def test_an_adapter_is_taken_as_a_file_beside_others(own: Path, id: str) -> None:
    file = own / "adapter.safetensors"
    file.write_bytes(WEIGHTS)
    with pytest.raises(models.ModelError, match="it has 2"):
        models.use_folder(id, own)
    assert models.use_folder(id, file).state == "ok" and models.files(id) == (file,)
    assert models.verify_hub(id).state == "ok"
    assert adapter_files(("a", id)) == (("a", file),)
    for name, data in (("a.pt", WEIGHTS), ("a.onnx", WEIGHTS), ("a.safetensors", WEIGHTS[:-1])):
        (own / name).write_bytes(data)
        with pytest.raises(models.ModelError):
            models.use_folder(id, own / name)
    assert models.files(id) == (file,)


def test_a_folder_for_a_family_is_the_model_of_its_size(own: Path) -> None:
    assert models.use_folder("sam2", own).model.id == "sam2.1-tiny"  # 3 MB: nearest to the smallest


def test_a_folder_that_vanished_or_changed_is_damaged(own: Path) -> None:
    models.use_folder(FREE.id, own)
    (own / "model.safetensors").write_bytes(WEIGHTS[:-5])
    assert "bytes" in models.look_hub(FREE.id).reason
    shutil.rmtree(own)
    assert models.look_hub(FREE.id).state == "damaged" and models.place(FREE.id) is None


@pytest.mark.parametrize("name", ["pytorch_model.bin", "sam2.pt", "sam2.ckpt", "model.pth"])
def test_only_pickled_weights_are_refused(own: Path, cache: Path, name: str) -> None:
    (own / "model.safetensors").rename(own / name)
    with pytest.raises(models.ModelError, match=rf"only pickled weights \({name}\)") as caught:
        models.use_folder(FREE.id, own)
    assert "\n" not in str(caught.value) and left_in(cache) == []


def test_pickled_weights_beside_plain_ones_are_not_used(own: Path) -> None:
    (own / "pytorch_model.bin").write_bytes(b"\x80\x04.")
    assert check_folder("sam2", own) == ("config.json", "model.safetensors")


def test_what_is_no_model_is_one_sentence(own: Path, tmp_path: Path) -> None:
    def refused(sentence: str, id: str = FREE.id, at: Path = own) -> None:
        with pytest.raises(models.ModelError, match=sentence):
            models.use_folder(id, at)

    refused("is not a folder", at=tmp_path / "none")
    refused("'sam2', not sam3", "sam3")
    refused("needs one encoder and one decoder", "mobile-sam")
    refused("there is no model called 'dinosaur'", "dinosaur")
    (own / "config.json").write_text("{")
    refused("does not say which model")
    (own / "config.json").unlink()
    refused("holds no config.json")
    (own / "model.safetensors").unlink()
    refused("holds no .safetensors")


@pytest.mark.parametrize("end", [0, 4, 9, 30, 1000, len(WEIGHTS) - 1])
def test_a_cut_off_file_is_refused(own: Path, end: int) -> None:
    (own / "model.safetensors").write_bytes(WEIGHTS[:end])
    with pytest.raises(models.ModelError, match=r"cut off|only its beginning"):
        models.use_folder(FREE.id, own)


@pytest.mark.parametrize("length", [1, 1 << 40, 50])
def test_a_lying_header_is_refused(tmp_path: Path, length: int) -> None:
    at = tmp_path / "a.safetensors"
    at.write_bytes(length.to_bytes(8, "little") + b"[1, 2]" + b" " * 100)
    with pytest.raises(models.ModelError, match=r"not a \.safetensors"):
        check_safetensors(at)


def test_paths_in_the_lock_file_stay_inside_the_folder(cache: Path) -> None:
    cache.mkdir(parents=True)
    (cache / FREE.id).mkdir()
    entry = {"files": {"../../x": {"size": 1, "sha256": ""}}, "revision": "", "folder": ""}
    (cache / hub.NAME).write_text(json.dumps({"version": 1, "models": {FREE.id: entry}}))
    found = hub.locked(FREE.id)
    assert found is not None and not found.files
    entry["folder"] = str(cache)
    told = {"lama": entry, "qwen-refine-lora": entry, "mobile-sam": entry}
    (cache / hub.NAME).write_text(json.dumps({"version": 1, "models": told}))
    assert all(models.verify_hub(id).reason for id in told), "of no file of it anything is known"
