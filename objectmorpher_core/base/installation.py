"""The kind of installation: by pip, or as a whole by an installer.

An installer's copy holds its own Python, in which nothing can be installed; its folder may be read
only, or another one at every start (AppImage).
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import platformdirs

BUILD = "build.txt"  # in an installer's copy: a name of all its sources
LOCATOR = "objectmorpher_core.base.kernel_files.InstalledLocator"
PROJECT = "pyproject.toml"  # in a checkout, and in an installer's copy
EXTRA_MARK = re.compile(r"(;| and) *extra *== *[\"'](?P<name>[^\"']*)[\"']")
KERNELS = "OBJECTMORPHER_KERNELS"  # environment variable: where compiled kernels are kept


def is_frozen() -> bool:
    """Whether an installer brought this copy, with a Python of its own."""
    return bool(getattr(sys, "frozen", False))


def extra(name: str) -> str:
    """The command after which the optional packages `name` are there, for this kind of copy."""
    if name == "models":  # an AppImage is called by the name of its file
        return f"{os.environ.get('APPIMAGE', 'objectmorpher')} models setup"
    return f"{'pipx' if is_frozen() else 'pip'} install 'objectmorpher[{name}]'"


def requirements(extra: str) -> tuple[str, ...]:
    """What an extra of the program wants, as pip takes it; "": what the program itself wants."""
    import tomllib  # here: the window's start does not wait for what it does not ask
    from importlib.metadata import PackageNotFoundError, requires

    if (inside() / PROJECT).is_file():
        told = tomllib.loads((inside() / PROJECT).read_text(encoding="utf-8"))["project"]
        return tuple(told["optional-dependencies"][extra] if extra else told["dependencies"])
    try:
        lines = requires("objectmorpher") or []
    except PackageNotFoundError:
        return ()
    found = ((line, EXTRA_MARK.search(line)) for line in lines)
    return tuple(EXTRA_MARK.sub("", line).strip() for line, mark in found
                 if (mark["name"] if mark else "") == extra)  # fmt: skip


def kernel_folder() -> Path:
    """Return the folder of the kernels that an installer's copy compiled for this processor."""
    if named := os.environ.get(KERNELS):
        return Path(named)
    return platformdirs.user_cache_path("objectmorpher", appauthor=False) / "kernels"


def prepare(inside: Path) -> None:
    """Prepare this process and its children for an installer's copy in the folder `inside`.

    numba keeps what it compiles beside the sources, or under a name made of their folder: neither
    would be found again by a copy that is read only, or in another folder every time.
    """
    os.environ.setdefault("NUMBA_CACHE_DIR", str(kernel_folder()))
    os.environ.setdefault("NUMBA_CACHE_LOCATOR_CLASSES", LOCATOR)
    os.environ["OBJECTMORPHER_INSIDE"] = str(inside)


def inside() -> Path:
    """The folder of an installer's copy; that of a checkout or wheel elsewhere."""
    named = os.environ.get("OBJECTMORPHER_INSIDE")
    return Path(named) if named else Path(__file__).parents[2]


def build_name(folder: Path) -> str:
    """The name of the sources below `folder`, hexadecimal: of their names and all they hold.

    A kernel is compiled together with those that it calls: any change of any file may be one of it.
    """
    digest = hashlib.sha256()
    for name, path in _sources(folder):
        content = path.read_bytes()
        digest.update(b"%d %d " % (len(name), len(content)) + name + content)
    return digest.hexdigest()


def _sources(folder: Path) -> Iterator[tuple[bytes, Path]]:
    """The name and the path of each source; a checkout has one of the packages in `app`."""
    for package in ("objectmorpher", "objectmorpher_core"):
        above = folder if (folder / package).is_dir() else folder / "app"
        for path in sorted((above / package).rglob("*.py")):
            yield path.relative_to(above).as_posix().encode(), path


def written_build(folder: Path) -> str:
    """The name that was written when the copy in `folder` was built. Raises OSError."""
    return (folder / BUILD).read_text(encoding="ascii").strip()
