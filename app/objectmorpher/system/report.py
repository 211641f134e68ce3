"""What an artist sends when something went wrong: version, machine, log; no private names."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from .. import __version__
from .logs import CRASHES, NAME
from .private import without_names

PACKAGES = ("numpy", "numba", "opencv-contrib-python-headless", "onnxruntime", "torch", "moderngl")
MOST = 40_000  # characters of each file: its end is of interest


def report(folder: Path) -> str:
    """Of the log and the crashes that are kept in `folder`."""
    lines = [
        f"objectmorpher {__version__}",
        f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        ", ".join(f"{name} {number}" for name in PACKAGES if (number := _version(name))),
    ]
    for name in (NAME, CRASHES):
        lines += ["", f"-- {name}", _end_of(folder / name)]
    return without_names("\n".join(lines))


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def _end_of(path: Path) -> str:
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return "(there is none)"
    return text if len(text) <= MOST else "…" + text[-MOST:].partition("\n")[2]
