"""The options of an edit: one table, of which the command line, scripts and the library are made.

Each field of `EditScript` is an option, with its default, the values that it takes, the part of an
edit that it belongs to, and what `--help` says of it. Imports little: `--help` waits for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

from ..base.quoting import count_range, meant, shown
from ..document.bounds import (
    BACKS,
    KINDS,
    LEAST_THICKNESS,
    MODES,
    MOST_BLUR,
    MOST_EXPOSURE,
    MOST_SATURATION,
    MOST_SHARPNESS,
    MOST_THICKNESS,
    MOST_VIEWS,
    NORMAL,
)

XY = tuple[float, float]
MOST_NUMBER = 1e9  # px, degrees, diameters
MOST_KEYS = 11  # beside the pose of the edit itself

# The parts of an edit.
CHOOSING, SHAPE, FINISH, POSE, PHOTO, OTHER = PARTS = (
    "choosing", "shape", "finish", "pose", "photo", "other",
)  # fmt: skip
# The headings of `edit --help`, in their order.
OBJECT = "choosing the object (px of the upright photo)"
BACKENDS, LOOK, DEFORMING = "backends", "the object's shape", "deforming"
PLACING = "placing the whole object, after the handles"


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
class MoreView:
    """A further photo of the object."""

    photo: str  # file
    at: XY | None = None  # px, on the object there; None: that photo's main subject


Read = Callable[[str, Any], Any]
"""What checks an option's value, by the option's name; raises ScriptError."""


def _number(key: str, value: Any) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or value != value:
        raise ScriptError(f"{key}: {shown(value)} is not a number")
    if not -MOST_NUMBER <= value <= MOST_NUMBER:
        raise ScriptError(f"{key}: {shown(value)} is farther from 0 than {MOST_NUMBER:g}")
    return float(value)


def _numbers(least: int, most: int) -> Callable[[str, Any], tuple[float, ...]]:
    def parse(key: str, value: Any) -> tuple[float, ...]:
        if least == 1 and isinstance(value, int | float):
            value = [value]
        if not isinstance(value, list | tuple) or not least <= len(value) <= most:
            raise ScriptError(f"{key}: {shown(value)} is not {count_range(least, most)} numbers")
        numbers = tuple(_number(key, v) for v in value)
        return numbers + (0.0,) * (most - len(numbers))

    return parse


def _several(what: str, read: Read, most: int | None = None) -> Read:
    """Read a list of what `read` takes; `what`: they are called."""

    def parse(key: str, value: Any) -> tuple[Any, ...]:
        if not isinstance(value, list | tuple):
            raise ScriptError(f"{key}: {shown(value)} is not a list of {what}")
        if most is not None and len(value) > most:
            raise ScriptError(f"{key}: there are {len(value)} {what}, and at most {most} are taken")
        return tuple(read(key, each) for each in value)

    return parse


def _handle(key: str, value: Any) -> HandleMove:
    if isinstance(value, HandleMove):
        return value
    if not isinstance(value, dict) or not {"at", "to"} <= set(value) <= {"at", "to", "dz"}:
        raise ScriptError(f'{key}: {shown(value)} is not {{"at": [x, y], "to": [x, y], "dz": d}}')
    at, to = (_numbers(2, 2)(key, value[end]) for end in ("at", "to"))
    return HandleMove((at[0], at[1]), (to[0], to[1]), _number(key, value.get("dz", 0.0)))


def _source(key: str, value: Any) -> FillFrom:
    if isinstance(value, FillFrom):
        return value
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


def _view(key: str, value: Any) -> MoreView:
    if isinstance(value, MoreView):
        return value
    if not isinstance(value, dict) or not {"photo"} <= set(value) <= {"photo", "at"}:
        raise ScriptError(f'{key}: {shown(value)} is not {{"photo": "FILE", "at": [x, y]}}')
    at = None if value.get("at") is None else _numbers(2, 2)(key, value["at"])
    return MoreView(_text(key, value["photo"]), None if at is None else (at[0], at[1]))


def _key(key: str, value: Any) -> EditScript:
    if isinstance(value, EditScript):
        return value
    if not isinstance(value, dict):
        raise ScriptError(f"{key}: {shown(value)} is not a pose")
    for name in sorted(value.keys() - options_of(POSE)):
        known = ", ".join(sorted(options_of(POSE)))
        raise ScriptError(f"{key}: a pose has no {shown(name)}; it may have {known}")
    return script_from(value)


def _text(key: str, value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise ScriptError(f"{key}: {shown(value)} is not a name")
    return value


def _one_of(*allowed: str) -> Callable[[str, Any], str]:
    def parse(key: str, value: Any) -> str:
        name = value.replace("-", " ") if isinstance(value, str) else value  # soft-light
        if name not in allowed:
            raise ScriptError(f"{key}: {shown(value)} is not one of {', '.join(allowed)}")
        return name

    return parse


def _flag(key: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise ScriptError(f"{key}: {shown(value)} is not true or false")
    return value


def whole(least: int, most: int) -> Callable[[str, Any], int]:
    """Return what reads a whole number in this range, or raises ScriptError."""

    def parse(key: str, value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise ScriptError(f"{key}: {shown(value)} is not a whole number from {least} to {most}")
        return value

    return parse


def _factor(key: str, value: Any) -> float:
    factor = _number(key, value)
    if factor <= 0:
        raise ScriptError(f"{key}: a scale of {factor:g} is not above 0")
    return factor


def _between(least: float, most: float) -> Callable[[str, Any], float]:
    def parse(key: str, value: Any) -> float:
        number = _number(key, value)
        if not least <= number <= most:
            raise ScriptError(f"{key}: {shown(value)} is not a number from {least:g} to {most:g}")
        return number

    return parse


@dataclass(frozen=True)
class Values:
    """The values of an option: `read` checks one of a script, by the option's name.

    `kind` names how they are written on the command line: "text", "flag", "number", "whole",
    "numbers" with commas, or one of "points", "handles", "sources", "views" and "keys", of which
    there may be several.
    """

    kind: str
    read: Read
    counts: tuple[int, int] = (1, 1)  # least and most, of numbers


FLAG, TEXT, NUMBER = Values("flag", _flag), Values("text", _text), Values("number", _number)
POINTS = Values("points", _several("points", _numbers(2, 2)), (2, 2))
HANDLES = Values("handles", _several("handles", _handle))
SOURCES = Values("sources", _several("sources", _source))
VIEWS = Values("views", _several("photos", _view, MOST_VIEWS))
KEYS = Values("keys", _several("poses", _key, MOST_KEYS))
SHARE = Values("number", _between(0, 1))


def _range(least: float, most: float) -> Values:
    return Values("number", _between(least, most))


def _count(least: int, most: int) -> Values:
    return Values("whole", whole(least, most))


def _names(*allowed: str) -> Values:
    return Values("text", _one_of(*allowed))


def _list(least: int, most: int) -> Values:
    return Values("numbers", _numbers(least, most), (least, most))


@dataclass(frozen=True)
class Option:
    """An option's values, its part of an edit, and its lines of `--help`."""

    values: Values
    part: str  # of PARTS
    heading: str
    placeholder: str | None  # of the value in `--help`
    help: str


