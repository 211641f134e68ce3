"""Models of several files: what is there, getting them from the Hub, or using a user's folder.

A model appears in the cache folder only whole and verified: its files are downloaded beside its
place, and the folder is renamed. What a broken download has left is gone on with by the next.
"""

from __future__ import annotations

import importlib.util
import json
import logging
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from ..base import installation, torch_environment
from ..base.files import make_folder, sync_folder, write_all
from ..base.progress import Progress, part, silent
from ..base.quoting import shown
from . import hub_download
from .fetch import SLACK, check_online, folder, run_watched, sha256_of
from .onnx_graphs import check_graphs
from .registry import HubModel, ModelError, families, hub_model, hub_models, with_needs
from .tensors_only import convert
from .weight_folder import (
    LATENT,
    PICKLED,
    PLAIN,
    check_file,
    check_files,
    check_folder,
    pickled_latent,
)

log = logging.getLogger(__name__)
EXTRA = installation.extra("models")
PARTIAL = ".partial-"


def not_installed(packages: Sequence[str]) -> str | None:
    """Which of the packages are missing, and what installs them, as one sentence; None: none."""
    absent = [name for name in packages if importlib.util.find_spec(name) is None]
    if not absent:
        return None
    return f"{' and '.join(absent)} {'is' if len(absent) == 1 else 'are'} not installed: {EXTRA}"


@dataclass(frozen=True)
class HubState:
    """The state of a model."""

    model: HubModel
    path: Path  # the folder where it is, or would be
    state: Literal["ok", "missing", "damaged"]
    revision: str = ""  # commit
    is_own: bool = False  # in a folder of the user's
    reason: str = ""  # why it is damaged


def look_hub(id: str) -> HubState:
    """Return the state of model `id` by its files' names and sizes. Raises ModelError."""
    return _state(hub_model(id), is_hashed=False)


def verify_hub(id: str) -> HubState:
    """Return the state of model `id` with every file hashed. Raises ModelError."""
    return _state(hub_model(id), is_hashed=True)


def place(id: str) -> Path | None:
    """The folder of model `id`, or None where it is not there whole."""
    state = look_hub(id)
    return state.path if state.state == "ok" else None


def files(id: str) -> tuple[Path, ...]:
    """Return the files of model `id`; none where it is incomplete."""
    known, at = locked(id), place(id)
    return tuple(at / name for name in known.files) if known and at else ()


def installed(family: str) -> tuple[HubModel, ...]:
    """The models of a family that are there, the best first."""
    return tuple(m for m in hub_models() if m.family == family and place(m.id) is not None)


def check_licence(model: HubModel, accepted: str) -> None:
    """Raises ModelError where the licence has to be accepted by its name, and is not."""
    if model.is_free or accepted.strip().lower() == model.licence.lower():
        return
    why = "is not for every use" if model.licence_kind == "non-commercial" else "has its own terms"
    raise ModelError(
        f"{model.id}: the {model.licence} {why}, read it at {model.home}"
        f" and accept it by its name: --accept-licence '{model.licence}'"
    )


def get(id: str, progress: Progress = silent, accepted: str = "") -> Path:
    """The folder of model `id`, downloaded unless it is there. `accepted`: a licence's name.

    Raises ModelError: one sentence. `Cancelled` passes through; the next call goes on from there.
    """
    model = hub_model(id)
    state = look_hub(id)
    if state.state == "ok":
        progress(1.0, f"{id} is ready")
        return state.path
    if not model.repository:
        told = f"get it from {model.home} and use it by: objectmorpher models add {id} FOLDER"
        raise ModelError(f"{id} is brought by you: {told}")
    check_licence(model, accepted)
    check_online(id)
    if not is_plain(model) and importlib.util.find_spec("huggingface_hub") is None:
        raise ModelError(f"{id} cannot be downloaded without huggingface_hub: {EXTRA}")
    try:
        _download(model, progress)
    except OSError as error:
        reason = error.strerror or str(error)
        raise ModelError(f"{id} cannot be written to {folder()}: {reason}") from error
    progress(1.0, f"{id} is ready")
    return folder() / id


def missing(id: str) -> tuple[HubModel, ...]:
    """What is still to be got for model `id` to work, itself last. Raises ModelError."""
    found = with_needs(id, lambda other: place(other) is not None)
    return tuple(model for model in found if place(model.id) is None)


