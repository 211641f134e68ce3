"""Makes the environment that holds PyTorch for the learned models, beside the program.

`base/torch_environment.py` says what it is and how it is used. First, which build a machine wants,
and what that takes on the disk: PyTorch's project keeps an index of packages for each build; the
plain package of the usual index has CUDA on Linux, none on Windows, and Apple's GPU on macOS. The
least drivers are those of the CUDA toolkits' release notes; which cards a build has kernels for is
what PyTorch's releases say.
"""

from __future__ import annotations

import importlib.util
import json
import os
import platform
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

INDEX = "https://download.pytorch.org/whl"
AMD_NODES = Path("/sys/class/kfd/kfd/topology/nodes")  # of the compute side of AMD's driver


@dataclass(frozen=True)
class TorchMachine:
    """What of a machine decides on the build."""

    system: str  # as platform.system() says: Linux, Windows, Darwin
    processor: str  # as platform.machine() says: x86_64, AMD64, aarch64, arm64
    driver: str = ""  # version of NVIDIA's driver; empty: there is none
    capability: str = ""  # of the best NVIDIA card, such as 8.9; empty: not known
    has_amd: bool = False  # whether AMD's driver offers a GPU for computing


@dataclass(frozen=True)
class TorchBuild:
    """A build, where it comes from, and what it takes, about."""

    name: str  # cu130, cu128, cu126, rocm6.4, cpu, mps
    index: str  # address of its index; empty: the usual one
    download: float  # bytes
    disk: float  # bytes when installed, its own libraries included
    why: str  # one clause for the user


GB = 1e9
SIZES = {  # download, disk, with the libraries that come along; estimates, but for the CPU's
    "cu130": (2.8 * GB, 6.0 * GB), "cu128": (3.7 * GB, 7.8 * GB), "cu126": (3.5 * GB, 7.2 * GB),
    "rocm6.4": (5.0 * GB, 18.0 * GB), "cpu": (0.2 * GB, 0.8 * GB), "mps": (0.1 * GB, 0.5 * GB),
}  # fmt: skip
CUDA = (  # build, least driver on Linux and Windows, range of the cards' capabilities
    ("cu130", 580, 7.5, 13.0), ("cu128", 570, 7.5, 13.0), ("cu126", 528, 5.0, 10.0),
)  # fmt: skip
USUAL = 7.5  # capability of a card that does not say


def build_for(machine: TorchMachine, wanted: str = "") -> TorchBuild:
    """Return the build for a machine, or the `wanted` one where there is such a build for it.

    Raises ModelError: one sentence, where PyTorch has none.
    """
    system, processor = machine.system, machine.processor.lower()
    if system == "Darwin" and processor != "arm64":
        raise ModelError("PyTorch has no builds for Macs with Intel processors any more")
    if system not in ("Linux", "Windows", "Darwin") or processor not in (
        "x86_64", "amd64", "aarch64", "arm64",
    ):  # fmt: skip
        raise ModelError(f"PyTorch has no build for {system} on {machine.processor}")
    if wanted:
        known = _builds_of(system)
        if wanted not in known:
            raise ModelError(f"{wanted} is no build for {system}: {', '.join(known)}")
        return _build(wanted, "it was asked for")
    if system == "Darwin":
        return _build("mps", "it uses Apple's GPU")
    if machine.driver:
        return _for_nvidia(machine)
    if machine.has_amd and system == "Linux":
        return _build("rocm6.4", "this is an AMD GPU")
    if machine.has_amd:
        return _build("cpu", f"PyTorch has no build for AMD's GPUs on {system}")
    return _build("cpu", "no GPU was found that PyTorch can use")


def _builds_of(system: str) -> tuple[str, ...]:
    if system == "Darwin":
        return ("mps",)
    return tuple(n for n in SIZES if n != "mps" and (system == "Linux" or n != "rocm6.4"))


def _for_nvidia(machine: TorchMachine) -> TorchBuild:
    """The newest build that both driver and card can run; the CPU's, and why, without one."""
    driver = int(machine.driver.partition(".")[0])
    capability = float(machine.capability or USUAL)
    for name, least, oldest, newest in CUDA:
        if driver >= least and oldest <= capability < newest:
            return _build(name, f"this is an NVIDIA GPU with driver {machine.driver}")
    needed = [least for _, least, oldest, newest in CUDA if oldest <= capability < newest]
    if not needed:
        return _build("cpu", f"PyTorch has no build for NVIDIA GPUs of capability {capability:g}")
    return _build(
        "cpu", f"the NVIDIA driver {machine.driver} is too old for its GPU: {min(needed)} or newer"
    )


def _build(name: str, why: str) -> TorchBuild:
    return TorchBuild(name, "" if name == "mps" else f"{INDEX}/{name}", *SIZES[name], why)


def this_machine() -> TorchMachine:
    """Ask the drivers; PyTorch is not needed for that."""
    system, processor = platform.system(), platform.machine()
    asked = ["nvidia-smi", "--query-gpu=driver_version,compute_cap", "--format=csv,noheader"]
    try:
        said = subprocess.run(asked, capture_output=True, text=True, timeout=10, check=True).stdout
    except (OSError, subprocess.SubprocessError):
        return TorchMachine(system, processor, has_amd=_has_amd(AMD_NODES))
    return parse_nvidia_smi(system, processor, said)


def parse_nvidia_smi(system: str, processor: str, said: str) -> TorchMachine:
    """Return the machine for what nvidia-smi has `said`: "driver, capability", a line a card."""
    rows = [[word.strip() for word in line.split(",")] for line in said.splitlines()]
    found = [row for row in rows if row[0].partition(".")[0].isdigit()]
    if not found:
        return TorchMachine(system, processor, has_amd=_has_amd(AMD_NODES))
    told = [row[1] for row in found if row[1:] and row[1].replace(".", "", 1).isdigit()]
    return TorchMachine(system, processor, found[0][0], max(told, key=float, default=""))


def _has_amd(nodes: Path) -> bool:
    """Whether a node of AMD's compute driver has the units of a GPU; processors are nodes, too."""
    try:
        told = [(node / "properties").read_text(encoding="ascii") for node in nodes.iterdir()]
    except (OSError, UnicodeDecodeError):
        return False
    pairs = [line.split() for text in told for line in text.splitlines()]
    return any(pair[0] == "simd_count" and pair[1:] != ["0"] for pair in pairs if pair)


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
