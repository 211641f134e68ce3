"""A real Ray with two processes per stage: they answer as this one does, and one may be killed."""

from __future__ import annotations

import http.client
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from same_values import same_values

from objectmorpher.server import client
from objectmorpher.server.address import Address, NotServed, ServedError, Server
from objectmorpher.server.client import call, hello
from objectmorpher.worker import job_functions
from objectmorpher.worker.job_functions import BackendChoice, Cut
from objectmorpher_core.base.arrays import frozen
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.compose.refine.refinement import CoarseEdit
from objectmorpher_core.document.model import Click, LiftSettings, Prompt
from objectmorpher_core.scripting.runner import RefineOptions

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed"),
]

TOKEN = "a-token-that-is-long-enough"
ROOT = Path(__file__).parents[3]
OPTIONS = (
    "--port", "0", "--stages", "segment,lift,inpaint",
    "--replicas", "2", "--cpus", "0.25", "--store", "100",
)  # fmt: skip
SAMPLE = ROOT / "assets" / "samples" / "coffee.jpg"


def descendants(root: int) -> set[int]:
    """Processes that `root` has started, and theirs."""
    listed = subprocess.run(["ps", "-e", "-o", "pid=,ppid="], capture_output=True, text=True)
    parents = dict(tuple(map(int, line.split())) for line in listed.stdout.splitlines())
    found = {root}
    while more := {pid for pid, parent in parents.items() if parent in found} - found:
        found |= more
    return found


@dataclass
class Serving:
    """`objectmorpher serve`, as it was started."""

    server: Server
    log: Path

    @property
    def pids(self) -> list[int]:
        """The processes in which jobs began, in that order."""
        return [int(n) for n in re.findall(r" runs on .*, process (\d+)", self.log.read_text())]


@pytest.fixture(scope="module")
def serving() -> Iterator[Serving]:
    """Lifting and filling, two processes each, and nothing of Ray's left afterwards."""
    # Short: Ray's sockets lie in it, and their paths may have 107 characters.
    folder = Path(tempfile.mkdtemp(prefix="om"))
    environment = os.environ | {"RAY_TMPDIR": str(folder), "OBJECTMORPHER_TOKEN": TOKEN}
    for name in ("RAY_AUTH_MODE", "RAY_AUTH_TOKEN", "RAY_ADDRESS"):
        environment.pop(name, None)
    with (folder / "log").open("w") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "objectmorpher", "serve", *OPTIONS], cwd=ROOT, env=environment,
            stdout=subprocess.PIPE, stderr=log, text=True,
        )  # fmt: skip
        assert process.stdout is not None
        line = process.stdout.readline()
    try:
        found = re.fullmatch(r"serving on http://127\.0\.0\.1:(\d+)\n", line)
        assert found, (folder / "log").read_text()
        address = Address("127.0.0.1", int(found.group(1)))
        started = descendants(process.pid)
        yield Serving(Server(address, TOKEN), folder / "log")
        started |= descendants(process.pid)
    finally:
        process.terminate()
        process.wait(40)
    end = time.monotonic() + 60
    while left := {pid for pid in started if is_alive(pid)}:
        assert time.monotonic() < end, f"Ray has left processes: {left}"
        time.sleep(0.1)
    assert process.returncode == 0
    shutil.rmtree(folder, ignore_errors=True)


def is_alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


@pytest.fixture
def server(serving: Serving) -> Server:
    return serving.server


@pytest.fixture(scope="module")
def photo() -> np.ndarray:
    """(300, 450, 3) of a real one."""
    pixels = cv2.imread(str(SAMPLE))[..., ::-1]
    return frozen(cv2.resize(pixels, (450, 300), interpolation=cv2.INTER_AREA))


@pytest.fixture(scope="module")
def mask(photo: np.ndarray) -> np.ndarray:
    """An ellipse (H, W) in the middle of it."""
    y, x = np.mgrid[0:300, 0:450]
    return frozen(((x - 225) / 80) ** 2 + ((y - 150) / 60) ** 2 < 1)


def test_it_tells_its_stages(server: Server) -> None:
    assert hello(server)["stages"] == {"segment": 2, "lift": 2, "inpaint": 2}


