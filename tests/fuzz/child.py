"""The process in which damaged files are read: bounded in memory and time, ended if it must be.

`python -m tests.fuzz.child REQUEST`, one JSON object: {"readers": {name: first number}, "seed",
"count", "seconds", "folder", "kept": folder}. Lines of JSON on stdout: {"found": {...}} for each
failure, {"done": {...}} at the end. The file that is being read lies in the folder, so that who
started the process knows it where the process dies of it. Files in the folder "kept", called
READER-anything, are read first.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import Any

from .checks import Reader, Refused
from .damage import Damage
from .readers import by_name

MEMORY = 2 << 30  # bytes of address space beyond what the imports took
SECONDS = 20  # of processor time for a file, user's and system's
NOW = "now"  # the file that is being read
NAME = "name"  # JSON: which one it is


def main(request: dict[str, Any]) -> None:
    """Reads file after file, and says what went wrong."""
    folder = Path(request["folder"])
    readers = [by_name(name) for name in request["readers"]]
    starts = list(request["readers"].values())
    pools = {reader.name: reader.seeds() for reader in readers}
    for reader in readers:  # what is imported and compiled late comes before the limits
        for data in pools[reader.name]:
            failure(reader, data, folder)
    bound(MEMORY)
    read_kept(request.get("kept"), readers, folder)
    end = time.monotonic() + request["seconds"]
    tally = {r.name: {"files": n, "refused": 0} for r, n in zip(readers, starts, strict=True)}
    spent = dict.fromkeys(tally, 0.0)  # s, over the reader's share
    while time.monotonic() < end:
        waiting = [r for r in readers if tally[r.name]["files"] < request["count"]]
        if not waiting:
            break
        reader = min(waiting, key=lambda r: spent[r.name])
        own, start = tally[reader.name], time.monotonic()
        seed = f"{request['seed']}:{reader.name}:{own['files']}"
        data = reader.mend(Damage(seed, pools[reader.name]).file())
        own["files"] += 1
        (folder / NOW).write_bytes(data)
        now = {"reader": reader.name, "seed": seed, "tally": tally}
        (folder / NAME).write_text(json.dumps(now))
        found = failure(reader, data, folder)
        spent[reader.name] += (time.monotonic() - start) / reader.share
        if found == "refused":
            own["refused"] += 1
        elif found:
            say(found={"reader": reader.name, "seed": seed, "how": found})
    say(done=tally)


def read_kept(kept: str | None, readers: list[Reader], folder: Path) -> None:
    """The files of earlier failures."""
    for path in sorted(Path(kept).iterdir()) if kept else ():
        for reader in readers:
            if path.name.rpartition("-")[0] == reader.name:
                found = failure(reader, path.read_bytes(), folder)
                if found not in ("", "refused"):
                    say(found={"reader": reader.name, "seed": path.name, "how": found})


def failure(reader: Reader, data: bytes, folder: Path) -> str:
    """What is wrong with how a file was read: "" nothing, "refused" nothing either."""
    scratch = Path(tempfile.mkdtemp(dir=folder))
    signal.setitimer(signal.ITIMER_PROF, SECONDS)  # its signal ends the process
    try:
        reader.read(data, scratch)
    except Refused:
        return "refused"
    except AssertionError as error:
        return "not sound" + _told(error)
    except Exception as error:
        return type(error).__name__ + _told(error)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        shutil.rmtree(scratch, ignore_errors=True)
    return ""


def _told(error: BaseException) -> str:
    """Where it comes from, the last places in our own sources, and what it says."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if "/objectmorpher_core/" in f.filename or "/app/" in f.filename]
    places = [f"{Path(f.filename).name}:{f.lineno}" for f in (own or frames)[-3:]]
    return f" at {' > '.join(places)}: {str(error)[:200]!r}"


def bound(memory: int) -> None:
    """No more address space than this, beyond what is taken already."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * os.sysconf("SC_PAGE_SIZE") + memory
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def say(**value: Any) -> None:
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
