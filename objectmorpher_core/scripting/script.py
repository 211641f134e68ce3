"""The edit script: what is to be done to one photo, in the words of the command line.

The options of `objectmorpher edit` and a JSON file of `--script` are this one dataclass. A file may
go on with further objects of the same photo.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from ..base.files import read_input
from ..base.quoting import count_range, meant, shown
from ..document.model import BACKS, KINDS, LEAST_THICKNESS, MOST_THICKNESS
from ..document.settings import (
    MODES,
    MOST_BLUR,
    MOST_EXPOSURE,
    MOST_SATURATION,
    MOST_SHARPNESS,
    NORMAL,
    Finish,
)

XY = tuple[float, float]
MOST_NUMBER = 1e9  # px, degrees, diameters


class ScriptError(ValueError):
    """The script asks for something that does not exist or makes no sense; one sentence."""


@dataclass(frozen=True)
class HandleMove:
    """The surface point seen at `at` must appear at `to`, moved `dz` diameters away."""

    at: XY  # px
    to: XY  # px
    dz: float = 0.0  # object diameters


@dataclass(frozen=True)
class FillFrom:
    """The background around `to` is filled in from around `source`."""

    source: XY  # px
    to: XY  # px
    radius: float | None = None  # px; None: the usual share of the photo


@dataclass(frozen=True)
class EditScript:
    """An edit. Every field is a long option of the command line."""

    click: tuple[XY, ...] = ()  # px
    not_click: tuple[XY, ...] = ()
    box: tuple[float, float, float, float] | None = None
    subject: bool = False
    mask: str | None = None  # file
    segment: str = "auto"
    lift: str = "auto"
    inpaint: str = "auto"
    fill_from: tuple[FillFrom, ...] = ()
    refine: str = "auto"
    refine_strength: float = 1.0  # of a learned refinement, in [0, 1]
    splats: str | None = None  # file
    flip: bool = False  # that file's object stands on its head
    gaussians: int | None = None
    thickness: float = 1.0  # x what the silhouette says
    back: str = "auto"
    symmetry: str = "auto"
    floating: bool = False  # not turned as its feet on the ground tell
    shape: str = "auto"  # what it is: of KINDS
    trust: float = 1.0  # in the shape network, of [0, 1]
    no_depth: bool = False  # not as a depth network sees it, where one is installed
    hidden: str | None = None  # file
    opacity: float = 1.0  # in [0, 1]
    exposure: float = 0.0  # stops
    warmth: float = 0.0  # in [-1, 1], from blue to amber
    saturation: float = 1.0  # x as far from grey
    sharpness: float = 0.0  # x its fine detail
    blur: float = 0.0  # px
    blend_mode: str = NORMAL  # of MODES
    decontaminate: float = 0.0  # in [0, 1], of the background's colour in its edge
    front: tuple[XY, ...] = ()  # px, on things that stay in front of what is edited
    front_mask: str | None = None  # file: another one
    remove: bool = False
    pin: tuple[XY, ...] = ()
    handle: tuple[HandleMove, ...] = ()
    move: tuple[float, float, float] | None = None  # px, px, diameters
    turn: tuple[float, float, float] | None = None  # degrees
    scale: float | None = None
    deform: str = "arap"
    links: str = "geodesic"
    faithful: bool = False
    nodes: int | None = None  # control points
    stiffness: float = 1.0
    stretch_limit: float | None = None
    split: bool = False
    key: tuple[EditScript, ...] = ()  # further key poses of a video: options of OF_A_KEY
    shadow: str = "auto"
    fov: float | None = None
    seed: int = 0

    def merged(self, other: EditScript, said: Iterable[str]) -> EditScript:
        """This script with the fields `said` taken from `other`, be they defaults or not."""
        return replace(self, **{name: getattr(other, name) for name in said})


@dataclass(frozen=True)
class FurtherObject:
    """Another object of the photo. The numbers of objects begin with 1, the script's own."""

    script: EditScript  # its options that are not of the whole photo
    duplicate: int | None = None  # number of the earlier object that it is a copy of
    stay_in_front: bool = False  # it is not edited: it covers what is
    said: frozenset[str] = frozenset()  # the options that stand there


@dataclass(frozen=True)
class Others:
    """The parts of a script beside its own object."""

    objects: tuple[FurtherObject, ...] = ()
    order: tuple[int, ...] = ()  # numbers of objects, back to front


