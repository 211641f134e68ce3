"""Downloads files of a Hub repository into a folder: a program of its own, run by `hub.py`.

`python hub_download.py REQUEST`, one JSON object: {"repository", "revision", "files", "sha256",
"target", "slack"}. Lines of JSON on stdout: {"plan": {"revision", "files"}}, then {"done": files}
or {"error": kind, "detail"}. A process of its own can be ended while a network hangs, reads the
Hub's environment variables afresh, and keeps the library out of the window's process.

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
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

PART = ".part"
# No room; a quota that is used up; a disk or a limit that takes no larger file.
FULL = (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC), errno.EFBIG)
BLOCK = 1 << 20  # bytes read at a time


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
    for name, expected in plan["files"].items():
        sha256 = _fetch(target / name, sources[name], expected)
        facts[name] = {"size": expected["size"], "sha256": sha256}
    _say(done=facts)


def _plan(request: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """{"revision", "files": {name: {"size", "sha256", "sha1"}}}, and where each file is."""
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
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in found):
            raise _Failure("entry", pattern)
    return sorted(n for n in found if not Path(n).is_absolute() and ".." not in Path(n).parts)


def _fetch(place: Path, url: str, expected: dict[str, Any]) -> str:
    """The file at its place, with the right hash; the sha256 of it."""
    from huggingface_hub.file_download import http_get
    from huggingface_hub.utils import build_hf_headers

    place.parent.mkdir(parents=True, exist_ok=True)
    growing = place.with_name(place.name + PART)
    if place.exists():
        os.replace(place, growing)  # an older try; what it is its hash tells
    size = expected["size"]
    if growing.exists() and growing.stat().st_size > size:
        growing.unlink()
    with growing.open("ab") as file:
        http_get(url, file, resume_size=file.tell(), headers=build_hf_headers(), expected_size=size)
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
    """Of all files below a folder; they may vanish while we look."""
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
    from huggingface_hub import errors

    names = {
        errors.GatedRepoError: "gated", errors.RevisionNotFoundError: "revision",
        errors.EntryNotFoundError: "entry", errors.RepositoryNotFoundError: "repository",
        errors.OfflineModeIsEnabled: "offline",
    }  # fmt: skip
    detail = str(error).strip().splitlines()
    for known, name in names.items():
        if isinstance(error, known):
            return name, detail[-1] if detail else ""
    if isinstance(error, OSError) and error.errno in FULL:
        return "full", ""
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
    except Exception as error:  # whatever it was is told in one line
        kind, detail = _kind_of(error)
        _say(error=kind, detail=detail)
