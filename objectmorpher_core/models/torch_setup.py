"""Makes the environment that holds PyTorch for the learned models, beside the program.

`base/torch_environment.py` says what it is and how it is used.
"""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import distributions
from pathlib import Path

from ..base import installation, torch_environment
from ..base.files import write_all
from ..base.progress import Progress
from ..base.torch_environment import apart_variables, packages_in, python_in
from .fetch import SLACK, check_online, reason_of_pip, run_watched
from .hub_download import bytes_in
from .registry import ModelError
from .torch_build import TorchBuild

BUILD = "build.txt"  # written first: a folder without it is none of ours
SAID = "setup.log"  # what pip has said last
RATE = 10e6  # bytes a second of the network that the minutes assume: 80 Mbit/s
UNPACKING = 60e6  # bytes a second that pip unpacks to an ordinary disk
BORROWED = "borrowed.pth"  # names the folders of the main environment's packages
EXTRA = "models"
EXTRA_DOWNLOAD, EXTRA_DISK = 0.2e9, 0.4e9  # bytes: the extra without PyTorch, rounded up
MAIN_DOWNLOAD, MAIN_DISK = 0.3e9, 0.9e9  # bytes: what the program itself needs
PYTHONS = ("python3", "python3.14", "python3.13", "python3.12", "python3.11", "python")
ASK = "import sys; print(*sys.version_info[:2]); import venv"


@dataclass(frozen=True)
class SetupPlan:
    """What is to be made, and where."""

    folder: Path
    python: str  # the interpreter that makes it
    build: TorchBuild
    requirements: tuple[str, ...]  # beside PyTorch, as pip takes them
    borrowed: tuple[str, ...]  # folders whose packages it uses, too; none: it has its own
    wheels: Path | None = None  # a folder that holds all packages, in place of any index

    @property
    def download(self) -> float:
        """Bytes, about."""
        return self.build.download + EXTRA_DOWNLOAD + (0 if self.borrowed else MAIN_DOWNLOAD)

    @property
    def minutes(self) -> int:
        """How long it takes at RATE and UNPACKING, rounded up."""
        return int((self.download / RATE + self.disk / UNPACKING) / 60) + 1

    @property
    def disk(self) -> float:
        """Bytes that it has when it is there, about."""
        return self.build.disk + EXTRA_DISK + (0 if self.borrowed else MAIN_DISK)


def plan(build: TorchBuild, wheels: Path | None = None) -> SetupPlan:
    """Return what `make` is to do for this copy. Raises ModelError: nothing can be made."""
    lines = list(installation.requirements(EXTRA))
    at, is_apart = torch_environment.folder(), installation.is_frozen()
    if is_apart:
        lines += installation.requirements("")
    wanted = tuple(line for line in lines if not re.match(r"torch\b", line))
    if is_apart:
        return SetupPlan(at, _outer_python(), build, wanted, (), wheels)
    own = str(packages_in(at))
    there = importlib.util.find_spec("torch")
    if there is not None and there.origin and own not in there.origin:
        where = Path(there.origin).parents[1]
        raise ModelError(f"PyTorch is here already, in {where}; no other one would be used")
    borrowed = tuple(p for p in sys.path if p.endswith("-packages") and p != own)
    return SetupPlan(at, sys.executable, build, wanted, borrowed, wheels)


def make(plan: SetupPlan, progress: Progress) -> torch_environment.Environment:
    """Make the environment, or bring one that is there up to date.

    Raises ModelError: one sentence. `Cancelled` passes; what is unfinished is not used, and gone on
    with by the next call.
    """
    if plan.wheels is None:
        check_online("PyTorch")
    _check_room(plan)
    progress(0.0, "making the environment")
    try:
        _begin(plan)
        _install(plan, progress)
        found = torch_environment.Environment(
            plan.build.name, _torch_in(plan), _version_of(plan.python), not plan.borrowed,
            bytes_in(plan.folder),
        )  # fmt: skip
        write_all({plan.folder / torch_environment.NOTE: json.dumps(asdict(found)).encode()})
    except OSError as error:
        told = error.strerror or error
        raise ModelError(f"{plan.folder} cannot be written: {told}") from error
    progress(1.0, "PyTorch is ready")
    return found


def unmake() -> int:
    """Remove the environment, whole or unfinished; the bytes that it had. Raises ModelError."""
    at = torch_environment.folder()
    if not (at / BUILD).is_file():
        raise ModelError(f"there is no environment in {at}")
    size = bytes_in(at)
    try:
        (at / torch_environment.NOTE).unlink(missing_ok=True)  # first: a half of it is not used
        shutil.rmtree(at)
    except OSError as error:
        raise ModelError(f"{at} cannot be removed: {error.strerror or error}") from error
    return size


def _begin(plan: SetupPlan) -> None:
    """An environment without packages, or the one that is there; others' files are not touched."""
    at, build = plan.folder, plan.build.name
    if at.is_dir() and any(at.iterdir()):
        if not (at / BUILD).is_file():
            raise ModelError(f"{at} holds other files, and no environment is made there")
        (at / torch_environment.NOTE).unlink(missing_ok=True)
        is_other = (at / BUILD).read_text(encoding="ascii").strip() != build
        if is_other or _version_of(str(python_in(at))) != _version_of(plan.python):
            shutil.rmtree(at)
    at.mkdir(parents=True, exist_ok=True)
    write_all({at / BUILD: f"{build}\n".encode()})
    if not python_in(at).exists():
        _run([plan.python, "-m", "venv", "--without-pip", str(at)], plan)
    lines = "\n".join([*plan.borrowed, ""])
    write_all({packages_in(at) / BORROWED: lines.encode()})


