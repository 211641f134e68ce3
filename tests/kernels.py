"""Compiles the kernels before the tests: `python -m tests.kernels`.

Processes that begin together would compile the same ones. To load them all takes seconds: a list of
them is kept until a source changes or one is gone.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.alone import alone

ROOT = Path(__file__).parents[1]
PYTHONPATH = os.pathsep.join([str(ROOT / "app"), str(ROOT)])
FOLDERS = (ROOT / "objectmorpher_core", ROOT / "app" / "objectmorpher")
KEPT = ROOT / ".pytest_cache" / "kernels.txt"


def compile_kernels() -> None:
    """A minute or two the first time; other processes that ask wait for it, and find the list."""
    sources = sorted(path for folder in FOLDERS for path in folder.rglob("*.py"))
    times = repr([(str(path), path.stat().st_mtime_ns) for path in sources])
    KEPT.parent.mkdir(exist_ok=True)
    with alone(KEPT.with_suffix(".lock")):
        before = KEPT.read_text(encoding="utf-8").splitlines() if KEPT.exists() else []
        if before[:1] == [times] and all(map(os.path.exists, before[1:])):
            return
        command = [sys.executable, "-m", "objectmorpher.system.warm_up"]
        own = os.environ | {"PYTHONPATH": PYTHONPATH}
        subprocess.run(command, cwd=ROOT, env=own, check=True)
        found = [str(path) for folder in FOLDERS for path in folder.rglob("*.nbi")]
        KEPT.write_text("\n".join([times, *sorted(found)]), encoding="utf-8")


if __name__ == "__main__":
    compile_kernels()
