"""Readers of small files: scripts, settings, locks, workers, tokens, weights; and messages."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from objectmorpher.editor.settings import Settings, read_settings, write_settings
from objectmorpher.server.address import TokenError, check_token, read_token
from objectmorpher.server.message import MessageError, decode, encode
from objectmorpher.server.table import table, types
from objectmorpher.worker.job_functions import BackendChoice, Cut
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import Click, LiftSettings, Plate, Prompt
from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.workers.file import FOLDER, read_worker
from objectmorpher_core.models import hub
from objectmorpher_core.models.added import added
from objectmorpher_core.models.registry import ModelError
from objectmorpher_core.models.weight_folder import (
    DIFFUSERS,
    PIPELINES,
    check_folder,
    check_safetensors,
)
from objectmorpher_core.scripting.options import EditScript, ScriptError
from objectmorpher_core.scripting.script import BatchItem, parse_scripts

from .checks import Reader, check_finite, check_same, refusing

SCRIPT = {
    "photo": "a.png", "out": "b.png", "click": [[10, 20.5], [3, 4]], "not_click": [[1, 2]],
    "box": [1, 2, 30, 40], "subject": True, "segment": "auto", "gaussians": 2000,
    "thickness": 1.1, "back": "auto", "trust": 0.5, "pin": [[5, 6]], "turn": [10, 20, 0],
    "handle": [{"at": [10, 20], "to": [30, 40], "dz": 0.1}], "move": [3, 4], "scale": 1.5,
    "fill_from": [{"source": [1, 2], "to": [3, 4], "radius": 5}], "nodes": 100, "seed": 3,
    "fov": 40, "order": [2, 1], "objects": [{"click": [[1, 2]], "stay_in_front": True}],
}  # fmt: skip


def script_seeds() -> list[bytes]:
    items = [SCRIPT, {"click": [[1, 2]], "objects": [{"duplicate": 1, "move": [1, 2, 0.5]}]}]
    return [json.dumps(SCRIPT, indent=1).encode(), json.dumps(items).encode(), b"{}"]


def read_script(data: bytes, folder: Path) -> None:
    with refusing(ScriptError, UnicodeDecodeError):
        items = parse_scripts(data.decode("utf-8"))
    assert items and all(isinstance(item, BatchItem) for item in items)
    for item in items:
        assert isinstance(item.script, EditScript)
        check_finite(item)
        for further in item.others.objects:
            check_finite(further.script)


def settings_seeds() -> list[bytes]:
    return [
        b'theme = "dark"\nscale = 1.5\nquality = 95\nis_motion_reduced = false\n'
        b'recent = ["/x/a.png", "/x/\xc3\xbc.png"]\nserver = "https://a:1"\nhistory_mb = 1024\n'
        b'\n[backends]\nsegment = "auto"\nlift = "relief"\n\n[shortcuts]\nsave = "Ctrl+S"\n',
        b'theme = "light"\nexport_seconds = 4.0\ndeclined_models = ["sam"]\n',
    ]


def read_own_settings(data: bytes, folder: Path) -> None:
    """Whatever the file says, there are settings; written and read again they are the same."""
    path = folder / "settings.toml"
    path.write_bytes(data)
    settings = read_settings(path)
    for field in dataclasses.fields(Settings):
        default, value = getattr(Settings(), field.name), getattr(settings, field.name)
        assert type(value) is type(default), field.name
        assert not isinstance(value, float) or math.isfinite(value), field.name
    write_settings(path, settings)
    check_same(read_settings(path), settings)


@contextmanager
def variable(name: str, folder: Path) -> Any:
    """The environment names the folder."""
    before = os.environ.get(name)
    os.environ[name] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before


def lock_seeds() -> list[bytes]:
    model = {"revision": "abc", "folder": "", "files": {"a.safetensors": {"size": 3, "sha256": ""}}}
    return [json.dumps({"version": 1, "models": {"sam-vit-base": model}}).encode()]


def read_lock(data: bytes, folder: Path) -> None:
    """models.lock, and looking at what it says is there."""
    from objectmorpher_core.models.hub import look_hub

    (folder / "models").mkdir()
    (folder / "models" / hub.NAME).write_bytes(data)
    with variable("OBJECTMORPHER_CACHE", folder), refusing(ModelError):
        found = hub.locked("sam-vit-base")
        assert found is None or all(".." not in name for name in found.files)
        look_hub("sam-vit-base")


def note_seeds() -> list[bytes]:
    return [json.dumps({"name": "a.onnx", "sha256": "00"}).encode()]


def read_note(data: bytes, folder: Path) -> None:
    """The note beside a file that the user brought."""
    models = folder / "models"
    models.mkdir()
    (models / "depth.onnx").write_bytes(b"x")
    (models / "depth.json").write_bytes(data)
    with variable("OBJECTMORPHER_CACHE", folder):
        assert added("depth").state == "damaged"


def worker_seeds() -> list[bytes]:
    return [
        b'name = "w"\ncommand = ["{python}", "{here}/worker.py"]\nlicence = "MIT"\ntimeout = 900\n'
    ]


def read_worker_file(data: bytes, folder: Path) -> None:
    (folder / "w.toml").write_bytes(data)
    with variable(FOLDER, folder), refusing(LiftError):
        worker = read_worker("w")
    with refusing(LiftError):
        worker.missing()
    assert worker.command and 0 < worker.timeout <= 24 * 3600


def read_token_file(data: bytes, folder: Path) -> None:
    (folder / "token").write_bytes(data)
    with refusing(TokenError):
        token = read_token(folder / "token")
    assert not token or check_token(token)


def weight_seeds() -> list[bytes]:
    head = json.dumps({"a": {"dtype": "F32", "shape": [1], "data_offsets": [0, 4]}}).encode()
    config = json.dumps({"model_type": "sam"}).encode()
    index = json.dumps({"_class_name": "Flux2KleinPipeline"}).encode()
    parts = json.dumps({"args": {"models": {r: f"c/{r}" for r in PIPELINES["trellis"]}}}).encode()
    return [len(head).to_bytes(8, "little") + head + bytes(4), config, index, parts]


def read_weights(data: bytes, folder: Path) -> None:
    """A folder whose weights and descriptions are all of these bytes."""
    names = ("config.json", "model.safetensors", "model_index.json", "pipeline.json")
    for name in names:
        (folder / name).write_bytes(data)
    with refusing(ModelError):
        for family in ("sam", *DIFFUSERS, *PIPELINES, "qwen-lora"):
            try:
                check_folder(family, folder)
            except ModelError as error:
                refused = error
        check_safetensors(folder / "model.safetensors")
        raise refused


def message_seeds() -> list[bytes]:
    photo = np.random.default_rng(3).integers(0, 255, (20, 30, 3)).astype(np.uint8)
    mask, camera = photo[..., 0] > 100, Camera.from_fov(30, 20)
    prompt = Prompt((Click(1.5, 2.0), Click(3.0, 1.0, False)), (0.0, 0.0, 9.0, 9.0), level="part")
    asked = [
        (photo, prompt, BackendChoice("auto", 7)),
        (Cut(photo, camera, mask), BackendChoice("auto", 7),
         LiftSettings(hidden=mask, horizon=3.5)),
        (photo, mask, BackendChoice("auto", 7), 3), Plate(0, 0, photo, mask, "patchmatch"),
        [1, (2.5, "ä", None, True), photo.astype(np.float32)],
    ]  # fmt: skip
    return [encode(value, types()).body for value in asked]


def read_message(data: bytes, folder: Path) -> None:
    """What came over the wire; what a function takes is what its types say."""
    with refusing(MessageError):
        value = decode(data, types())
    again = encode(value, types())
    with suppress(MessageError):  # an array that stands there often may be too many of them
        check_same(decode(again.body, types()), value)
    taken = 0
    for served in table().values():
        try:
            served.checked(value)
        except MessageError:
            continue
        taken += 1
    assert taken <= len(table())


READERS = [
    Reader("script", script_seeds, read_script),
    Reader("settings", settings_seeds, read_own_settings),
    Reader("models-lock", lock_seeds, read_lock, share=0.5),
    Reader("model-note", note_seeds, read_note, share=0.2),
    Reader("worker-file", worker_seeds, read_worker_file, share=0.5),
    Reader("token", lambda: [b"0123456789abcdef\n"], read_token_file, share=0.1),
    Reader("weights", weight_seeds, read_weights),
    Reader("message", message_seeds, read_message),
]
