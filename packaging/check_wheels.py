"""Whether each pinned requirement has a wheel of the pinned hash for the systems not built here.

    python packaging/check_wheels.py [LOCK]        in an environment with pip and packaging

Asks the package index, as pip is set up, and installs nothing. Prints a line for each system;
exits with 1 where a wheel is missing.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
LOCK = ROOT / "packaging" / "locks" / "run-time.txt"
VERSION = "3.11"  # of Python, in all installers
# What markers see on each system, and the tags of wheels that its oldest supported release loads.
SYSTEMS = {
    "Windows, x86-64": ({"sys_platform": "win32", "platform_system": "Windows", "os_name": "nt",
                         "platform_machine": "AMD64"}, ["win_amd64"]),
    "macOS, arm64": ({"sys_platform": "darwin", "platform_system": "Darwin", "os_name": "posix",
                      "platform_machine": "arm64"},
                     [f"macosx_{n}_0_{kind}" for n in range(14, 10, -1)
                      for kind in ("arm64", "universal2")]),
    "macOS, x86-64": ({"sys_platform": "darwin", "platform_system": "Darwin", "os_name": "posix",
                       "platform_machine": "x86_64"},
                      [f"macosx_{n}_{kind}" for n in ("14_0", "13_0", "12_0", "11_0",
                                                      "10_15", "10_14", "10_13", "10_12", "10_9")
                       for kind in ("x86_64", "universal2", "intel")]),
    "Linux, aarch64": ({"sys_platform": "linux", "platform_system": "Linux", "os_name": "posix",
                        "platform_machine": "aarch64"},
                       [f"manylinux_2_{n}_aarch64" for n in (36, 34, 31, 28, 27, 26, 24, 17)]
                       + ["manylinux2014_aarch64"]),
}  # fmt: skip


def pinned(lock: Path) -> list[tuple[Requirement, str]]:
    """The requirements of a lock, and their lines with hashes."""
    entries = re.split(r"\n(?=\S)", lock.read_text("utf-8").replace("\\\n", " "))
    lines = [line for line in entries if re.match(r"[A-Za-z0-9]", line)]
    return [(Requirement(re.split(r"\s--hash|\s+#", line)[0].strip()), line) for line in lines]


def check(lock: Path, marked: dict[str, str], tags: list[str]) -> tuple[int, list[str]]:
    """How many requirements a system has, and what is said of those without a wheel."""
    here = {"python_version": VERSION, "python_full_version": f"{VERSION}.0"}
    wanted = [
        (requirement, line)
        for requirement, line in pinned(lock)
        if requirement.marker is None or requirement.marker.evaluate({**here, **marked})
    ]
    platforms = [word for tag in tags for word in ("--platform", tag)]
    missing = []
    with tempfile.TemporaryDirectory() as folder:
        for requirement, line in wanted:
            file = Path(folder) / "one.txt"
            hashes = re.findall(r"--hash=\S+", line)
            file.write_text(f"{requirement.name}{requirement.specifier} {' '.join(hashes)}\n")
            done = subprocess.run(
                [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "-q",
                 "--dry-run", "--no-deps", "--only-binary", ":all:", "--require-hashes",
                 "--python-version", VERSION, "--implementation", "cp", *platforms,
                 "--target", folder, "-r", str(file)],
                capture_output=True, text=True,
            )  # fmt: skip
            if done.returncode != 0:
                missing.append(f"{requirement.name}: {done.stderr.strip().splitlines()[-1]}")
    return len(wanted), missing


def main() -> int:
    """Check all systems; the exit code."""
    lock = Path(sys.argv[1]) if len(sys.argv) > 1 else LOCK
    status = 0
    for name, (marked, tags) in SYSTEMS.items():
        count, missing = check(lock, marked, tags)
        print(f"{name}: {count - len(missing)} of {count} requirements have a wheel")
        for line in missing:
            print(f"  {line}")
            status = 1
    return status


if __name__ == "__main__":
    sys.exit(main())
