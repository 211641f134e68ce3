"""Which build of PyTorch a machine wants, and what that takes on the disk.

PyTorch's project keeps an index of packages for each build; the plain package of the usual index
has CUDA on Linux, none on Windows, and Apple's GPU on macOS. The least drivers are those of the
CUDA toolkits' release notes; which cards a build has kernels for is what PyTorch's releases say.
"""

from __future__ import annotations

import platform
import subprocess
from dataclasses import dataclass
from pathlib import Path

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
