"""Nothing leaves this computer unless somebody asks: the main job where the network is refused.

Every socket that is made or connected, by Python, native code or a child, is seen by the kernel
and refused; the job is done all the same, and nothing was tried. `test_first_use` sees the window
so.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hands import ROOT
from objectmorpher_core.pictures.image import read_picture
from objectmorpher_core.session.file import decode_session
from tests.faults import network
from tests.faults.tracer import missing

JOB = Path(__file__).with_name("main_job.py")
CALL = "import socket; socket.create_connection(('127.0.0.1', 9), 1)"
TALKATIVE = {  # what must be found out, and what is then refused
    "a connection": (CALL, "AF_INET"),
    "a thread": (
        f"import threading; threading.Thread(target=exec, args=({CALL!r},)).start()", "AF_INET"),
    "a child": (
        f"import subprocess, sys; subprocess.run([sys.executable, '-c', {CALL!r}])", "AF_INET"),
    "a spawned worker": (
        "import multiprocessing, socket\n"
        "pool = multiprocessing.get_context('spawn').Pool(1)\n"
        "pool.apply_async(socket.create_connection, (('127.0.0.1', 9), 1)).wait()\n"
        "pool.terminate(); pool.join()", "AF_INET"),
    "urllib": (
        "import urllib.request; urllib.request.urlopen('http://127.0.0.1:9/')", "AF_INET"),
    "a look-up": ("import socket; socket.getaddrinfo('objectmorpher.example', 80)", "AF_INET"),
    "IPv6, by native code": ("import ctypes; ctypes.CDLL(None).socket(10, 2, 0)", "AF_INET6"),
    "a name server behind a file": (
        "import socket; socket.socket(socket.AF_UNIX).connect('/run/resolver')", "/run/resolver"),
}  # fmt: skip

linux_only = pytest.mark.skipif(bool(missing()), reason=missing())


@pytest.fixture
def home(compiled: None, tmp_path: Path, photo_bytes: bytes) -> Path:
    """A user's first day: a photo, and nothing else."""
    (tmp_path / "photo.png").write_bytes(photo_bytes)
    return tmp_path


def environment(home: Path) -> dict[str, str]:
    """As a desktop has it: without what machines of CI set, which keeps some libraries silent."""
    own = {
        "PATH": os.environ["PATH"], "HOME": str(home), "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join([str(ROOT / "app"), str(ROOT), str(ROOT / "tests" / "app")]),
    }  # fmt: skip
    if "NUMBA_CACHE_DIR" in os.environ:
        own["NUMBA_CACHE_DIR"] = os.environ["NUMBA_CACHE_DIR"]
    return own


def assert_done(home: Path) -> None:
    before = read_picture((home / "photo.png").read_bytes()).pixels
    for name in ("line", "editor"):
        after = read_picture((home / f"{name}.png").read_bytes()).pixels
        assert after.shape == before.shape and (after != before).any()
        (thing,) = decode_session((home / f"{name}.omorph").read_bytes()).objects
        assert thing.lifted is not None and thing.handles


@pytest.mark.slow
@linux_only
def test_the_main_job_asks_nobody(home: Path) -> None:
    command = [sys.executable, str(JOB), str(home)]
    status, said, tried = network.run(command, home, environment(home))
    assert tried == []
    assert status == 0, said
    assert_done(home)
    assert not list(home.rglob("*Microsoft*"))


def can_be_alone() -> bool:
    """Whether this system gives a process a network of its own, which has no other side."""
    try:
        return subprocess.run(["unshare", "-rn", "true"], capture_output=True).returncode == 0
    except OSError:
        return False


@pytest.mark.slow
@pytest.mark.skipif(not missing(), reason="it is seen that nothing is asked of any network")
@pytest.mark.skipif(not can_be_alone(), reason="no network of one's own is to be had")
def test_the_main_job_is_done_without_a_network(home: Path) -> None:
    command = ["unshare", "-rn", sys.executable, str(JOB), str(home)]
    done = subprocess.run(command, env=environment(home), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert_done(home)


@linux_only
@pytest.mark.parametrize("name", TALKATIVE)
def test_who_calls_is_found_out(name: str, tmp_path: Path) -> None:
    code, refused = TALKATIVE[name]
    _, _, tried = network.run([sys.executable, "-c", code], tmp_path, environment(tmp_path))
    assert refused in {attempt.target for attempt in tried}