ALONE = Others()


@dataclass(frozen=True)
class BatchItem:
    """One edit of a batch: its photo, its output, and its script."""

    script: EditScript
    photo: str | None = None
    out: str | None = None
    others: Others = ALONE


def parse_scripts(text: str) -> tuple[BatchItem, ...]:
    """The edits in the JSON of `--script`: one object, or an array of them. Raises ScriptError."""
    try:
        data = json.loads(text)
    except json.JSONDecodeError as error:
        raise ScriptError(f"the script is not JSON: {error.msg} in line {error.lineno}") from error
    except (ValueError, RecursionError) as error:  # a number of thousands of digits; depth
        raise ScriptError("the script is JSON that nobody can read") from error
    items = data if isinstance(data, list) else [data]
    if not items:
        raise ScriptError("the script is empty")
    return tuple(_batch_item(item) for item in items)


def read_scripts(path: Path) -> tuple[BatchItem, ...]:
    """The edits in a script's file. Raises ScriptError, InputError, OSError."""
    try:
        text = read_input(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise ScriptError(f"{path} is no script: it is not UTF-8 text") from error
    return parse_scripts(text)


def script_text(item: BatchItem) -> str:
    """JSON of which `parse_scripts` makes this one item."""
    told: dict[str, Any] = {"photo": item.photo, "out": item.out, **said_by(item.script)}
    told = {key: value for key, value in told.items() if value is not None}
    if item.others.objects:
        told["objects"] = [_told(each) for each in item.others.objects]
    if item.others.order:
        told["order"] = list(item.others.order)
    return json.dumps(told)


def _told(each: FurtherObject) -> dict[str, Any]:
    told = said_by(each.script, each.said)
    told |= {} if each.duplicate is None else {"duplicate": each.duplicate}
    return told | ({"stay_in_front": True} if each.stay_in_front else {})


def said_by(script: EditScript, said: frozenset[str] = frozenset()) -> dict[str, Any]:
    """The options that differ from their defaults, and those of `said`."""
    default = asdict(EditScript())
    told = asdict(script) | {"key": tuple(said_by(key) for key in script.key)}
    return {name: v for name, v in told.items() if name in said or v != default[name]}


def beside(item: BatchItem, folder: Path) -> BatchItem:
    """File names of a script are relative to the script."""

    def at(name: str | None) -> str | None:
        return None if name is None else str(folder / name)

    def found(name: str | None) -> str | None:
        """Beside the script, or, as in older ones, where the command is run."""
        is_beside = name is None or (folder / name).exists() or not Path(name).exists()
        return at(name) if is_beside else name

    def own(script: EditScript) -> EditScript:
        return replace(
            script, mask=at(script.mask), front_mask=at(script.front_mask),
            hidden=found(script.hidden), splats=found(script.splats),
        )  # fmt: skip

    objects = tuple(replace(each, script=own(each.script)) for each in item.others.objects)
    others = replace(item.others, objects=objects)
    return BatchItem(own(item.script), at(item.photo), at(item.out), others)


def files_of(script: EditScript) -> tuple[str | None, ...]:
    """Return the files that an edit reads beside the photo."""
    return script.mask, script.front_mask, script.hidden, script.splats


def script_from(options: Mapping[str, Any]) -> EditScript:
    """A script from long option names without dashes. Raises ScriptError."""
    known = {f.name for f in fields(EditScript)}
    said: dict[str, Any] = {}
    for key, value in options.items():
        name = key.replace("-", "_")
        if name not in known:
            raise ScriptError(f"there is no option {shown(key)}{meant(name, known)}")
        said[name] = PARSERS[name](key, value)
    return EditScript(**said)


def _batch_item(item: Any) -> BatchItem:
    if not isinstance(item, dict):
        raise ScriptError("the script is not a JSON object")
    options = {k: v for k, v in item.items() if k not in OF_A_FILE}
    for key in ("photo", "out"):
        if key in item and not isinstance(item[key], str):
            raise ScriptError(f"the script's {shown(key)} is not a file name")
    script = script_from(options)
    return BatchItem(script, item.get("photo"), item.get("out"), _others(item))


def _others(item: dict[str, Any]) -> Others:
    further = item.get("objects", [])
    if not isinstance(further, list):
        raise ScriptError("the script's 'objects' are not a list")
    objects = tuple(_further(number, value) for number, value in enumerate(further, 2))
    order = item.get("order", [])
    if not isinstance(order, list):
        raise ScriptError("the script's 'order' is not a list of objects' numbers")
    numbers = tuple(_whole(1, len(objects) + 1)("order", number) for number in order)
    if len(set(numbers)) < len(numbers):
        raise ScriptError("order: an object stands there twice")
    return Others(objects, numbers)


def _further(number: int, value: Any) -> FurtherObject:
    try:
        return _further_object(number, value)
    except ScriptError as error:
        raise ScriptError(f"object {number}: {error}") from error


def _further_object(number: int, value: Any) -> FurtherObject:
    if not isinstance(value, dict):
        raise ScriptError("it is not a JSON object")
    options = {k: v for k, v in value.items() if k not in ("duplicate", "stay_in_front")}
    said = {key.replace("-", "_") for key in options}
    for key in sorted(said & OF_THE_PHOTO):
        raise ScriptError(f"{shown(key)} is of the whole photo; it stands beside 'objects'")
    script = script_from(options)
    stays = _flag("stay_in_front", value.get("stay_in_front", False))
    of = value.get("duplicate")
    if of is not None:
        of = _whole(1, number - 1)("duplicate", of)
    allowed = OF_A_COPY if of is not None else CHOOSING if stays else said
    if of is not None and stays:
        raise ScriptError("a copy cannot stay in front: it is in no photo")
    for key in sorted(said - allowed):
        what = "a copy" if of is not None else "what stays in front"
        raise ScriptError(f"{shown(key)} is nothing that {what} can be told")
    return FurtherObject(script, of, stays, frozenset(said))


def _number(key: str, value: Any) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not -MOST_NUMBER <= value <= MOST_NUMBER:  # NaN compares false
        raise ScriptError(f"{key}: {shown(value)} is not a number")
    return float(value)


def _numbers(least: int, most: int) -> Callable[[str, Any], tuple[float, ...]]:
    def parse(key: str, value: Any) -> tuple[float, ...]:
        if not isinstance(value, list | tuple) or not least <= len(value) <= most:
            raise ScriptError(f"{key}: {shown(value)} is not {count_range(least, most)} numbers")
        numbers = tuple(_number(key, v) for v in value)
        return numbers + (0.0,) * (most - len(numbers))

    return parse


def _points(key: str, value: Any) -> tuple[tuple[float, ...], ...]:
    if not isinstance(value, list | tuple):
        raise ScriptError(f"{key}: {shown(value)} is not a list of points")
    return tuple(_numbers(2, 2)(key, v) for v in value)


def _handles(key: str, value: Any) -> tuple[HandleMove, ...]:
    if not isinstance(value, list | tuple):
        raise ScriptError(f"{key}: {shown(value)} is not a list of handles")
    return tuple(_handle(key, v) for v in value)


def _handle(key: str, value: Any) -> HandleMove:
    if isinstance(value, HandleMove):
        return value
    if not isinstance(value, dict) or not {"at", "to"} <= set(value) <= {"at", "to", "dz"}:
        raise ScriptError(f'{key}: {shown(value)} is not {{"at": [x, y], "to": [x, y], "dz": d}}')
    at, to = (_numbers(2, 2)(key, value[end]) for end in ("at", "to"))
    return HandleMove((at[0], at[1]), (to[0], to[1]), _number(key, value.get("dz", 0.0)))


def _sources(key: str, value: Any) -> tuple[FillFrom, ...]:
    if not isinstance(value, list | tuple):
        raise ScriptError(f"{key}: {shown(value)} is not a list of sources")
    return tuple(_source(key, v) for v in value)


def _source(key: str, value: Any) -> FillFrom:
    known = {"source", "to", "radius"}
    if not isinstance(value, dict) or not {"source", "to"} <= set(value) <= known:
        raise ScriptError(
            f'{key}: {shown(value)} is not {{"source": [x, y], "to": [x, y], "radius": r}}'
        )
    source, to = (_numbers(2, 2)(key, value[end]) for end in ("source", "to"))
    radius = value.get("radius")
    if radius is not None and _number(key, radius) <= 0:
        raise ScriptError(f"{key}: a radius of {shown(radius)} px is none")
    known_radius = None if radius is None else float(radius)
    return FillFrom((source[0], source[1]), (to[0], to[1]), known_radius)


def _keys(key: str, value: Any) -> tuple[EditScript, ...]:
    if not isinstance(value, list | tuple) or len(value) > MOST_KEYS:
        raise ScriptError(f"{key}: {shown(value)} is not a list of at most {MOST_KEYS} poses")
    return tuple(_key(key, pose) for pose in value)


def _key(key: str, value: Any) -> EditScript:
    if isinstance(value, EditScript):
        return value
    if not isinstance(value, dict):
        raise ScriptError(f"{key}: {shown(value)} is not a pose")
    for name in sorted(value.keys() - OF_A_KEY):
        known = ", ".join(sorted(OF_A_KEY))
        raise ScriptError(f"{key}: a pose has no {shown(name)}; it may have {known}")
    return script_from(value)


def _text(key: str, value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise ScriptError(f"{key}: {shown(value)} is not a name")
    return value


def _one_of(*allowed: str) -> Callable[[str, Any], str]:
    def parse(key: str, value: Any) -> str:
        if value not in allowed:
            raise ScriptError(f"{key}: {shown(value)} is not one of {', '.join(allowed)}")
        return value

    return parse


def _flag(key: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise ScriptError(f"{key}: {shown(value)} is not true or false")
    return value


def _whole(least: int, most: int) -> Callable[[str, Any], int]:
    def parse(key: str, value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise ScriptError(f"{key}: {shown(value)} is not a whole number from {least} to {most}")
        return value

    return parse


def _between(least: float, most: float) -> Callable[[str, Any], float]:
    def parse(key: str, value: Any) -> float:
        number = _number(key, value)
        if not least <= number <= most:
            raise ScriptError(f"{key}: {shown(value)} is not a number from {least:g} to {most:g}")
        return number

    return parse


PARSERS: dict[str, Callable[[str, Any], Any]] = {
    "click": _points, "not_click": _points, "box": _numbers(4, 4), "subject": _flag,
    "mask": _text, "segment": _text, "lift": _text, "inpaint": _text, "refine": _text,
    "refine_strength": _between(0, 1),
    "fill_from": _sources,
    "splats": _text, "flip": _flag, "thickness": _between(LEAST_THICKNESS, MOST_THICKNESS),
    "back": _one_of(*BACKS), "symmetry": _one_of("auto", "yes", "no"), "floating": _flag,
    "shape": _one_of(*KINDS), "trust": _between(0, 1), "decontaminate": _between(0, 1),
    "opacity": _between(0, 1), "warmth": _between(-1, 1),
    "exposure": _between(-MOST_EXPOSURE, MOST_EXPOSURE),
    "saturation": _between(0, MOST_SATURATION), "sharpness": _between(0, MOST_SHARPNESS),
    "blur": _between(0, MOST_BLUR), "blend_mode": _one_of(*MODES),
    "no_depth": _flag, "hidden": _text,
    "gaussians": _whole(100, 2_000_000), "front": _points, "front_mask": _text, "remove": _flag,
    "pin": _points, "handle": _handles, "key": _keys,
    "move": _numbers(2, 3), "turn": _numbers(1, 3), "scale": _number,
    "deform": _one_of("arap", "laplacian"), "links": _one_of("geodesic", "euclidean"),
    "faithful": _flag, "nodes": _whole(4, 4096), "stiffness": _between(0.25, 4.0),
    "stretch_limit": _between(1.01, 10.0), "split": _flag,
    "shadow": _one_of("auto", "none"), "fov": _number,
    "seed": _whole(0, 2**31 - 1),
}  # fmt: skip

OF_A_FILE = ("photo", "out", "objects", "order")  # keys of a script that are no options
OF_THE_PHOTO = {"fov", "inpaint", "refine_strength", "front", "front_mask", "seed", "key"}
CHOOSING = {"click", "not_click", "box", "subject", "mask", "segment"}
OF_A_KEY = {"pin", "handle", "move", "turn", "scale"}
MOST_KEYS = 11  # beside the pose of the edit itself
OF_A_FINISH = frozenset(field.name for field in fields(Finish))
OF_A_COPY = {"pin", "handle", "move", "turn", "scale", "shadow", "refine"} | OF_A_FINISH