def _check_room(plan: SetupPlan) -> None:
    where = plan.folder
    while not where.exists() and where != where.parent:
        where = where.parent
    free = shutil.disk_usage(where).free + (bytes_in(plan.folder) if where == plan.folder else 0)
    # pip keeps what it downloads until it is unpacked.
    needed = 0 if plan.wheels else plan.download
    needed += plan.disk if not plan.wheels else 2 * bytes_in(plan.wheels)
    if free < needed + SLACK:
        told = f"{needed / 1e9:.1f} GB, and {free / 1e9:.1f} GB are free"
        raise ModelError(f"PyTorch and its packages need {told} in {plan.folder}")


def _install(plan: SetupPlan, progress: Progress) -> None:
    """PyTorch of the build first; the others then take it as it is."""
    there = distributions(path=list(plan.borrowed)) if plan.borrowed else ()
    held = {d.metadata["Name"]: d.version for d in there if d.metadata["Name"]}
    _pip(plan, ["torch>=2.6"], held, (progress, 0.02, 0.8), plan.build.index)
    held["torch"] = _torch_in(plan)
    _pip(plan, plan.requirements, held, (progress, 0.8, 0.99))


def _pip(
    plan: SetupPlan, wanted: Sequence[str], held: dict[str, str],
    stage: tuple[Progress, float, float], index: str = "",
) -> None:  # fmt: skip
    """Install what is wanted with packages held to versions, by this program's own pip."""
    found = importlib.util.find_spec("pip")
    if found is None or found.origin is None:
        raise ModelError(f"{sys.executable} has no pip, which installs packages")
    held_file = plan.folder / "held.txt"
    write_all({held_file: "".join(f"{n}=={v}\n" for n, v in sorted(held.items())).encode()})
    command = [
        str(python_in(plan.folder)),
        str(Path(found.origin).parent),
        "install",
    ]
    command += ["--no-cache-dir", "--disable-pip-version-check", "--no-input", "--upgrade"]
    command += ["--progress-bar", "off", "--only-binary=:all:", "-c", str(held_file)]
    if plan.wheels is not None:
        command += ["--isolated", "--no-index", "--find-links", str(plan.wheels)]
    elif index:
        command += ["--index-url", index]
    _run([*command, *wanted], plan, stage)


def _run(
    command: list[str], plan: SetupPlan, stage: tuple[Progress, float, float] | None = None
) -> None:
    """Run a command with what it unpacks in the folder. Raises ModelError: why it failed."""
    scratch, said = plan.folder / "scratch", plan.folder / SAID
    scratch.mkdir(exist_ok=True)
    places = {name: str(scratch) for name in ("TMPDIR", "TEMP", "TMP")}
    if plan.wheels is not None:  # no index and no folder that pip's own settings name, either
        places["PIP_CONFIG_FILE"] = os.devnull
    variables = apart_variables() | places
    try:
        code = run_watched(command, said, variables, _watch(plan, stage))
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    if code != 0:
        why = reason_of_pip(said, "it")
        raise ModelError(f"the environment for PyTorch cannot be made: {why}")


def _watch(
    plan: SetupPlan, stage: tuple[Progress, float, float] | None
) -> Callable[[], None]:  # fmt: skip
    """What shows how far it is while it runs: the bytes that have come, counted once a second."""
    if stage is None:
        return lambda: None
    progress, start, end = stage
    before, share, counted = bytes_in(plan.folder), 0.0, time.monotonic()

    def look() -> None:
        nonlocal share, counted
        if time.monotonic() > counted + 1.0:
            come = max(bytes_in(plan.folder) - before, 0)
            share, counted = min(come / (plan.download + plan.disk), 1.0), time.monotonic()
        progress(start + share * (end - start), f"installing PyTorch ({plan.build.name})")

    return look


def _torch_in(plan: SetupPlan) -> str:
    """The version of the PyTorch that was installed. Raises ModelError."""
    found = [d.version for d in distributions(path=[str(packages_in(plan.folder))])
             if d.metadata["Name"] == "torch"]  # fmt: skip
    if not found:
        raise ModelError("the environment was made, and PyTorch is not in it")
    return found[0]


def _outer_python() -> str:
    """A Python outside the installer's copy that can make an environment. Raises ModelError."""
    found = [(version, at) for name in PYTHONS if (at := shutil.which(name))
             and (version := _version_of(at)) and "3.11" <= version <= "3.14"]  # fmt: skip
    if not found:
        told = "install it from your system, or from python.org"
        if sys.platform == "linux":
            told = "such as by: sudo apt install python3 python3-venv"
        raise ModelError(f"a Python 3.11 to 3.14 with its venv module is needed: {told}")
    return found[0][1]


def _version_of(interpreter: str) -> str:
    """Such as 3.11; empty for what is no Python with venv."""
    try:
        said = subprocess.run([interpreter, "-c", ASK], capture_output=True, text=True,
                              timeout=20, check=True, env=apart_variables())  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return ""
    return ".".join(said.stdout.split())
