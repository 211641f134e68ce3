"""Downloads files of a Hub repository into a folder: a program of its own, run by `hub.py`.

`python hub_download.py REQUEST`, one JSON object: {"repository", "revision", "files", "sha256",
"target", "slack", "is_plain"}. Lines of JSON on stdout: {"plan": {"revision", "files"}}, then
{"done": files} or {"error": kind, "detail"}. A process of its own can be ended while a network
hangs, reads the Hub's environment variables afresh, and keeps the library out of the window's.

Files that another program has fetched into the Hub's shared cache are taken from there. `is_plain`
says that commit and hashes are known and the Hub's library is absent: then Python's own does.

A file that is only partly there is gone on with, also by another process: it is written in its
place under the ending PART, and renamed once its hash is right.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import shutil
import sys
from collections.abc import Callable
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any
from urllib.parse import quote

PART = ".part"
# No room; a quota that is used up; a disk or a limit that takes no larger file.
FULL = (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC), errno.EFBIG)
BLOCK = 1 << 20  # bytes read at a time
WAIT = 30.0  # s for an answer


class _Failure(Exception):
    """Why it cannot be had: a kind that `hub.py` has a sentence for, and a detail."""


def main(request: dict[str, Any]) -> None:
    """Does what the request says; raises _Failure, and whatever the Hub's library raises."""
    target = Path(request["target"])
    plan, sources = _plan(request)
    _say(plan=plan)
    missing = sum(f["size"] for f in plan["files"].values()) - bytes_in(target)
    free = shutil.disk_usage(target).free
    if missing + request["slack"] > free:
        raise _Failure("disk", f"{missing + request['slack'] >> 20} MB, {free >> 20} MB are free")
    facts = {}
    get = _get_plainly if request.get("is_plain") else _get_by_library
    for name, expected in plan["files"].items():
        if not request.get("is_plain") and not (target / name).exists():
            _take_cached(request["repository"], plan["revision"], name, target / name)
        sha256 = _fetch(target / name, sources[name], expected, get)
        facts[name] = {"size": expected["size"], "sha256": sha256}
    _say(done=facts)


