"""The user's own programs that lift: a TOML file each, in a folder of the user's.

`OBJECTMORPHER_WORKERS` names another folder than `workers` beside the settings. A file says

    name = "sam3d"                                  # for --lift sam3d
    command = ["{here}/env/bin/python", "{here}/worker.py"]
    licence = "SAM License"                         # of the weights, shown by doctor
    licence_kind = "gated"                          # or "non-commercial"; "permissive" if not said
    page = "https://github.com/..."                 # where to read it
    timeout = 900                                   # s

The command is a list of arguments and never goes through a shell; the job's folder is added as
the last one. `{here}` is the TOML file's folder, `{python}` the Python that runs the editor.
A licence that is not for every use has to be accepted by its name before anything is run; that is
kept in accepted.json, in the same folder.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import platformdirs

from ...base.files import write_all
from ...base.limits import WORKER_FILE as BYTES
from ...base.quoting import named, reason, shown
from .. import LiftError

FOLDER = "OBJECTMORPHER_WORKERS"  # environment variable
FREE = "permissive"
KINDS = (FREE, "non-commercial", "gated")  # of licences
TIMEOUT = 900.0  # s, unless the file says another
LONGEST = 24 * 3600.0  # s
ACCEPTED = "accepted.json"  # worker -> the licence that was accepted
NAME = re.compile(r"[a-z0-9][a-z0-9._-]{0,40}")


@dataclass(frozen=True)
class LiftWorker:
    """A command that lifts, in an environment of its own."""

    name: str
    command: tuple[str, ...]
    licence: str = ""  # of the weights
    timeout: float = TIMEOUT  # s
    licence_kind: str = FREE  # of KINDS
    page: str = ""  # where the licence can be read

    @property
    def is_free(self) -> bool:
        """Whether no licence has to be accepted by its name."""
        return self.licence_kind == FREE

    @property
    def is_accepted(self) -> bool:
        """Whether it may run, as far as its licence goes; another licence is another question."""
        return self.is_free or _accepted().get(self.name) == self.licence

    def missing(self) -> str | None:
        """Return a sentence where the command is missing, or its licence is not accepted."""
        if shutil.which(self.command[0]) is None:
            return f"the command of the worker {self.name} is not there: {self.command[0]}"
        return None if self.is_accepted else self.asks()

    def asks(self) -> str:
        """Return a sentence on the licence that has to be accepted, where, and how."""
        why = "is not for every use" if self.licence_kind != "gated" else "has its own terms"
        read = f", read it at {self.page}," if self.page else ""
        return (
            f"the {self.licence} of the worker {self.name} {why}{read} and accept it by its name:"
            f" objectmorpher models get {self.name} --accept-licence '{self.licence}'"
        )


def workers_folder() -> Path:
    """Return the folder of the workers' files."""
    if named := os.environ.get(FOLDER):
        return Path(named)
    return Path(platformdirs.user_config_dir("objectmorpher", appauthor=False)) / "workers"


def worker_names() -> tuple[str, ...]:
    """Return the names of all files in the folder, damaged ones and those in subfolders too."""
    return tuple(sorted(_files()))


def read_worker(name: str) -> LiftWorker:
    """The worker called `name`. Raises LiftError: there is none, or its file is of no use."""
    files = _files()
    if name not in files:
        raise LiftError(f"there is no worker called {name!r} in {workers_folder()}")
    at = files[name]
    try:
        if at.stat().st_size > BYTES:
            raise ValueError("it is too large")
        return _worker(tomllib.loads(at.read_text(encoding="utf-8")), name, at.parent)
    except RecursionError as error:
        raise LiftError(f"the worker's file {at} is of no use: it is nested too deep") from error
    except (OSError, ValueError) as error:
        raise LiftError(f"the worker's file {at} is of no use: {reason(error)}") from error


def accept_licence(name: str, accepted: str) -> None:
    """Keeps that the user accepts a worker's licence, by its name. Raises LiftError otherwise."""
    worker = read_worker(name)
    if accepted.strip().lower() != worker.licence.lower():
        raise LiftError(worker.asks())
    _keep({**_accepted(), name: worker.licence})


def forget_licence(name: str) -> None:
    """Forget that the licence was accepted. Raises LiftError."""
    _keep({known: told for known, told in _accepted().items() if known != name})


def _accepted() -> dict[str, str]:
    """Nothing where the file is missing or damaged: then it is asked again."""
    try:
        told = json.loads((workers_folder() / ACCEPTED).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return {str(k): str(v) for k, v in told.items()} if isinstance(told, dict) else {}


def _keep(accepted: dict[str, str]) -> None:
    at = workers_folder() / ACCEPTED
    try:
        write_all({at: (json.dumps(accepted, indent=1) + "\n").encode()})
    except OSError as error:
        raise LiftError(f"{at} cannot be written: {error.strerror or error}") from error


def _files() -> dict[str, Path]:
    where = workers_folder()
    found = {at.stem: at for at in where.glob("*.toml")}
    found |= {at.parent.name: at for at in where.glob("*/worker.toml")}
    return {name: at for name, at in found.items() if NAME.fullmatch(name)}


def _worker(told: dict, name: str, here: Path) -> LiftWorker:
    """Raises ValueError."""
    texts = ("licence", "licence_kind", "page")
    if unknown := sorted(set(told) - {"name", "command", "timeout", *texts}):
        raise ValueError(f"{named(unknown[0])} is not known")
    if told.get("name", name) != name:
        raise ValueError(f"it is called {shown(told['name'])}, its file {name!r}")
    command = told.get("command")
    if not isinstance(command, list) or not command or not all(isinstance(c, str) for c in command):
        raise ValueError("command is not a list of texts")
    timeout = told.get("timeout", TIMEOUT)
    is_number = isinstance(timeout, int | float) and not isinstance(timeout, bool)
    if not is_number or not 0 < timeout <= LONGEST:
        raise ValueError(f"timeout is {shown(timeout)}, not seconds of at most a day")
    licence, kind, page = (told.get(key, "") for key in texts)
    for key in texts:
        if not isinstance(told.get(key, ""), str):
            raise ValueError(f"{key} is not a text")
    if (kind or FREE) not in KINDS:
        raise ValueError(f"licence_kind is {shown(kind)}, not one of {', '.join(KINDS)}")
    if kind not in ("", FREE) and not licence.strip():
        raise ValueError("a licence that has to be accepted has a name")
    stands = {"{here}": str(here.absolute()), "{python}": sys.executable}
    filled = []
    for argument in command:
        for sign, value in stands.items():
            argument = argument.replace(sign, value)
        filled.append(argument)
    return LiftWorker(name, tuple(filled), licence, float(timeout), kind or FREE, page)
