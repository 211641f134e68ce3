"""`objectmorpher models`: what is there of learned weights, getting and checking them."""

from __future__ import annotations

import argparse
import sys

from objectmorpher_core import models
from objectmorpher_core.models import Added, State

from .terminal import UsageError, progress_bar


def run_models(options: argparse.Namespace) -> None:
    """`objectmorpher models list|get|path|verify|add|remove`"""
    action, id = options.action, options.id
    if (action == "add") != (options.file is not None):
        raise UsageError("a file is added as in: objectmorpher models add depth FILE.onnx")
    if action == "add":
        _write(_told(models.add(id, options.file)))
    elif action == "remove":
        models.remove(id or "")
    elif action == "get":
        for weight in [models.weight(id)] if id else models.weights():
            with progress_bar(f"Getting {weight.id}") as progress:
                at = models.fetch(weight.id, progress)
            _write(f"{weight.id}: {at}")
    else:
        _look(action, id)


def _look(action: str, id: str | None) -> None:
    """Lists, tells the places of, or hashes one of them or all."""
    is_users = id in {kind.id for kind in models.KINDS}
    states = () if is_users else models.verify(id) if action == "verify" else models.look(id)
    brought = tuple(models.added(kind.id) for kind in models.KINDS if id in (None, kind.id))
    for state in states:
        _write(_line_of(action, state))
    for own in brought:
        _write(_line_of_added(action, own))
    # What only a user can bring is not missed, unless it is asked for.
    broken = [state.weight.id for state in states if state.state != "ok"]
    broken += [b.kind.id for b in brought if b.state == "damaged" or (id and b.state != "ok")]
    if broken and action != "list":
        raise UsageError(f"{', '.join(broken)}: not installed or damaged, see `models list`")


def _line_of(action: str, state: State) -> str:
    weight = state.weight
    if action == "verify":
        return f"{weight.id}: {state.state}"
    if action == "path":
        return str(state.path) if state.state == "ok" else ""
    there = "installed" if state.state == "ok" else "not installed"
    size = f"{weight.size / 1e6:7.1f} MB"
    return f"{weight.id:<14}{size}  {weight.licence:<12} {there:<14} {weight.purpose}"


def _line_of_added(action: str, own: Added) -> str:
    if action == "path":
        return str(own.path) if own.state == "ok" else ""
    return f"{own.kind.id}: {own.state}" if action == "verify" else _told(own)


def _told(own: Added) -> str:
    """Which of the user's files it is, or which it could be."""
    kind = own.kind
    if own.state == "ok":
        size = f"{own.size / 1e6:7.1f} MB"
        told = f"{kind.purpose} ({own.name}, sha256 {own.sha256})"
        return f"{kind.id:<14}{size}  {'yours':<12} {'installed':<14} {told}"
    there = "not installed" if own.state == "missing" else "damaged"
    told = f"{kind.purpose}; models add {kind.id} FILE, {kind.example}"
    return f"{kind.id:<14}{'':10}  {'yours':<12} {there:<14} {told}"


def _write(line: str) -> None:
    sys.stdout.write(f"{line}\n" if line else "")
