"""Which files of a model are the right ones here: `models.lock` beside the models.

A model whose commit the registry does not name gets the newest; from then on the lock file says
which that was and what its files hash to, so that it stays the same model after it was removed,
and on every machine that the lock file is copied to.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from ..files import make_folder, write_all
from .fetch import folder
from .registry import ModelError

NAME = "models.lock"
TOO_MUCH = (RecursionError, OverflowError)  # depth, and numbers beyond numbers


@dataclass(frozen=True)
class FileFacts:
    """What a file has to be."""

    size: int  # bytes
    sha256: str  # hexadecimal; empty where nobody has computed it: in the user's own folder


@dataclass(frozen=True)
class Locked:
    """The files that are a model here."""

    files: Mapping[str, FileFacts]  # by path, in the model's folder
    revision: str = ""  # commit of its repository
    folder: str = ""  # the user's own; empty: ours


def locked(id: str) -> Locked | None:
    """What the lock file says of a model, if anything. Raises ModelError where it is damaged."""
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
    return Locked(facts, str(told["revision"]), str(told["folder"]))
