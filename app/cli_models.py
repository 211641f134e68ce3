"""`objectmorpher models`: what is there of learned weights, getting and checking them."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from objectmorpher_core import models
from objectmorpher_core.models import Added, HubModel, HubState, State

from .terminal import UsageError, progress_bar

WIDE, NARROW = 18, 12  # characters of the list's columns


def run_models(options: argparse.Namespace) -> None:
    """`objectmorpher models list|get|path|verify|add|remove`"""
    action, id = options.action, options.id
    if (action == "add") != (options.file is not None):
        raise UsageError(
            "a file is added as in: objectmorpher models add depth FILE.onnx, and a folder as in:"
            " objectmorpher models add sam2 FOLDER"
        )
    if options.is_offline:
        os.environ[models.OFFLINE] = "1"
    if action == "add":
        _add(id, options.file)
    elif action == "remove":
        _remove(id or "")
    elif action == "get":
        _get(options)
    else:
        _look(action, id)


def _add(id: str, source: Path) -> None:
    if id in {kind.id for kind in models.KINDS}:
        _write(_told(models.add(id, source)))
        return
    known = (*models.families(), *(model.id for model in models.hub_models()))
    if id not in known:
        names = ", ".join((*(kind.id for kind in models.KINDS), *known))
        raise UsageError(f"nothing can be added as {id!r}; known are {names}")
    _write(_line_of_hub("list", models.use_folder(id, source)))


def _remove(id: str) -> None:
    if id in {model.id for model in models.hub_models()}:
        models.remove_hub(id)
    elif id in {weight.id for weight in models.weights()}:
        models.remove_weight(id)
    else:
        models.remove(id)


def _get(options: argparse.Namespace) -> None:
    """One; or all single files, which are small. Models of several files are got one by one."""
    id = options.id
    if id in {model.id for model in models.hub_models()}:
        model = models.hub_model(id)
        if models.place(id) is None and model.repository:
            models.check_licence(model, options.accept_licence or "")
            _ask(model, options.is_agreed)
        with progress_bar(f"Getting {id}") as progress:
            at = models.get(id, progress, options.accept_licence or "")
        _write(f"{id}: {at}")
        return
    for weight in [models.weight(id)] if id else models.weights():
        with progress_bar(f"Getting {weight.id}") as progress:
            at = models.fetch(weight.id, progress)
        _write(f"{weight.id}: {at}")


def _ask(model: HubModel, is_agreed: bool) -> None:
    """The user's consent to a download. Raises UsageError without it."""
    told = f"{model.id}: {_size(model.size)} from {model.home}, licence {model.licence}"
    if is_agreed:
        sys.stderr.write(f"{told}\n")
        return
    if not sys.stdin.isatty():
        raise UsageError(f"{told}; to download it add --yes")
    sys.stderr.write(f"{told}. Download it? [y/N] ")
    sys.stderr.flush()
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        raise UsageError(f"{model.id} was not downloaded")


def _look(action: str, id: str | None) -> None:
    """Lists, tells the places of, or hashes one of them or all."""
    is_users = id in {kind.id for kind in models.KINDS}
    is_hub = id in {model.id for model in models.hub_models()}
    states = () if is_users or is_hub else _states(action, id)
    brought = tuple(models.added(kind.id) for kind in models.KINDS if id in (None, kind.id))
    look = models.verify_hub if action == "verify" else models.look_hub
    several = tuple(look(model.id) for model in models.hub_models() if id in (None, model.id))
    if action != "list" and id is None:  # what nobody has got is only listed
        several = tuple(state for state in several if state.state != "missing")
    for state in states:
        _write(_line_of(action, state))
    for own in brought:
        _write(_line_of_added(action, own))
    for found in several:
        _write(_line_of_hub(action, found))
    # What only a user can bring is not missed, unless it is asked for.
    broken = [state.weight.id for state in states if state.state != "ok"]
    broken += [b.kind.id for b in brought if b.state == "damaged" or (id and b.state != "ok")]
    broken += [found.model.id for found in several if found.state != "ok"]
    if broken and action != "list":
        raise UsageError(f"{', '.join(broken)}: not installed or damaged, see `models list`")


def _states(action: str, id: str | None) -> tuple[State, ...]:
    return models.verify(id) if action == "verify" else models.look(id)


def _line_of(action: str, state: State) -> str:
    weight = state.weight
    if action == "verify":
        return f"{weight.id}: {state.state}"
    if action == "path":
        return str(state.path) if state.state == "ok" else ""
    there = "installed" if state.state == "ok" else "not installed"
    return _columns(weight.id, _size(weight.size), weight.licence, there, weight.purpose)


def _line_of_hub(action: str, found: HubState) -> str:
    model = found.model
    if action == "verify":
        return f"{model.id}: {found.state}{f' ({found.reason})' if found.reason else ''}"
    if action == "path":
        return str(found.path) if found.state == "ok" else ""
    there = {"ok": "installed", "missing": "not installed", "damaged": "damaged"}[found.state]
    purpose = model.purpose
    if found.is_own:
        there, purpose = "yours" if found.state == "ok" else there, f"{purpose} ({found.path})"
    elif not model.repository:
        purpose += f"; models add {model.id} FOLDER, from {model.home}"
    licence = model.licence if model.is_free else f"{model.licence}*"
    return _columns(model.id, _size(model.size), licence, there, purpose)


def _line_of_added(action: str, own: Added) -> str:
    if action == "path":
        return str(own.path) if own.state == "ok" else ""
    return f"{own.kind.id}: {own.state}" if action == "verify" else _told(own)


def _told(own: Added) -> str:
    """Which of the user's files it is, or which it could be."""
    kind = own.kind
    if own.state == "ok":
        told = f"{kind.purpose} ({own.name}, sha256 {own.sha256})"
        return _columns(kind.id, _size(own.size), "yours", "installed", told)
    there = "not installed" if own.state == "missing" else "damaged"
    told = f"{kind.purpose}; models add {kind.id} FILE, {kind.example}"
    return _columns(kind.id, "", "yours", there, told)


def _columns(id: str, size: str, licence: str, there: str, purpose: str) -> str:
    return f"{id:<{WIDE}}{size:>10}  {licence:<{NARROW}} {there:<14} {purpose}"


def _size(count: int) -> str:
    """Bytes for people."""
    return f"{count / 1e6:.1f} MB" if count < 1e9 else f"{count / 1e9:.2f} GB"


def _write(line: str) -> None:
    sys.stdout.write(f"{line}\n" if line else "")
