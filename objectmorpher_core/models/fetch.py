"""Fetches weights into the user's cache, from a mirror or out of a wheel, and checks their hashes.

A file appears in the cache folder only whole and verified: it is written beside its place and
renamed. Whatever else was written is removed, also after a failure or a cancel.
"""

from __future__ import annotations

import hashlib
import importlib.util
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

import platformdirs

from ..base.files import place_file
from ..base.progress import Progress, part, silent
from .hub_download import bytes_in
from .registry import ModelError, Weight, mirrors, weight, weights

# Where else a weight can be had: folders on the web that hold the files by their names.
#
# A mirror is asked before the Python package that carries a weight. What it answers is believed
# only where it has the size and the hash of the registry, so that a mirror needs no trust.

VARIABLE = "OBJECTMORPHER_MIRROR"  # environment variable: a mirror that is asked first
WAIT = 20.0  # s for an answer, and between two blocks
MIRROR_BLOCK = 1 << 18  # bytes read at a time
SCHEMES = ("https://", "http://")

Answer = TypeVar("Answer")
log = logging.getLogger(__name__)


def addresses() -> tuple[str, ...]:
    """The mirrors in the order in which they are asked. Raises ModelError for what is none."""
    own = os.environ.get(VARIABLE, "")
    if own and not own.startswith(SCHEMES):
        raise ModelError(f"{VARIABLE} is {own!r}, which is no address of the web")
    return tuple(address.rstrip("/") for address in (own, *mirrors()) if address)


def fetch_mirrored(wanted: Weight, target: Path, progress: Progress) -> bool:
    """Whether a mirror had the file, which is `target` then, of the right size.

    Its hash is for the caller to check. Raises OSError where the disk is full. `Cancelled` passes.
    """
    from http.client import HTTPException
    from urllib.error import URLError

    for address in addresses():
        try:
            if _copy(f"{address}/{wanted.file}", wanted, target, progress):
                return True
            reason = "it has another size"
        except (URLError, HTTPException) as error:
            reason = str(error)
        log.info("%s does not come from %s: %s", wanted.id, address, reason)
    return False


def _copy(address: str, wanted: Weight, target: Path, progress: Progress) -> bool:
    """Write what `address` answers to `target`; no more of it than the weight has.

    Raises OSError: URLError where it does not answer or breaks off, another where the disk is full.
    """
    from urllib.request import urlopen

    count = 0
    with _of_network(lambda: urlopen(address, timeout=WAIT)) as answer, target.open("wb") as file:
        while count <= wanted.size and (block := _of_network(lambda: answer.read(MIRROR_BLOCK))):
            file.write(block)
            count += len(block)
            note = f"downloading {wanted.id}: {count >> 20} of {wanted.size >> 20} MB"
            progress(min(count / wanted.size, 1.0), note)
    return count == wanted.size


def _of_network(ask: Callable[[], Answer]) -> Answer:
    """What `ask` gives; whatever the system says of the connection is raised as URLError."""
    from urllib.error import URLError

    try:
        return ask()
    except URLError:
        raise
    except OSError as error:  # reset, unreachable, too slow, badly encrypted
        raise URLError(error) from error


BLOCK = 1 << 20  # bytes read at a time
POLL = 0.1  # s between two looks at the download
SLACK = 16 << 20  # bytes that must stay free on the disk
STALE = 24 * 3600  # s; an unfinished folder older than this belongs to a process that died
UNFINISHED = ".unfinished-"
OFFLINE = "OBJECTMORPHER_OFFLINE"  # environment variable: nothing is downloaded

_verified: dict[tuple[str, int, int], bool] = {}  # (path, bytes, mtime ns) -> hash is right


@dataclass(frozen=True)
class CacheState:
    """The cache's state of a weight."""

    weight: Weight
    path: Path  # where it is, or would be
    state: Literal["ok", "missing", "damaged"]


def folder() -> Path:
    """The cache folder of the weights; OBJECTMORPHER_CACHE overrides the user's cache folder."""
    root = os.environ.get("OBJECTMORPHER_CACHE")
    base = Path(root) if root else platformdirs.user_cache_path("objectmorpher")
    return base / "models"