def _plan(request: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """{"revision", "files": {name: {"size", "sha256", "sha1"}}}, and where each file is."""
    if request.get("is_plain"):
        return _plan_plainly(request)
    from huggingface_hub import get_hf_file_metadata, hf_hub_url

    repository, revision = request["repository"], request["revision"] or "main"
    files, sources = {}, {}
    for name in _names(repository, revision, request["files"]):
        url = hf_hub_url(repository, name, revision=revision)
        found = get_hf_file_metadata(url)
        if found.size is None or not found.commit_hash:
            raise _Failure("odd", f"{name} comes without its size or commit")
        revision = found.commit_hash  # all the files of one commit
        tag = found.etag or ""
        sha256 = request["sha256"].get(name) or (tag if re.fullmatch("[0-9a-f]{64}", tag) else "")
        sha1 = tag if re.fullmatch("[0-9a-f]{40}", tag) else ""  # git's, of small files
        files[name] = {"size": found.size, "sha256": sha256, "sha1": sha1}
        # Not its location: that may be a signed address elsewhere which grows old.
        sources[name] = hf_hub_url(repository, name, revision=revision)
    return {"revision": revision, "files": files}, sources


def _names(repository: str, revision: str, patterns: list[str]) -> list[str]:
    """The files that the patterns mean; the repository is listed only where one has a star."""
    if not any("*" in pattern for pattern in patterns):
        return patterns
    from huggingface_hub import HfApi
    from huggingface_hub.hf_api import RepoFile

    tree = HfApi().list_repo_tree(repository, recursive=True, revision=revision)
    names = [entry.path for entry in tree if isinstance(entry, RepoFile)]
    found = [name for name in names if any(fnmatchcase(name, p) for p in patterns)]
    absent = [p for p in patterns if not any(fnmatchcase(name, p) for name in found)]
    if not found or any("*" not in pattern for pattern in absent):
        raise _Failure("entry", absent[0])
    if absent:  # another version may have other files; those that are needed are checked later
        _say(absent=absent)
    return sorted(n for n in found if not Path(n).is_absolute() and ".." not in Path(n).parts)


def _plan_plainly(request: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """As `_plan`, of files of one commit whose hashes are known."""
    from urllib.request import Request, urlopen

    base = os.environ.get("HF_ENDPOINT", "https://huggingface.co").rstrip("/")
    files, sources = {}, {}
    for name in request["files"]:
        url = f"{base}/{request['repository']}/resolve/{request['revision']}/{quote(name)}"
        with urlopen(Request(url, method="HEAD"), timeout=WAIT) as answer:
            size = answer.headers.get("X-Linked-Size") or answer.headers["Content-Length"]
        files[name] = {"size": int(size), "sha256": request["sha256"][name], "sha1": ""}
        sources[name] = url
    return {"revision": request["revision"], "files": files}, sources


def _get_plainly(url: str, file: Any, size: int) -> None:
    """Writes the rest of a file from where `file` ends."""
    if file.tell() >= size:
        return
    from urllib.request import Request, urlopen

    request = Request(url, headers={"Range": f"bytes={file.tell()}-"})
    with urlopen(request, timeout=WAIT) as answer:
        if file.tell() and answer.status != 206:
            file.truncate(0)
        while block := answer.read(BLOCK):
            file.write(block)


def _get_by_library(url: str, file: Any, size: int) -> None:
    from huggingface_hub.file_download import http_get
    from huggingface_hub.utils import build_hf_headers

    http_get(url, file, resume_size=file.tell(), headers=build_hf_headers(), expected_size=size)


def _take_cached(repository: str, revision: str, name: str, place: Path) -> None:
    """A file that the Hub's shared cache has is linked or copied; its hash is checked as any's."""
    from huggingface_hub import try_to_load_from_cache

    cached = try_to_load_from_cache(repository, name, revision=revision)
    if not isinstance(cached, str):
        return
    place.parent.mkdir(parents=True, exist_ok=True)
    source = os.path.realpath(cached)  # a link to the content
    growing = place.with_name(place.name + PART)
    growing.unlink(missing_ok=True)
    try:
        shutil.copyfile(source, growing)
    except OSError:
        growing.unlink(missing_ok=True)


Get = Callable[[str, Any, int], None]


def _fetch(place: Path, url: str, expected: dict[str, Any], get: Get) -> str:
    """The file at its place, with the right hash; the sha256 of it."""
    place.parent.mkdir(parents=True, exist_ok=True)
    growing = place.with_name(place.name + PART)
    if place.exists():
        os.replace(place, growing)  # an older try; its hash says what it is
    size = expected["size"]
    if growing.exists() and growing.stat().st_size > size:
        growing.unlink()
    with growing.open("ab") as file:
        if file.tell() < size:
            get(url, file, size)
        file.flush()
        os.fsync(file.fileno())  # before it gets its name
    sha256, sha1 = hashlib.sha256(), hashlib.sha1(b"blob %d\0" % size)
    with growing.open("rb") as file:
        while block := file.read(BLOCK):
            sha256.update(block)
            sha1.update(block)
    is_right = expected["sha256"] in ("", sha256.hexdigest())
    if growing.stat().st_size != size or not is_right or expected["sha1"] not in (
        "", sha1.hexdigest()
    ):  # fmt: skip
        growing.unlink()
        raise _Failure("checksum", place.name)
    os.replace(growing, place)
    return sha256.hexdigest()


def bytes_in(folder: Path) -> int:
    """Return the bytes of all files below a folder, which may vanish meanwhile."""
    total = 0
    for inner, _, names in os.walk(folder):
        for name in names:
            try:
                total += os.path.getsize(os.path.join(inner, name))
            except OSError:
                continue
    return total


def _say(**told: Any) -> None:
    sys.stdout.write(json.dumps(told) + "\n")
    sys.stdout.flush()


def _kind_of(error: Exception) -> tuple[str, str]:
    """What the Hub's library means by an exception."""
    if isinstance(error, OSError) and error.errno in FULL:
        return "full", ""
    from urllib.error import HTTPError

    if isinstance(error, HTTPError):
        return {404: ("revision", ""), 401: ("repository", "")}.get(error.code, ("network", ""))
    try:
        from huggingface_hub import errors
    except ImportError:
        return "network", str(error)

    names = {
        errors.GatedRepoError: "gated", errors.RevisionNotFoundError: "revision",
        errors.EntryNotFoundError: "entry", errors.RepositoryNotFoundError: "repository",
        errors.OfflineModeIsEnabled: "offline",
    }  # fmt: skip
    detail = str(error).strip().splitlines()
    for known, name in names.items():
        if isinstance(error, known):
            return name, detail[-1] if detail else ""
    if "Consistency check failed" in str(error):
        return "truncated", ""
    kinds = {kind.__name__ for kind in type(error).__mro__}
    if kinds & {"TransportError", "ConnectionError", "TimeoutError"}:
        return "network", detail[0] if detail else ""
    return "other", detail[0] if detail else type(error).__name__


if __name__ == "__main__":
    try:
        main(json.loads(sys.argv[1]))
    except _Failure as failure:
        _say(error=failure.args[0], detail=failure.args[1])
    except Exception as error:  # whatever it was is reported in one line
        kind, detail = _kind_of(error)
        _say(error=kind, detail=detail)
