"""Script files: the options of `objectmorpher edit` as JSON, for one photo or several.

A file may go on with further objects of the same photo.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..base.files import read_input
from ..base.quoting import shown
from .options import (
    CHOOSING,
    FINISH,
    FLAG,
    PHOTO,
    POSE,
    EditScript,
    ScriptError,
    options_of,
    said_by,
    script_from,
    whole,
)

OF_A_FILE = ("photo", "out", "objects", "order")  # keys of a script that are no options
OF_A_COPY = options_of(POSE, FINISH) | {"shadow", "refine"}


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
        data = json.loads(text.removeprefix("\ufeff"))  # with which editors of Windows mark UTF-8
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
            more_views=tuple(replace(v, photo=str(folder / v.photo)) for v in script.more_views),
        )  # fmt: skip

    objects = tuple(replace(each, script=own(each.script)) for each in item.others.objects)
    others = replace(item.others, objects=objects)
    return BatchItem(own(item.script), at(item.photo), at(item.out), others)


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
    numbers = tuple(whole(1, len(objects) + 1)("order", number) for number in order)
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
    for key in sorted(said & options_of(PHOTO)):
        raise ScriptError(f"{shown(key)} is of the whole photo; it stands beside 'objects'")
    script = script_from(options)
    stays = FLAG.read("stay_in_front", value.get("stay_in_front", False))
    of = value.get("duplicate")
    if of is not None:
        of = whole(1, number - 1)("duplicate", of)
    allowed = OF_A_COPY if of is not None else options_of(CHOOSING) if stays else said
    if of is not None and stays:
        raise ScriptError("a copy cannot stay in front: it is in no photo")
    for key in sorted(said - allowed):
        what = "a copy" if of is not None else "what stays in front"
        raise ScriptError(f"{shown(key)} is nothing that {what} can be told")
    return FurtherObject(script, of, stays, frozenset(said))