def path(id: str) -> Path | None:
    """The verified file of weight `id`, or None where the cache does not hold it."""
    state = _state(weight(id))
    return state.path if state.state == "ok" else None


def look(id: str | None = None) -> tuple[CacheState, ...]:
    """Return the cache's state of weight `id`, or of all; a file is hashed once in a process."""
    return tuple(_state(known) for known in (weights() if id is None else (weight(id),)))


def verify(id: str | None = None) -> tuple[CacheState, ...]:
    """Return the cache's state of weight `id`, or of all, with every file hashed afresh."""
    _verified.clear()
    return look(id)


def fetch(id: str, progress: Progress = silent) -> Path:
    """The file of weight `id`, downloaded unless the cache holds it.

    Raises ModelError: one sentence saying why it could not be had. `Cancelled` passes through.
    """
    wanted = weight(id)
    found = path(id)
    if found is None:
        check_online(id)
        try:
            _download(wanted, progress)
        except OSError as error:
            reason = error.strerror or str(error)
            raise ModelError(f"{id} cannot be written to {folder()}: {reason}") from error
        found = path(id)
        if found is None:
            raise ModelError(f"{id} vanished from {folder()} right after it was written")
    progress(1.0, f"{id} is ready")
    return found


def remove_weight(id: str) -> None:
    """Remove a weight as if it had never been fetched. Raises ModelError."""
    at = folder() / weight(id).file
    try:
        at.unlink(missing_ok=True)
    except OSError as error:
        raise ModelError(f"{at} cannot be removed: {error.strerror or error}") from error


def check_online(id: str) -> None:
    """Raises ModelError where nothing may be downloaded."""
    if os.environ.get(OFFLINE, "") not in ("", "0"):
        raise ModelError(f"{id} is not here, and {OFFLINE} says to download nothing")


def _state(known: Weight) -> CacheState:
    """What the cache holds of `known`; a hash is computed once per file and process."""
    at = folder() / known.file
    try:
        found = at.stat()
    except OSError:
        return CacheState(known, at, "missing")
    key = (str(at), found.st_size, found.st_mtime_ns)
    if key not in _verified:
        _verified[key] = found.st_size == known.size and sha256_of(at) == known.sha256
    return CacheState(known, at, "ok" if _verified[key] else "damaged")