def get_all(
    wanted: Sequence[HubModel], name: str, progress: Progress = silent, accepted: str = ""
) -> None:
    """Download models one after the other; `name` stands for all of them in messages.

    Raises ModelError: one sentence, before anything starts where the disk is too small or a
    licence is not accepted. `Cancelled` passes through; the next call goes on from there.
    """
    where = folder()
    while not where.exists():
        where = where.parent
    # What comes as pickles is written twice.
    needed = sum(model.size * (2 if has_pickles(model) else 1) for model in wanted) + SLACK
    free = shutil.disk_usage(where).free
    if wanted and needed > free:
        raise ModelError(
            f"{name} needs {needed / 1e9:.1f} GB in {folder()}, {free / 1e9:.1f} GB are free"
        )
    for model in wanted:
        check_licence(model, accepted)
    whole, done = max(sum(model.size for model in wanted), 1), 0
    for model in wanted:
        get(model.id, part(progress, done / whole, (done + model.size) / whole), accepted)
        done += model.size
    progress(1.0, f"{name} is ready")


def is_plain(model: HubModel) -> bool:
    """Whether commit and hash of each file are known, so that it can be had without the library."""
    return bool(model.revision) and set(model.files) == set(model.sha256)


def use_folder(id: str, at: Path) -> HubState:
    """A folder of the user's is the model `id` from now on; for a family, the one of its size.

    `at` may be the file itself where the model is one. Nothing is copied. Raises ModelError: one
    sentence, and nothing has changed.
    """
    family, at = id if id in families() else hub_model(id).family, at.expanduser().absolute()
    try:
        if at.is_file():
            check_file(family, at)
            at, names = at.parent, (at.name,)
        else:
            names = check_folder(family, at)
        check_graphs(family, at, names)
        id = _nearest(family, sum((at / n).stat().st_size for n in names)) if id == family else id
        facts = {name: FileFacts((at / name).stat().st_size, "") for name in names}
        write(id, Locked(facts, folder=str(at), ours=_ours(id)))
    except OSError as error:
        raise ModelError(f"{at.name} cannot be used: {error.strerror or error}") from error
    return look_hub(id)


