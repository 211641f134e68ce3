"""The options that do nothing beside others on a command line: a table with a sentence for each."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from objectmorpher_core.scripting.options import FINISH, POSE, options_of

from .terminal import UsageError

Said = Mapping[str, Any]
"""What stands on a command line: values by the option's name, with _ for -."""


@dataclass(frozen=True)
class Idle:
    """Options that have no effect `when` the others are these, and what to say of it."""

    options: tuple[str, ...]
    when: Callable[[Said], bool]
    why: str  # goes on from "--option has no effect"
    is_refused: bool = True  # else the command runs, and says it


def without(*options: str) -> Callable[[Said], bool]:
    """None of these is there."""
    return lambda said: not any(said.get(option) for option in options)


def beside(*options: str) -> Callable[[Said], bool]:
    """One of these is there."""
    return lambda said: any(said.get(option) for option in options)


def _is_still(said: Said) -> bool:
    """Nothing deforms the object, nor can in a session."""
    keys = said.get("key") or ()
    has_keyed = any(key.get("handle") if isinstance(key, dict) else key.handle for key in keys)
    return not (said.get("handle") or has_keyed or said.get("session"))


def _makes_all(said: Said) -> bool:
    """The lifter is one that does not ask how the object is to be."""
    return said.get("lift", "auto") not in ("auto", "relief")


def _has_no_network(said: Said) -> bool:
    from objectmorpher_core.compose import refine

    return said.get("refine") not in refine.BACKENDS and not said.get("objects")


def _is_of_video(said: Said) -> bool:
    return said.get("video") != "keys" and not said.get("session")


def _is_gone(said: Said) -> bool:
    return bool(said.get("remove")) and not said.get("session")


def _reads_no_mesh(said: Said) -> bool:
    """It is known to be none: what a .ply is, its header says."""
    from objectmorpher_core.splat_files import SplatFileError, is_mesh

    source = Path(said.get("source", ""))
    if source.suffix.lower() == ".omorph":
        return True
    try:
        return not is_mesh(source)
    except (OSError, SplatFileError):
        return False  # which reading it says better


def _is_action(*actions: str) -> Callable[[Said], bool]:
    """It is none of these."""
    return lambda said: said.get("action") not in actions


RELIEF = ("thickness", "back", "symmetry", "floating", "shape", "trust", "hidden")
PLACED = (*sorted(options_of(POSE, FINISH)), "seen_from")
DEFORMED = ("pin", "deform", "links", "faithful", "stiffness", "stretch_limit", "split")
VIDEO = Idle(("video", "seconds"), without("save_video"), "without --save-video")
OF_A_WINDOW = ("renderer", "theme", "scale", "size", "return", "frames", "screenshot", "frame_log")

IDLE: dict[str, tuple[Idle, ...]] = {
    "edit": (
        Idle(("flip",), without("splats"), "without --splats, whose file it turns"),
        Idle(("lift",), beside("splats"), "beside --splats, whose file is the shape"),
        Idle(RELIEF, beside("splats"), "beside --splats, which brings its shape", is_refused=False),
        Idle(RELIEF, _makes_all, "with a --lift that makes the shape by itself", is_refused=False),
        Idle(
            ("refine_strength",), _has_no_network,
            "without a network that refines, such as --refine klein",
        ),
        Idle(PLACED, _is_gone, "beside --remove, which takes the object away"),
        Idle(("key",), _is_of_video, "without --video keys or --session", is_refused=False),
        Idle(DEFORMED, _is_still, "without --handle, which is what bends it", is_refused=False),
        VIDEO,
    ),
    "replay": (VIDEO,),
    "batch": (Idle(("format",), without("out"), "without -o, the folder of those outputs"),),
    "convert": (
        Idle(("count",), _reads_no_mesh, "on this file: only a mesh gets new Gaussians"),
        Idle(
            ("flip",), lambda said: str(said.get("source", "")).lower().endswith(".omorph"),
            "on a session, whose object has its axes",
        ),
    ),
    "models": (
        Idle(("yes",), _is_action("get", "setup"), "but for models get and setup"),
        Idle(("accept_licence",), _is_action("get"), "but for models get"),
        Idle(("convert",), _is_action("add"), "but for models add"),
        Idle(("offline",), _is_action("get", "setup"), "but for models get and setup"),
        Idle(("build", "from", "undo"), _is_action("setup"), "but for models setup"),
        Idle(("build", "from", "yes"), beside("undo"), "beside --undo, which only removes"),
    ),
    "serve": (
        Idle(
            ("ray", "replicas", "cpus", "gpus", "store"), beside("alone"),
            "beside --alone, which computes in this process",
        ),
        Idle(
            ("ray", "stages", "replicas", "cpus", "gpus", "store", "alone"), beside("web"),
            "beside --web: the editor computes in this process",
        ),
    ),
    "window": (Idle(("sample",), beside("files"), "beside a file that is to be opened"),),
    "window without a display": (
        Idle(OF_A_WINDOW, lambda said: True, "without a display, where no window opens"),
        Idle(
            ("fov", "seed"), lambda said: str(said["files"][0]).lower().endswith(".omorph")
            if said.get("files") else False,
            "on a session, which has its own",
        ),
    ),
}  # fmt: skip


def said_on(options: argparse.Namespace, parser: argparse.ArgumentParser) -> dict[str, Any]:
    """What stands on a command line that `parser` has read: all that differs from a default."""
    said: dict[str, Any] = {}
    for action in parser._actions:
        long = next((o[2:] for o in action.option_strings if o.startswith("--")), action.dest)
        value = getattr(options, action.dest, action.default)
        if value != action.default and value is not None:
            said[long.replace("-", "_")] = value
    return said


def refuse_idle(command: str, said: Said) -> tuple[str, ...]:
    """Return sentences about options that are `said` and do nothing, to be printed at the end.

    Raises UsageError where that is refused.
    """
    notes = []
    for row in IDLE[command]:
        idle = [option for option in row.options if option in said]
        if not idle or not row.when(said):
            continue
        names = " and ".join(f"--{option.replace('_', '-')}" for option in idle)
        sentence = f"{names} {'has' if len(idle) == 1 else 'have'} no effect {row.why}"
        if row.is_refused:
            raise UsageError(sentence)
        notes.append(sentence)
    return tuple(notes)