def test_a_lift_is_what_it_is_here_to_the_last_bit(
    server: Server, photo: np.ndarray, mask: np.ndarray
) -> None:
    cut = Cut(photo, Camera.from_fov(450, 300), mask)
    arguments = cut, BackendChoice("auto", 1), LiftSettings(count=2000)
    steps: list[float] = []
    answer = call(server, "lift", arguments, lambda fraction, _: steps.append(fraction))
    assert same_values(answer, job_functions.lift(*arguments, progress=silent))
    assert len(steps) > 3


def test_two_processes_work_at_a_time_and_a_third_job_waits(
    serving: Serving, photo: np.ndarray, mask: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    # On a busy machine the third may wait longer than the window does before it works here.
    monkeypatch.setattr(client, "QUEUE", 300.0)
    arguments = photo, mask, BackendChoice("auto", 5), 2
    answers: list[Any] = []

    def work() -> None:
        answers.append(call(serving.server, "fill_variants", arguments, silent))

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(300)
    assert len(answers) == 3
    assert all(same_values(answer, answers[0]) for answer in answers)
    assert len(set(serving.pids[-3:])) == 2


def test_clicks_reach_the_process_that_has_read_the_photo(
    serving: Serving, photo: np.ndarray
) -> None:
    photos = [frozen(np.roll(photo, 37 * k, 1)) for k in range(4)]

    def click(number: int, x: float) -> int:
        """The process that answers."""
        asked = photos[number], Prompt((Click(x, 150.0),)), BackendChoice("grabcut")
        before = len(serving.pids)
        assert call(serving.server, "segment", asked, silent).mask.any()
        end = time.monotonic() + 60
        while len(serving.pids) == before:  # the line is on its way from the process's machine
            assert time.monotonic() < end
            time.sleep(0.02)
        return serving.pids[-1]

    read = [click(k, 225.0) for k in range(4)]
    for x in (230.0, 220.0, 240.0):
        assert [click(k, x) for k in (2, 0, 3, 1)] == [read[k] for k in (2, 0, 3, 1)]


def test_whoever_lacks_the_token_is_told_nothing_by_the_proxies_either(serving: Serving) -> None:
    address = serving.server.address
    for path in ("/v1/hello", "/", "/-/routes", "/-/healthz"):
        for headers in ({}, {"Authorization": f"Bearer {TOKEN}x"}):
            connection = http.client.HTTPConnection(address.host, address.port, timeout=10)
            connection.request("GET", path, headers=headers)
            response = connection.getresponse()
            assert response.status == 401 and b"token" in response.read()
            connection.close()
    assert TOKEN not in serving.log.read_text()


def test_cancelling_ends_the_job_in_its_process(
    server: Server, photo: np.ndarray, mask: np.ndarray
) -> None:
    arguments = photo, mask, BackendChoice("auto", 5), 12

    def progress(fraction: float, note: str) -> None:
        if fraction > 0.1:
            raise Cancelled

    for _ in range(2):  # both processes
        with pytest.raises(Cancelled):
            call(server, "fill_variants", arguments, progress)
    start = time.monotonic()
    call(server, "inpaint", arguments[:3], silent)
    assert time.monotonic() - start < 20  # the cancelled ones would go on for minutes


def test_a_job_that_fails_there_says_why(
    server: Server, photo: np.ndarray, mask: np.ndarray
) -> None:
    with pytest.raises(ServedError, match="no inpainter"):
        call(server, "inpaint", (photo, mask, BackendChoice("nobody")), silent)


def test_a_stage_that_is_not_served_is_refused(server: Server, photo: np.ndarray) -> None:
    edit = CoarseEdit(0, 0, photo, photo, np.ones((300, 450), np.float32))
    with pytest.raises(NotServed, match="does not refine"):
        call(server, "refine", (edit, RefineOptions("auto")), silent)


def test_a_job_whose_process_is_killed_is_done_by_the_other_one_with_the_same_answer(
    serving: Serving, photo: np.ndarray, mask: np.ndarray
) -> None:
    arguments = photo, mask, BackendChoice("auto", 3), 2
    killed: list[int] = []

    def kill(fraction: float, note: str) -> None:
        if not killed and fraction >= 0.5:  # one background of two is ready
            killed.append(serving.pids[-1])
            assert killed[0] in descendants(os.getpid())
            os.kill(killed[0], signal.SIGKILL)

    answer = call(serving.server, "fill_variants", arguments, kill)
    assert killed
    assert len(serving.pids) >= 2
    assert serving.pids[-1] not in killed
    assert same_values(answer, job_functions.fill_variants(*arguments, progress=silent))