def convert_folder(id: str, at: Path, progress: Progress = silent) -> HubState:
    """Model `id` from a user's folder as it is published, pickles and all: only its numbers.

    They are written into our models folder; nothing in the user's changes. Raises ModelError.
    """
    model, at = hub_model(id), at.expanduser().absolute()
    if model.family not in LATENT:
        raise ModelError(f"{id} is not published as pickles: add it without converting")
    wanted = pickled_latent(model.family, at)
    partial, place = folder() / (PARTIAL + id), folder() / id
    try:
        needed = sum(source.stat().st_size for source in wanted.values()) + SLACK
        folder().mkdir(parents=True, exist_ok=True)
        if needed > (free := shutil.disk_usage(folder()).free):
            raise ModelError(
                f"{id} needs {needed >> 20} MB in {folder()}, {free >> 20} MB are free"
            )
        shutil.rmtree(partial, ignore_errors=True)
        progress(0.0, f"taking the numbers out of {at.name}")
        pickles = {s: partial / name for name, s in wanted.items() if s.suffix in PICKLED}
        convert(pickles)
        for name, source in wanted.items():
            if source not in pickles:
                (partial / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source, partial / name)
        facts = {name: _facts(partial / name) for name in wanted}
        if place.exists():
            shutil.rmtree(place)
        write(id, Locked(facts))
        os.replace(partial, place)
    except OSError as error:
        raise ModelError(f"{at.name} cannot be converted: {error.strerror or error}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    progress(1.0, f"{id} is ready")
    return look_hub(id)


def remove_hub(id: str) -> None:
    """Remove a model; a folder of the user's is forgotten, and what was there before it is used.

    Which commit it was stays in the lock file. Raises ModelError.
    """
    model = hub_model(id)
    known = locked(id)
    try:
        if known is not None and known.folder:
            write(id, known.ours)
            return
        for left in (folder() / model.id, folder() / (PARTIAL + model.id)):
            if left.exists():
                shutil.rmtree(left)
    except OSError as error:
        raise ModelError(f"{id} cannot be removed: {error.strerror or error}") from error


def _ours(id: str) -> Locked | None:
    """What is known of the files in our own folder, also beneath a folder of the user's."""
    known = locked(id)
    return known.ours if known is not None and known.folder else known


def _nearest(family: str, size: int) -> str:
    """Of the models of a family the one whose size in bytes is most like this."""
    own = [model for model in hub_models() if model.family == family]
    return min(own, key=lambda m: max(m.size, size) / max(min(m.size, size), 1)).id


def _state(model: HubModel, is_hashed: bool) -> HubState:
    known = locked(model.id)
    at = Path(known.folder) if known and known.folder else folder() / model.id
    if known is None or not (known.folder or at.is_dir()):
        return HubState(model, at, "missing")
    reason = _damage(at, known, is_hashed)
    if not reason and known.folder and is_hashed:
        try:
            check_graphs(model.family, at, check_files(model.family, at, tuple(known.files)))
        except ModelError as error:
            reason = str(error)
    state = "damaged" if reason else "ok"
    return HubState(model, at, state, known.revision, bool(known.folder), reason)


def _damage(at: Path, known: Locked, is_hashed: bool) -> str:
    """What is wrong with the files, or nothing."""
    for name, fact in known.files.items():
        try:
            size = (at / name).stat().st_size
            if size != fact.size:
                return f"{name} has {size} bytes, not {fact.size}"
            if is_hashed and fact.sha256 and sha256_of(at / name) != fact.sha256:
                return f"{name} has another hash than the one in {NAME}"
        except OSError as error:
            return f"{name} cannot be read: {error.strerror or error}"
        except ValueError:
            return f"{shown(name)} is no file's name"
    return ""


def _download(model: HubModel, progress: Progress) -> None:
    """Hub -> partial folder -> hashes -> its place, and the lock file."""
    where = folder()
    where.mkdir(parents=True, exist_ok=True)
    partial, at = where / (PARTIAL + model.id), where / model.id
    partial.mkdir(exist_ok=True)
    pinned = _ours(model.id)
    revision = model.revision or (pinned.revision if pinned else "")
    known = {name: fact.sha256 for name, fact in pinned.files.items()} if pinned else {}
    request = {
        "repository": model.repository, "revision": revision, "files": list(model.files),
        "sha256": known | dict(model.sha256), "target": str(partial),
        "is_plain": is_plain(model) and importlib.util.find_spec("huggingface_hub") is None,
        "slack": SLACK + (model.size if has_pickles(model) else 0),  # each is written once more
    }  # fmt: skip
    answer, revision = _run(model, request, progress)
    facts = {name: FileFacts(fact["size"], fact["sha256"]) for name, fact in answer.items()}
    facts = _as_tensors(model, partial, facts, progress)
    if at.exists():  # a damaged one
        shutil.rmtree(at)
    # The pin first: files that are in place are looked at by it.
    write(model.id, Locked(facts, revision))
    os.replace(partial, at)
    sync_folder(where)


def _as_tensors(
    model: HubModel, partial: Path, facts: Mapping[str, FileFacts], progress: Progress
) -> dict[str, FileFacts]:
    """The files' facts once its pickles, which are deleted, have become safetensors."""
    pickles = [name for name in facts if name.endswith(PICKLED)]
    if not pickles:
        return dict(facts)
    progress(0.99, f"taking the numbers out of {model.id}'s pickles")
    new = {name: Path(name).with_suffix(PLAIN).as_posix() for name in pickles}
    convert({partial / name: partial / new[name] for name in pickles})
    for name in pickles:
        (partial / name).unlink()
    rest = {name: fact for name, fact in facts.items() if name not in new}
    return rest | {name: _facts(partial / name) for name in new.values()}


def _facts(at: Path) -> FileFacts:
    return FileFacts(at.stat().st_size, sha256_of(at))


def has_pickles(model: HubModel) -> bool:
    """Whether it is published as pickles only."""
    return any(name.endswith(PICKLED) for name in model.files)


def _run(
    model: HubModel, request: Mapping[str, Any], progress: Progress
) -> tuple[dict[str, dict[str, Any]], str]:
    """Runs `hub_download.py`: what it says of the files, and their commit."""
    script = Path(hub_download.__file__)
    command = [torch_environment.python(), "-P", str(script), json.dumps(request)]
    settings = {"HF_HUB_DISABLE_TELEMETRY": "1", "HF_HUB_DISABLE_PROGRESS_BARS": "1"}
    settings = torch_environment.apart_variables() | settings
    target = Path(request["target"])
    said = target.with_name(target.name + ".log")
    try:
        run_watched(
            command, said, settings, lambda: _tell(model, target, said, progress), is_quiet=True
        )
        told = _lines(said)
    finally:
        said.unlink(missing_ok=True)
    for pattern in told.get("absent", ()):
        log.warning("%s has no file %s", model.repository, shown(pattern))
    if "done" not in told:
        raise ModelError(_sentence(model, told.get("error", "other"), told.get("detail", "")))
    return told["done"], told["plan"]["revision"]


def _tell(model: HubModel, target: Path, said: Path, progress: Progress) -> None:
    """How far the download is, from the files that grow."""
    plan = _lines(said).get("plan")
    whole = sum(f["size"] for f in plan["files"].values()) if plan else model.size
    here = hub_download.bytes_in(target)
    note = f"downloading {model.id}: {here >> 20} of {whole >> 20} MB"
    progress(min(0.99, here / max(whole, 1)), note)


def _lines(said: Path) -> dict[str, Any]:
    """All that the download has said so far."""
    told: dict[str, Any] = {}
    for line in said.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            told |= json.loads(line)
        except ValueError:
            continue  # being written, or a library's own words
    return told


def _sentence(model: HubModel, kind: str, detail: str) -> str:
    """Why it cannot be had, for a user."""
    reasons = {
        "gated": f"its licence has to be accepted at {model.home}, and HF_TOKEN to be set",
        "repository": f"the Hub has no {model.repository}, or shows it only with a token: HF_TOKEN",
        "revision": f"the Hub has no such version of {model.repository} any more",
        "entry": f"{model.repository} lacks {detail or 'a file'}",
        "offline": "the Hub's library is set to work offline",
        "disk": f"it needs {detail} in {folder()}",
        "full": f"the disk of {folder()} is full, or takes no file that large",
        "checksum": f"{detail} is not the file that it should be: wrong checksum",
        "truncated": "a file ended before its end: try again",
        "network": "the Hub does not answer; is there a network?",
        "odd": f"the Hub's answer is odd: {detail}",
    }
    return f"{model.id} cannot be downloaded: {reasons.get(kind, detail or 'nothing was said')}"


# Which files of a model are the right ones here: `models.lock` beside the models.

NAME = "models.lock"
TOO_MUCH = (RecursionError, OverflowError)  # depth, and numbers beyond numbers


@dataclass(frozen=True)
class FileFacts:
    """The required facts of a file."""

    size: int  # bytes
    sha256: str  # hexadecimal; empty where nobody has computed it: in the user's own folder


@dataclass(frozen=True)
class Locked:
    """The files that are a model here."""

    files: Mapping[str, FileFacts]  # by path, in the model's folder
    revision: str = ""  # commit of its repository
    folder: str = ""  # the user's own; empty: ours
    ours: Locked | None = None  # what is used once the user's own folder is forgotten


def locked(id: str) -> Locked | None:
    """Return the lock file's entry of a model, if any. Raises ModelError where it is damaged."""
    return _read().get(id)


def write(id: str, entry: Locked | None) -> None:
    """Changes the entry of one model; None takes it out. Raises ModelError or OSError."""
    known = _read()
    known.pop(id, None)
    if entry is not None:
        known[id] = entry
    told = {name: asdict(known[name]) for name in sorted(known)}
    where = folder()
    make_folder(where)
    text = json.dumps({"version": 1, "models": told}, indent=1) + "\n"
    write_all({where / NAME: text.encode()})


def _read() -> dict[str, Locked]:
    at = folder() / NAME
    try:
        data = at.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        return {}
    except OSError as error:
        if not os.access(at.parent, os.X_OK):  # a home that nobody may look into holds no model
            return {}
        raise ModelError(f"{at} cannot be read: {error.strerror or error}") from error
    try:
        return {str(id): _entry(told) for id, told in json.loads(data)["models"].items()}
    except (ValueError, KeyError, TypeError, AttributeError, *TOO_MUCH) as error:
        raise ModelError(f"{at} is damaged: remove it, and get its models again") from error


def _entry(told: dict) -> Locked:
    facts = {
        str(name): FileFacts(int(fact["size"]), str(fact["sha256"]))
        for name, fact in told["files"].items()
        if not Path(name).is_absolute() and ".." not in Path(name).parts
    }
    ours = told.get("ours")
    return Locked(
        facts, str(told["revision"]), str(told["folder"]), None if ours is None else _entry(ours)
    )
