"""The command line: subcommands, progress bars, exit codes.

A failure is one sentence on stderr and a non-zero exit; nothing is then written.
"""

from __future__ import annotations

import argparse
import logging
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from objectmorpher_core.base.quoting import count_range, reason
from objectmorpher_core.scripting.options import OBJECT, OPTIONS, Option

from .. import __version__
from .command_parser import (
    MISUSED,
    RESEARCH,
    Parser,
    Subcommand,
    add_ray,
    add_subcommands,
    completed_files,
    lazily,
    misspelt_command,
    research_commands,
)
from .options import RENDERERS, WindowOptions
from .terminal import FAILURES, PROGRAM, UsageError, failure_sentence, is_librarys

SAMPLE = "assets/samples/coffee.jpg"
FAILED = 1  # exit code
FORMATS = ("png", "jpg", "tif", "webp", "avif", "jxl")  # of a batch's outputs
SHELLS = ("bash", "zsh", "tcsh")  # whose completion shtab writes
UNFORESEEN = "something went wrong that should not have"

log = logging.getLogger(__name__)


def main(arguments: Sequence[str]) -> int:
    """Runs a subcommand; returns the exit code."""
    if (absent := _absent(arguments)) is not None:
        sys.stderr.write(f"{PROGRAM}: {absent}\n")
        return FAILED
    options = build_parser().parse_args(_joined_negatives(arguments))
    try:
        options.run(options)
    except KeyboardInterrupt:
        sys.stderr.write(f"{PROGRAM}: interrupted\n")
        return 130
    except Exception as error:
        sys.stderr.write(f"{PROGRAM}: {_told(error, options.command)}\n")
        return FAILED
    return 0


def _told(error: Exception, command: str) -> str:
    """What the user reads of it; the log has a fault of ours in full."""
    if isinstance(error, FAILURES) and not is_librarys(error):
        return failure_sentence(error)
    from ..system.logs import log_path

    log.error("%s failed", command, exc_info=error)
    return f"{UNFORESEEN} ({type(error).__name__}: {reason(error)}); see {log_path()}"


def _absent(arguments: Sequence[str]) -> str | None:
    """Return why a command of the research package cannot run: one sentence, or None."""
    word = next(iter(arguments), "")
    if word not in RESEARCH or word in (command.name for command in research_commands()):
        return None
    from objectmorpher_core.base.installation import extra

    return f"{word} is part of the research package, which is not installed: `{extra('research')}`"


def build_parser() -> argparse.ArgumentParser:
    """Build the parser of all subcommands, those of an installed research package included."""
    parser = Parser(
        prog=PROGRAM,
        description="Open a photo, click an object, drag points on it in 3D, save the photo.",
        epilog="Without a subcommand the editor opens: objectmorpher [FILE ...]",
    )
    parser.add_argument("--version", action="version", version=f"{PROGRAM} {__version__}")
    add_subcommands(parser, "command", (*SUBCOMMANDS, *research_commands()))
    return parser


def window_parser() -> argparse.ArgumentParser:
    """The options of the editor's window: `objectmorpher [FILE ...]`."""
    parser = Parser(prog=PROGRAM, description="Open the editor.")
    add = parser.add_argument
    add("files", nargs="*", type=Path, metavar="FILE", help="photos or sessions, a tab each")
    add("--sample", dest="is_sample", action="store_true", help="open a sample photo")
    add("--renderer", choices=RENDERERS, default="auto", help="gl draws on the GPU, tiles does not")
    add("--theme", choices=("dark", "light"), help="for this run; default as in the preferences")
    add("--scale", type=float, metavar="S", help="pixels per point")
    add("--size", type=_list(2, 2, "W,H"), metavar="W,H", default=(1440.0, 900.0), help="points")
    add("--fov", type=float, metavar="DEG", help="horizontal; default from EXIF, else 50")
    add("--seed", type=int, default=0, help="of everything random")
    add(
        "--return",
        dest="returns",
        type=Path,
        metavar="FILE",
        help="for plug-ins: Send back writes the edit there (.ora .psd .png .tif) and closes",
    )
    add("--frames", type=int, metavar="N", help="close after N frames")
    add("--screenshot", type=Path, metavar="F.png", help="picture of the last frame")
    add("--frame-log", type=Path, metavar="F.json", help="when each frame was shown")
    return parser


def parse_window(arguments: Sequence[str]) -> argparse.Namespace:
    """Parse the options of the window on this command line."""
    wrong = misspelt_command(arguments, COMMANDS)
    if wrong is not None:
        sys.stderr.write(f"{PROGRAM}: {wrong}\n")
        raise SystemExit(MISUSED)
    parser = window_parser()
    options = parser.parse_args(list(arguments))
    options.parser = parser
    return options