def _option(
    default: Any, values: Values, where: tuple[str, str], placeholder: str | None, help: str
) -> Any:
    part, heading = where
    option = Option(values, part, heading, placeholder, help)
    return field(default=default, metadata={"option": option})


_CHOOSING, _SHAPE, _FINISH = (CHOOSING, OBJECT), (SHAPE, LOOK), (FINISH, LOOK)
_POSE, _DEFORMING, _PLACED = (POSE, DEFORMING), (OTHER, DEFORMING), (POSE, PLACING)
_WHOLE = (PHOTO, PLACING)


@dataclass(frozen=True)
class EditScript:
    """An edit. Every field is a long option of the command line, in the order of its help."""

    click: tuple[XY, ...] = _option((), POINTS, _CHOOSING, "X,Y", "on the object")
    not_click: tuple[XY, ...] = _option((), POINTS, _CHOOSING, "X,Y", "not on the object")
    box: tuple[float, float, float, float] | None = _option(
        None, _list(4, 4), _CHOOSING, "X0,Y0,X1,Y1", "around it"
    )
    subject: bool = _option(False, FLAG, _CHOOSING, None, "the photo's main subject")
    mask: str | None = _option(
        None, TEXT, _CHOOSING, "M.png", "a mask picture; overrides all of these"
    )
    segment: str = _option(
        "auto", TEXT, _CHOOSING, "NAME",
        "backend: auto, dino, grabcut, subject, sam2, sam, sam3, sam-onnx, or one model's id",
    )  # fmt: skip
    seed: int = _option(
        0, _count(0, 2**31 - 1), (PHOTO, OBJECT), "N",
        "default 0; the same seed gives the same bytes",
    )  # fmt: skip
    inpaint: str = _option(
        "auto", TEXT, (PHOTO, BACKENDS), "NAME",
        "auto, pixelhacker, moebius, klein, lama, migan, patchmatch or telea",
    )  # fmt: skip
    lift: str = _option(
        "auto", TEXT, (SHAPE, BACKENDS), "NAME",
        "auto, relief, trellis, cupid, triposplat, or a worker",
    )  # fmt: skip
    fill_from: tuple[FillFrom, ...] = _option(
        (), SOURCES, (PHOTO, BACKENDS), "X,Y:X2,Y2[,R]",
        "fill the background within R px of X2,Y2 from around X,Y",
    )  # fmt: skip
    refine: str = _option(
        "auto", TEXT, (OTHER, BACKENDS), "NAME",
        "none (also auto), harmonise (light, grain, focus), qwen or klein",
    )  # fmt: skip
    refine_strength: float = _option(
        1.0, SHARE, (PHOTO, BACKENDS), "S", "how much of a network's change to keep, 0 to 1"
    )
    fov: float | None = _option(
        None, NUMBER, (PHOTO, BACKENDS), "DEG", "horizontal; default from EXIF, else 50"
    )
    gaussians: int | None = _option(
        None, _count(100, 2_000_000), _SHAPE, "N",
        "how many Gaussians the object gets, default 16000",
    )  # fmt: skip
    thickness: float = _option(
        1.0, _range(LEAST_THICKNESS, MOST_THICKNESS), _SHAPE, "S",
        "a factor on what its outline suggests, default 1",
    )  # fmt: skip
    back: str = _option(
        "auto", _names(*BACKS), _SHAPE, "KIND", "the unseen side: auto, mirrored or continued"
    )
    symmetry: str = _option(
        "auto", _names("auto", "yes", "no"), _SHAPE, "auto|yes|no",
        "whether it looks the same left and right",
    )  # fmt: skip
    floating: bool = _option(
        False, FLAG, _SHAPE, None, "it does not stand on the ground: ignore where its foot is"
    )
    shape: str = _option(
        "auto", _names(*KINDS), _SHAPE, "KIND", "its kind: auto, free, round, flat, box or tube"
    )
    trust: float = _option(
        1.0, SHARE, _SHAPE, "T",
        "weight of the shape network, 0 (the outline alone) to 1 (default)",
    )  # fmt: skip
    no_depth: bool = _option(
        False,
        FLAG,
        _SHAPE,
        None,
        "ignore the depth model, also for shadows, even where one is installed",
    )  # fmt: skip
    hidden: str | None = _option(
        None, TEXT, _SHAPE, "M.png", "a mask of its parts that are hidden behind something"
    )
    more_views: tuple[MoreView, ...] = _option(
        (), VIEWS, _SHAPE, "FILE[@X,Y]",
        "another photo of the same thing, seen at X,Y there, from another side; up to three",
    )  # fmt: skip
    decontaminate: float = _option(
        0.0, SHARE, _SHAPE, "S",
        "take this share of the background's colour out of its edge, 0 to 1",
    )  # fmt: skip
    opacity: float = _option(1.0, SHARE, _FINISH, "S", "how opaque it is, 0 to 1 (default)")
    exposure: float = _option(
        0.0, _range(-MOST_EXPOSURE, MOST_EXPOSURE), _FINISH, "STOPS",
        "brighten or darken it, -3 to 3 stops",
    )  # fmt: skip
    warmth: float = _option(0.0, _range(-1, 1), _FINISH, "W", "its colour, -1 (blue) to 1 (amber)")
    saturation: float = _option(
        1.0, _range(0, MOST_SATURATION), _FINISH, "S", "its colours, 0 (grey) to 2; default 1"
    )
    sharpness: float = _option(
        0.0, _range(0, MOST_SHARPNESS), _FINISH, "S", "sharpen its fine detail, 0 to 3 times"
    )
    blur: float = _option(
        0.0, _range(0, MOST_BLUR), _FINISH, "PX", "blur it by so many pixels, 0 to 50"
    )
    blend_mode: str = _option(
        NORMAL, _names(*MODES), _FINISH, "MODE",
        "mix it with what is behind it: normal, multiply, screen or soft-light",
    )  # fmt: skip
    splats: str | None = _option(
        None, TEXT, _SHAPE, "FILE", "use this 3DGS or mesh file instead of lifting"
    )
    flip: bool = _option(False, FLAG, _SHAPE, None, "turn that file upside down")
    pin: tuple[XY, ...] = _option((), POINTS, _POSE, "X,Y", "a point that stays")
    handle: tuple[HandleMove, ...] = _option(
        (), HANDLES, _POSE, "X,Y:X2,Y2[,DZ]",
        "drag the surface point at X,Y to X2,Y2, and DZ object diameters away",
    )  # fmt: skip
    deform: str = _option(
        "arap", _names("arap", "laplacian"), _DEFORMING, "MODE", "arap (default) or laplacian"
    )
    links: str = _option(
        "geodesic", _names("geodesic", "euclidean"), _DEFORMING, "KIND",
        "geodesic (default) or euclidean",
    )  # fmt: skip
    faithful: bool = _option(
        False, FLAG, _DEFORMING, None, "the method exactly as printed in the paper"
    )
    nodes: int | None = _option(
        None, _count(4, 4096), _DEFORMING, "N", "control points, 4 to 4096, default 512"
    )
    stiffness: float = _option(
        1.0, _range(0.25, 4.0), _DEFORMING, "S",
        "reach of the links between control points, 0.25 to 4, default 1",
    )  # fmt: skip
    stretch_limit: float | None = _option(
        None, _range(1.01, 10.0), _DEFORMING, "S",
        "stop handles before a part becomes S times as long",
    )  # fmt: skip
    split: bool = _option(False, FLAG, _DEFORMING, None, "split Gaussians that are stretched far")
    move: tuple[float, float, float] | None = _option(
        None, _list(2, 3), _PLACED, "DX,DY[,DZ]", "px, px, diameters"
    )
    turn: tuple[float, float, float] | None = _option(
        None, _list(1, 3), _PLACED, "YAW[,PITCH,ROLL]",
        "degrees; a positive yaw turns its front to the left",
    )  # fmt: skip
    spin: float = _option(
        0.0, NUMBER, _PLACED, "DEGREES",
        "turn it where it stands, about its own upright axis, before --turn",
    )  # fmt: skip
    seen_from: float | None = _option(
        None, _range(0.0, 90.0), (OTHER, PLACING), "DEGREES",
        "how steeply you look down on it: 0 from its side, 90 from above",
    )  # fmt: skip
    scale: float | None = _option(
        None, Values("number", _factor), _PLACED, "S", "scale factor, from its foot where it stands"
    )
    key: tuple[EditScript, ...] = _option(
        (), KEYS, _WHOLE, "POSE",
        "a further pose for --video keys, such as 'turn=-20 handle=X,Y:X2,Y2'",
    )  # fmt: skip
    shadow: str = _option(
        "auto", _names("auto", "none"), (OTHER, PLACING), "auto|none",
        "auto (default): its shadow in the photo goes along; what is only turned keeps it",
    )  # fmt: skip
    remove: bool = _option(
        False, FLAG, (OTHER, PLACING), None, "take the object away and show what is behind it"
    )
    front: tuple[XY, ...] = _option(
        (), POINTS, _WHOLE, "X,Y", "on something that stays in front of the object"
    )
    front_mask: str | None = _option(
        None, TEXT, _WHOLE, "M.png", "a mask of something that stays in front"
    )

    def merged(self, other: EditScript, said: Iterable[str]) -> EditScript:
        """This script with the fields `said` taken from `other`, be they defaults or not."""
        return replace(self, **{name: getattr(other, name) for name in said})


