"""What of the build machine's system went into the program's folder, and under which licence."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable
from importlib.metadata import packages_distributions
from pathlib import Path

from packaging.utils import canonicalize_name

# Under the GPL; Python can do without each.
GPL = ("libreadline", "readline.", "libgdbm", "_gdbm", "libdb-5")
DOCUMENTED = Path("/usr/share/doc")
# Of SciPy what nothing in the folder imports; tests/test_imports.py does without them.
UNUSED_SCIPY = (
    "cluster", "datasets", "differentiate", "fftpack", "integrate", "interpolate", "io", "misc",
    "odr", "signal", "stats",
)  # fmt: skip
# Libraries that are built with symbols which only a debugger reads: 60 MB. None of those that a
# wheel brings in a `.libs` folder: their headers were moved, and `strip` can break them.
WITH_SYMBOLS = ("libllvmlite.so", "zstandard/*.so", "libpython3.*.so*")


def strangers(shipped: Iterable[str]) -> list[str]:
    """Return the modules of this environment that no distribution of `shipped` (names) brings.

    They belong to the tools that build the installer. What is shipped imports some of them where
    they are there (trimesh lxml); they would go along, without their licences.
    """
    own = {canonicalize_name(name) for name in shipped}
    owners = packages_distributions().items()
    return sorted(name for name, of in owners if not own & {canonicalize_name(one) for one in of})


def check(folder: Path) -> None:
    """Raises SystemExit where a library under the GPL is in it."""
    found = [p.name for p in folder.rglob("*") if p.name.startswith(GPL)]
    if found:
        raise SystemExit(f"under the GPL, and may not be shipped: {', '.join(found)}")


def strip_symbols(inside: Path) -> None:
    """Take the symbols out of WITH_SYMBOLS, where this system has binutils."""
    if shutil.which("strip") is None:
        return
    for library in sorted(p for name in WITH_SYMBOLS for p in inside.rglob(name)):
        subprocess.run(["strip", "--strip-unneeded", str(library)], check=True)


def write_system_texts(folder: Path, target: Path) -> None:
    """The copyright files of the Debian packages whose libraries are in it."""
    if shutil.which("dpkg") is None:
        return
    inside = folder / "_internal"
    for library in sorted(inside.glob("*.so*")):
        told = subprocess.run(
            ["dpkg", "-S", f"*/{library.name}"], capture_output=True, text=True, check=False
        )
        for line in told.stdout.splitlines():
            package = line.split(":")[0]
            text = DOCUMENTED / package / "copyright"
            if text.is_file():
                own = target / f"debian-{package}"
                own.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(text, own / "copyright")
                break