def idle_in_window(options: argparse.Namespace, has_display: bool) -> str | None:
    """Return what on the command line of the window would have no effect: one sentence, or None."""
    from .idle_options import refuse_idle, said_on

    said = said_on(options, options.parser)
    if not has_display and len(options.files) > 1:
        return "without a display one photo is edited at a time: objectmorpher batch does many"
    try:
        refuse_idle("window", said)
        if not has_display:
            refuse_idle("window without a display", said)
    except UsageError as error:
        return str(error)
    return None


def window_options(options: argparse.Namespace) -> WindowOptions:
    """Return the parsed options in the form that the window takes."""
    from ..system.resources import resource

    files = tuple(options.files) or ((resource(SAMPLE),) if options.is_sample else ())
    width, height = options.size
    return WindowOptions(
        files, options.renderer, options.theme, options.scale, (int(width), int(height)),
        options.fov, options.seed, options.frames, options.screenshot, options.frame_log,
        options.returns,
    )  # fmt: skip


def _add_options(parser: argparse.ArgumentParser, *headings: str) -> None:
    """Add the options of an edit that stand below these headings; all, where none is given."""
    groups: dict[str, argparse._ArgumentGroup] = {}
    for name, option in OPTIONS.items():
        if headings and option.heading not in headings:
            continue
        if option.heading not in groups:
            groups[option.heading] = parser.add_argument_group(option.heading)
        written = {} if option.placeholder is None else {"metavar": option.placeholder}
        flag = f"--{name.replace('_', '-')}"
        groups[option.heading].add_argument(flag, help=option.help, **written, **_reading(option))


def _reading(option: Option) -> dict[str, Any]:
    """Return how argparse reads the values of an option. One that is not given is None."""
    form = option.placeholder or ""
    several = {"points": _list(2, 2, form), "handles": _handle, "sources": _fill_from, "keys": _key,
               "views": _more_view}  # fmt: skip
    one = {"number": float, "whole": int, "numbers": _list(*option.values.counts, form)}
    kind = option.values.kind
    if kind == "flag":
        return {"action": "store_true", "default": None}
    if kind in several:
        return {"action": "append", "type": several[kind]}
    return {"type": one[kind]} if kind in one else {}


def _add_edit(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "photo",
        type=Path,
        nargs="?",
        metavar="PHOTO",
        help="a picture file; a script may name it instead",
    )
    parser.add_argument("-o", "--out", type=Path, metavar="OUT", help="the edited photo")
    _add_options(parser)
    add = parser.add_argument_group("scripts and further outputs").add_argument
    add(
        "--script",
        type=Path,
        metavar="EDIT.json",
        help="the same options from a file, and further objects (docs/formats.md)",
    )
    add("--session", type=Path, metavar="S.omorph", help="a session for the editor and for replay")
    add("--save-mask", type=Path, metavar="FILE", help="the selection")
    add("--save-plate", type=Path, metavar="FILE", help="the photo without the object")
    add("--save-object", type=Path, metavar="FILE", help="the edited object, straight alpha")
    add("--save-depth", type=Path, metavar="FILE", help="nearness, 16 bit: white is nearest")
    add("--save-layers", type=Path, metavar="FILE",
        help="layers, for paint programs: .ora or .psd")  # fmt: skip
    _add_video(add)
    add("--save-splats", type=Path, metavar="FILE",
        help="the edited object as .ply, .compressed.ply, .splat or .spz")  # fmt: skip
    add("--save-mesh", type=Path, metavar="FILE.glb",
        help="the edited object as a mesh with the photo on it")  # fmt: skip
    add("--report", type=Path, metavar="R.json",
        help="figures: seconds, handles, footprint and more")  # fmt: skip


def _add_batch(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Runs scripts one after the other and prints a line for each. A failure does not stop the "
        "others, and outputs that are up to date are kept."
    )
    add = parser.add_argument
    add("scripts", type=Path, nargs="+", metavar="SCRIPT", help="edit scripts, or folders of them")
    add("-o", "--out", type=Path, metavar="FOLDER",
        help="for outputs that no script names; created if missing")  # fmt: skip
    add("--photo", type=Path, action="append", metavar="PHOTO",
        help="photos, or folders of them, for scripts that name none")  # fmt: skip
    add("--format", choices=FORMATS, metavar="ENDING",
        help="of those outputs: png, jpg, tif, webp, avif, jxl; default as the photo")  # fmt: skip
    add("--overwrite", action="store_true", help="redo outputs that are up to date")
    add("--report", type=Path, metavar="R.json", help="the outcome and the figures of each edit")
    add_ray(parser)