OPTIONS: dict[str, Option] = {f.name: f.metadata["option"] for f in fields(EditScript)}


def options_of(*parts: str) -> frozenset[str]:
    """Return the names of the options that belong to these parts of an edit."""
    return frozenset(name for name, option in OPTIONS.items() if option.part in parts)


WRITTEN = ("report", "session", "video", "seconds")  # and save-...: options that are no edit's


def script_from(options: Mapping[str, Any], dashes: str = "") -> EditScript:
    """A script from long option names without dashes. Raises ScriptError.

    `dashes` come before the names in errors, as on the command line.
    """
    said: dict[str, Any] = {}
    for key, value in options.items():
        name = key.replace("-", "_")
        if name in WRITTEN or name.startswith("save_"):
            raise ScriptError(
                f"{shown(key)} is no option of an edit: it belongs on the command line"
            )
        if name not in OPTIONS:
            raise ScriptError(f"there is no option {shown(key)}{meant(name, OPTIONS)}")
        said[name] = OPTIONS[name].values.read(dashes + key, value)
    return EditScript(**said)


def said_by(script: EditScript, said: frozenset[str] = frozenset()) -> dict[str, Any]:
    """The options that differ from their defaults, and those of `said`."""
    default = asdict(EditScript())
    told = asdict(script) | {"key": tuple(said_by(key) for key in script.key)}
    return {name: v for name, v in told.items() if name in said or v != default[name]}


def files_of(script: EditScript) -> tuple[str | None, ...]:
    """Return the files that an edit reads beside the photo."""
    further = (view.photo for view in script.more_views)
    return script.mask, script.front_mask, script.hidden, script.splats, *further