def sha256_of(at: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal."""
    digest = hashlib.sha256()
    with at.open("rb") as file:
        while block := file.read(BLOCK):
            digest.update(block)
    return digest.hexdigest()


def _download(wanted: Weight, progress: Progress) -> None:
    """Mirror or wheel -> file -> hash -> its place in the cache folder."""
    where = folder()
    where.mkdir(parents=True, exist_ok=True)
    _remove_stale(where)
    needed = 2 * wanted.wheel_size + wanted.size + SLACK  # pip keeps the wheel twice for a moment
    free = shutil.disk_usage(where).free
    if free < needed:
        megabytes = f"{needed >> 20} MB, and {free >> 20} MB are free"
        raise ModelError(f"{wanted.id} needs {megabytes} in {where}")
    # A scratch folder on the same disk as the cache, so that the last step is a mere rename.
    with tempfile.TemporaryDirectory(
        dir=where, prefix=UNFINISHED, ignore_cleanup_errors=True
    ) as scratch:
        mirrored = Path(scratch) / "mirrored"
        if fetch_mirrored(wanted, mirrored, part(progress, 0.0, 0.95)) and (
            sha256_of(mirrored) == wanted.sha256
        ):
            place_file(mirrored, where / wanted.file)
            return
        mirrored.unlink(missing_ok=True)
        _check_pip(wanted)
        wheel = _pip_download(wanted, Path(scratch), part(progress, 0.0, 0.95))
        progress(0.95, f"unpacking {wanted.id}")
        install(wanted, wheel, Path(scratch), where)


def _check_pip(wanted: Weight) -> None:
    if importlib.util.find_spec("pip") is None:
        raise ModelError(f"{wanted.id} cannot be fetched: {sys.executable} has no pip")


def install(wanted: Weight, wheel: Path, scratch: Path, where: Path) -> None:
    """The wheel's member into the cache folder. Raises ModelError, OSError: nothing has changed."""
    _take_member(wanted, wheel, scratch / wanted.file)
    place_file(scratch / wanted.file, where / wanted.file)


def _remove_stale(where: Path) -> None:
    """Removes what a killed process left unfinished."""
    for left in where.glob(UNFINISHED + "*"):
        if time.time() - left.stat().st_mtime > STALE:
            shutil.rmtree(left, ignore_errors=True)


def _pip_download(wanted: Weight, scratch: Path, progress: Progress) -> Path:
    """The wheel, downloaded into `scratch`; the growing files there are the progress."""
    wheels, temporary, log = scratch / "wheels", scratch / "temporary", scratch / "pip.log"
    wheels.mkdir()
    temporary.mkdir()
    command = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:"]
    command += ["--no-cache-dir", "--disable-pip-version-check", "--no-input"]
    command += ["--progress-bar", "off", "--dest", str(wheels), wanted.wheel]
    # As variables, so that a pip too old to know a name just ignores it.
    settings = {"TMPDIR": str(temporary), "TEMP": str(temporary), "TMP": str(temporary)}
    settings |= {"PIP_RESUME_RETRIES": "5"}

    def look() -> None:
        here = max(bytes_in(temporary), bytes_in(wheels))
        note = f"downloading {wanted.id}: {here >> 20} of {wanted.wheel_size >> 20} MB"
        progress(min(here / wanted.wheel_size, 1.0), note)

    code = run_watched(command, log, os.environ | settings, look)
    found = list(wheels.glob("*.whl"))
    if code != 0 or len(found) != 1:
        raise ModelError(f"{wanted.id} cannot be downloaded: {reason_of_pip(log, wanted.wheel)}")
    return found[0]


def run_watched(
    command: Sequence[str], said: Path, variables: Mapping[str, str], look: Callable[[], None],
    is_quiet: bool = False,
) -> int:  # fmt: skip
    """Run a command that writes into the file `said`, and return its exit code.

    `look` is called every `POLL` seconds; where it raises, such as `Cancelled`, the process is
    ended. `is_quiet`: what the process says of errors is dropped.
    """
    errors = subprocess.DEVNULL if is_quiet else subprocess.STDOUT
    with said.open("wb") as output:
        child = subprocess.Popen(command, stdout=output, stderr=errors, env=variables)
        try:
            while child.poll() is None:
                look()
                time.sleep(POLL)
        finally:
            if child.poll() is None:
                child.kill()
                child.wait()
    return child.returncode


def reason_of_pip(log: Path, wanted: str) -> str:
    """Why pip failed, in a user's words."""
    text = log.read_text(encoding="utf-8", errors="replace")
    if "No space left" in text or "File too large" in text:  # the user's share of it counts, too
        return "the disk is full"
    offline = ("Failed to establish", "Connection", "Name or service", "timed out", "Retrying")
    if any(sign in text for sign in offline):
        return "the package index does not answer; is there a network?"
    if "No matching distribution" in text or "Could not find a version" in text:
        return f"the package index does not have {wanted}"
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1].removeprefix("ERROR:").strip() if lines else "pip said nothing"


def _take_member(wanted: Weight, wheel: Path, target: Path) -> None:
    """Unpacks the one file of the wheel to `target` and checks its hash."""
    try:
        with (
            zipfile.ZipFile(wheel) as archive,
            archive.open(wanted.member) as source,
            target.open("wb") as file,
        ):
            shutil.copyfileobj(source, file, BLOCK)
    except (zipfile.BadZipFile, KeyError) as error:
        raise ModelError(f"{wanted.wheel} does not hold {wanted.member} undamaged") from error
    if sha256_of(target) != wanted.sha256:
        raise ModelError(f"{wanted.id} from {wanted.wheel} is not the file we know: wrong hash")
