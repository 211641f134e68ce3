"""The report of an artist whose program failed: version, machine, log; no private names."""

from __future__ import annotations

import getpass
import os
import platform
import re
from pathlib import Path

from .. import __version__
from .logs import CRASHES, NAME

PACKAGES = ("numpy", "numba", "opencv-contrib-python-headless", "onnxruntime", "torch", "moderngl")
MOST = 40_000  # characters of each file: its end is of interest


def report(folder: Path) -> str:
    """Build a report from the log and the crashes in `folder`."""
    lines = [
        f"objectmorpher {__version__}",
        f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        ", ".join(f"{name} {number}" for name in PACKAGES if (number := _version(name))),
    ]
    for name in (NAME, CRASHES):
        lines += ["", f"-- {name}", _end_of(folder / name)]
    return without_names("\n".join(lines))


def _version(package: str) -> str:
    from importlib.metadata import PackageNotFoundError, version  # 10 ms

    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def _end_of(path: Path) -> str:
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return "(there is none)"
    return text if len(text) <= MOST else "…" + text[-MOST:].partition("\n")[2]


# Texts that a user may show to others: without names of people, folders and photos.

HOME, USER, PHOTO, SESSION, FILE = "~", "<user>", "<photo>", "<session>", "<file>"
KINDS = {  # ending -> what stands for the name
    **dict.fromkeys(
        ("jpg", "jpeg", "jpe", "png", "tif", "tiff", "webp", "bmp", "heic", "heif", "avif", "gif"),
        PHOTO,
    ),
    "omorph": SESSION,
    **dict.fromkeys(
        ("ora", "mp4", "webm", "ply", "splat", "spz", "glb", "gltf", "obj", "stl", "off", "mtl"),
        FILE,
    ),
}
_ENDING = rf"\.(?P<ending>{'|'.join(KINDS)})(?![\w])"
_END = r"/\\'\"“”‘’:,;()\[\]{}<>=|\n\t"  # what a name is taken to end at
_PATH = re.compile(rf"(?:~|\b[A-Za-z]:)?(?:[/\\]+[^{_END}]+)+{_ENDING}", re.IGNORECASE)
_QUOTED = re.compile(
    rf"(?P<quote>['\"])(?:(?!(?P=quote))[^\n])+?{_ENDING}(?P<end>(?P=quote))"
    rf"|(?P<open>[“‘])[^”\n]+?{_ENDING.replace('ending', 'kind')}(?P<close>[”’])",
    re.IGNORECASE,
)
_NAME = re.compile(rf"(?P<lead>[A-Z][a-z]+ing )?[^{_END}]+{_ENDING}", re.IGNORECASE)


def without_names(text: str, home: Path | None = None, user: str | None = None) -> str:
    """`text` without the home folder, the user's name in paths, and names of the user's files.

    Where a name begins is not always to be seen: rather a word too many is taken away.
    """
    home, user = home or _home(), user or _user()
    for place in sorted(
        {str(home), os.path.realpath(home), home.as_posix()}, key=len, reverse=True
    ):
        if len(Path(place).parts) > 1:  # not "/"
            for written in (place.replace("\\", "\\\\"), place):
                text = re.sub(rf"{re.escape(written)}(?![\w-])", HOME, text)
    text = _QUOTED.sub(_requoted, text)
    text = _PATH.sub(lambda m: KINDS[m["ending"].lower()], text)
    text = _NAME.sub(_renamed, text)
    return re.sub(rf"(?<=[/\\]){re.escape(user)}(?![\w.-])", USER, text) if user else text


def _requoted(match: re.Match[str]) -> str:
    kind = KINDS[(match["ending"] or match["kind"]).lower()]
    return f"{match['quote'] or match['open']}{kind}{match['end'] or match['close']}"


def _renamed(match: re.Match[str]) -> str:
    space = "" if match["lead"] or not match[0][:1].isspace() else " "
    return f"{space}{match['lead'] or ''}{KINDS[match['ending'].lower()]}"


def _home() -> Path:
    try:
        return Path.home()
    except RuntimeError:  # a user without one
        return Path("/")


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return ""
