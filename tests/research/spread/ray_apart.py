"""Ray in a process of a test's own, with a folder and settings of its own."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
NEEDS_RAY_DATA = pytest.mark.skipif(
    any(find_spec(name) is None for name in ("ray", "pyarrow", "pandas")),
    reason="Ray Data is not installed",
)


@contextmanager
def own_folder() -> Iterator[Path]:
    """Short: Ray's sockets lie in it, and their paths may have 107 characters."""
    at = Path(tempfile.mkdtemp(prefix="om"))
    try:
        yield at
    finally:
        shutil.rmtree(at, ignore_errors=True)


def environment(folder: Path, **more: str) -> dict[str, str]:
    """This process's, without what names another Ray."""
    own = {"RAY_TMPDIR": str(folder), "RAY_USAGE_STATS_ENABLED": "0"}
    foreign = ("RAY_AUTH_MODE", "RAY_AUTH_TOKEN", "RAY_ADDRESS")
    return {k: v for k, v in os.environ.items() if k not in foreign} | own | more


def claim_gpu(folder: Path, size: int) -> dict[str, str]:
    """Variables by which each machine has a GPU of `size` bytes, as its driver would say."""
    program = folder / "nvidia-smi"
    program.write_text(f"#!/bin/sh\necho {size >> 20}\n")
    program.chmod(0o755)
    cache = str(folder / "cache")
    return {"PATH": f"{folder}{os.pathsep}{os.environ['PATH']}", "OBJECTMORPHER_CACHE": cache}


def place_models(*ids: str) -> None:
    """Folders that look like installed models: their memory is planned by what is published."""
    from objectmorpher_core import models
    from objectmorpher_core.models.hub import FileFacts, Locked, write

    for id in ids:
        (models.folder() / id).mkdir(parents=True)
        (models.folder() / id / "config.json").write_text("{}")
        write(id, Locked({"config.json": FileFacts(2, "")}, ""))


def told_by(script: str, folder: Path, *arguments: object, **more: str) -> Any:
    """The last line, JSON, of a script beside this file that is run with `arguments`."""
    done = subprocess.run(
        [sys.executable, str(HERE / script), *map(str, arguments)],
        capture_output=True, text=True, timeout=500, env=environment(folder, **more),
        cwd=HERE.parents[2],
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])
