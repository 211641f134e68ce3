"""The environment beside the program that holds PyTorch for the learned models, and its use.

`objectmorpher models setup` makes it (`models/torch_setup.py`). Where the program runs in a Python
that packages can be added to, the environment holds PyTorch and the extra's packages alone, made by
that very Python and held to the versions that are there; `join` puts it behind all else that is
imported. An installer's copy has a Python that lacks parts of its library: there the environment
has another Python and all that the program needs, and the program's sources run in it (`apart`).
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import platformdirs

from . import installation

VARIABLE = "OBJECTMORPHER_LEARNED"  # environment variable: the folder
NOTE = "environment.json"  # written last: without it, the environment is unfinished
WORKER = "--worker"  # first argument of a worker process of the window
BOOT = f"""import json, sys
sys.path += json.loads(sys.argv.pop(1))  # last: what is installed goes first
if sys.argv[1] == "{WORKER}":
    from objectmorpher.worker.apart import work_apart as main
else:
    from objectmorpher.__main__ import main
sys.exit(main(sys.argv[1:]))"""


@dataclass(frozen=True)
class Environment:
    """One that is whole."""

    build: str
    torch: str  # version
    python: str  # version, such as 3.11
    is_apart: bool  # whether it has all that the program needs
    size: int  # bytes


def folder() -> Path:
    """Return where it is, or would be; each Python has its own."""
    if named := os.environ.get(VARIABLE):
        return Path(named)
    kind = "installed"
    if not installation.is_frozen():
        kind = f"{running()}-{hashlib.sha256(sys.prefix.encode()).hexdigest()[:8]}"
    return platformdirs.user_data_path("objectmorpher", appauthor=False) / f"learned-{kind}"


def look() -> Environment | None:
    """The environment, where one is there whole and fits this copy of the program."""
    try:
        told: dict[str, Any] = json.loads((folder() / NOTE).read_text(encoding="utf-8"))
        found = Environment(**told)
    except (OSError, ValueError, TypeError):
        return None
    fits = found.is_apart if installation.is_frozen() else found.python == running()
    return found if fits and python_in(folder()).exists() else None


def join() -> bool:
    """Let this process import what the environment holds; whether it does.

    Not where PyTorch is there already, nor in an installer's copy.
    """
    if installation.is_frozen() or importlib.util.find_spec("torch") is not None:
        return False
    if look() is None:
        return False
    sys.path.append(str(packages_in(folder())))
    return True


def python() -> str:
    """The Python for a process that needs the learned models' packages."""
    is_used = installation.is_frozen() or str(packages_in(folder())) in sys.path
    return str(python_in(folder())) if is_used and look() is not None else sys.executable


def apart(*arguments: str) -> list[str] | None:
    """The command that runs the program's own sources in the environment of an installer's copy.

    None where the program runs itself. The process wants `apart_variables`.
    """
    if not installation.is_frozen() or look() is None:
        return None
    import objectmorpher_core

    above = Path(objectmorpher_core.__file__).parents[1]
    places = [str(above), *([str(above / "app")] if (above / "app").is_dir() else [])]
    return [str(python_in(folder())), "-P", "-c", BOOT, json.dumps(places), *arguments]


def apart_variables() -> dict[str, str]:
    """The environment variables of such a process: without the installer's own libraries."""
    kept = dict(os.environ)
    if not installation.is_frozen():
        return kept
    for name in ("LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH"):
        was = kept.pop(f"{name}_ORIG", None)  # PyInstaller's program keeps what the user has set
        kept.pop(name, None)
        if was is not None:
            kept[name] = was
    kernels = str(folder() / "kernels")  # another numba, whose kernels are other files
    return kept | {installation.KERNELS: kernels, "NUMBA_CACHE_DIR": kernels}


def python_in(at: Path) -> Path:
    """The interpreter of the environment in a folder."""
    return at / "Scripts" / "python.exe" if sys.platform == "win32" else at / "bin" / "python"


def packages_in(at: Path) -> Path:
    """Its folder of packages; the one it would have where it is not made yet."""
    if sys.platform == "win32":
        return at / "Lib" / "site-packages"
    found = sorted((at / "lib").glob("python3.*/site-packages"))
    return found[-1] if found else at / "lib" / f"python{running()}" / "site-packages"


def running() -> str:
    """The version of this Python, such as 3.11."""
    return "{}.{}".format(*sys.version_info[:2])
