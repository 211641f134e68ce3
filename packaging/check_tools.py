"""The wheel by `pipx install` and by `uv tool install`, each into a folder of its own, and an edit.

    python packaging/check_tools.py [--compiled] [FOLDER]      in an environment with hatchling

The tools themselves are installed into FOLDER, too (a temporary one by default). `--compiled`: the
edit takes the checkout's kernels, where there are any; it compiles its own otherwise.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PHOTO = ROOT / "assets" / "samples" / "coffee.jpg"
BIN = "Scripts" if os.name == "nt" else "bin"


def run(*command: object, cwd: Path, **more: str) -> str:
    """Its output. Raises RuntimeError: all that it said."""
    own = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    done = subprocess.run(
        [str(part) for part in command], cwd=cwd, env=own | more, capture_output=True, text=True
    )
    if done.returncode != 0:
        raise RuntimeError(f"{command[0]}: {(done.stdout + done.stderr)[-2000:]}")
    return done.stdout


def bring_kernels(packages: Path) -> None:
    """Copies what numba has compiled of the checkout to an installed wheel's `packages`.

    The sources there are the same; their times become so, too, by which older numbas go.
    """
    for above, name in ((ROOT, "objectmorpher_core"), (ROOT / "app", "objectmorpher")):
        for kernel in (above / name).rglob("__pycache__/*.nb[ic]"):
            there = packages / kernel.relative_to(above)
            there.parent.mkdir(exist_ok=True)
            shutil.copy(kernel, there)
        for source in (above / name).rglob("*.py"):
            shutil.copystat(source, packages / source.relative_to(above))


def check(folder: Path, tool: str, is_compiled: bool) -> tuple[float, float]:
    """Seconds that the installation took, and the first edit."""
    for own in ("home", "bin", "cache"):
        (folder / tool / own).mkdir(parents=True)
    wheel = next(folder.glob("*.whl"))
    at = folder / tool
    program = at / "bin" / ("objectmorpher.exe" if os.name == "nt" else "objectmorpher")
    if tool == "pipx":
        command = (folder / "tools" / BIN / "pipx", "install", "--python", sys.executable, wheel)
        own = {"PIPX_HOME": str(at / "home"), "PIPX_BIN_DIR": str(at / "bin")}
        own["PIPX_MAN_DIR"] = str(at / "man")
    else:
        command = (
            folder / "tools" / BIN / "uv",
            "tool",
            "install",
            "--python",
            sys.executable,
            wheel,
        )
        own = {"UV_TOOL_DIR": str(at / "home"), "UV_TOOL_BIN_DIR": str(at / "bin")}
        own["UV_CACHE_DIR"] = str(at / "cache")
        own["UV_FIND_LINKS"] = ""
    start = time.monotonic()
    run(*command, cwd=folder, **own)
    installed = time.monotonic() - start
    if is_compiled:
        bring_kernels(next((at / "home").rglob("objectmorpher_core")).parent)
    start = time.monotonic()
    assert run(program, "--version", cwd=folder).startswith("objectmorpher ")
    run(
        program, "edit", PHOTO, "--click", "280,150", "--turn", "15,0,0", "-o",
        at / "edited.png", cwd=folder, OBJECTMORPHER_CACHE=str(at / "none"),
    )  # fmt: skip
    assert (at / "edited.png").stat().st_size > 10_000
    python = next((at / "home").glob(f"**/objectmorpher/{BIN}/python"))
    run(python, "-m", "pip", "--version", cwd=folder)  # by which weights are fetched
    return installed, time.monotonic() - start


def main() -> None:
    """Checks both, and says how long each took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, metavar="FOLDER")
    parser.add_argument("--compiled", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = (options.folder or Path(scratch)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder, cwd=ROOT)
        venv.create(folder / "tools", with_pip=True)
        run(
            folder / "tools" / BIN / "python",
            "-m",
            "pip",
            "install",
            "-q",
            "pipx",
            "uv",
            cwd=folder,
        )
        for tool in ("pipx", "uv"):
            installed, edited = check(folder, tool, options.compiled)
            print(f"{tool}: installed in {installed:.0f} s, first edit after {edited:.0f} s more")


if __name__ == "__main__":
    main()
