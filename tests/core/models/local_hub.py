"""A server on this machine that answers what huggingface_hub asks: files and their list."""

from __future__ import annotations

import hashlib
import json
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from objectmorpher_core import models
from objectmorpher_core.models import HubModel, registry

COMMIT = "a" * 40


@dataclass
class Hub:
    """Repositories by name, and how the server misbehaves."""

    repositories: dict[str, dict[str, bytes]] = field(default_factory=dict)
    commit: str = COMMIT  # of `main`
    gated: set[str] = field(default_factory=set)  # repositories that want TOKEN
    wrong: set[str] = field(default_factory=set)  # files whose content is not what was announced
    short: set[str] = field(default_factory=set)  # files that end early
    sizes: dict[str, int] = field(default_factory=dict)  # announced instead of the true ones
    stall: threading.Event | None = None  # GETs give a part of a file, and wait for it
    stall_at: int = 0  # bytes of that part; 0: half
    ranges: list[tuple[str, int]] = field(default_factory=list)  # of GETs: file, first byte
    url: str = ""


TOKEN = "hf_right"
TINY_SAM2 = {  # files of a repository
    "config.json": b'{"model_type": "sam2"}',
    "model.safetensors": b"\x02\0\0\0\0\0\0\0{}",  # no tensors
}


def _handler(hub: Hub) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def log_message(self, format: str, *args: object) -> None:
            """Silent."""

        def do_HEAD(self) -> None:
            self._answer(is_head=True)

        def do_GET(self) -> None:
            if tree := re.fullmatch(r"/api/models/([^/]+/[^/]+)/tree/([^?]+)(\?.*)?", self.path):
                files = hub.repositories.get(tree[1], {})
                entries = [
                    {"type": "file", "path": p, "size": len(d), "oid": "0" * 40}
                    for p, d in files.items()
                ]
                self._send(200, json.dumps(entries).encode(), {"Content-Type": "application/json"})
            else:
                self._answer(is_head=False)

        def _answer(self, is_head: bool) -> None:
            found = re.fullmatch(r"/([^/]+/[^/]+)/resolve/([^/]+)/(.+)", self.path)
            repository, revision, name = found.groups() if found else ("", "", "")
            files = hub.repositories.get(repository)
            if files is None:
                return self._refuse(401, "RepoNotFound")
            is_known = f"Bearer {TOKEN}" == self.headers.get("Authorization")
            if repository in hub.gated and not is_known:
                return self._refuse(403, "GatedRepo")
            if revision not in ("main", hub.commit):
                return self._refuse(404, "RevisionNotFound")
            if name not in files:
                return self._refuse(404, "EntryNotFound")
            data = files[name]
            told = {
                "X-Repo-Commit": hub.commit, "ETag": _tag(name, data),
                "X-Linked-Size": str(hub.sizes.get(name, len(data))), "Accept-Ranges": "bytes",
            }  # fmt: skip
            if is_head:
                return self._send(200, data, told, is_head=True)
            start = int((re.findall(r"bytes=(\d+)-", self.headers.get("Range", "")) or [0])[0])
            hub.ranges.append((name, start))
            if name in hub.wrong:
                data = data[:-1] + bytes([data[-1] ^ 1])
            if name in hub.short:
                data = data[: len(data) // 2]
            if start:
                told["Content-Range"] = f"bytes {start}-{len(data) - 1}/{len(data)}"
            self._send(206 if start else 200, data[start:], told)
            return None

        def _refuse(self, status: int, code: str) -> None:
            self._send(status, b"", {"X-Error-Code": code, "X-Error-Message": code})

        def _send(
            self, status: int, data: bytes, told: dict[str, str], is_head: bool = False
        ) -> None:
            self.send_response(status)
            for key, value in told.items():
                self.send_header(key, value)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            if is_head:
                return
            if hub.stall is not None and len(data) > 1 << 16:
                self.wfile.write(data[: hub.stall_at or len(data) // 2])
                self.wfile.flush()
                hub.stall.wait(20)
                self.close_connection = True
                return
            self.wfile.write(data)

    return Handler


def _tag(name: str, data: bytes) -> str:
    """As the Hub: sha256 of large files, git's own hash of small ones."""
    if name.endswith((".safetensors", ".onnx")):
        return f'"{hashlib.sha256(data).hexdigest()}"'
    blob = b"blob %d\0" % len(data) + data
    return f'"{hashlib.sha1(blob).hexdigest()}"'


POLL = 0.01  # s, in which it sees that it is to end


@contextmanager
def serving() -> Iterator[Hub]:
    """The server, until the block ends."""
    hub = Hub()
    server = ThreadingHTTPServer(("127.0.0.1", 0), _handler(hub))
    server.daemon_threads = True
    hub.url = f"http://127.0.0.1:{server.server_address[1]}"
    thread = threading.Thread(target=server.serve_forever, args=(POLL,), daemon=True)
    thread.start()
    yield hub
    if hub.stall is not None:
        hub.stall.set()
    server.shutdown()
    server.server_close()
    thread.join()


def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """No model, token or wish of the user's is seen; the folder where models will be."""
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("HF_HOME", str(tmp_path / "hf"))
    for name in ("HF_TOKEN", "HF_HUB_OFFLINE", models.OFFLINE):
        monkeypatch.delenv(name, raising=False)
    return tmp_path / "cache" / "models"


@contextmanager
def offering(
    monkeypatch: pytest.MonkeyPatch, files: Mapping[str, bytes], free: HubModel, *gated: HubModel
) -> Iterator[Hub]:
    """The server, with these files of each model; huggingface_hub asks it, or the test skips.

    Their commits and hashes in the registry are those of the real files: here none are known.
    """
    pytest.importorskip("huggingface_hub")
    offered = {model.id for model in (free, *gated)}
    known = tuple(
        replace(model, revision="", sha256={}) if model.id in offered else model
        for model in registry.hub_models()
    )
    monkeypatch.setattr(registry, "hub_models", lambda: known)
    with serving() as hub:
        monkeypatch.setenv("HF_ENDPOINT", hub.url)
        hub.repositories = {model.repository: dict(files) for model in (free, *gated)}
        hub.gated |= {model.repository for model in gated}
        yield hub
