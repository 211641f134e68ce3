"""The user's preferences, in a TOML file."""

from __future__ import annotations

import logging
import os
import tomllib
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import platformdirs

from objectmorpher_core.base.files import make_folder, write_all
from objectmorpher_core.document.model import GAUSSIANS

if TYPE_CHECKING:
    from objectmorpher_core.doctor import StageReport

log = logging.getLogger(__name__)

RECENT = 6  # files remembered
LARGEST = 1e9  # of any number that is no whole one
AUTO = "auto"
HERE, SERVER = "here", "server"  # where jobs run
AS_THEY_ARE = "off"
TABLES = ("backends", "shortcuts")  # of the file; everything else is a line of it
DOCTORS = {  # stage, as in the settings -> what the doctor calls it
    "segment": "select", "lift": "lift", "inpaint": "background", "refine": "refine",
}  # fmt: skip
STAGES = tuple(DOCTORS)


def by_stage(looked_at: Iterable[StageReport]) -> dict[str, StageReport]:
    """Return the doctor's findings by the names of STAGES."""
    found = {stage.name: stage for stage in looked_at}
    return {stage: found[name] for stage, name in DOCTORS.items()}


@dataclass(frozen=True)
class Backends:
    """Which backend does each stage; `auto` is the best that is available."""

    segment: str = AUTO
    lift: str = AUTO
    inpaint: str = AUTO
    refine: str = AUTO


@dataclass(frozen=True)
class Settings:
    """The defaults are what a first start has."""

    theme: str = "dark"  # or "light"
    scale: float = 0.0  # canvas px per point; 0: the monitor's
    dialogs: str = AUTO  # file dialogs: "auto" (the system's where there are any) or "built-in"
    motion: str = AUTO  # "auto" (as the system has it), "full" or "reduced"
    screen_profile: str = AUTO  # "auto" (the system's), "off", or the path of an ICC file
    proof_profile: str = ""  # path of an ICC file, by which colours are proofed
    quality: int = 95  # of JPEG exports
    webp_quality: int = 100  # of WebP exports; 100 is lossless
    export_format: str = ""  # empty: the photo's own
    export_bits: int = 0  # 8 or 16; 0: the photo's own
    export_film: str = ""  # format of videos; empty: the first there is
    export_layers: str = ""  # format of layers, likewise
    export_motion: str = "Photo to edit"
    export_seconds: float = 4.0
    export_folder: str = ""  # for photos that are no file of the user's
    declined_models: tuple[str, ...] = ()  # ids of those that are not offered any more
    dismissed: tuple[str, ...] = ()  # cards with help that are not shown any more
    gaussians: int = GAUSSIANS  # of a lifted object
    history_mb: int = 1024  # MiB that steps which can be undone may hold
    recent: tuple[str, ...] = ()  # paths, newest first
    language: str = "en"
    compute: str = HERE  # where long jobs run: HERE or SERVER
    server: str = ""  # its address; the token has a file of its own
    backends: Backends = field(default_factory=Backends)
    shortcuts: dict[str, str] = field(default_factory=dict)  # command -> keys of the user's own

    def with_recent(self, path: Path) -> Settings:
        """`path` is the file opened last."""
        name = str(path.absolute())
        others = tuple(r for r in self.recent if r != name)
        return replace(self, recent=(name, *others)[:RECENT])


def pictures_folder() -> Path:
    """Where this desktop keeps its photos; the home folder where there is no such folder."""
    folder = platformdirs.user_pictures_path()
    return folder if folder.is_dir() else Path.home()


def settings_path() -> Path:
    """The user's settings file; OBJECTMORPHER_SETTINGS names another one."""
    if named := os.environ.get("OBJECTMORPHER_SETTINGS"):
        return Path(named)
    return Path(platformdirs.user_config_dir("objectmorpher", appauthor=False)) / "settings.toml"


def read_settings(path: Path) -> Settings:
    """Settings of a file. What is missing, misspelt or of another type has its default."""
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return Settings()
    except (OSError, ValueError, RecursionError) as error:
        log.warning("The settings %s cannot be read (%s); defaults are used", path.name, error)
        return Settings()
    backends = Backends(**_matching(Backends(), values.pop("backends", {})))
    shortcuts = _words(values.pop("shortcuts", {}))
    if values.pop("is_motion_reduced", False) is True:  # its earlier name
        values.setdefault("motion", "reduced")
    for name in ("recent", "declined_models", "dismissed"):
        if isinstance(values.get(name), list):
            values[name] = tuple(str(r) for r in values[name])
    return replace(
        Settings(backends=backends, shortcuts=shortcuts), **_matching(Settings(), values)
    )


def write_settings(path: Path, settings: Settings) -> None:
    """Writes the file; a failure is logged, for no work depends on it."""
    plain = [f.name for f in fields(settings) if f.name not in TABLES]
    lines = [f"{name} = {_toml(getattr(settings, name))}" for name in plain]
    for title, table in (
        ("backends", asdict(settings.backends)),
        ("shortcuts", settings.shortcuts),
    ):
        lines += ["", f"[{title}]", *(f"{k} = {_toml(v)}" for k, v in table.items())]
    try:
        make_folder(path.parent)
        write_all({path: ("\n".join(lines) + "\n").encode("utf-8", "replace")})
    except OSError as error:
        log.warning("The settings cannot be written: %s", error)


def _words(values: object) -> dict[str, str]:
    """The entries of a table that are names with a text."""
    if not isinstance(values, dict):
        return {}
    return {k: v for k, v in values.items() if k.isidentifier() and isinstance(v, str)}


def _matching(defaults: object, values: object) -> dict:
    """The entries of `values` that `defaults` has, with the same type."""
    if not isinstance(values, dict):
        return {}
    known = {f.name: getattr(defaults, f.name) for f in fields(defaults)}  # type: ignore[arg-type]
    fitting = {}
    for name, default in known.items():
        value = values.get(name)
        if type(default) is float and isinstance(value, int | float):
            # NaN compares false; a whole number may be too large for a float.
            is_usable = not isinstance(value, bool) and abs(value) <= LARGEST
            value = float(value) if is_usable else None
        if type(value) is type(default):
            fitting[name] = value
    return fitting


def _escape(letter: str) -> str:
    """TOML takes no halves of surrogate pairs, which stand for odd bytes of a file's name."""
    return "?" if "\ud800" <= letter <= "\udfff" else f"\\U{ord(letter):08x}"


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else _escape(c) for c in escaped) + '"'
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    return str(value)