def _add_select(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("photo", type=Path, metavar="PHOTO", help="a picture file")
    add(
        "-o",
        "--out",
        type=Path,
        metavar="MASK.png",
        required=True,
        help="white where the object is",
    )
    _add_options(parser, OBJECT)


def _add_video(add: Callable[..., object]) -> None:
    add("--save-video", type=Path, metavar="FILE",
        help="as .webm, .mp4, .gif or .webp; without an ending, a folder of PNG files")  # fmt: skip
    add("--video", metavar="KIND",
        help="morph (photo to edit and back, the default), sway, turn or keys")  # fmt: skip
    add("--seconds", type=float, metavar="S", help="length of the video, default 4")


def _add_replay(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("session", type=Path, metavar="SESSION", help="an .omorph file")
    add("-o", "--out", type=Path, metavar="OUT", required=True, help="the edited photo")
    add("--handles", type=Path, metavar="H.json",
        help="move the handles to where this file has them")  # fmt: skip
    add("--save-handles", type=Path, metavar="H.json", help="the handles' places, to be moved")
    add("--save-mesh", type=Path, metavar="M.glb", help="the first object, as it is posed")
    add("--save-session", type=Path, metavar="S.omorph", help="the edit with the handles moved")
    _add_video(add)
    add(
        "--report",
        type=Path,
        metavar="R.json",
        help="figures: seconds, handles, footprint and more",
    )


def _add_info(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("session", type=Path, metavar="SESSION", help="an .omorph file")
    parser.add_argument("--json", action="store_true", help="as one JSON object")


def _add_convert(parser: argparse.ArgumentParser) -> None:
    parser.description = "The endings of the names choose the formats."
    add = parser.add_argument
    add(
        "source",
        type=Path,
        metavar="IN",
        help=".ply .compressed.ply .splat .spz, a mesh (.glb .gltf .obj .stl .off), or a session",
    )
    add("out", type=Path, metavar="OUT", help=".ply .compressed.ply .splat .spz, or .glb")
    add("--count", type=int, metavar="N", help="Gaussians on a mesh, default 20000")
    add("--flip", action="store_true",
        help="turn it upside down, where IN ignores its format's axes")  # fmt: skip


def _add_completion(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Prints a completion script. For bash: objectmorpher completion bash >"
        " ~/.local/share/bash-completion/completions/objectmorpher"
    )
    parser.add_argument("shell", choices=SHELLS, help="the shell that it is for")


def run_completion(options: argparse.Namespace) -> None:
    import shtab

    sys.stdout.write(shtab.complete(completed_files(build_parser()), options.shell))


def _add_share(parser: argparse.ArgumentParser) -> None:
    parser.description = "Writes one file that any browser with WebGL 2 shows, also offline."
    add = parser.add_argument
    add("session", type=Path, metavar="SESSION", help="an .omorph file with a lifted object")
    add("-o", "--out", type=Path, metavar="PAGE.html", required=True, help="the page")
    add("--object", type=int, metavar="N", help="which object, from 1; default the first")


def _add_warm_up(parser: argparse.ArgumentParser) -> None:
    parser.description = "Takes a minute or two after an installation, and seconds afterwards."


def _add_models(parser: argparse.ArgumentParser) -> None:
    parser.description = "Manages learned weights: those to be fetched and your own."
    actions = ("list", "get", "path", "verify", "add", "remove", "setup")
    parser.add_argument(
        "action",
        choices=actions,
        help="path: print where it is; add: add one of your own;"
        " setup: install PyTorch, which most models need",
    )
    parser.add_argument("id", nargs="?", help="a name of the list; default all")
    parser.add_argument("file", nargs="?", type=Path, metavar="FILE",
        help="for add: add depth FILE, or add sam2 FOLDER, which stays where it is")  # fmt: skip
    add = parser.add_argument_group("downloads").add_argument
    add(
        "--yes",
        dest="is_agreed",
        action="store_true",
        help="accept size and licence without being asked",
    )
    add("--accept-licence", metavar="NAME", help="needed for models with a star in the list")
    add("--convert", dest="is_converted", action="store_true",
        help="for add pixelhacker, moebius: extract the weights from pickle files")  # fmt: skip
    add("--offline", dest="is_offline", action="store_true",
        help="download nothing; also by OBJECTMORPHER_OFFLINE=1")  # fmt: skip
    add = parser.add_argument_group("setup").add_argument
    add("--build", metavar="NAME",
        help="PyTorch's build, such as cu128; default: what this machine can run")  # fmt: skip
    add("--from", dest="wheels", type=Path, metavar="FOLDER",
        help="take all packages from the wheels in a folder, without a network")  # fmt: skip
    add("--undo", dest="is_undone", action="store_true", help="remove what setup has installed")


def _add_doctor(parser: argparse.ArgumentParser) -> None:
    parser.description = "Reports which backend each stage would use on this machine, and why."
    parser.add_argument("--json", dest="is_json", action="store_true", help="as one JSON object")


def _joined_negatives(arguments: Sequence[str]) -> list[str]:
    """`--move -10,4` as `--move=-10,4`: a value may begin with a minus sign."""
    joined: list[str] = []
    for word in arguments:
        if joined and re.fullmatch(r"--[a-z-]+", joined[-1]) and re.match(r"-[\d.]", word):
            joined[-1] += "=" + word
        else:
            joined.append(word)
    return joined


def _list(least: int, most: int, form: str = "") -> Callable[[str], tuple[float, ...]]:
    count = "a number" if most == 1 else f"{count_range(least, most)} numbers with commas"

    def parse(text: str) -> tuple[float, ...]:
        try:
            numbers = tuple(float(word) for word in text.split(","))
        except ValueError:
            numbers = ()
        if not least <= len(numbers) <= most:
            told = f"{text!r} is not {count}{form and f', as in {form}'}"
            raise argparse.ArgumentTypeError(told)
        return numbers

    return parse


def _from_to(text: str, third: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Two places; the second may have a `third` number."""
    start, colon, end = text.partition(":")
    if not colon:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y:X2,Y2 or X,Y:X2,Y2,{third}")
    return _list(2, 2)(start), _list(2, 3)(end)


def _handle(text: str) -> dict[str, Any]:
    at, target = _from_to(text, "DZ")
    return {"at": at, "to": target[:2], "dz": target[2] if target[2:] else 0.0}


def _key(text: str) -> dict[str, Any]:
    """A key pose: words such as turn=20 and pin=3,4, in any order; none is the pose at rest."""
    parsers = {"turn": _list(1, 3), "move": _list(2, 3), "scale": _list(1, 1),
               "spin": _list(1, 1), "handle": _handle, "pin": _list(2, 2)}  # fmt: skip
    pose: dict[str, Any] = {}
    for word in text.split():
        name, _, value = word.partition("=")
        if name not in parsers:
            raise argparse.ArgumentTypeError(
                f"{word!r} is not one of {', '.join(parsers)}, = and a value"
            )
        parsed = parsers[name](value)
        if name in ("handle", "pin"):
            pose.setdefault(name, []).append(parsed)
        else:
            pose[name] = parsed[0] if name in ("scale", "spin") else parsed
    return pose


def _fill_from(text: str) -> dict[str, Any]:
    source, target = _from_to(text, "R")
    radius = {"radius": target[2]} if target[2:] else {}
    return {"source": source, "to": target[:2], **radius}


def _more_view(text: str) -> dict[str, Any]:
    """A file name may hold the sign itself: only numbers behind the last one are a place."""
    photo, sign, at = text.rpartition("@")
    if sign and re.fullmatch(r"[-+.,\deE]+", at):
        return {"photo": photo, "at": _list(2, 2)(at)}
    return {"photo": text}


def _command(
    name: str, help: str, add_options: Callable[[argparse.ArgumentParser], None],
    module: str = "commands",
) -> Subcommand:  # fmt: skip
    return Subcommand(name, help, add_options, lazily(module, f"run_{name.replace('-', '_')}"))


def _on_photo(
    name: str, help: str, add_options: Callable[[argparse.ArgumentParser], None]
) -> Subcommand:
    """A command that looks for an object in a photo first of all."""
    command = _command(name, help, add_options)

    def run(options: argparse.Namespace) -> None:
        from ..system.warm_up import open_early

        is_seen = bool(options.click or options.box or options.subject) and not options.mask
        open_early(options.photo, options.segment, is_seen)
        assert command.run is not None
        command.run(options)

    return replace(command, run=run)


SUBCOMMANDS = (
    _on_photo("edit", "edit a photo without a window", _add_edit),
    _command("batch", "run many edit scripts", _add_batch, "batch"),
    _on_photo("select", "write the mask of the chosen object", _add_select),
    _command("replay", "render a saved session again", _add_replay),
    _command("info", "show what a session holds", _add_info),
    _command("convert", "convert splat and mesh files", _add_convert),
    _command("share", "make a web page in which the object can be dragged", _add_share),
    _command("models", "list, get and check learned weights", _add_models, "models"),
    _command("doctor", "show what runs on this machine, and what would help", _add_doctor),
    _command(
        "plugin", "install the plug-in for Krita, GIMP or ComfyUI",
        lazily("plugin", "add_plugin"), "plugin",
    ),
    _command("warm-up", "compile the kernels in advance", _add_warm_up),
    Subcommand(
        "completion", "print a completion script for your shell", _add_completion, run_completion
    ),
    _command("serve", "run the long jobs for other computers", lazily("serve", "add_serve"),
             "serve"),
)  # fmt: skip
COMMANDS = (*(subcommand.name for subcommand in SUBCOMMANDS), *RESEARCH)
