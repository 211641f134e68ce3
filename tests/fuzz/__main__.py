"""Damages files and has them read, in processes that are bounded: `make fuzz SECONDS=3600`.

`python -m tests.fuzz --seconds S [--readers a,b] [--seed N] [--report F.json] [--keep FOLDER]`.
Exits with 1 where something was found; what was found is told, and its files are kept.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .child import NAME, NOW
from .readers import by_name, readers

ROOT = Path(__file__).parents[2]
TURN = 600.0  # s that a process reads, at most
SILENCE = 600.0  # s after which a process counts as stuck; its kernels may be compiled first


@dataclass
class Tally:
    """What was read, and what was found."""

    files: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    seconds: float = 0.0
    found: dict[str, dict[str, Any]] = field(default_factory=dict)  # by reader and how

    def add(self, other: Tally) -> None:
        """What another run has read and found, too."""
        self.files += other.files
        self.refused += other.refused
        self.seconds += other.seconds
        for key, found in other.found.items():
            times = self.found[key]["times"] if key in self.found else 0
            self.found[key] = found | {"times": found["times"] + times}


def fuzz(
    names: list[str], seed: str, count: int, seconds: float, keep: Path | None,
    kept: Path | None = None,
) -> Tally:  # fmt: skip
    """Has `count` damaged files of each reader read, or as many as there is time for.

    `keep`: where the files of failures go; `kept`: files of earlier ones, which are read first.
    """
    tally, begin = Tally(), time.monotonic()
    end, at = begin + seconds, dict.fromkeys(names, 0)
    with tempfile.TemporaryDirectory() as scratch:
        while any(n < count for n in at.values()) and time.monotonic() < end:
            request = {"readers": at, "seed": seed, "count": count,
                       "seconds": end - time.monotonic(), "folder": scratch,
                       "kept": str(kept) if kept else None}  # fmt: skip
            kept = None
            at = _one_process(request, Path(scratch), tally, keep)
    tally.files.update(at)
    tally.seconds = time.monotonic() - begin
    return tally


def _one_process(
    request: dict[str, Any], folder: Path, tally: Tally, keep: Path | None
) -> dict[str, int]:
    """Reads until the end, or until the process dies; the numbers to go on with."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1",
                                "PYTHONWARNINGS": "ignore"}  # fmt: skip
    for left in (folder / NAME, folder / NOW):
        left.unlink(missing_ok=True)
    command = [sys.executable, "-m", "tests.fuzz.child", json.dumps(request)]
    with (folder / "stderr").open("w") as noise:
        child = subprocess.Popen(
            command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True, stderr=noise
        )
        try:
            told, _ = child.communicate(timeout=request["seconds"] + SILENCE)
        except subprocess.TimeoutExpired:
            child.send_signal(signal.SIGKILL)
            told, _ = child.communicate()
    done = None
    for line in told.splitlines():
        said = json.loads(line)
        if "found" in said:
            _note(tally, said["found"], keep)
        done = said.get("done", done)
    if done is None:
        if not (folder / NAME).exists():
            noise = (folder / "stderr").read_text()[-2000:]
            raise RuntimeError(noise or "the process did not begin")
        now = json.loads((folder / NAME).read_text())
        how = f"ended with {child.returncode} ({_signal(child.returncode)})"
        _note(tally, {"reader": now["reader"], "seed": now["seed"], "how": how}, keep,
              (folder / NOW).read_bytes())  # fmt: skip
        done = now["tally"]
    tally.refused.update({name: own["refused"] for name, own in done.items()})
    return {name: own["files"] for name, own in done.items()}


def _note(tally: Tally, found: dict[str, Any], keep: Path | None, data: bytes = b"") -> None:
    """Tells of each kind of failure once, and keeps its file."""
    key = f"{found['reader']}: {found['how'].partition(': ')[0]}"  # what and where
    if key in tally.found:
        tally.found[key]["times"] += 1
        return
    tally.found[key] = found | {"times": 1}
    print(f"FOUND {found['reader']}: {found['how']}\n      {found['seed']}", flush=True)
    if keep is not None:
        from .damage import Damage

        if not data:
            reader = by_name(found["reader"])
            data = reader.mend(Damage(found["seed"], reader.seeds()).file())
        keep.mkdir(parents=True, exist_ok=True)
        digest = hashlib.sha256(data).hexdigest()[:10]
        (keep / f"{found['reader']}-{digest}").write_bytes(data)


def _signal(code: int) -> str:
    return signal.Signals(-code).name if code < 0 else "an exit code"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="for all readers together")
    parser.add_argument("--readers", default="", help="names, separated by commas; all if none")
    parser.add_argument("--seed", default=str(int(time.time())), help="the same gives the same")
    parser.add_argument("--report", type=Path, help="a JSON file of what was read and found")
    parser.add_argument("--keep", type=Path, help="a folder for the files of failures")
    options = parser.parse_args()
    chosen = [r for r in readers() if not options.readers or r.name in options.readers.split(",")]
    total, end, turn = Tally(), time.monotonic() + options.seconds, 0
    names = [reader.name for reader in chosen]
    while (left := end - time.monotonic()) > 0:
        part = fuzz(names, f"{options.seed}.{turn}", 1 << 40, min(TURN, left), options.keep)
        total.add(part)
        turn += 1
        if options.report is not None:
            _report(options.report, options.seed, total)
    for name, files in sorted(total.files.items()):
        print(f"{name:15} {files:9,} files, {total.refused[name]:9,} refused")
    print(f"{total.files.total():,} files in {total.seconds:.0f} s; {len(total.found)} found")
    return int(bool(total.found))


def _report(path: Path, seed: str, total: Tally) -> None:
    told = {"seed": seed, "seconds": round(total.seconds), "files": dict(total.files),
            "refused": dict(total.refused), "found": list(total.found.values())}  # fmt: skip
    path.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
