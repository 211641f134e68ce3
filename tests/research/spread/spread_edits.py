"""Run as a program by the tests: work on a Ray of two nodes on this machine, workers killed.

Arguments: a folder with scripts/, out/, truth/ and subjects/. Prints what happened as JSON.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[3]))

from objectmorpher.cli import parser as cli
from objectmorpher.server.spread import spread
from objectmorpher_research.commands import paper
from objectmorpher_research.evaluation.subjects.folders import read_subjects
from objectmorpher_research.evaluation.truth import spread_photos
from objectmorpher_research.evaluation.truth.running import claim

PHOTOS = (0, 1)  # of three edits in all


def main(folder: Path) -> None:
    from ray.cluster_utils import Cluster

    small: dict[str, Any] = {"num_cpus": 1, "object_store_memory": 100 << 20}
    cluster = Cluster(initialize_head=True, head_node_args=small | {"include_dashboard": False})
    cluster.add_node(**small)
    cluster.wait_for_nodes()
    address = str(cluster.address)
    out, truth = folder / "out", folder / "truth"
    killing = Killing(out, "*.png")
    report = folder / "report.json"
    status = cli.main([
        "batch", str(folder / "scripts"), "-o", str(out), "--ray", address,
        "--report", str(report),
    ])  # fmt: skip
    killed = [killing.stopped()]
    claim(truth, 0)
    asked = {"folder": str(truth), "seed": 0, "quick": True}
    killing = Killing(truth, "cases/*/*.json")
    jobs = [asked | {"photo": k} for k in PHOTOS]
    photos = [answer["name"] for answer in spread(spread_photos._photo, jobs, address)]
    killed.append(killing.stopped())
    subjects = run_subjects(folder, address)
    done = [spread_photos._jobs(asked)[k].is_done for k in PHOTOS]
    measured = measure_pictures(out, folder, address)
    cluster.shutdown()
    told = {"status": status, "killed": killed, "photos": photos, "done": done}
    told |= {"subjects": subjects, "measured": measured}
    print(json.dumps(told | {"batch": json.loads(report.read_text())}))


def measure_pictures(out: Path, folder: Path, address: str) -> int:
    """Each of them and the next one, by the cluster."""
    paths = sorted(out.glob("*.png"))
    (folder / "next").mkdir()
    for path, other in zip(paths, (*paths[1:], paths[0]), strict=True):
        (folder / "next" / path.name).write_bytes(other.read_bytes())
    asked = ["evaluate", "metrics", str(out), str(folder / "next")]
    return cli.main([*asked, "--json", str(folder / "spread.json"), "--ray", address])


def run_subjects(folder: Path, address: str) -> list[str]:
    """What `evaluate paper --run` says that it could not edit."""
    words = ["evaluate", "paper", str(folder / "subjects"), "--run", str(folder / "ours")]
    options = cli.build_parser().parse_args([*words, "--ray", address])
    return list(paper.run_ours(options, read_subjects(options.folder)))


class Killing:
    """Kills one worker of this Ray while it works, as soon as something is made."""

    def __init__(self, at: Path, made: str) -> None:
        self._at, self._made = at, made
        self._killed, self._is_over = 0, False
        self._thread = threading.Thread(target=self._kill, daemon=True)
        self._thread.start()

    def stopped(self) -> int:
        """The process that was killed."""
        self._is_over = True
        self._thread.join()
        return self._killed

    def _kill(self) -> None:
        while not self._is_over:
            if list(self._at.glob(self._made)) and (working := _working()):
                os.kill(working[0], signal.SIGKILL)
                self._killed = working[0]
                return
            time.sleep(0.02)


def _working() -> list[int]:
    """Workers of this Ray that have a job: it names them after it."""
    mine = f"RAY_TMPDIR={os.environ['RAY_TMPDIR']}\0".encode()
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            is_working = (process / "cmdline").read_bytes().startswith(b"ray::Map(_answered)")
            if is_working and mine in (process / "environ").read_bytes() + b"\0":
                found.append(int(process.name))
        except OSError:  # it has ended, or is another user's
            continue
    return found


if __name__ == "__main__":
    main(Path(sys.argv[1]))
